//! Mutated scenes under an oracle: a run that ends well and without a warning has found what an independent assembly of
//! the same statements finds, every statement took part, and all its numbers are finite.
//!
//! Promises that the same number gives the same mutant on every machine. Does not judge scenes that are refused, that do
//! not converge or that are warned of: there the user has been told.

mod audit;
mod mutate;
mod took_part;

use std::{path::PathBuf, time::Instant};

pub use audit::{Audit, audit};
pub use mutate::{Mutant, Seed, mutate, seeds, word};
pub use took_part::idle_statements;
use wfl::{Diagnostic, NoFiles, SourceMap, resolve};
use wfl_checks::locked_bodies;
use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_discrete::{pruning::Pruning, system::FIXED};
use wfl_jit::JitBackend;
use wfl_problem::{Equations, Measured, Prepared, RuleChoice, Scene, prepare_keeping};
use wfl_run::{Outcome, Quiet, RunOptions, run};

use crate::{doubts, fuzz::Random};

/// A residual above this part of the forces is none of a solution; the tolerance that scenes have by default is far below.
const RESIDUAL: f64 = 1e-6;
/// Above this a measure is rounding times a number of the mutation: no quantity of a scene is as large.
const MEANINGFUL: f64 = 1e100;
/// Prescribed values and measures are the same formulas at the same state.
const SAME: f64 = 1e-9;
/// A rule with more points moves no measure of these coarse meshes by more than this part of its largest value.
const FINER: f64 = 0.5;
/// What the degree of a rule is raised by.
const MORE: usize = 4;
/// What rounding leaves of the unknowns, in parts of the largest one.
const NOISE: f64 = 1e-13;
/// States with such noise that are looked at.
const NOISY: usize = 16;
/// The warning that numbers are those of a quadrature rule: all else is judged.
const RULE_DECIDES: &str = "W617";
/// Steps of a mutant, at most; more are a longer run and not another one.
const STEPS: usize = 6;

/// What became of a mutant.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// An error before the run or in it: the code where it has one.
    Refused(String),
    /// A step did not converge.
    NotConverged,
    /// A warning.
    Warned(String),
    /// Solved, and the oracle agrees.
    Agreed,
    /// Solved without a warning, and something is wrong.
    Disagrees(Vec<String>),
}

/// The mutant of a number.
#[must_use]
pub fn mutant(seeds: &[Seed], number: u64) -> Mutant {
    mutate(seeds, &mut Random(number.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(1)))
}

/// A mutant made ready with a backend; `keep` is done although the scene does not need it.
#[must_use]
pub fn ready(mutant: &Mutant, backend: &dyn KernelBackend, keep: &[Pruning]) -> Prepared {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", mutant.text());
    let resolved = resolve(&mut sources, main, &mut NoFiles, &[]);
    let Some(script) = resolved.value.filter(|_| !resolved.diagnostics.iter().any(Diagnostic::is_error)) else {
        return Prepared { scene: None, diagnostics: resolved.diagnostics };
    };
    let mut prepared = prepare_keeping(&script, &mutant.folder, backend, keep);
    prepared.diagnostics.extend(resolved.diagnostics);
    if let Some(scene) = &mut prepared.scene {
        scene.steps.values.truncate(STEPS);
    }
    prepared
}

