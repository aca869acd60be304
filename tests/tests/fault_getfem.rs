//! The fault benchmark against GetFEM: two independent assemblies of the same weak forms on the same meshes with the
//! same quadrature must agree to the eight digits of the file.

use serde_json::Value;
use wfl_tests::{Solved, examples, reference, solve};

/// Eight significant digits, and what rounding leaves of a mean that nearly cancels.
const TOLERANCE: f64 = 2e-7;

/// What GetFEM's quantities are in the language; appended to the scene.
const MEASURES: &str = "
measure friction_norm = integral(Norm(tang(force))) on fault
measure traction_x = integral(trac(uL).[1,0,0]) on fault
measure traction_y = integral(trac(uL).[0,1,0]) on fault
measure traction_z = integral(trac(uL).[0,0,1]) on fault
measure jump_x = mean(jump(uL,uR).[1,0,0]) on fault
measure jump_y = mean(jump(uL,uR).[0,1,0]) on fault
measure jump_z = mean(jump(uL,uR).[0,0,1]) on fault
measure slip_mean = mean(Norm(tang(jump(uL,uR)))) on fault
measure penetration = mean(pos_part(jump(uL,uR).Normal)) on fault
measure open = mean(if Pn <= 1e-12 then 1 else 0) on fault
";

fn number(v: &Value) -> f64 {
    v.as_f64().expect("a number")
}

fn text<'a>(v: &'a Value, key: &str) -> &'a str {
    v[key].as_str().expect("a word")
}

/// Solves the scene of a run: its method, element, quadrature and multiplier.
fn run_of(run: &Value) -> Solved {
    let folder = examples().join("fault");
    let (file, theta) = match text(run, "method") {
        "nitsche" => ("nitsche.wfl", run["theta"].as_f64()),
        "penalty" => ("penalty.wfl", None),
        _ => ("augmented_lagrangian.wfl", None),
    };
    let degree = match text(run, "integration") {
        "IM_GAUSS_PARALLELEPIPED(3,3)" => 3,
        "IM_GAUSS_PARALLELEPIPED(3,5)" => 5,
        "IM_TETRAHEDRON(2)" => 2,
        other => panic!("no rule for {other}"),
    };
    let scene = std::fs::read_to_string(folder.join(file)).expect("an example");
    let scene = scene.replace("quadrature on fault vertex\n", "");
    let scene = format!("{scene}\nquadrature on fault degree {degree}\n{MEASURES}");
    let cells = if text(run, "group") == "cubes_h0.5" { [4, 8, 8] } else { [8, 16, 16] };
    let mut edits = vec![
        ("cells [8, 8, 8] hex", format!("cells {cells:?} {}", text(run, "element"))),
        ("steps t = 0 to 9.5 by 0.5", "steps t = 0 to 10 by 0.5".to_owned()),
    ];
    if run["multiplier"] == "P0" {
        edits.push(("lambda : vector on fault", "lambda : vector P0 on fault".to_owned()));
    }
    let mut params = vec![("gamma", number(&run["gamma"]))];
    params.extend(theta.map(|t| ("theta", t)));
    solve(&folder, scene, &edits, &params).unwrap_or_else(|e| panic!("{}: {e}", run["id"]))
}

