//! What results do along directions of the parameters, against what they follow: forward and adjoint derivatives have laws,
//! solutions and recursions of their own, and agree to rounding. Both against differences of runs, in the examples.

use std::path::Path;

use wfl::{Diagnostic, FieldKind};
use wfl_gradient::{
    Differentiated, Direction, Gradient, Mode, Request, WantedResult, When, gradients, jacobian_by, not_together,
    tangents,
};
use wfl_jit::JitBackend;
use wfl_tests::{Sequence, examples, prepared, ran, scene_files, script_and_messages, side_by_side, solve};

/// Forward and adjoint agree within this part of the derivative, or of the result over the parameter, ...
const AGREE: f64 = 1e-12;
/// ... within so many times what rounding makes of the derivative along a third of the direction, ...
const ROUNDING: f64 = 30.0;
/// ... within so many roundings of the largest one in the same parameter, where a result is the difference of others, ...
const ROUNDINGS: f64 = 100.0;
/// ... and results below this part of the largest one are rounding of it, below the second number that of a solution of
/// order 1.
const ZERO: f64 = 1e-9;
const LEAST: f64 = 1e-13;
/// A difference of runs over this part of a parameter is as good as this, for results that are no rounding.
const CHANGE: f64 = 1e-5;
const DIFFERENCE: f64 = 1e-3;

/// The derivative of a result in one number of a parameter, or along a direction in a data field.
struct Found {
    result: String,
    value: f64,
    by: String,
    /// The value of the parameter, if it is one number.
    at: Option<f64>,
    back: f64,
    along: f64,
    /// What rounding makes of it.
    rounding: f64,
}

/// The derivatives of a scene, and what was refused.
#[derive(Default)]
struct Both {
    /// The run chooses its steps: another one has others.
    auto: bool,
    list: Vec<Found>,
    refused: Vec<String>,
}

/// Parameters that are 0 in their example and leave out a term with second rates: nothing determines what it reads (E470).
const SWITCHES: [&str; 1] = ["inertia"];

/// All measures at the last step and over all steps, in all parameters and data that are not refused.
fn adjoint(
    of: Differentiated<'_>,
    refused: &mut Vec<String>,
) -> Result<(Request, Vec<Gradient>, usize), Box<Diagnostic>> {
    let script = of.script;
    let numbers = script.computed.iter().map(|c| c.name.name.clone());
    let mut measures: Vec<String> = script.measures.iter().map(|m| m.name.name.clone()).chain(numbers).collect();
    let data = script.fields.iter().filter(|f| matches!(f.kind, FieldKind::Data { .. }));
    let mut request = Request {
        parameters: script
            .params
            .iter()
            .map(|p| p.name.name.clone())
            .filter(|name| !SWITCHES.contains(&name.as_str()))
            .collect(),
        fields: data.map(|f| f.name.name.clone()).collect(),
        ..Request::default()
    };
    loop {
        let result = |m: &String, when| WantedResult { name: m.clone(), measure: m.clone(), when };
        request.results = measures.iter().flat_map(|m| [result(m, When::Last), result(m, When::Sum)]).collect();
        if measures.is_empty() {
            return Ok((request, Vec::new(), 0));
        }
        let told = match gradients(of, &request) {
            Ok(made) => return Ok((request, made.results, made.near.len())),
            Err(told) => told,
        };
        // what the message is about is left out
        let word = told.message.split('`').nth(1).unwrap_or_default().to_owned();
        let lists = [&mut measures, &mut request.parameters, &mut request.fields];
        let place =
            lists.iter().enumerate().find_map(|(l, list)| Some((l, list.iter().position(|name| *name == word)?)));
        match place {
            Some((list, k)) => drop(lists[list].remove(k)),
            None => return Err(told),
        }
        refused.push(told.message.clone());
    }
}

