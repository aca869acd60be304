//! What the derivatives of a result need of a run: where each step began and ended.
//!
//! Kept on request alone. A step is its unknowns and the states that its equations read; data follow from the scene.
//! Parts of a step are steps of their own.

use super::{RunOptions, rates::StepTime};
use crate::{
    field::Field,
    newton::{StepHistory, Stop},
    rates::Rates,
    scene::Solving,
};
use wfl_compiler::types::FieldKind;

/// A run as a sequence of states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// All unknowns before the first step.
    pub start: Vec<f64>,
    /// Its steps.
    pub steps: Vec<PassedStep>,
}

/// A step, or a part of one, that has converged.
#[derive(Clone, Debug, PartialEq)]
pub struct PassedStep {
    /// The step variable at its end.
    pub time: f64,
    /// Its increment.
    pub increment: f64,
    /// All unknowns where its equations stand: at its end, for most schemes.
    pub u: Vec<f64>,
    /// All unknowns at its end, where its equations stand before it.
    pub end: Option<Vec<f64>>,
    /// By field its values as the equations read them: those of states at the start of the step; empty for other fields.
    pub states: Vec<Vec<f64>>,
    /// The rates of the step, with what was kept at its start; nothing in a scene without.
    pub rates: Option<Rates>,
    /// What it is.
    pub kind: Passed,
}

impl PassedStep {
    /// All unknowns at its end.
    #[must_use]
    pub fn at_end(&self) -> &[f64] {
        self.end.as_deref().unwrap_or(&self.u)
    }
}

/// What a step of a trajectory is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passed {
    /// The state where time starts: nothing was solved.
    Given,
    /// A part of a step, at whose end no measure is taken.
    Part,
    /// A step of the scene.
    Step,
    /// An explicit step of the scene: no equation was solved, and its laws stand in it with rates half a step before its end.
    Explicit,
}

impl Passed {
    /// What a step of the scene with this history is.
    pub(super) fn of(history: &StepHistory) -> Self {
        if history.stop == Some(Stop::Given) { Self::Given } else { Self::Step }
    }
}

impl Trajectory {
    /// A run before its first step, where the options ask for it.
    pub(super) fn begin(options: &RunOptions, u: &[f64]) -> Option<Self> {
        options.keep_trajectory.then(|| Self { start: u.to_vec(), steps: Vec::new() })
    }

    /// Adds a step that has converged at `u`, before its states are renewed.
    pub(super) fn add(&mut self, scene: &Solving<'_>, at: StepTime, u: &[f64], kind: Passed) {
        let of = |(k, field): (usize, &Field)| match field.kind {
            FieldKind::State => scene.system.data()[k].clone(),
            _ => Vec::new(),
        };
        let states = scene.system.fields.iter().enumerate().map(of).collect();
        let (u, rates) = (u.to_vec(), scene.system.rates().map(Rates::as_begun));
        self.steps.push(PassedStep { time: at.time, increment: at.increment, u, end: None, states, rates, kind });
    }

    /// The step that was added last ends at `u`, behind where its equations stand.
    pub(super) fn ended_at(&mut self, u: &[f64]) {
        if let Some(step) = self.steps.last_mut().filter(|step| step.kind != Passed::Given) {
            step.end = Some(u.to_vec());
        }
    }
}
