//! The twelve defects that were measured in GetFEM 5.4.2: each is right here.

use wfl_compiler::{InterpreterBackend, first_non_finite, types::PlaceKind};

use super::point::{As, Outcome, State, compile, compile_on, scalar};

const I: InterpreterBackend = InterpreterBackend;

fn state(p: f64, q: f64) -> State {
    State::default().value("p", &[p]).value("q", &[q])
}

fn near(found: f64, right: f64) {
    assert!((found - right).abs() <= 4.0 * f64::EPSILON * right.abs(), "{found:e}, not {right:e}");
}

#[test]
fn defect_01_reg_pos_part() {
    near(scalar("reg_pos_part(p, 0.1)", "p", &state(0.05, 0.0), &I).1, 0.5);
    near(scalar("reg_pos_part(p, 0.1)", "p", &state(1.0, 0.0), &I).1, 1.0);
    near(scalar("reg_pos_part(p, q)", "q", &state(0.05, 0.1), &I).1, -0.125);
    near(scalar("reg_pos_part(p, q)", "q", &state(1.0, 0.1), &I).1, -0.5);
    near(scalar("Derivative_1_reg_pos_part(p, 0.1)", "p", &state(0.05, 0.0), &I).0, 0.5);
}

#[test]
fn defect_02_derivative_of_max_of_equal_arguments() {
    for f in ["max", "min"] {
        assert_eq!(scalar(&format!("{f}(p, p)"), "p", &state(0.3, 0.0), &I), (0.3, 1.0));
        // written differently, so that only the values are equal
        let (value, slope) = scalar(&format!("{f}(p, (p+p)/2)"), "p", &state(0.3, 0.0), &I);
        assert_eq!((value, slope), (0.3, 1.0));
        let sides = ["p", "q"].map(|unknown| scalar(&format!("{f}(p, q)"), unknown, &state(0.3, 0.3), &I).1);
        assert_eq!(sides[0] + sides[1], 1.0, "in the convex hull of both branches");
    }
}

#[test]
fn defect_03_coulomb_projection_in_friction_and_augmentation() {
    let text = "Coulomb_friction_coupled_projection([0.1;0.2;-10], [0;0;1], [0.1;-0.05;0], 0, [p], q).Test_u";
    let law = compile(text, 3, As::Term).expect("compiles");
    let at = Outcome::at(&law, &state(0.4, 1.5), &I);
    assert_eq!([0, 1, 2].map(|i| at.slope("u", i, "p", 0)), [0.0; 3], "a sticking point does not feel friction");
    let in_r = [0, 1, 2].map(|i| at.slope("u", i, "q", 0));
    for (found, right) in in_r.into_iter().zip([-0.10, 0.05, 0.0]) {
        assert!((found - right).abs() < 1e-16, "{in_r:?}");
    }
    // slipping: the force is the friction limit along the direction of slip
    let slipping =
        compile(&text.replace("[0.1;0.2;-10]", "[30;40;-10]").replace("[0.1;-0.05;0]", "[0;0;0]"), 3, As::Term)
            .expect("compiles");
    let at = Outcome::at(&slipping, &state(0.4, 1.5), &I);
    for (i, right) in [(0, 6.0), (1, 8.0), (2, 0.0)] {
        assert!((at.slope("u", i, "p", 0) - right).abs() < 1e-14);
        assert!(at.slope("u", i, "q", 0).abs() < 1e-15);
    }
}

#[test]
fn defect_04_derivative_of_derivative_erf() {
    let t = 0.3f64;
    let right = -2.0 * t * std::f64::consts::FRAC_2_SQRT_PI * (-t * t).exp();
    near(scalar("Derivative_erf(p)", "p", &state(t, 0.0), &I).1, right);
    near(scalar("Derivative_erfc(p)", "p", &state(t, 0.0), &I).1, -right);
}

#[test]
fn defect_05_negative_radius() {
    let law = compile("Ball_projection([3;4], p).Test_u", 2, As::Term).expect("compiles");
    let at = Outcome::at(&law, &state(-1.0, 0.0), &I);
    assert_eq!((at.flux("u", 0), at.flux("u", 1)), (0.0, 0.0));
    assert_eq!((at.slope("u", 0, "p", 0), at.slope("u", 1, "p", 0)), (0.0, 0.0));
}

#[test]
fn defect_06_infinite_entries_are_kept_and_found() {
    let law = compile("sqrt(p)*Test_p", 2, As::Term).expect("compiles");
    let at = Outcome::at(&law, &state(0.0, 0.0), &I);
    assert_eq!(at.slope("p", 0, "p", 0), f64::INFINITY);
    let inputs = state(0.0, 0.0).inputs(&law);
    let found = first_non_finite(&law.tangent, &[], &inputs).expect("the place where it became infinite");
    assert!(found.origin.is_some(), "with its place in the text");
    assert!(first_non_finite(&law.tangent, &[], &state(1.0, 0.0).inputs(&law)).is_none());
}

#[test]
fn defect_07_neighbour_on_cells() {
    for (kind, code) in [(PlaceKind::Cells, "E203"), (PlaceKind::Facets, "E203"), (PlaceKind::Global, "E203")] {
        let errors = compile_on("Interpolate(p, neighbor_element)*Test_p", 2, As::Term, kind).expect_err("refused");
        assert_eq!(errors[0].code, code);
    }
}

#[test]
fn defect_08_scalar_with_vector() {
    for (text, value) in [
        ("max([-1;2], 0).[1;10]", 20.0),
        ("max(0, [-1;2]).[1;10]", 20.0),
        ("pow([3;2], 2).[1;10]", 49.0),
        ("atan2([0;0], 1).[1;10]", 0.0),
    ] {
        assert_eq!(scalar(text, "p", &state(0.0, 0.0), &I).0, value, "{text}");
    }
}

#[test]
fn defect_09_max_of_vectors_is_component_by_component() {
    assert_eq!(scalar("max([1;2],[0;3]).[1;10]", "p", &state(0.0, 0.0), &I).0, 31.0);
}

#[test]
fn defect_10_names_of_the_invariants() {
    for name in ["Matrix_i2", "Matrix_j1", "Matrix_j2"] {
        assert!(compile(&format!("{name}(A)*Test_p"), 3, As::Term).is_ok());
    }
    let errors = compile("Matrix_I2(A)*Test_p", 3, As::Term).expect_err("unknown");
    assert_eq!(errors[0].code, "E201");
    assert!(errors[0].labels.iter().any(|l| l.text.contains("Matrix_i2")), "{errors:?}");
}

#[test]
fn defect_11_a_macro_cannot_hide_a_field() {
    let mut sources = wfl::SourceMap::new();
    let text =
        "mesh box [0,0] to [1,1] cells [2,2] quad\nunknown p : scalar\ndef p(a) = 2*a\nterm on all : p(3)*Test_p\n";
    let main = sources.add("scene.wfl", text);
    let checked = wfl::resolve(&mut sources, main, &mut wfl::NoFiles, &[]);
    assert!(checked.has_errors(), "two meanings of one name are an error");
    assert!(checked.diagnostics.iter().any(|d| d.is_error() && d.message.contains("`p`")), "{:?}", checked.diagnostics);
}

#[test]
fn defect_12_an_unloaded_start_sticks() {
    let law = compile("Ball_projection(u, 0.4*pos_part(p)).Test_u", 2, As::Term).expect("compiles");
    let at = Outcome::at(&law, &State::default(), &I);
    for i in 0..2 {
        for j in 0..2 {
            assert_eq!(at.slope("u", i, "u", j), f64::from(u8::from(i == j)));
        }
    }
}
