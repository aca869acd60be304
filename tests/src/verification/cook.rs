//! B13: Cook's membrane in plane stress and plane strain on every mesh of an independent program.

use serde_json::Value;

use super::{
    Benchmark, Case, Tolerance,
    common::{PLANE, example, or_failed, rows},
};
use crate::reference;

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[Benchmark {
    id: "B13",
    title: "Cook's membrane: lift of the tip and energy on every mesh",
    origin: "scikit-fem, `physics_cook.json`; limit 23.96 of the literature",
    slow: false,
    open: None,
    run: cook,
}];

/// Finest mesh of each table that is solved.
const FINEST: f64 = 32.0;

fn cook() -> Vec<Case> {
    let data = reference("physics_cook.json");
    let mut cases = Vec::new();
    for (state, key) in [("plane stress", "plane_stress"), ("plane strain", "plane_strain")] {
        for (element, shape, _) in PLANE {
            let what = format!("{state}, {element}");
            cases.push(or_failed(&what, table(&what, element, shape, &data[key])));
        }
    }
    cases
}

fn table(what: &str, element: &str, shape: &str, data: &Value) -> Result<Case, String> {
    let number = |key: &str| data[key].as_f64().unwrap_or(f64::NAN);
    let mut edits = vec![
        ("cells [n,n] quad", format!("cells [n,n] {shape}")),
        ("vector Q2", format!("vector {element}")),
        ("expect abs(work/11.989479962580134 - 1) < 1e-6", String::new()),
    ];
    if what.starts_with("plane strain") {
        edits.push(("def lambda   = E*nu/(1-nu^2) ", "def lambda   = E*nu/((1+nu)*(1-2*nu))".to_owned()));
    }
    let params = [("E", number("E")), ("nu", number("nu"))];
    let mut case = Case::new(what);
    for row in rows(&data["results"][element]).iter().filter(|r| r[0] <= FINEST) {
        let mut all = params.to_vec();
        all.push(("n", row[0]));
        let solved = example("elasticity/cook.wfl", &edits, &all)?;
        let found = [
            solved.at(0, "u", [48.0, 52.0, 0.0])[1],
            solved.at(0, "u", [48.0, 60.0, 0.0])[1],
            solved.measure(0, "work"),
        ];
        for (k, name) in ["u_y(48,52)", "u_y(48,60)", "energy"].into_iter().enumerate() {
            let label = format!("n = {}, {name}", row[0]);
            case = case.compare(label, found[k], row[k + 1], Tolerance::Relative(1e-6));
        }
    }
    Ok(case)
}
