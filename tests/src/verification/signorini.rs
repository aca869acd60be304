//! B6: manufactured frictionless contact with a known contact set.
//!
//! The load has a kink inside the elements, so errors depend on the quadrature rule: squares use 6 by 6 Gauss points
//! as their reference does, triangles the 12-point symmetric rule and a reference made with that rule.

use serde_json::Value;

use super::{
    Benchmark, Case, Tolerance,
    common::{PLANE, example, or_failed, order},
};
use crate::reference;

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[Benchmark {
    id: "B6",
    title: "manufactured frictionless contact, contact set x < sqrt(2)/3: errors of displacement and pressure",
    origin: "an independent program, `physics_signorini_mms.json`, and scikit-fem, `physics_signorini_triangles.json`; orders: theory",
    slow: true,
    open: None,
    run: signorini,
}];

fn signorini() -> Vec<Case> {
    let runs = |file: &str| reference(file)["results"].as_array().cloned().unwrap_or_default();
    let squares =
        runs("physics_signorini_mms.json").into_iter().filter(|r| r["element"] == "Q1" || r["element"] == "Q2");
    runs("physics_signorini_triangles.json")
        .into_iter()
        .chain(squares)
        .map(|run| {
            let text = |key: &str| run[key].as_str().unwrap_or_default();
            let theta = run["theta"].as_f64().unwrap_or(f64::NAN);
            let method =
                if text("method") == "nitsche" { format!("Nitsche theta = {theta}") } else { "penalty".to_owned() };
            let what = format!("{}, {method}, gamma = {} E/h", text("element"), run["gamma0"]);
            or_failed(&what, table(&what, &run))
        })
        .collect()
}

fn table(what: &str, run: &Value) -> Result<Case, String> {
    let number = |v: &Value, key: &str| v[key].as_f64().unwrap_or(f64::NAN);
    let element = run["element"].as_str().unwrap_or_default();
    let (_, shape, degree) = PLANE.into_iter().find(|p| p.0 == element).ok_or("an element of the plane")?;
    let penalty = run["method"] == "penalty";
    let mut edits = vec![
        ("cells [n,n] quad", format!("cells [n,n] {shape}")),
        ("vector Q1", format!("vector {element}")),
        ("10*E*n", format!("{:?}*E*n", number(run, "gamma0"))),
    ];
    if shape == "tri" {
        edits.push(("quadrature on all degree 11", "quadrature on all degree 6".to_owned()));
    }
    if penalty {
        edits.push(("def Pn     = gamma*(u.Normal) - sn(u)", "def Pn     = gamma*(u.Normal)".to_owned()));
        edits.push(("term stress  on contact : -theta/gamma*sn(u)*sn(Test_u)", String::new()));
        edits.push(("- theta*sn(Test_u)", String::new()));
        edits.push(("param theta = 0   in {-1, 0, 1}", String::new()));
    }
    let mut case = Case::new(what);
    let mut found: Vec<(f64, [f64; 3])> = Vec::new();
    for row in run["rows"].as_array().cloned().unwrap_or_default() {
        let mut params = vec![("n", number(&row, "n"))];
        if !penalty {
            params.push(("theta", number(run, "theta")));
        }
        let solved = example("signorini/signorini.wfl", &edits, &params)?;
        let errors = ["l2", "h1", "pP"].map(|m| solved.measure(0, m).sqrt());
        for (k, key) in ["L2", "H1", "pP"].into_iter().enumerate() {
            let label = format!("n = {}, {key} error", row["n"]);
            case = case.compare(label, errors[k], number(&row, key), Tolerance::Relative(1e-4));
        }
        let label = format!("n = {}, contact force", row["n"]);
        case = case.compare(label, solved.measure(0, "total"), number(&row, "force"), Tolerance::Relative(1e-4));
        found.push((number(&row, "n"), errors));
    }
    Ok(orders(case, &found, element, degree, penalty))
}

/// Orders of the last two meshes where theory promises them.
fn orders(mut case: Case, found: &[(f64, [f64; 3])], element: &str, degree: f64, penalty: bool) -> Case {
    let [.., (n, coarse), (m, fine)] = found else { return case };
    let of = |k: usize| order(*n, coarse[k], *m, fine[k]);
    case = case.compare("order in H1", of(1), degree, Tolerance::Absolute(0.1));
    // for P2 it depends on where the end of contact falls in an element: 2.3 to 3.7 from mesh to mesh of the reference
    if !penalty && element != "P2" {
        case = case.compare("order in L2", of(0), degree + 1.0, Tolerance::Absolute(0.1));
    }
    if !penalty && element.starts_with('Q') {
        case = case.compare("order of the pressure", of(2), degree + 1.0, Tolerance::Absolute(0.1));
    }
    case
}
