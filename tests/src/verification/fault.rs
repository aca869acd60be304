//! B3, B17: the slipping fault against an independent program and against the original one.

use serde_json::Value;

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
};
use crate::{Solved, examples, reference, solve};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "B3",
        title: "the slipping fault, 20 load steps, all methods: forces, energy, slip, open and slipping parts, displacements, iterations",
        origin: "an independent program (`physics_seed_fault.json`)",
        slow: false,
        open: None,
        run: coarse,
    },
    Benchmark {
        id: "B3-fine",
        title: "the slipping fault on finer and quadratic meshes",
        origin: "an independent program (`physics_seed_fault.json`)",
        slow: true,
        open: None,
        run: fine,
    },
    Benchmark {
        id: "B17",
        title: "the slipping fault: every displacement of 20 load steps",
        origin: "the original program on GetFEM (`seed_run_nitsche_theta0_gamma1e5.json`)",
        slow: false,
        open: None,
        run: original,
    },
];

/// What the reference tells beside the measures of the scene.
const MEASURES: &str = "
measure slip_square = integral(Norm_sqr(tang(jump(uL,uR)))) on fault
measure max_pen = max(jump(uL,uR).Normal) on fault
measure open_frac = mean(if Pn < 0 then 1 else 0) on fault
";

/// Displacements of the reference: name, field and node.
const PLACES: &[(&str, &str, [f64; 3])] = &[
    ("u_R_outer_top", "uR", [1.0, 2.0, 4.0]),
    ("u_R_fault_top", "uR", [0.0, 2.0, 4.0]),
    ("u_L_fault_top", "uL", [0.0, 2.0, 4.0]),
    ("u_L_outer_top", "uL", [-1.0, 2.0, 4.0]),
    ("u_R_outer_mid", "uR", [1.0, 2.0, 2.0]),
];

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or(f64::NAN)
}

fn list(v: &Value) -> Vec<Value> {
    v.as_array().cloned().unwrap_or_default()
}

fn vector(v: &Value) -> Vec<f64> {
    list(v).iter().map(number).collect()
}

/// Solves a run of the reference: its method, parameters, face rule and cells.
fn run_of(run: &Value, cells: [usize; 3], degree: usize) -> Result<Solved, String> {
    let method = run["method"].as_str().unwrap_or_default();
    let file = match method {
        "nitsche" => "nitsche.wfl",
        "penalty" => "penalty.wfl",
        _ => "augmented_lagrangian.wfl",
    };
    let folder = examples().join("fault");
    let mut text = std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string())?;
    let rule = run["face_quadrature"].as_str().map_or_else(|| run["face_quadrature"].to_string(), str::to_owned);
    if let Ok(points) = rule.parse::<usize>() {
        text = text.replace("quadrature on fault vertex\n", "");
        text += &format!("\nquadrature on fault degree {}\n", 2 * points - 1);
    }
    text += MEASURES;
    let mut edits = vec![("cells [8, 8, 8]", format!("cells {cells:?}"))];
    if degree == 2 {
        edits.push((": vector on", ": vector Q2 on".to_owned()));
    }
    let mut params = vec![("gamma", number(&run["gamma"]))];
    if method == "nitsche" {
        params.push(("theta", number(&run["theta"])));
    }
    converged(solve(&folder, text, &edits, &params)?)
}

/// Forces, energy and displacements within 1e-6, slip 1e-5, parts of the fault exact, few iterations.
fn compare(what: &str, run: &Value, solved: &Solved, limits: (usize, usize)) -> Case {
    let steps = list(&run["steps"]);
    let largest = |key: &str| steps.iter().fold(0.0f64, |m, s| m.max(number(&s[key]).abs()));
    let moved =
        PLACES.iter().flat_map(|p| steps.iter().flat_map(|s| vector(&s[p.0]))).fold(0.0f64, |m, x| m.max(x.abs()));
    let mut case = Case::new(what);
    let mut compared = 0;
    for (k, result) in solved.outcome.steps.iter().enumerate() {
        let t = result.window.end;
        let limit = if k == 0 { limits.0 } else { limits.1 };
        let n = result.history.n_iterations();
        case = case.compare(format!("t = {t}, iterations"), n as f64, limit as f64, Tolerance::AtMost);
        let Some(expected) = steps.iter().find(|s| (number(&s["t"]) - t).abs() < 1e-9) else { continue };
        compared += 1;
        let energy = solved.measure(k, "energy_left") + solved.measure(k, "energy_right");
        // a multiplier leaves no penetration but rounding
        let noise = 1e-12 * moved;
        for (key, got, relative, absolute) in [
            ("Fn", solved.measure(k, "Fn"), 1e-6, 0.0),
            ("Ftz", solved.measure(k, "Ftz"), 1e-6, 0.0),
            ("energy", energy, 1e-6, 0.0),
            ("max_slip", solved.measure(k, "max_slip"), 1e-5, noise),
            ("l2_slip", solved.measure(k, "slip_square").sqrt(), 1e-5, noise),
            ("max_pen", solved.measure(k, "max_pen"), 1e-5, noise),
            ("slip_frac", solved.measure(k, "slipping"), 0.0, 1e-9),
            ("open_frac", solved.measure(k, "open_frac"), 0.0, 1e-9),
        ] {
            let tolerance = Tolerance::Absolute(relative * largest(key) + absolute);
            case = case.compare(format!("t = {t}, {key}"), got, number(&expected[key]), tolerance);
        }
        case = displacements(case, solved, k, expected);
    }
    case.compare("steps compared", f64::from(compared), steps.len() as f64, Tolerance::Bitwise)
}

