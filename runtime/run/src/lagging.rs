//! How far the unknowns lag behind the states of a step that the run chooses.
//!
//! A term may read a state as the step before has left it: creep strain, wear, an age. At the end of a step the unknowns then
//! belong to the state at its start, and no extrapolation shows it: of steps that double the line through the last two
//! solutions predicts the next one exactly. The terms are evaluated once more, with states on their way to those that the step
//! leaves, and the tangent says what all of that way would change of the unknowns. A return mapping gives the same forces behind
//! a part of its own update: it lags by nothing. Terms that read the increment, a rate or the past of an unknown make a step of
//! their own of the old states, and say nothing of the new ones.
//!
//! Promises: states and equations are left as they were.

use wfl_compiler::types::{InputSlot, UniformSlot};
use wfl_discrete::{
    assemble::AssembledTerm,
    system::{Branches, System, SystemError},
};
use wfl_newton::DEFAULT_TOLERANCE;
use wfl_problem::Solving;

use super::stepping::Stepper;

/// The part of their change over the step by which states are moved: half of the digits. A contact that wears by more than it is
/// compressed would open, and say nothing of how far the unknowns are behind.
const MOVED: f64 = 1.0 / 134_217_728.0;
/// Forces that change by less with the whole change of the states, in parts of the largest force of the terms that read them, change
/// by the rounding of a return mapping, which is `f64::EPSILON` over [`MOVED`] of what cancels in it: they are looked at again.
const NOTHING: f64 = 1e-6;
/// The same of forces that the whole change of the states changes by less than [`NOTHING`], so that no contact opens on the way: all of it
/// is tried, and what is rounded is a million times smaller than this part.
const NOTHING_AT_ALL: f64 = 1e-9;

/// By dof what the new states of a step that was solved at `u` would change of the unknowns; `None` where that is nothing or cannot be
/// found.
pub(super) fn lag(stepper: &mut Stepper, scene: &mut Solving<'_>, u: &[f64]) -> Option<Vec<f64>> {
    let terms = terms_that_lag(scene);
    if terms.is_empty() {
        return None;
    }
    let before = forces(scene.system, &terms, u).ok()?;
    let next = &stepper.next_states;
    let mut differs_behind = |part: f64| -> Option<(Vec<f64>, f64)> {
        let moved = |now: &[f64], next: &[f64]| now.iter().zip(next).map(|(a, b)| a + part * (b - a)).collect();
        let states = scene.scene.states.iter().zip(next);
        let changed: Vec<(usize, Vec<f64>)> =
            states.map(|(state, next)| (state.field, moved(&scene.system.data()[state.field], next))).collect();
        let behind = scene.system.with_data(&changed, |system| forces(system, &terms, u)).ok()?;
        let team = scene.system.team();
        let largest = |forces: &[f64]| team.largest(forces.iter().fold(0.0f64, |most, f| most.max(f.abs())));
        let differs: Vec<f64> = before.iter().zip(&behind).map(|(a, b)| (a - b) / part).collect();
        let share = largest(&differs) / largest(&before);
        Some((differs, share))
    };
    // a force that is no number has no size either; of no force nothing is a part
    let (mut differs, share) = differs_behind(MOVED)?;
    if share <= NOTHING || share.is_nan() {
        let (of_all, share) = differs_behind(1.0)?;
        if !(NOTHING_AT_ALL..=NOTHING).contains(&share) {
            return None;
        }
        differs = of_all;
    }
    solution(stepper, scene.system, u, differs)
}

/// What forces change of the unknowns at `u`, by dof.
fn solution(stepper: &mut Stepper, system: &System, u: &[f64], mut forces: Vec<f64>) -> Option<Vec<f64>> {
    let (solver, tangent) = (stepper.solver.as_mut()?, stepper.tangent.as_mut()?);
    // the one at hand may be of an iterate before, or of a run before
    system.tangent(u, Branches::AsWritten, tangent).ok()?;
    solver.update(system, tangent, true).ok()?;
    system.numbering.turn(&mut forces);
    let (mut rhs, mut found) = (Vec::new(), Vec::new());
    system.numbering.gather(&forces, &mut rhs);
    solver.solve(&rhs, &mut found, DEFAULT_TOLERANCE).ok()?;
    let mut changes = vec![0.0; u.len()];
    for (d, change) in system.numbering.free_dofs.iter().zip(&found) {
        changes[*d as usize] = *change;
    }
    Some(changes)
}

/// The terms that read states and nothing of the step.
fn terms_that_lag(scene: &Solving<'_>) -> Vec<usize> {
    let is_state = |field: usize| scene.scene.states.iter().any(|state| state.field == field);
    let reads_state = |term: &AssembledTerm| {
        let of = |slot: &InputSlot| match slot {
            InputSlot::Field(slot) | InputSlot::Previous(slot) => is_state(slot.field.index()),
            _ => false,
        };
        term.law.inputs.iter().any(of)
    };
    let reads_step = |term: &AssembledTerm| {
        let of_past = |slot: &InputSlot| match slot {
            InputSlot::Previous(slot) => !is_state(slot.field.index()),
            InputSlot::History(..) => true,
            _ => false,
        };
        term.law.inputs.iter().any(of_past) || term.law.prologue.slots.contains(&UniformSlot::TimeStep)
    };
    let terms = scene.system.terms.iter().enumerate();
    terms.filter(|(_, term)| reads_state(term) && !reads_step(term)).map(|(k, _)| k).collect()
}

/// By dof in the axes of the scene.
fn forces(system: &System, terms: &[usize], u: &[f64]) -> Result<Vec<f64>, SystemError> {
    let mut sum = vec![0.0; u.len()];
    terms.iter().try_for_each(|k| system.term_residual(*k, u, &mut sum))?;
    Ok(sum)
}
