//! The verification suite: every case of every benchmark passes; `docs/verification.md` shows the same cases.

use std::path::Path;

use wfl_tests::verification::{Case, Tolerance, assert_holds, benchmarks};

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn manufactured_solutions_have_the_errors_of_the_independent_program() {
    assert_holds("B12");
}

#[test]
fn solids_converge_with_the_order_of_their_elements() {
    assert_holds("B12-3D");
}

#[test]
fn cooks_membrane_has_the_table_of_the_independent_program() {
    assert_holds("B13");
}

#[test]
fn manufactured_contact_has_the_errors_of_the_independent_program() {
    assert_holds("B6");
}

#[test]
fn the_page_names_every_benchmark_and_none_fails() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/verification.md");
    let page = std::fs::read_to_string(path).expect("the page is in the repository");
    let made = "make it again: cargo run --release -p wfl-tests --bin verification";
    for benchmark in benchmarks() {
        let row = format!("| {} | {} |", benchmark.id, benchmark.title);
        assert!(page.contains(&row), "the page lacks {}; {made}", benchmark.id);
        assert!(
            page.contains(&format!("\n## {}: ", benchmark.id)),
            "the page lacks the cases of {}; {made}",
            benchmark.id
        );
    }
    assert!(!page.contains("FAIL"), "the page shows a failure");
}

/// The machinery can fail: a wrong number, no number and NaN do not pass.
#[test]
fn a_wrong_number_is_noticed() {
    let compare = |got: f64, expected: f64, t| Case::new("x").compare("x", got, expected, t).passes();
    assert!(
        compare(1.0, 1.0 + 1e-7, Tolerance::Relative(1e-6)) && !compare(1.0, 1.0 + 1e-5, Tolerance::Relative(1e-6))
    );
    assert!(compare(0.0, 0.0, Tolerance::Relative(1e-6)) && !compare(1e-30, 0.0, Tolerance::Relative(1e-6)));
    assert!(compare(1.0, 2.0, Tolerance::AtMost) && !compare(2.0, 1.0, Tolerance::AtMost));
    assert!(compare(2.0, 1.0, Tolerance::AtLeast) && !compare(1.0, 2.0, Tolerance::AtLeast));
    assert!(compare(1.0, 1.0, Tolerance::Bitwise) && !compare(1.0, 1.0 + f64::EPSILON, Tolerance::Bitwise));
    for t in [Tolerance::Relative(1.0), Tolerance::Absolute(1.0), Tolerance::AtMost, Tolerance::AtLeast] {
        assert!(!compare(f64::NAN, 1.0, t) && !compare(1.0, f64::NAN, t), "{t:?} accepts NaN");
    }
    assert!(!Case::new("nothing compared").passes() && !Case::failed("error", "why").passes());
    assert!(!Case::new("outcome").require(false, "why").passes() && Case::new("outcome").require(true, "why").passes());
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn pressed_cylinders_have_the_pressure_of_hertz() {
    assert_holds("B9");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_pressed_sphere_has_the_pressure_of_hertz() {
    assert_holds("B10");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn sheared_cylinders_stick_where_cattaneo_and_mindlin_say() {
    assert_holds("B11");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn units_sizes_directions_and_numbering_do_not_matter() {
    assert_holds("B15");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn every_assembled_tangent_is_the_derivative_of_the_residual() {
    assert_holds("B16");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn two_blocks_have_the_closed_form_of_stick_and_slip() {
    assert_holds("B1");
}

#[test]
fn the_theta_term_is_consistent_with_friction() {
    assert_holds("B2");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn all_methods_agree_with_the_independent_program_on_the_fault() {
    assert_holds("B3");
}

/// Minutes without optimisation, so only in the release suite.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn finer_and_quadratic_meshes_agree_with_the_independent_program_on_the_fault() {
    assert_holds("B3-fine");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_block_held_by_friction_alone_is_in_equilibrium_up_to_the_limit() {
    assert_holds("B4");
}

#[test]
fn an_inclined_interface_passes_the_patch_test() {
    assert_holds("B5");
}

#[test]
fn every_displacement_agrees_with_the_original_program() {
    assert_holds("B17");
}

#[test]
fn a_press_fit_is_a_negative_gap() {
    assert_holds("B18");
}

#[test]
fn a_closed_crack_slips_as_the_closed_form_says() {
    assert_holds("B7");
}

#[test]
fn a_pressurised_crack_opens_as_the_closed_form_says() {
    assert_holds("B8");
}

/// Right scenes of other programs' manuals and reports: their numbers, without a message.
#[test]
fn public_cases_have_the_values_of_their_sources() {
    for k in 1..=15 {
        assert_holds(&format!("P{k}"));
    }
}