fn displacements(mut case: Case, solved: &Solved, k: usize, expected: &Value) -> Case {
    let scale = PLACES.iter().flat_map(|p| vector(&expected[p.0])).fold(0.0f64, |m, x| m.max(x.abs()));
    let t = solved.outcome.steps[k].window.end;
    for (key, field, x) in PLACES {
        for (c, (got, expected)) in solved.at(k, field, *x).iter().zip(vector(&expected[*key])).enumerate() {
            let label = format!("t = {t}, {key}({})", c + 1);
            case = case.compare(label, *got, expected, Tolerance::Absolute(1e-6 * scale));
        }
    }
    case
}

/// All runs of a group of the reference; `limits` gives the iterations of the first and of later steps.
fn group(
    key: &str,
    mesh: &str,
    cells: [usize; 3],
    degree: usize,
    limits: impl Fn(&Value) -> (usize, usize),
) -> Vec<Case> {
    let data = reference("physics_seed_fault.json");
    let runs = if data[key].is_array() { list(&data[key]) } else { list(&data[key]["runs"]) };
    runs.iter()
        .map(|run| {
            let method = run["method"].as_str().unwrap_or_default();
            let theta = if method == "nitsche" { format!(" theta = {}", run["theta"]) } else { String::new() };
            let what = format!("{mesh}: {method}{theta}, gamma = {}, rule {}", run["gamma"], run["face_quadrature"]);
            or_failed(&what, run_of(run, cells, degree).map(|solved| compare(&what, run, &solved, limits(run))))
        })
        .collect()
}

fn coarse() -> Vec<Case> {
    let mut cases = group("runs_8x8x8", "8x8x8", [8, 8, 8], 1, |_| (8, 8));
    cases.extend(group("runs_h0_5", "cubes h = 0.5", [4, 8, 8], 1, |_| (8, 8)));
    cases
}

fn fine() -> Vec<Case> {
    // far above E/h the reference needs more iterations too
    let most = |run: &Value| if number(&run["gamma"]) > 5e5 { (8, 11) } else { (8, 8) };
    let mut cases = group("runs_h0_25", "cubes h = 0.25", [8, 16, 16], 1, most);
    cases.extend(group("runs_Q2_h0_5", "Q2, h = 0.5", [4, 8, 8], 2, |_| (8, 14)));
    cases
}

fn original() -> Vec<Case> {
    let what = "nitsche.wfl, theta = 0, gamma = 1e5, 8x8x8";
    vec![or_failed(what, every_displacement(what))]
}

fn every_displacement(what: &str) -> Result<Case, String> {
    let data = reference("seed_run_nitsche_theta0_gamma1e5.json");
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("nitsche.wfl")).map_err(|e| e.to_string())?;
    let solved = converged(solve(&folder, text, &[], &[])?)?;
    let nodes: Vec<Vec<f64>> = list(&data["nodes"]).iter().map(vector).collect();
    let left = data["left_nodes"].as_u64().unwrap_or_default();
    let steps = list(&data["steps"]);
    let mut case =
        Case::new(what).compare("steps", solved.outcome.steps.len() as f64, steps.len() as f64, Tolerance::Bitwise);
    for (k, step) in steps.iter().enumerate() {
        let u: Vec<Vec<f64>> = list(&step["u"]).iter().map(vector).collect();
        let scale = u.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        for (n, (x, expected)) in nodes.iter().zip(&u).enumerate() {
            let field = if (n as u64) < left { "uL" } else { "uR" };
            for (got, expected) in solved.at(k, field, [x[0], x[1], x[2]]).iter().zip(expected) {
                let label = format!("node {n} in step {k}");
                case = case.compare(label, *got, *expected, Tolerance::Absolute(1e-4 * scale));
            }
        }
    }
    Ok(case)
}
