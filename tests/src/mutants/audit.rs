//! An independent assembly of the statements of a scene, at the states that a run found: on the interpreter, with every
//! term at every state, on one thread.

use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    assemble::AssembledTerm,
    system::{FIXED, Form, System},
    window::Window,
};
use wfl_problem::{Measured, Scene};
use wfl_run::StepResult;

use crate::fuzz::Random;

/// Rounding of a sum of some hundred numbers.
const ROUNDING: f64 = 1e-13;
/// How far beside a state its forces are compared, in parts of it.
const BESIDE: f64 = 1e-3;

/// What an audit found, each the worst of all steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Audit {
    /// Largest free entry of the residual over the largest entry of a term in the equations of its field, or of one that it
    /// meets on an interface: a body that nothing touches has no force of its own.
    pub residual: f64,
    /// Largest distance of a prescribed value from what the statements say, over the largest of the field's values.
    pub prescribed: f64,
    /// Largest difference of a measure, over its size.
    pub measures: f64,
}

/// Goes through the steps of a run with its states. `None` where a step was made in parts and something reads the past:
/// the states in between are not known.
///
/// # Errors
/// A term without a finite value at one of the states.
pub fn audit(scene: &mut Scene, steps: &[StepResult]) -> Result<Option<Audit>, String> {
    let reads_past = scene.system.past().is_some() || !scene.states.is_empty();
    if reads_past && steps.iter().any(|s| !s.parts().is_empty()) {
        return Ok(None);
    }
    let mut audit = Audit::default();
    let mut before = start(scene, steps)?;
    for (number, step) in steps.iter().enumerate() {
        let window = step.window;
        if number == 0 {
            set_data(scene, window)?;
        }
        scene.system.end_step(&before);
        set_data(scene, window)?;
        scene.system.begin_step(window).map_err(|e| e.to_string())?;
        if !(number == 0 && scene.steps.from_start) {
            audit.residual = audit.residual.max(residual(scene, &step.state, &before)?);
            audit.prescribed = audit.prescribed.max(prescribed(scene, step)?);
            let next: Vec<Vec<f64>> = {
                let Scene { system, states, .. } = &mut *scene;
                states.iter_mut().map(|s| s.next(system, window, &step.state)).collect()
            };
            for (state, values) in scene.states.iter().zip(next) {
                scene.system.set_data(state.field, values);
            }
        }
        let is_given = number == 0 && scene.steps.from_start;
        audit.measures = audit.measures.max(measures(scene, step, is_given));
        before.clone_from(&step.state);
    }
    Ok(Some(audit))
}

/// First values of the unknowns; those of states are put where they are kept.
fn start(scene: &mut Scene, steps: &[StepResult]) -> Result<Vec<f64>, String> {
    let mut u = vec![0.0; scene.system.numbering.n_dofs];
    let first = Window::instant(steps.first().map_or(0.0, |s| s.window.end));
    for (field, value) in &mut scene.starts {
        let at = positions(scene.system.fields.get(*field));
        let values = value.at(&at, first).map_err(|_| "a first guess without a value")?;
        match scene.system.numbering.starts[*field] {
            Some(first) => u[first..first + values.len()].copy_from_slice(&values),
            None => scene.system.set_data(*field, values),
        }
    }
    Ok(u)
}

fn positions(field: Option<&wfl_discrete::field::Field>) -> Vec<[f64; 3]> {
    field.map(|f| (0..f.n_nodes()).map(|n| f.node_position(n)).collect()).unwrap_or_default()
}

fn set_data(scene: &mut Scene, window: Window) -> Result<(), String> {
    for (field, value) in &mut scene.data {
        let positions = positions(scene.system.fields.get(*field));
        let values = value.at(&positions, window).map_err(|_| "data without a value")?;
        scene.system.set_data(*field, values);
    }
    Ok(())
}

