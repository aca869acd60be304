//! What a scene does not need is listed, can be put back, and changes nothing beyond rounding.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

fn wfl(words: &[&str]) -> Output {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    Command::new(env!("CARGO_BIN_EXE_wfl")).current_dir(examples).args(words).output().expect("wfl runs")
}

/// Solves a scene to the floor of rounding and reads its report.
fn report(scene: &str, name: &str, words: &[&str]) -> serde_json::Value {
    let out: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("prune_{name}"));
    let folder = out.display().to_string();
    let run = wfl(&[&["run", scene, "-q", "--out", &folder], words].concat());
    assert!(run.status.success(), "{scene} {words:?}: {}", String::from_utf8_lossy(&run.stderr));
    let text = std::fs::read_to_string(out.join("report.json")).expect("a report");
    serde_json::from_str(&text).expect("a report is JSON")
}

/// What rounding leaves in the best of cases, of the largest measure: the runs themselves say 2e-14 of the loads.
const ROUNDING: f64 = 1e-13;

/// Measures of every step. Some are rounding themselves: they are compared at 1e-6 of the largest.
fn measures(report: &serde_json::Value) -> Vec<f64> {
    let steps = report["steps"].as_array().expect("steps");
    let of = |s: &serde_json::Value| s["measures"].as_object().expect("measures").clone();
    steps.iter().flat_map(|s| of(s).into_iter().map(|m| m.1.as_f64().expect("a number"))).collect()
}

fn moves_by_rounding(scene: &str, switch: &str, words: &[&str], within: f64) {
    let name = format!("{}_{switch}", scene.replace(['/', '.'], "_"));
    let with = report(scene, &name, words);
    let without = report(scene, &(name + "_kept"), &[words, &["--no-prune", switch]].concat());
    let lists = |r: &serde_json::Value| r["left_out"].as_array().into_iter().flatten().any(|l| l["switch"] == switch);
    assert!(lists(&with) && !lists(&without), "{scene}: the switch {switch} does nothing");
    let (a, b) = (measures(&with), measures(&without));
    assert_eq!(a.len(), b.len());
    assert!(!a.is_empty());
    let largest = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for (x, y) in a.iter().zip(&b) {
        let allowed = (within * x.abs().max(1e-6 * largest)).max(ROUNDING * largest);
        assert!((x - y).abs() <= allowed, "{scene} without {switch}: {x} and {y}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn what_is_left_out_changes_the_result_by_rounding_only() {
    // the fault's Newton iterations stop at 1e-10 of the forces; its measures agree to a thousand times that
    moves_by_rounding("fault/penalty.wfl", "condense", &[], 1e-7);
    moves_by_rounding("fault/penalty.wfl", "linear", &[], 1e-7);
    moves_by_rounding("fault/penalty.wfl", "constant", &[], 1e-7);
    moves_by_rounding("fault/penalty.wfl", "quadrature", &[], 1e-7);
    moves_by_rounding("elasticity/block.wfl", "quadrature", &[], 1e-8);
    moves_by_rounding("poisson/poisson.wfl", "linear", &[], 1e-10);
    moves_by_rounding("poisson/poisson.wfl", "symmetric", &[], 1e-10);
}

#[test]
fn check_lists_what_is_left_out_with_its_switch() {
    let told = |scene: &str| String::from_utf8_lossy(&wfl(&["check", scene, "--all"]).stdout).into_owned();
    let linear = told("poisson/poisson.wfl");
    for needed in ["all terms are linear", "--no-prune linear", "--no-prune symmetric", "third component"] {
        assert!(linear.contains(needed), "{needed}: {linear}");
    }
    let contact = told("fault/nitsche.wfl");
    for needed in ["linear terms once", "--no-prune condense", "dofs have nonlinear terms"] {
        assert!(contact.contains(needed), "{needed}: {contact}");
    }
    assert!(!contact.contains("--no-prune symmetric"), "Nitsche with friction is not symmetric: {contact}");
    let frictionless = wfl(&["check", "fault/nitsche.wfl", "fric=0", "--all"]);
    let frictionless = String::from_utf8_lossy(&frictionless.stdout).into_owned();
    assert!(frictionless.contains("`fric` is 0: terms with this factor are not compiled"), "{frictionless}");
    let wrong = wfl(&["run", "poisson/poisson.wfl", "--no-prune", "everything"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(
        String::from_utf8_lossy(&wrong.stderr)
            .contains("constant, linear, condense, forces, symmetric, quadrature, past")
    );
}

/// Instructions of the contact term by its fields in `wfl check`.
fn instructions(words: &[&str]) -> u64 {
    let told = String::from_utf8_lossy(&wfl(words).stdout).into_owned();
    let line = told.lines().find(|l| l.trim_start().starts_with("contact ")).expect("the contact term");
    line.split_whitespace().last().and_then(|n| n.parse().ok()).expect("instructions of the tangent")
}

/// A friction coefficient of 0 leaves out the tangential terms; one of 1e-300 does not and gives the same.
#[test]
fn without_friction_there_are_no_tangential_terms() {
    let (without, with) =
        (["check", "--all", "fault/nitsche.wfl", "fric=0"], ["check", "--all", "fault/nitsche.wfl", "fric=1e-300"]);
    assert!(2 * instructions(&without) < instructions(&with));
    let run = |name: &str, fric: &str| measures(&report("fault/penalty.wfl", name, &[fric]));
    let (a, b) = (run("fric_0", "fric=0"), run("fric_tiny", "fric=1e-300"));
    let largest = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for (x, y) in a.iter().zip(&b) {
        assert!((x - y).abs() <= 1e-7 * x.abs().max(1e-6 * largest), "{x} and {y}");
    }
}

#[test]
fn savings_are_measured_and_reported() {
    let made = report("poisson/poisson.wfl", "savings", &["--savings"]);
    let list = made["left_out"].as_array().expect("what was left out");
    let linear = list.iter().find(|l| l["switch"] == "linear").expect("Newton is left out");
    assert!(linear["times"].as_f64().expect("a ratio") > 0.0);
    assert!(linear["moved"].as_f64().expect("a number") < 1e-9);
    let both = wfl(&["run", "poisson/poisson.wfl", "--savings", "--no-prune", "linear"]);
    assert!(!both.status.success());
}
