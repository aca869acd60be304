//! Derivatives of results: beside the results of a run, and against differences of whole runs.
//!
//! A difference is that of two runs of the scene with another value of one parameter, on both sides of its own: it uses
//! nothing of what derivatives are made of. Where the run chooses its steps, the others go through those. Does not print.

use std::{path::Path, time::Instant};

use wfl::SourceMap;
use wfl_compiler::backend::KernelBackend;
use wfl_gradient::{Differentiated, Gradient, Gradients, Request, ToSides, WantedResult, ahead, gradients};
use wfl_output::{
    GradientReport, OrderedMap, OutputDir, OutputError, ParameterValue, Report, write_csv, write_report, write_vtu,
};
use wfl_problem::Scene;
use wfl_run::{Outcome, Quiet, RunOptions, field_grid, run};

use crate::{Loaded, scene_file::read_scene_with_knobs};

/// The table of the derivatives of a run.
pub const GRADIENT_FILE: &str = "gradient.csv";

/// Changes of a parameter in parts of its value (of one for a value of zero), the larger first: the difference of two
/// central differences says how good they are.
const CHANGES: [f64; 2] = [1e-4, 1e-5];
/// Runs for differences are solved to this residual.
const TOLERANCE: f64 = 1e-13;
/// A derivative agrees with a difference within this part of the larger of both, ...
const AGREEMENT: f64 = 1e-5;
/// ... within so many times what the differences say of their own error, ...
const SPREAD: f64 = 10.0;
/// ... as long as that is below this part of the derivative, ...
const ROUGH: f64 = 1e-3;
/// ... and within what this part of the result leaves of a difference.
const ROUNDING: f64 = 1e-12;
/// Differences to both sides that are further apart than this part of them are those of a kink.
const KINK: f64 = 0.1;

/// The name of a file with the derivatives in a data field.
fn field_file(result: &str, field: &str) -> String {
    let plain: String = result.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    format!("gradient_{plain}_by_{field}.csv")
}

/// The name of the picture of the derivatives in a data field.
fn grid_file(field: &str) -> String {
    format!("gradient_by_{field}.vtu")
}

/// The files that derivatives are written to, each with what is in it.
#[must_use]
pub fn files(request: &Request) -> Vec<(String, String)> {
    let of_field = |result: &str, field: &String| {
        (field_file(result, field), format!("the derivatives of `{result}` in the field `{field}`"))
    };
    let of_fields = request.results.iter().flat_map(|r| request.fields.iter().map(move |f| of_field(&r.name, f)));
    let grids = request.fields.iter().map(|f| (grid_file(f), format!("the grid of derivatives in the field `{f}`")));
    let table = (GRADIENT_FILE.to_owned(), "the table of derivatives".to_owned());
    std::iter::once(table).chain(of_fields).chain(grids).collect()
}

/// Names of derivatives with their numbers: `Fn_by_E`, `Fn_by_g(2)` of a parameter of several numbers.
#[must_use]
pub fn numbers(of: &Gradients) -> Vec<(String, f64)> {
    let mut out = Vec::new();
    for result in &of.results {
        for (parameter, entries) in &result.parameters {
            let name = format!("{}_by_{parameter}", result.name);
            match entries.as_slice() {
                [one] => out.push((name, *one)),
                several => out.extend((1..).zip(several).map(|(k, x)| (format!("{name}({k})"), *x))),
            }
        }
    }
    out
}

/// Derivatives to one side with their names: `Fn_by_E_larger`, `Fn_by_g(2)_smaller`.
fn sided_numbers(of: &Gradients) -> Vec<(String, f64)> {
    let mut out = Vec::new();
    for result in &of.results {
        for sides in &result.sides {
            for (word, entries) in [("larger", &sides.larger), ("smaller", &sides.smaller)] {
                let name = format!("{}_by_{}", result.name, sides.parameter);
                match entries.as_slice() {
                    [one] => out.push((format!("{name}_{word}"), *one)),
                    several => out.extend((1..).zip(several).map(|(k, x)| (format!("{name}({k})_{word}"), *x))),
                }
            }
        }
    }
    out
}

/// The derivatives of a result to larger and to smaller values of a parameter, `g(2)` for the second entry of one of several
/// numbers; nothing where nobody asked.
#[must_use]
pub fn to_sides(of: &Gradient, parameter: &str) -> [Option<f64>; 2] {
    let (name, entry) = match parameter.strip_suffix(')').and_then(|p| p.split_once('(')) {
        Some((name, k)) => (name, k.parse::<usize>().map_or(0, |k| k.saturating_sub(1))),
        None => (parameter, 0),
    };
    let mine = || of.sides.iter().filter(|s| s.parameter == name);
    let find = |f: fn(&ToSides) -> &Vec<f64>| mine().find_map(|s| f(s).get(entry).copied());
    [find(|s| &s.larger), find(|s| &s.smaller)]
}