/// Derivatives along each number of each parameter, and along a direction in each data field, both ways.
fn both(of: Differentiated<'_>) -> Result<Both, Box<Diagnostic>> {
    let mut made = Both { auto: of.scene.steps.auto.is_some(), ..Both::default() };
    let (request, results, near) = adjoint(of, &mut made.refused)?;
    let Some(first) = results.first() else { return Ok(made) };
    let mut sequence = Sequence(39);
    let mut directions = Vec::new();
    for (name, entries) in &first.parameters {
        for entry in 0..entries.len() {
            let unit: Vec<f64> = (0..entries.len()).map(|k| f64::from(u8::from(k == entry))).collect();
            directions.push(Direction { parameters: vec![(name.clone(), unit)], fields: Vec::new() });
        }
    }
    for (name, values) in &first.fields {
        let any = values.iter().map(|_| sequence.number()).collect();
        directions.push(Direction { parameters: Vec::new(), fields: vec![(name.clone(), any)] });
    }
    let third = |list: &[(String, Vec<f64>)]| {
        list.iter().map(|(name, x)| (name.clone(), x.iter().map(|x| x / 3.0).collect())).collect()
    };
    let n = directions.len();
    let thirds: Vec<Direction> =
        directions.iter().map(|d| Direction { parameters: third(&d.parameters), fields: third(&d.fields) }).collect();
    directions.extend(thirds);
    let mut less = request.clone();
    let n_steps = of.outcome.steps.len();
    for (k, result) in less.results.iter_mut().enumerate() {
        let part = |step: usize| if k % 2 == 1 || step + 1 == n_steps { 1.0 / 3.0 } else { 0.0 };
        result.when = When::Steps((0..n_steps).map(part).collect());
    }
    let less = gradients(of, &less)?.results;
    let measures: Vec<String> = request.results.iter().step_by(2).map(|r| r.measure.clone()).collect();
    let along = tangents(of, &measures, &directions)?;
    assert_eq!(along.near.len(), near, "points between two branches");
    for (k, result) in results.iter().enumerate() {
        let at_steps = |direction: usize| -> f64 {
            let steps = &along.moved[direction][k / 2];
            if k % 2 == 0 { steps.last().copied().unwrap_or(0.0) } else { steps.iter().sum() }
        };
        for (d, direction) in directions[..n].iter().enumerate() {
            let (name, by) = direction.parameters.iter().chain(&direction.fields).next().expect("one");
            let product = |of: &Gradient| -> f64 {
                let entries = &of.parameters.iter().chain(&of.fields).find(|l| l.0 == *name).expect("a name").1;
                entries.iter().zip(by).map(|(g, x)| g * x).sum()
            };
            let param = of.scene.params.iter().find(|p| p.0 == *name);
            made.list.push(Found {
                result: if k % 2 == 0 { result.name.clone() } else { format!("sum({})", result.name) },
                value: result.value,
                by: name.clone(),
                at: param.and_then(|p| <[f64; 1]>::try_from(p.1.values.as_slice()).ok()).map(|[x]| x),
                back: product(result),
                along: at_steps(d),
                rounding: (3.0 * at_steps(n + d) - at_steps(d))
                    .abs()
                    .max((3.0 * product(&less[k]) - product(result)).abs()),
            });
        }
    }
    Ok(made)
}

/// What is rounding of a derivative, from all results of a scene.
fn sizes(list: &[Found]) -> impl Fn(&Found) -> f64 + '_ {
    let scale = |f: &Found| f.at.filter(|x| *x != 0.0).map_or(1.0, f64::abs);
    let own = move |f: &Found| f.back.abs().max(f.along.abs()).max(f.value.abs() / scale(f));
    move |f| {
        let of_all = list.iter().filter(|g| g.by == f.by).map(own).fold(0.0, f64::max);
        let own = if own(f) > ZERO * of_all { own(f) } else { of_all };
        own.max(ROUNDINGS * f64::EPSILON / AGREE * of_all).max(LEAST / AGREE / scale(f) * 1e-3)
    }
}

/// Where both ways of a scene do not agree.
fn apart(of: &Both) -> Vec<String> {
    let size = sizes(&of.list);
    let is_apart = |f: &&Found| {
        let missing = (f.back - f.along).abs();
        missing.is_nan() || missing > (AGREE * size(f)).max(ROUNDING * f.rounding)
    };
    let line = |f: &Found| {
        let part = (f.back - f.along).abs() / size(f);
        format!("{} by {}: {:e} along, {:e} back, {part:.1e}", f.result, f.by, f.along, f.back)
    };
    of.list.iter().filter(is_apart).map(line).collect()
}