/// Every quantity of every converged step, relative to its largest value over the run.
fn compare(run: &Value, solved: &Solved, sample_yz: &[Value]) {
    let vector = |v: &Value| -> Vec<f64> { v.as_array().expect("a vector").iter().map(number).collect() };
    let steps = run["steps"].as_array().expect("steps");
    let of = |s: &Value| -> Vec<(&'static str, &'static [&'static str], Vec<f64>)> {
        vec![
            ("contact_force_n", &["Fn"], vec![number(&s["contact_force_n"])]),
            ("friction_force", &["Fty", "Ftz"], vector(&s["friction_force"])[1..].to_vec()),
            ("friction_force_norm_integral", &["friction_norm"], vec![number(&s["friction_force_norm_integral"])]),
            ("left_traction_force", &["traction_x", "traction_y", "traction_z"], vector(&s["left_traction_force"])),
            ("jump_mean", &["jump_x", "jump_y", "jump_z"], vector(&s["jump_mean"])),
            ("slip_norm_mean", &["slip_mean"], vec![number(&s["slip_norm_mean"])]),
            ("penetration_mean", &["penetration"], vec![number(&s["penetration_mean"])]),
            ("fraction_open", &["open"], vec![number(&s["fraction_open"])]),
            ("fraction_slip", &["slipping"], vec![number(&s["fraction_slip"])]),
        ]
    };
    let samples_of = |s: &Value| ["uL", "uR"].map(|f| s[f].as_array().cloned().unwrap_or_default()).concat();
    let moved = steps.iter().flat_map(samples_of).flat_map(|u| vector(&u)).fold(0.0f64, |m, x| m.max(x.abs()));
    let mut scales = vec![0.0f64; of(&steps[0]).len()];
    for step in steps {
        for (scale, (_, _, values)) in scales.iter_mut().zip(of(step)) {
            *scale = values.iter().fold(*scale, |m, v| m.max(v.abs()));
        }
    }
    assert!(!steps.is_empty(), "{}: nothing to compare", run["id"]);
    for expected in steps {
        let time = number(&expected["t"]);
        let k =
            solved.outcome.steps.iter().position(|s| (s.window.end - time).abs() < 1e-9).expect("the same load steps");
        assert!(solved.outcome.steps[k].history.converged(), "{}: t = {time} did not converge", run["id"]);
        for ((key, names, values), scale) in of(expected).into_iter().zip(&scales) {
            let scale = if key.starts_with("fraction") { 1.0 } else { *scale };
            for (name, value) in names.iter().zip(values) {
                let gap = (solved.measure(k, name) - value).abs();
                // a multiplier leaves no penetration but rounding
                let rounding = if key.contains("jump") || key.contains("mean") { 1e-12 * moved } else { 0.0 };
                assert!(
                    gap <= TOLERANCE * scale + rounding,
                    "{}: {key} at t = {time} is off by {:e}",
                    run["id"],
                    gap / scale
                );
            }
        }
        compare_samples(run, solved, k, expected, sample_yz);
    }
}

/// Displacements of both sides of the fault at the sampled nodes, where the file has them.
fn compare_samples(run: &Value, solved: &Solved, k: usize, expected: &Value, sample_yz: &[Value]) {
    if expected["uL"].is_null() {
        return;
    }
    let all = ["uL", "uR"].iter().flat_map(|f| expected[*f].as_array().expect("samples"));
    let scale = all.flat_map(|u| u.as_array().expect("a vector")).fold(0.0f64, |m, v| m.max(number(v).abs()));
    for field in ["uL", "uR"] {
        for (yz, u) in sample_yz.iter().zip(expected[field].as_array().expect("samples")) {
            let found = solved.at(k, field, [0.0, number(&yz[0]), number(&yz[1])]);
            for (f, e) in found.iter().zip(u.as_array().expect("a vector")) {
                let gap = (f - number(e)).abs() / scale;
                assert!(gap <= TOLERANCE, "{}: {field} at {yz} in step {k} is off by {gap:e}", run["id"]);
            }
        }
    }
}

fn compare_group(group: &str) {
    let data = reference("fault_getfem.json");
    let sample_yz = data["sample_yz"].as_array().expect("samples");
    let runs = data["runs"].as_array().expect("runs");
    let runs: Vec<&Value> = runs.iter().filter(|r| text(r, "group") == group).collect();
    assert!(runs.len() >= 8, "the runs have gone");
    for run in runs {
        compare(run, &run_of(run), sample_yz);
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn every_method_agrees_with_getfem_on_cubes() {
    compare_group("cubes_h0.5");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn every_method_agrees_with_getfem_on_finer_cubes() {
    compare_group("cubes_h0.25");
}