/// Writes derivatives beside the results of a run that has ended, and into its report.
///
/// # Errors
/// Of the folder.
pub fn write(folder: &Path, scene: &Scene, of: &Gradients, report: &mut Report) -> Result<(), OutputError> {
    let dir = OutputDir::open(folder)?;
    let (names, values): (Vec<String>, Vec<f64>) = numbers(of).into_iter().chain(sided_numbers(of)).unzip();
    let mut files = Vec::new();
    if !names.is_empty() {
        write_csv(&dir, GRADIENT_FILE, &names, &[values])?;
        files.push(GRADIENT_FILE.to_owned());
    }
    for result in &of.results {
        for (name, values) in &result.fields {
            let file = field_file(&result.name, name);
            let Some(field) = scene.system.fields.iter().find(|f| f.name == *name) else { continue };
            let n = field.n_components;
            let columns = ["x", "y", "z"].map(str::to_owned).into_iter();
            let columns: Vec<String> =
                columns.chain((1..=n).map(|k| format!("{}_by_{name}({k})", result.name))).collect();
            let row = |node: usize| [&field.node_position(node)[..], &values[node * n..][..n]].concat();
            let rows: Vec<Vec<f64>> = (0..field.n_nodes()).map(row).collect();
            write_csv(&dir, &file, &columns, &rows)?;
            files.push(file);
        }
    }
    files.extend(write_grids(&dir, scene, of)?);
    dir.sync()?;
    for file in files {
        if !report.files.contains(&file) {
            report.files.push(file);
        }
    }
    self::report(of, report);
    write_report(&dir, report)?;
    dir.settle()
}

/// Puts derivatives, and what there is to tell of them, into the report of their run.
pub fn report(of: &Gradients, report: &mut Report) {
    report.gradients = of.results.iter().map(reported).collect();
    report.warnings.extend(told(of));
}

/// Writes a grid for each data field with the derivatives of all results at its nodes; none for a field that has no such
/// grid. Gives the names of the files.
fn write_grids(dir: &OutputDir, scene: &Scene, of: &Gradients) -> Result<Vec<String>, OutputError> {
    let mut files = Vec::new();
    for (k, field) in scene.system.fields.iter().enumerate() {
        let values =
            |result: &wfl_gradient::Gradient| Some(result.fields.iter().find(|f| f.0 == field.name)?.1.clone());
        let found: Vec<(String, Vec<f64>)> =
            of.results.iter().filter_map(|r| Some((format!("{}_by_{}", r.name, field.name), values(r)?))).collect();
        let named: Vec<(String, &[f64])> = found.iter().map(|(name, v)| (name.clone(), v.as_slice())).collect();
        if let Some(piece) = field_grid(scene, k, &named).filter(|_| !named.is_empty()) {
            let file = grid_file(&field.name);
            write_vtu(dir, &file, None, &[piece])?;
            files.push(file);
        }
    }
    Ok(files)
}

/// What there is to tell of derivatives, with its code.
#[must_use]
pub fn told(of: &Gradients) -> Vec<String> {
    of.near.iter().map(|near| format!("W660: {}", near.finding().line())).collect()
}

fn reported(of: &wfl_gradient::Gradient) -> GradientReport {
    let value = |entries: &[f64]| match entries {
        [one] => ParameterValue::from(*one),
        several => ParameterValue::from(several),
    };
    let by: OrderedMap<ParameterValue> =
        of.parameters.iter().map(|(name, entries)| (name.as_str(), value(entries))).collect();
    let side = |f: fn(&ToSides) -> &Vec<f64>| -> OrderedMap<ParameterValue> {
        let found = of.sides.iter().filter(|s| !f(s).is_empty());
        found.map(|s| (s.parameter.as_str(), value(f(s)))).collect()
    };
    let (by_larger, by_smaller) = (side(|s| &s.larger), side(|s| &s.smaller));
    GradientReport { result: of.name.clone(), value: wfl_output::Real(of.value), by, by_larger, by_smaller }
}

/// What is verified: a scene, its settings, and the derivatives.
#[derive(Clone, Copy)]
pub struct Verified<'a> {
    /// The scene.
    pub file: &'a Path,
    /// Values of its parameters and knobs.
    pub overrides: &'a [String],
    /// The derivatives.
    pub request: &'a Request,
    /// Runs terms.
    pub backend: &'a dyn KernelBackend,
    /// Threads of each run.
    pub threads: usize,
}

