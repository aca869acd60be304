//! Whether every statement of a solved scene took part: without it something must be different - an error, the unknowns,
//! the free equations at the states found and beside them, prescribed values, measures, files - or the program must have
//! told. A prescribed value must hold, whatever else is prescribed.

use wfl_compiler::InterpreterBackend;
use wfl_discrete::system::{FIXED, Form};
use wfl_problem::{Measured, Scene};
use wfl_run::StepResult;

use super::{Mutant, mutate::word, ready};
use crate::fuzz::Random;

/// Statements that may say what would be so without them.
const MAY_REPEAT: [&str; 8] = ["quadrature", "solver", "expect", "gradient", "use", "wfl", "mesh", "steps"];
/// A prescribed value holds to this part of the largest value.
const HOLDS: f64 = 1e-9;
/// States beside those found, where contact is open, closed and slipping.
const BESIDE: usize = 1;

/// What a scene makes of its statements.
#[derive(PartialEq)]
struct Traces {
    free: Vec<u32>,
    names: Vec<String>,
    /// Bits of prescribed values, first guesses, measures and step values.
    values: Vec<u64>,
    /// The residual at each state: of the free dofs, and of all.
    forces: Vec<Vec<u64>>,
}

/// Statements of a mutant, solved without a warning, that had no part in the solution.
#[must_use]
pub fn idle_statements(mutant: &Mutant, steps: &[StepResult]) -> Vec<String> {
    // one solved step tells what the statements do; where time starts nothing is solved
    let steps = &steps[steps.len().saturating_sub(1)..];
    let Some(whole) = traces(mutant, steps) else { return vec!["the scene cannot be prepared again".to_owned()] };
    let mut found = Vec::new();
    for (at, statement) in mutant.statements.iter().enumerate() {
        let kind = word(statement);
        if MAY_REPEAT.contains(&kind) {
            continue;
        }
        if kind == "fix" {
            found.extend(not_held(mutant, at, steps));
            continue;
        }
        let is_doubled = mutant.statements.iter().filter(|s| *s == statement).count() > 1;
        if is_doubled && kind == "start" {
            continue;
        }
        let mut without = mutant.clone();
        without.statements.remove(at);
        let Some(less) = traces(&without, steps) else { continue };
        // a term that is zero everywhere says so itself, as does a load of zero
        let says_zero = matches!(kind, "term" | "energy" | "start") || (kind == "load" && is_of_zero(statement));
        let is_zero = says_zero && whole.1 == less.1;
        if whole.0 == less.0 && !is_zero {
            found.push(format!("takes no part: {statement}"));
        }
    }
    found
}

/// True for `load u = 0 on east`, `load u = [0,0] on east` and `load u = (0*2) on east`.
fn is_of_zero(statement: &str) -> bool {
    let value = statement.split_once('=').and_then(|(_, v)| v.rsplit_once(" on ")).map_or("", |(v, _)| v);
    let is_zero = |factor: &str| factor.trim_matches(['(', ')', '[', ']', ' ']).parse() == Ok(0.0);
    !value.is_empty() && value.split([',', ';']).all(|entry| entry.split('*').any(is_zero))
}

/// What follows from the statements, and the residual of all dofs; `None` for a scene that is refused.
fn traces(mutant: &Mutant, steps: &[StepResult]) -> Option<(Traces, Vec<Vec<u64>>)> {
    let mut scene = ready(mutant, &InterpreterBackend, &[]).scene?;
    let mut traces = Traces {
        free: scene.system.numbering.free.clone(),
        names: scene.vtk.iter().map(|v| format!("{} {}", v.file, v.pieces.len())).collect(),
        values: scene.steps.values.iter().map(|v| v.to_bits()).collect(),
        forces: Vec::new(),
    };
    traces.names.extend(scene.csv.iter().map(|c| c.file.clone()));
    traces.names.extend(scene.measures.iter().map(|m| m.name.clone()));
    traces.names.extend(scene.computed.iter().map(|c| c.name.clone()));
    let mut everywhere = Vec::new();
    if traces.free.len() != steps.first()?.state.len() {
        return Some((traces, everywhere));
    }
    for step in steps {
        step_traces(&mut scene, step, &mut traces, &mut everywhere)?;
    }
    Some((traces, everywhere))
}

fn step_traces(
    scene: &mut Scene,
    step: &StepResult,
    traces: &mut Traces,
    everywhere: &mut Vec<Vec<u64>>,
) -> Option<()> {
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
    let window = step.window;
    let positions = |scene: &Scene, k: usize| -> Vec<[f64; 3]> {
        let f = &scene.system.fields[k];
        (0..f.n_nodes()).map(|n| f.node_position(n)).collect()
    };
    for k in 0..scene.data.len() {
        let at = positions(scene, scene.data[k].0);
        let (field, value) = &mut scene.data[k];
        scene.system.set_data(*field, value.at(&at, window).ok()?);
    }
    for k in 0..scene.starts.len() {
        let at = positions(scene, scene.starts[k].0);
        let values = scene.starts[k].1.at(&at, window).ok()?;
        // zero is what all unknowns start from
        if values.iter().any(|v| *v != 0.0) {
            traces.values.extend(bits(&values));
        }
    }
    scene.system.begin_step(window).ok()?;
    let mut u = step.state.clone();
    scene.prescribed.apply(window, &mut u).ok()?;
    traces.values.extend(bits(&u));
    for measure in &mut scene.measures {
        let at = Measured::new(&scene.system, window, &step.state);
        traces.values.push(measure.evaluate(&at).to_bits());
    }
    let size = step.state.iter().fold(1e-3f64, |m, v| m.max(v.abs()));
    let mut random = Random(7);
    for beside in 0..=BESIDE {
        let wobble = |random: &mut Random| if beside == 0 { 0.0 } else { random.below(2001) as f64 / 1000.0 - 1.0 };
        let state: Vec<f64> = step.state.iter().map(|v| v + size * wobble(&mut random)).collect();
        // beside a state a logarithm may have no value; at the state it has one
        let all = match scene.system.residual(&state, &Form::AS_WRITTEN) {
            Err(_) if beside > 0 => continue,
            other => other.ok()?.values,
        };
        let is_free = |d: &usize| scene.system.numbering.free[*d] != FIXED;
        traces.forces.push((0..all.len()).filter(is_free).map(|d| all[d].to_bits()).collect());
        everywhere.push(bits(&all));
    }
    Some(())
}

/// A `fix` by itself, against the states: dofs where they have another value, or that it meets none.
fn not_held(mutant: &Mutant, at: usize, steps: &[StepResult]) -> Option<String> {
    let statement = &mutant.statements[at];
    let mut alone = mutant.clone();
    alone.statements = mutant
        .statements
        .iter()
        .enumerate()
        .filter(|(k, s)| *k == at || word(s) != "fix")
        .map(|(_, s)| s.clone())
        .collect();
    let scene = ready(&alone, &InterpreterBackend, &[]).scene?;
    if scene.prescribed.dofs().is_empty() {
        return Some(format!("meets no unknown: {statement}"));
    }
    for step in steps {
        let mut u = step.state.clone();
        if u.len() != scene.system.numbering.n_dofs {
            return Some(format!("changes the unknowns: {statement}"));
        }
        scene.prescribed.apply(step.window, &mut u).ok()?;
        let size = u.iter().chain(&step.state).fold(0.0f64, |m, v| m.max(v.abs()));
        let apart = u.iter().zip(&step.state).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        if apart > HOLDS * size {
            return Some(format!("does not hold at t = {}, by {apart:e} of {size:e}: {statement}", step.window.end));
        }
    }
    None
}
