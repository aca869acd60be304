//! Earthquake cycles against the published series of the SCEC SEAS project (`tests/reference/seas_bp1.json`).

use std::path::Path;

use serde_json::Value;
use wfl_tests::{examples, solve};

/// Seconds of a year in the scene.
const YEAR: f64 = 31_557_600.0;

fn published() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/seas_bp1.json");
    let text = std::fs::read_to_string(path).expect("the reference is in the repository");
    serde_json::from_str::<Value>(&text).expect("a file of numbers")["bp1_qd"].clone()
}

fn number(of: &Value) -> f64 {
    of.as_f64().expect("a number")
}

/// The first two events of BP1-QD with cells of 104 m, four times those of the published series. The second one is not
/// periodic yet: with cells of 45 m it follows the first one after 76.1 years (`examples/friction/README.md`). 15 s with
/// optimisation, so only in the release suite.
#[test]
fn the_cycle_of_bp1_on_coarse_cells_is_near_the_published_series() {
    if cfg!(debug_assertions) {
        eprintln!("skipped: BP1 runs in the release suite (cargo test --release -p wfl-suites)");
        return;
    }
    let folder = examples().join("friction");
    let text = std::fs::read_to_string(folder.join("bp1.wfl")).expect("the example");
    let solved = solve(&folder, text, &[], &[("n", 3.0), ("tol", 5e-4), ("years", 290.0)]);
    let solved = solved.unwrap_or_else(|messages| panic!("{messages}"));
    let (_, quakes) = &solved.outcome.events[0];
    let begins: Vec<f64> = quakes.iter().map(|quake| quake.begin / YEAR).collect();
    let series = &published()["series"];
    assert_eq!(begins.len(), 2, "{begins:?}");
    assert!((begins[0] / number(&series["first_event_yr"]) - 1.0).abs() < 0.015, "{begins:?}");
    let apart = (begins[1] - begins[0]) / number(&series["recurrence_periodic_yr"]);
    assert!((apart - 1.0).abs() < 0.05, "{begins:?}");
    let slip = |time: f64| {
        let step = solved.outcome.steps.iter().position(|s| s.window.end >= time).expect("a step");
        solved.measure(step, "surface")
    };
    let last = &quakes[1];
    let slipped = slip(last.end.expect("an end")) - slip(last.begin);
    assert!((slipped / number(&series["surface_slip_last_event_m"]) - 1.0).abs() < 0.02, "{slipped}");
}

/// The scene has the numbers of the description: its own expectations say so, with these values.
#[test]
fn the_scene_of_bp1_expects_the_numbers_of_the_description() {
    let text = std::fs::read_to_string(examples().join("friction/bp1.wfl")).expect("the example");
    let description = &published()["description"];
    for key in ["tau0_MPa", "log10_theta0_surface"] {
        let value = number(&description[key]);
        assert!(text.contains(&value.to_string()), "{key}: {value}");
    }
    let first = number(&published()["series"]["first_event_yr"]);
    assert!(text.contains(&format!("{first}*yr")), "{first}");
}
