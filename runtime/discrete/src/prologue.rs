//! Inputs of a compiled law for one load step: the step variable and its increment.

use wfl_compiler::{Prologue, run_prologue, types::UniformSlot};

/// The uniforms of a prologue at a step.
#[must_use]
pub fn uniforms_at(prologue: &Prologue, time: f64, increment: f64) -> Vec<f64> {
    run_prologue(prologue, &step_slots(prologue, time, increment))
}

/// What a prologue is given at a step.
pub(crate) fn step_slots(prologue: &Prologue, time: f64, increment: f64) -> Vec<f64> {
    let slot = |slot: &UniformSlot| match slot {
        UniformSlot::Time => time,
        UniformSlot::TimeStep => increment,
    };
    prologue.slots.iter().map(slot).collect()
}