/// Both ways in an example; nothing where derivatives of the scene as a whole are refused.
fn example(path: &str, edits: &[(&str, String)]) -> Result<Option<Both>, String> {
    let file = examples().join(path);
    let (folder, text) = (file.parent().expect("a folder"), std::fs::read_to_string(&file).expect("an example"));
    let backend = JitBackend::new().expect("machine code on this processor");
    let (script, _, messages) = script_and_messages(folder, text.clone(), edits, &[]);
    let script = script.ok_or(messages)?;
    if not_together(&prepared(folder, text.clone(), edits, &[], &backend)?, &script).is_some() {
        return Ok(None);
    }
    ran((folder, text), edits, &[], both).map(|(_, found)| Some(found))
}

/// Smaller than they are, so that all fit in a suite.
fn smaller() -> Vec<(&'static str, String)> {
    let edits = [
        ("cells [8, 8, 8]", "cells [4, 4, 4]"),
        ("param years = 200", "param years = 2"),
        ("steps t = 0 to 3.3*hertz/v by auto", "steps t = 0 to 0.1*hertz/v by auto"),
        ("steps t = 0 to 7.9 by auto", "steps t = 0 to 0.4 by auto"),
    ];
    edits.map(|(a, b)| (a, b.to_owned())).into()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn forward_and_adjoint_agree_in_small_examples() {
    for path in [
        "creep/kelvin.wfl",
        "creep/maxwell.wfl",
        "dg/poisson.wfl",
        "dynamics/bar.wfl",
        "dynamics/column.wfl",
        "dynamics/rod.wfl",
        "dynamics/vibration.wfl",
        "elasticity/rollers.wfl",
        "fault/augmented_lagrangian.wfl",
        "friction/weakening.wfl",
        "heat/layers.wfl",
        "hyperelastic/contact.wfl",
        "interface/cohesive.wfl",
        "mapping/pressed.wfl",
        "plasticity/perzyna.wfl",
        "signorini/signorini.wfl",
    ] {
        let both = example(path, &smaller()).unwrap_or_else(|e| panic!("{path}: {e}")).expect("derivatives");
        assert!(both.list.iter().any(|f| f.along != 0.0), "{path}");
        assert_eq!(apart(&both), Vec::<String>::new(), "{path}");
    }
}

/// Examples whose runs take long: what they are made of, others have, too.
const LARGE: [&str; 10] = [
    "crack/compression.wfl",
    "crack/pressure.wfl",
    "creep/history.wfl",
    "fault_gmsh/fault_2deg.wfl",
    "friction/bp1.wfl",
    "hertz/blocks.wfl",
    "hertz/sphere.wfl",
    "poro/mandel.wfl",
    "poro/reservoir.wfl",
    "surfaces/penny.wfl",
];

/// Examples without derivatives yet: nodes without mass, images that move.
const WITHOUT: [&str; 10] = [
    "dynamics/bars.wfl",
    "sliding/capstan.wfl",
    "sliding/gears.wfl",
    "sliding/half_rings.wfl",
    "sliding/ironing.wfl",
    "sliding/patch.wfl",
    "sliding/rolling.wfl",
    "sliding/shrink_fit.wfl",
    "sliding/slot.wfl",
    "sliding/snap_fit.wfl",
];

/// Examples that have not been compared yet: their runs are the longest, and each parameter takes several.
const NOT_COMPARED: [&str; 3] = ["dynamics/sphere.wfl", "dynamics/tpv205.wfl", "poro/slow_slip.wfl"];

/// Every example that has derivatives, and those that have none.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn forward_and_adjoint_agree_in_every_example_and_with_differences() {
    let mut files = scene_files();
    files.retain(|file| NOT_COMPARED.iter().all(|name| !file.ends_with(name)));
    let found = side_by_side(&files, |file| {
        let path = file.strip_prefix(examples()).expect("an example").display().to_string();
        let (mut wrong, mut compared) = (Vec::new(), None);
        match example(&path, &smaller()) {
            Ok(None) => {}
            Ok(Some(both)) => {
                compared = Some(both.list.len());
                wrong = apart(&both);
                if !both.auto && !LARGE.contains(&path.as_str()) {
                    wrong.extend(differences(&path, &both));
                }
            }
            Err(told) => (wrong, compared) = (vec![told], Some(0)),
        }
        let wrong: Vec<String> = wrong.into_iter().map(|line| format!("{path}: {line}")).collect();
        (path, wrong, compared)
    });
    let without: Vec<&str> = found.iter().filter(|f| f.2.is_none()).map(|f| f.0.as_str()).collect();
    let compared: usize = found.iter().filter_map(|f| f.2).sum();
    let wrong: Vec<String> = found.iter().flat_map(|f| f.1.clone()).collect();
    assert_eq!(wrong, Vec::<String>::new());
    assert!(compared > 1000, "{compared}");
    assert_eq!(without, WITHOUT);
}

