//! Inputs of a compiled law for one load step: the step variable, its increment, the scalars of rates.

use wfl_compiler::{Prologue, run_prologue, types::UniformSlot};

pub(crate) use crate::rates::StepAt;

/// The uniforms of a prologue at a step.
#[must_use]
pub fn uniforms_at(prologue: &Prologue, step: impl Into<StepAt>) -> Vec<f64> {
    run_prologue(prologue, &step_slots(prologue, step.into()))
}

/// What a prologue is given at a step.
pub(crate) fn step_slots(prologue: &Prologue, step: StepAt) -> Vec<f64> {
    let slot = |slot: &UniformSlot| match slot {
        UniformSlot::Time => step.time,
        UniformSlot::TimeStep => step.increment,
        UniformSlot::Rate(factor) => step.factors.of(*factor),
    };
    prologue.slots.iter().map(slot).collect()
}
