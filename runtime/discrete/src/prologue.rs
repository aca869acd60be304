//! Inputs of a compiled law for one step: the step variable, its increment, the scalars of rates.

use wfl_compiler::{Prologue, run_prologue, types::UniformSlot};

use crate::window::Window;

/// The uniforms of a prologue at a step.
#[must_use]
pub fn uniforms_at(prologue: &Prologue, window: Window) -> Vec<f64> {
    run_prologue(prologue, &step_slots(prologue, window))
}

/// What a prologue is given at a step.
pub(crate) fn step_slots(prologue: &Prologue, window: Window) -> Vec<f64> {
    let slot = |slot: &UniformSlot| match slot {
        UniformSlot::Time => window.stage,
        UniformSlot::TimeStep => window.increment,
        UniformSlot::Rate(factor) => window.rates.of(*factor),
    };
    prologue.slots.iter().map(slot).collect()
}