/// Where the derivatives of results at the last step do not agree with differences of runs on either side.
fn differences(path: &str, both: &Both) -> Vec<String> {
    let file = examples().join(path);
    let (folder, text) = (file.parent().expect("a folder"), std::fs::read_to_string(&file).expect("an example"));
    let size = sizes(&both.list);
    let mut names: Vec<(&String, f64)> = Vec::new();
    for f in &both.list {
        if let Some(value) = f.at.filter(|_| !names.iter().any(|n| *n.0 == f.by)) {
            names.push((&f.by, value));
        }
    }
    let mut wrong = Vec::new();
    for (name, value) in names {
        let change = CHANGE * if value == 0.0 { 1.0 } else { value.abs() };
        let at = |value: f64| {
            let solved = solve(folder, text.clone(), &smaller(), &[(name.as_str(), value)])?;
            Ok::<_, String>(solved.outcome.steps.last().map_or_else(Vec::new, |s| s.measures.clone()))
        };
        // at the end of its range, as of angles and choices, a parameter has no difference
        let (Ok(more), Ok(less)) = (at(value + change), at(value - change)) else { continue };
        for f in both.list.iter().filter(|f| f.by == *name && !f.result.starts_with("sum(")) {
            let of = |list: &[(String, f64)]| list.iter().find(|m| m.0 == f.result).map_or(f64::NAN, |m| m.1);
            let sides = [(of(&more) - f.value) / change, (f.value - of(&less)) / change];
            let central = 0.5 * (sides[0] + sides[1]);
            let agrees = |side: f64| (side - f.along).abs() <= DIFFERENCE * size(f).max(side.abs());
            // between the two sides of a kink
            let is_kink = (sides[0] - sides[1]).abs() > 0.1 * sides[0].abs().max(sides[1].abs());
            if is_kink && (f.along - sides[0]) * (f.along - sides[1]) < 0.0 {
                continue;
            }
            if ![central, sides[0], sides[1]].into_iter().any(agrees) {
                wrong.push(format!("{} by {name}: {:e}, differences {sides:?}", f.result, f.along));
            }
        }
    }
    wrong
}

/// A Jacobian has the same numbers by rows and by columns, over steps with friction and a memory.
#[test]
fn a_jacobian_by_rows_is_one_by_columns() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/gradients.md");
    let text = std::fs::read_to_string(page).expect("a page");
    let scene =
        text.split("```wfl fault.wfl\n").nth(1).and_then(|s| s.split("```").next()).expect("its scene").to_owned();
    let both = |of: Differentiated<'_>| -> Result<_, Box<Diagnostic>> {
        let request = Request::read("slip, work", "strength, mu, reach, field stiff").expect("names");
        Ok((jacobian_by(of, &request, Mode::Tangents)?, jacobian_by(of, &request, Mode::Adjoints)?))
    };
    let (_, (columns, rows)) = ran((Path::new("."), scene), &[], &[], both).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((columns.times.len(), &columns.times), (12, &rows.times));
    assert_eq!(columns.values.len(), 12 * 2 * (3 + 81));
    let size = columns.values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for (a, b) in columns.values.iter().zip(&rows.values) {
        assert!((a - b).abs() <= 1e-13 * size, "{a:e} {b:e}");
    }
}