/// Runs a mutant and asks the oracle. `out` is a folder for its files.
///
/// # Panics
/// If this processor cannot run machine code.
#[must_use]
pub fn judge(mutant: &Mutant, out: Option<PathBuf>) -> Verdict {
    let backend = JitBackend::new().expect("machine code on this processor");
    let prepared = ready(mutant, &backend, &[]);
    let Some(scene) = prepared.scene else {
        let error = prepared.diagnostics.iter().find(|d| d.is_error());
        return Verdict::Refused(error.map_or("no code", |d| d.code.as_str()).to_owned());
    };
    // what is not needed is no word about the numbers
    let (unused, told): (Vec<&Diagnostic>, Vec<&Diagnostic>) =
        prepared.diagnostics.iter().partition(|d| d.code == "W702");
    if let Some(d) = told.first() {
        return Verdict::Warned(d.code.to_string());
    }
    if let Some(code) = told_before(&scene) {
        return Verdict::Warned(code.to_owned());
    }
    let rules: Vec<(String, RuleChoice)> = scene.terms.iter().map(|t| (t.place.clone(), t.rule)).collect();
    let options = RunOptions { out: out.clone(), keep_states: true, ..RunOptions::without_files(2, Instant::now()) };
    let outcome = match run(&scene, &options, &mut Quiet) {
        Ok(outcome) => outcome,
        Err(error) => return Verdict::Refused(error.to_string().split(':').next().unwrap_or("").to_owned()),
    };
    if !outcome.converged() {
        return Verdict::NotConverged;
    }
    if let Some((code, _)) = doubts(&outcome).iter().find(|(code, _)| *code != RULE_DECIDES) {
        return Verdict::Warned((*code).to_owned());
    }
    // a measure that is no number is an error of the command, with the measure and the place
    let bad = outcome.bad_measures();
    if !bad.is_empty() && bad.iter().all(|(_, name, _, place)| place.is_some_and(|p| p.name == *name)) {
        return Verdict::Refused("E611".to_owned());
    }
    let mut wrong = not_finite(&outcome, out.as_ref());
    wrong.extend(not_the_same(mutant, &outcome));
    if doubts(&outcome).is_empty() {
        wrong.extend(not_under_a_finer_rule(mutant, &outcome, &rules));
    }
    let idle = idle_statements(mutant, &outcome.steps);
    wrong.extend(idle.into_iter().filter(|i| !unused.iter().any(|d| i.ends_with(stated(mutant, d)))));
    if wrong.is_empty() { Verdict::Agreed } else { Verdict::Disagrees(wrong) }
}

/// What the command says of a prepared scene about the size of its numbers, before a run.
fn told_before(scene: &Scene) -> Option<&'static str> {
    if scene.coarse_loads().is_ok_and(|loads| !loads.is_empty()) {
        return Some("W512");
    }
    scene.at_first_step().is_ok_and(|first| !locked_bodies(&first.system).is_empty()).then_some("W513")
}

/// The statement that a message points at.
fn stated<'m>(mutant: &'m Mutant, message: &Diagnostic) -> &'m str {
    let at = message.labels.first().map_or(usize::MAX, |l| l.span.start as usize);
    let mut end = 0;
    let holds = |s: &&String| {
        end += s.len() + 1;
        at < end
    };
    mutant.statements.iter().find(holds).map_or("(nowhere)", String::as_str)
}

/// Unknowns, measures and tables that hold something else than finite numbers.
fn not_finite(outcome: &Outcome, out: Option<&PathBuf>) -> Vec<String> {
    let mut wrong = Vec::new();
    for step in &outcome.steps {
        if step.state.iter().any(|v| !v.is_finite()) {
            wrong.push(format!("unknowns are not finite at t = {}", step.window.end));
        }
        let measures = step.measures.iter().filter(|(_, v)| !v.is_finite());
        wrong.extend(measures.map(|(name, v)| format!("measure {name} is {v} at t = {}", step.window.end)));
    }
    for file in outcome.files.iter().filter(|f| out.is_some() && f.extension().is_some_and(|e| e == "csv")) {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let rows: Vec<Vec<f64>> = text.lines().skip(1).map(numbers).collect();
        // a quantity has a value in its own body, and `nan` in others on the line
        let lives = |column: usize| rows.iter().any(|row| row[column].is_finite());
        let columns = rows.first().map_or(0, Vec::len);
        if rows.iter().flatten().any(|cell| cell.is_infinite()) || !(0..columns).all(lives) {
            wrong.push(format!("{} has cells that are no finite numbers", file.display()));
        }
    }
    let mut names = outcome.files.clone();
    names.sort();
    names.dedup();
    if names.len() != outcome.files.len() {
        wrong.push("a file was written twice".to_owned());
    }
    wrong
}

/// The cells of a row; infinite for what is no number and not `nan`.
fn numbers(row: &str) -> Vec<f64> {
    row.split(',').map(|cell| cell.trim().parse().unwrap_or(f64::INFINITY)).collect()
}

/// The same statements on the interpreter, without what is left out of a run, on one thread.
fn not_the_same(mutant: &Mutant, outcome: &Outcome) -> Option<String> {
    // cells that are no parallelograms have no exact rule: there a higher one is another scene
    let keep: Vec<Pruning> = Pruning::ALL.into_iter().filter(|p| *p != Pruning::Quadrature).collect();
    let mut scene = match ready(mutant, &InterpreterBackend, &keep) {
        Prepared { scene: Some(scene), .. } => scene,
        _ => return Some("the interpreter refuses the scene".to_owned()),
    };
    match audit(&mut scene, &outcome.steps) {
        Err(error) => Some(format!("an independent assembly fails: {error}")),
        Ok(None) => None,
        Ok(Some(a)) => {
            // a scene that asks for a tolerance of its own is solved to that
            let residual = RESIDUAL.max(scene.newton.tolerance);
            let right = a.residual <= residual && a.prescribed <= SAME && a.measures <= SAME;
            (!right).then(|| {
                format!(
                    "independent assembly: residual {:.1e}, prescribed values {:.1e}, measures {:.1e}",
                    a.residual, a.prescribed, a.measures
                )
            })
        }
    }
}