/// The largest entry by which the free equations are not met, in parts of the largest entry of any term there.
fn residual(scene: &mut Scene, u: &[f64], before: &[f64]) -> Result<f64, String> {
    let system = &scene.system;
    let n = u.len();
    let all = system.residual(u, &Form::AS_WRITTEN).map_err(|e| e.to_string())?.values;
    let mut sizes = vec![0.0f64; system.fields.len()];
    for term in 0..system.terms.len() {
        let mut own = vec![0.0; n];
        system.term_residual(term, u, &mut own).map_err(|e| e.to_string())?;
        for (field, size) in sizes.iter_mut().enumerate() {
            let range = system.range(field).unwrap_or(0..0);
            *size = own[range].iter().fold(*size, |m, v| m.max(v.abs()));
        }
    }
    let rounding = rounding(system, [u, before], &all)?;
    let mut worst = 0.0f64;
    for field in 0..sizes.len() {
        let size = (0..sizes.len()).filter(|k| meet(system, *k, field)).fold(0.0f64, |m, k| m.max(sizes[k]));
        let range = system.range(field).unwrap_or(0..0);
        let free = range.filter(|d| system.numbering.free[*d] != FIXED).map(|d| all[d].abs());
        let largest = free.fold(0.0f64, |m, r| if r.is_nan() { f64::INFINITY } else { m.max(r) });
        if largest > rounding {
            worst = worst.max(largest / size);
        }
    }
    Ok(worst)
}

/// True for one field twice, and for unknowns of one shape that a term tests together: bodies that meet.
fn meet(system: &System, a: usize, b: usize) -> bool {
    let of = |k: usize| &system.fields[k];
    let alike =
        of(a).kind == of(b).kind && of(a).kind == FieldKind::Unknown && of(a).n_components == of(b).n_components;
    let tests = |term: &AssembledTerm, k: usize| term.law.tests.iter().any(|slot| slot.field.index() == k);
    a == b || alike && system.terms.iter().any(|t| tests(t, a) && tests(t, b))
}

/// What rounding may leave: a part of what the forces change by where each unknown changes by the size of all, at the state or
/// at the one before, from which corrections led to it.
fn rounding(system: &System, of: [&[f64]; 2], at: &[f64]) -> Result<f64, String> {
    let [u, before] = of;
    let size = u.iter().chain(before).fold(0.0f64, |m, v| m.max(v.abs()));
    let mut random = Random(3);
    let beside: Vec<f64> = u.iter().map(|v| v + size * BESIDE * (random.below(2001) as f64 / 1000.0 - 1.0)).collect();
    let all = system.residual(&beside, &Form::AS_WRITTEN).map_err(|e| e.to_string())?.values;
    let change = all.iter().zip(at).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    Ok(ROUNDING * change / BESIDE)
}

/// How far prescribed values are from the state.
fn prescribed(scene: &mut Scene, step: &StepResult) -> Result<f64, String> {
    let mut u = step.state.clone();
    scene.prescribed.apply(step.window, &mut u).map_err(|_| "a prescribed value that is none")?;
    let system = &scene.system;
    let mut worst = 0.0f64;
    for field in 0..system.fields.len() {
        let Some(range) = system.range(field) else { continue };
        let size = u[range.clone()].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let apart = u[range.clone()].iter().zip(&step.state[range]).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        if apart > 0.0 {
            worst = worst.max(apart / size);
        }
    }
    Ok(worst)
}

fn measures(scene: &mut Scene, step: &StepResult, is_given: bool) -> f64 {
    let Scene { measures, computed, system, .. } = scene;
    // behind them stand the numbers that are made of them
    let are_there = measures.len() + computed.len() == step.measures.len();
    let mut worst = if are_there { 0.0f64 } else { f64::INFINITY };
    for (measure, (_, told)) in measures.iter_mut().zip(&step.measures) {
        let at = Measured::new(system, step.window, &step.state);
        // where time starts no equation was solved
        let found = measure.evaluate(&if is_given { at.where_time_starts() } else { at });
        if found.to_bits() != told.to_bits() {
            worst = worst.max((found - told).abs() / found.abs().max(told.abs()));
        }
    }
    worst
}