/// A parameter that stands where no derivative follows it through another one is the one that is told.
#[test]
fn the_parameter_that_was_asked_for_is_told() {
    let scene = "wfl 1\nparam a = 2\nparam last = 0.5*a\nmesh box [0] to [1] cells [2]\nregion left = faces where x == 0\n\
                 unknown u : scalar\nterm stiff on all : Grad_u.Grad_Test_u\nfix u = 0 on left\nload u = a*t on all\n\
                 steps t = 0.5 to last by 0.5\nmeasure top = max(u) on all\n";
    let request = Request::read("top", "a").expect("names");
    let told = ran((Path::new("."), scene.to_owned()), &[], &[], |of| gradients(of, &request)).err().expect("refused");
    assert!(
        told.contains("`a` stands in `steps` by `last`, which is made of it") && told.contains("scene.wfl:10"),
        "{told}"
    );
}

/// Friction on a fault from displacements at the surface: 16 strengths at its nodes, 8 stations at 12 steps.
const BURIED: &str = "wfl 1
PARAMS
mesh box [0,-2] to [4,0] cells [16,16] quad
region fault = faces where x == 0 and y >= -1
region below = faces where x == 0 and y <= -1
region far = faces where x == 4
unknown u : scalar
multiplier tau : scalar on fault
def hat(s) = pos_part(1 - abs(s)*16)
data strength : scalar on fault = SUM
term bulk on all : Grad_u.Grad_Test_u
term shear on fault : tau*Test_u
term law on fault : -1/8*(tau - Ball_projection(tau + 8*(u - Previous_u), strength))*Test_tau
quadrature on fault vertex
fix u = 0 on below
fix u = (if t <= 6 then t/4 else (if t <= 9 then 4.5 - t/2 else t*0.625 - 5.5)) on far
steps t = 1 to 12 by 1
";
const NODES: usize = 16;
const STATIONS: usize = 8;

/// The scene with these strengths, the deepest one first.
fn buried(strengths: &[f64]) -> String {
    let depth = |k: usize| f64::from(u32::try_from(NODES - 1 - k).expect("few")) / 16.0;
    let params: Vec<String> = strengths.iter().enumerate().map(|(k, b)| format!("param b{k} = {b:?}")).collect();
    let sum: Vec<String> = (0..NODES).map(|k| format!("b{k}*hat(y + {:?})", depth(k))).collect();
    let stations: String =
        (1..=STATIONS).map(|k| format!("measure s{k} = value(u) at [{:?},0]\n", 0.25 * k as f64)).collect();
    BURIED.replace("PARAMS", &params.join("\n")).replace("SUM", &sum.join(" + ")) + &stations
}

/// Displacements over the noise and their derivatives by row, at all stations and steps.
fn displacements(strengths: &[f64], noise: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let names = |letter: &str, list: std::ops::Range<usize>| -> String {
        list.map(|k| format!("{letter}{k}")).collect::<Vec<_>>().join(", ")
    };
    let request = Request::read(&names("s", 1..STATIONS + 1), &names("b", 0..NODES)).expect("names");
    let of = |of: Differentiated<'_>| jacobian_by(of, &request, Mode::Tangents);
    let (solved, made) = ran((Path::new("."), buried(strengths)), &[], &[], of).unwrap_or_else(|e| panic!("{e}"));
    let values = solved.outcome.steps.iter().flat_map(|s| s.measures.iter().map(|m| m.1 / noise)).collect();
    (values, made.values.chunks(NODES).map(|row| row.iter().map(|x| x / noise).collect()).collect())
}