/// True if what rounding leaves of the unknowns moves a measure by so much at the end of some step: a count of points that
/// slip where two bodies touch without pressure says nothing, under any rule.
fn rounding_decides(scene: &Scene, measure: usize, outcome: &Outcome, much: f64) -> bool {
    let (mut random, Equations { system, .. }) = (Random(5), &outcome.equations);
    outcome.steps.iter().any(|step| {
        let size = NOISE * step.state.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for _ in 0..NOISY {
            let noisy = |(dof, value): (usize, &f64)| {
                let is_free = system.numbering.free[dof] != FIXED;
                if is_free { value + size * (random.below(2001) as f64 / 1000.0 - 1.0) } else { *value }
            };
            let beside: Vec<f64> = step.state.iter().enumerate().map(noisy).collect();
            let found = scene.measures[measure].evaluate(&Measured::new(system, step.window, &beside));
            (least, most) = (least.min(found), most.max(found));
        }
        most - least > much
    })
}

/// Whether a measure is the largest or smallest value at points.
fn is_of_one_point(mutant: &Mutant, name: &str) -> bool {
    let declares = |s: &&String| {
        let rest = s.strip_prefix("measure ").map(str::trim_start).and_then(|rest| rest.strip_prefix(name));
        rest.is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let statement = mutant.statements.iter().find(declares);
    statement.is_some_and(|s| s.contains("max(") || s.contains("min("))
}

/// The scene once more with rules of a higher degree, where it does not ask for its own.
fn not_under_a_finer_rule(mutant: &Mutant, outcome: &Outcome, rules: &[(String, RuleChoice)]) -> Option<String> {
    if mutant.statements.iter().any(|s| word(s) == "quadrature") || outcome.steps.iter().all(|s| s.measures.is_empty())
    {
        return None;
    }
    let mut finer = mutant.clone();
    let mut places: Vec<&String> = Vec::new();
    for (place, rule) in rules {
        if let (RuleChoice::Degree(degree), false) = (rule, places.contains(&place) || place == "global") {
            places.push(place);
            finer.statements.push(format!("quadrature on {place} degree {}", degree + MORE));
        }
    }
    let backend = JitBackend::new().ok()?;
    let scene = ready(&finer, &backend, &[]).scene?;
    let options = RunOptions { keep_states: true, ..RunOptions::without_files(1, Instant::now()) };
    let again = run(&scene, &options, &mut Quiet).ok()?;
    if !again.converged() {
        return None;
    }
    let system = &again.equations.system;
    for measure in 0..scene.measures.len() {
        let told = |o: &Outcome| -> Vec<f64> { o.steps.iter().map(|s| s.measures[measure].1).collect() };
        // the largest value at the points of a rule is that of one of them, and a finer rule has others: both states are
        // looked at under the finer one
        let looked_at = |o: &Outcome| -> Vec<f64> {
            let of = &scene.measures[measure];
            o.steps.iter().map(|s| of.evaluate(&Measured::new(system, s.window, &s.state))).collect()
        };
        let (coarse, fine) = if is_of_one_point(mutant, &scene.measures[measure].name) {
            (looked_at(outcome), looked_at(&again))
        } else {
            (told(outcome), told(&again))
        };
        let size = coarse.iter().chain(&fine).fold(0.0f64, |m, v| m.max(v.abs()));
        // what is rounding beside the other measures is no number of its own
        let largest = outcome.steps.iter().flat_map(|s| &s.measures).fold(0.0f64, |m, (_, v)| m.max(v.abs()));
        let largest = outcome.steps.iter().flat_map(|s| &s.state).fold(largest, |m, v| m.max(v.abs()));
        let apart = coarse.iter().zip(&fine).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        let moves = apart > FINER * size && size > 1e-9 * largest && size < MEANINGFUL;
        if moves && !rounding_decides(&scene, measure, &again, FINER * apart) {
            let name = &outcome.steps[0].measures[measure].0;
            return Some(format!("a finer rule moves {name} by {apart:.2e} of {size:.2e}"));
        }
    }
    None
}