/// A derivative beside the differences of runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// The result.
    pub result: String,
    /// The parameter.
    pub parameter: String,
    /// The derivative.
    pub derivative: f64,
    /// Differences of runs: to larger values, to smaller ones, and of both.
    pub forward: f64,
    /// To smaller values.
    pub backward: f64,
    /// Of both.
    pub central: f64,
    /// How they agree.
    pub verdict: Verdict,
    /// The derivative agrees with the difference to larger values, and to smaller ones.
    pub agrees_with: [bool; 2],
    /// The derivatives to larger and to smaller values, where they were asked for.
    pub sides: [Option<f64>; 2],
}

/// How a derivative agrees with differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// With the central difference.
    Agrees,
    /// The result has a kink in the parameter; the derivative is that of one side, or between both.
    Kink,
    /// The result has a kink in the parameter, and the derivatives to both sides agree with the differences to both.
    BothSides,
    /// The differences are too rough to say so.
    Unclear,
    /// With neither.
    Disagrees,
}

/// Derivatives beside differences of runs.
pub struct Comparison {
    /// A row for each result and parameter.
    pub rows: Vec<Compared>,
    /// The derivatives.
    pub found: Gradients,
    /// The text that places of messages are in.
    pub sources: SourceMap,
}

/// Differentiates a scene and compares with differences of runs.
///
/// # Errors
/// In words with their places where there are some.
pub fn verify(of: Verified<'_>) -> Result<Comparison, String> {
    let (loaded, scene, outcome) = solved(of, None)?;
    let passed = outcome.trajectory.iter().flat_map(|t| &t.steps);
    let orders = passed.filter_map(|s| Some((s.window.end, s.order?))).collect();
    let chosen = Chosen { times: outcome.steps.iter().map(|s| s.window.end).collect(), orders };
    let differentiated = Differentiated {
        scene: &scene,
        script: &loaded.script,
        outcome: &outcome,
        backend: of.backend,
        threads: of.threads,
    };
    let found = gradients(differentiated, of.request).map_err(|d| wfl::render(&d, &loaded.sources))?;
    let mut rows = Vec::new();
    for parameter in &of.request.parameters {
        let value = scene.params.iter().find(|p| p.0 == *parameter).map_or(&[][..], |p| p.1.values.as_slice());
        let [value] = *value else {
            return Err(format!("`{parameter}` has several numbers: differences are made of one\n"));
        };
        let scale = if value == 0.0 { 1.0 } else { value.abs() };
        let mut runs = Vec::new();
        for change in CHANGES.map(|part| part * scale) {
            let at = |value: f64| -> Result<Vec<f64>, String> {
                let (_, _, outcome) = solved(of, Some((parameter, value, &chosen)))?;
                of.request.results.iter().map(|r| result(&outcome, r)).collect()
            };
            let (more, less) = (value + change, value - change);
            runs.push(([more - value, value - less], at(more)?, at(less)?));
        }
        for (k, gradient) in found.results.iter().enumerate() {
            let Some(derivative) = found.number(&gradient.name, parameter) else { continue };
            let sides = to_sides(gradient, parameter);
            rows.push(compared((&gradient.name, parameter), (derivative, gradient.value, sides), k, &runs));
        }
    }
    Ok(Comparison { rows, found, sources: loaded.sources })
}

/// The changes of a parameter upwards and downwards, and the results of both runs.
type Pair = ([f64; 2], Vec<f64>, Vec<f64>);

/// The derivative, the value of the result, and the derivatives to both sides.
type Found = (f64, f64, [Option<f64>; 2]);