/// The solution of a small symmetric system.
fn solution(mut matrix: Vec<Vec<f64>>, mut rhs: Vec<f64>) -> Vec<f64> {
    let n = rhs.len();
    for k in 0..n {
        for row in k + 1..n {
            let factor = matrix[row][k] / matrix[k][k];
            for column in k..n {
                matrix[row][column] -= factor * matrix[k][column];
            }
            rhs[row] -= factor * rhs[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| matrix[k][j] * rhs[j]).sum();
        rhs[k] = (rhs[k] - known) / matrix[k][k];
    }
    rhs
}

/// Gauss and Newton's method with the Jacobian, from a constant guess, with less and less weight of a smooth prior: 96 data
/// are met within their noise in at most 50 runs, which is what an independent program needed.
#[test]
fn friction_on_a_fault_is_found_from_displacements() {
    const NOISE: f64 = 1e-4;
    let depth = |k: usize| -(f64::from(u32::try_from(NODES - 1 - k).expect("few")) / 16.0);
    let truth: Vec<f64> = (0..NODES).map(|k| 0.10 + 0.15 * (-((depth(k) + 0.45) / 0.15f64).powi(2)).exp()).collect();
    let mut sequence = Sequence(39);
    let mut normal = || (0..12).map(|_| sequence.number()).sum::<f64>() / 2.0;
    let data: Vec<f64> = displacements(&truth, NOISE).0.iter().map(|x| x + normal()).collect();
    let mut runs = 0;
    let mut look = |b: &[f64]| {
        runs += 1;
        displacements(b, NOISE)
    };
    let misfit = |values: &[f64]| values.iter().zip(&data).map(|(x, d)| (x - d) * (x - d)).sum::<f64>();
    let rough = |b: &[f64]| b.windows(2).map(|w| (w[1] - w[0]) * (w[1] - w[0])).sum::<f64>();
    let mut b = vec![0.12; NODES];
    let mut found = look(&b);
    for weight in [1e7, 1e6, 1e5, 1e4] {
        let cost = |values: &[f64], b: &[f64]| misfit(values) + weight * rough(b);
        let mut damping = 1e-3;
        for _ in 0..12 {
            let (values, rows) = &found;
            let mut matrix = vec![vec![0.0; NODES]; NODES];
            let mut rhs = vec![0.0; NODES];
            for (row, (x, d)) in rows.iter().zip(values.iter().zip(&data)) {
                for i in 0..NODES {
                    rhs[i] -= row[i] * (x - d);
                    (0..NODES).for_each(|j| matrix[i][j] += row[i] * row[j]);
                }
            }
            for k in 0..NODES - 1 {
                for (i, sign) in [(k, -1.0), (k + 1, 1.0)] {
                    rhs[i] -= weight * sign * (b[k + 1] - b[k]);
                    matrix[i][k] -= weight * sign;
                    matrix[i][k + 1] += weight * sign;
                }
            }
            (0..NODES).for_each(|k| matrix[k][k] *= 1.0 + damping);
            let step = solution(matrix, rhs);
            let next: Vec<f64> = b.iter().zip(&step).map(|(b, s)| (b + s).clamp(1e-3, 1.0)).collect();
            let there = look(&next);
            let (before, after) = (cost(values, &b), cost(&there.0, &next));
            if after < before {
                (b, found, damping) = (next, there, damping * 0.1);
            } else {
                damping = (damping * 10.0).max(1e-3);
            }
            if (before - after).abs() < 1e-2 * before {
                break;
            }
        }
    }
    let error = b.iter().zip(&truth).map(|(b, t)| (b - t).abs()).fold(0.0, f64::max);
    let met = misfit(&found.0);
    assert!(runs <= 50 && met < 96.0 && error < 0.05, "{runs} runs, misfit {met}, error {error}: {b:?}");
}

/// A value of a field that nothing acts through has no influence, and that is told.
#[test]
fn values_without_influence_are_counted() {
    let scene = "wfl 1\nmesh box [0] to [2] cells [4]\nregion soft = cells where x < 1\nregion stiff = cells where x > 1\n\
                 region left = faces where x == 0\nunknown u : scalar\ndata k : scalar = 2\n\
                 term soft on soft : k*Grad_u.Grad_Test_u\nterm stiff on stiff : 9*Grad_u.Grad_Test_u\nfix u = 0 on left\n\
                 load u = 1 on all\nmeasure top = max(u) on all\n";
    let request = Request::read("top", "field k").expect("names");
    let of = |of: Differentiated<'_>| gradients(of, &request);
    let (_, found) = ran((Path::new("."), scene.to_owned()), &[], &[], of).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        found.notes.iter().any(|note| note.starts_with("`k` has no influence at 2 of 5 nodes")),
        "{:?}",
        found.notes
    );
}