fn compared(names: (&str, &str), at: Found, k: usize, runs: &[Pair]) -> Compared {
    let (derivative, value, sides) = at;
    let of = |(changes, more, less): &Pair| Difference {
        forward: (more[k] - value) / changes[0],
        backward: (value - less[k]) / changes[1],
        central: (more[k] - less[k]) / (changes[0] + changes[1]),
        noise: ROUNDING * value.abs().max(more[k].abs()).max(less[k].abs()) / changes[0],
    };
    let all: Vec<Difference> = runs.iter().map(of).collect();
    // both sides agree best where neither the change nor rounding is too large
    let apart = |d: &Difference| (d.forward - d.backward).abs();
    let best = *all.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).expect("two changes");
    let judged = |derivative: f64, number: fn(&Difference) -> f64| {
        let found = number(&best);
        let size = derivative.abs().max(found.abs());
        let rough = SPREAD * all.iter().map(|d| (number(d) - found).abs()).fold(0.0, f64::max);
        let missing = (derivative - found).abs();
        if missing <= (AGREEMENT * size).max(best.noise).max(rough.min(ROUGH * size)) {
            Verdict::Agrees
        } else if missing <= rough {
            Verdict::Unclear
        } else {
            Verdict::Disagrees
        }
    };
    let verdict = |number| judged(derivative, number);
    let of_sides: [fn(&Difference) -> f64; 2] = [|d| d.forward, |d| d.backward];
    let agrees_with = of_sides.map(|number| verdict(number) == Verdict::Agrees);
    let one_side = agrees_with.contains(&true);
    // differences to both sides that are apart for every change are those of a kink
    let is_kink = |d: &Difference| apart(d) > KINK * d.forward.abs().max(d.backward.abs()).max(d.noise);
    let between = all.iter().all(|d| is_kink(d) && (derivative - d.forward) * (derivative - d.backward) < 0.0);
    let wrong_side = [0, 1]
        .into_iter()
        .any(|k| sides[k].is_some_and(|derivative| judged(derivative, of_sides[k]) == Verdict::Disagrees));
    let verdict = match verdict(|d| d.central) {
        _ if wrong_side => Verdict::Disagrees,
        Verdict::Disagrees if one_side || between => match sides {
            [Some(_), Some(_)] => Verdict::BothSides,
            _ => Verdict::Kink,
        },
        of_both => of_both,
    };
    let Difference { forward, backward, central, .. } = best;
    let (result, parameter) = (names.0.to_owned(), names.1.to_owned());
    Compared { result, parameter, derivative, forward, backward, central, verdict, agrees_with, sides }
}

/// Differences of a result for one change of a parameter.
#[derive(Clone, Copy)]
struct Difference {
    forward: f64,
    backward: f64,
    central: f64,
    /// What rounding of the result leaves of them.
    noise: f64,
}

/// The value of a result of a run.
fn result(outcome: &Outcome, wanted: &WantedResult) -> Result<f64, String> {
    let times: Vec<f64> = outcome.steps.iter().map(|s| s.window.end).collect();
    let weights = wanted.weights(&times).map_err(|why| format!("`{}`: {why}\n", wanted.name))?;
    let value = |step: &wfl_run::StepResult| step.measures.iter().find(|m| m.0 == wanted.measure).map(|m| m.1);
    let counted = outcome.steps.iter().zip(weights).filter(|(_, weight)| *weight != 0.0);
    let values: Option<Vec<f64>> = counted.map(|(step, weight)| Some(weight * value(step)?)).collect();
    values.map(|v| v.iter().sum()).ok_or_else(|| format!("no measure `{}`\n", wanted.measure))
}

/// The steps that a run has chosen.
struct Chosen {
    times: Vec<f64>,
    /// By value of the step variable the order of backward differentiation.
    orders: Vec<(f64, usize)>,
}

/// Reads, prepares and runs the scene, with another value of one parameter through the steps of the first run.
fn solved(of: Verified<'_>, other: Option<(&str, f64, &Chosen)>) -> Result<(Loaded, Scene, Outcome), String> {
    let mut words: Vec<String> = of.overrides.to_vec();
    if let Some((name, value, _)) = other {
        words.retain(|word| word.split_once('=').is_none_or(|(n, _)| n.trim() != name));
        words.push(format!("{name}={value:?}"));
    }
    let mut loaded = read_scene_with_knobs(of.file, &words, "verify")?;
    let prepared = loaded.prepare(of.backend, &[]);
    let Some(mut scene) = prepared else {
        let errors = loaded.messages.iter().filter(|d| d.is_error());
        return Err(errors.map(|d| wfl::render(d, &loaded.sources)).collect::<Vec<_>>().join("\n"));
    };
    if other.is_none() {
        ahead(&scene, &loaded.script, of.request).map_err(|d| wfl::render(&d, &loaded.sources))?;
    }
    if let Some((_, _, chosen)) = other.filter(|_| scene.steps.auto.is_some() || scene.explicit.is_some()) {
        scene.follow_steps(&chosen.times, chosen.orders.clone()).map_err(|e| format!("{e}\n"))?;
    }
    scene.newton.tolerance = scene.newton.tolerance.min(TOLERANCE);
    let keep_trajectory = other.is_none();
    let options = RunOptions { keep_trajectory, judge: false, ..RunOptions::without_files(of.threads, Instant::now()) };
    let outcome = run(&scene, &options, &mut Quiet).map_err(|e| format!("{e}\n"))?;
    if let Some(step) = outcome.steps.iter().find(|s| !s.history.converged()) {
        let with = other.map_or_else(String::new, |(name, value, _)| format!(" with {name}={value:?}"));
        return Err(format!("the step at t = {} did not converge{with}\n", step.window.end));
    }
    Ok((loaded, scene, outcome))
}
