//! What the derivatives of a result need of a run: where each step began and ended.
//!
//! Kept on request alone. A step is its unknowns and the states that its equations read; data follow from the scene.
//! Parts of a step are steps of their own.
//!
//! Where a bound is given for what is kept ([`RunOptions::trajectory_bytes`]), a run leaves marks, each with all that it goes on
//! from with the same bits, an eighth of the bound apart; beyond the bound its first steps are left out, and are computed again
//! from their mark when they are asked for, two parts at a time. A quarter of the bound is for the last steps, one for those that are
//! computed again, and half for marks. A mark has the values of a tangent and is as large
//! as some hundred steps: where marks take their half every second one goes. One computation of a step more is what that
//! costs; schedules with less memory compute steps several times.

use std::{ops::Range, sync::Arc};

use wfl_compiler::types::FieldKind;
use wfl_discrete::{field::Field, rates::Rates, window::Window};
use wfl_newton::{StepHistory, Stop};
use wfl_problem::Solving;

use super::{RunOptions, RunState, watched::Watched};

/// A run as a sequence of states.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    /// All unknowns before the first step.
    pub start: Vec<f64>,
    /// Its steps. Of those that are left out ([`PassedStep::is_left_out`]) times and kinds are known alone.
    pub steps: Vec<Arc<PassedStep>>,
    /// What the run was told, where steps may be left out.
    pub(super) options: Option<Box<RunOptions>>,
    /// Where steps are computed again from, the first one before all steps.
    pub(super) marks: Vec<Mark>,
    /// Bytes of the steps in memory, and of those behind the last mark.
    held: u64,
    behind: u64,
    /// The first step that is in memory.
    first: usize,
}

/// Where a run goes on from with the same bits.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    /// The first step of the trajectory behind it.
    pub(super) first: usize,
    /// The steps of the scene before it.
    pub(super) done: usize,
    /// Nothing before the first step.
    pub(super) at: Option<Arc<(RunState, Watched)>>,
    bytes: u64,
}

/// A step, or a part of one, that has converged.
#[derive(Clone, Debug, PartialEq)]
pub struct PassedStep {
    /// When, with the stage at its end.
    pub window: Window,
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
    /// The order of backward differentiation that it was taken with, in a scene with rates.
    pub order: Option<usize>,
    /// Unknowns, states and rates were left out to keep to a bound of memory.
    pub is_left_out: bool,
}

impl PassedStep {
    /// What its numbers take in memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let of_rates = |r: &Rates| r.fields().iter().flat_map(|of| &of.kept).map(Vec::len).sum::<usize>();
        let states: usize = self.states.iter().map(Vec::len).sum();
        let numbers = self.u.len() + self.end.as_ref().map_or(0, Vec::len) + states;
        8 * (numbers + self.rates.as_ref().map_or(0, of_rates)) as u64
    }

    /// The step without its numbers.
    fn left_out(&self) -> Self {
        let (u, states) = (Vec::new(), Vec::new());
        Self { u, end: None, states, rates: None, is_left_out: true, ..*self }
    }

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
        let told =
            options.trajectory_bytes.map(|_| Box::new(RunOptions { keep_outputs: Vec::new(), ..options.clone() }));
        let mark = Mark { first: 0, done: 0, at: None, bytes: 0 };
        let marks = told.iter().map(|_| mark.clone()).collect();
        let made = || Self { start: u.to_vec(), options: told, marks, ..Self::default() };
        options.keep_trajectory.then(made)
    }

    fn bound(&self) -> Option<u64> {
        self.options.as_ref().and_then(|told| told.trajectory_bytes)
    }

    /// Whether a mark is due behind a step of the scene.
    pub(super) fn wants_mark(&self) -> bool {
        self.bound().is_some_and(|bound| self.behind >= bound / 8)
    }

    /// Sets a mark behind `done` steps of the scene, and leaves out what is beyond the bound.
    pub(super) fn mark(&mut self, done: usize, state: RunState, watched: Watched) {
        let (first, bytes) = (self.steps.len(), state.bytes());
        self.marks.push(Mark { first, done, at: Some(Arc::new((state, watched))), bytes });
        self.behind = 0;
        let Some(bound) = self.bound() else { return };
        while self.held > bound / 8 && self.leave_out(first) {}
        while self.marks.len() > 2 && self.of_marks() > bound / 2 {
            let mut number = 0;
            // the first one is before all steps, and the last one is that which steps are counted from
            let last = self.marks.len() - 1;
            self.marks.retain(|_| {
                number += 1;
                number % 2 == 1 || number > last
            });
        }
    }

    fn of_marks(&self) -> u64 {
        self.marks.iter().map(|mark| mark.bytes).sum()
    }

    /// Leaves out the first steps that are in memory, up to the next mark; false if there are none before `end`.
    fn leave_out(&mut self, end: usize) -> bool {
        let part = self.part_of(self.first);
        if part.end >= end {
            return false;
        }
        for step in &mut self.steps[self.first..part.end] {
            self.held -= step.bytes();
            *step = Arc::new(step.left_out());
        }
        self.first = part.end;
        true
    }

    /// The steps between the marks before and behind a step.
    pub(super) fn part_of(&self, step: usize) -> Range<usize> {
        let next = self.marks.partition_point(|mark| mark.first <= step);
        let begin = next.checked_sub(1).map_or(0, |k| self.marks[k].first);
        begin..self.marks.get(next).map_or(self.steps.len(), |mark| mark.first)
    }

    /// Adds a step that has converged at `u`, before its states are renewed.
    pub(super) fn add(&mut self, scene: &Solving<'_>, window: Window, u: &[f64], kind: Passed) {
        let of = |(k, field): (usize, &Field)| match field.kind {
            FieldKind::State => scene.system.data()[k].clone(),
            _ => Vec::new(),
        };
        let states = scene.system.fields.iter().enumerate().map(of).collect();
        let (u, rates) = (u.to_vec(), scene.system.rates().map(Rates::as_begun));
        let (order, is_left_out) = (rates.as_ref().map(Rates::taken_order), false);
        let step = PassedStep { window, u, end: None, states, rates, kind, order, is_left_out };
        self.held += step.bytes();
        self.behind += step.bytes();
        self.steps.push(Arc::new(step));
    }

    /// The step that was added last ends at `u`, behind where its equations stand.
    pub(super) fn ended_at(&mut self, u: &[f64]) {
        if let Some(step) = self.steps.last_mut().and_then(Arc::get_mut).filter(|step| step.kind != Passed::Given) {
            step.end = Some(u.to_vec());
            let more = 8 * u.len() as u64;
            self.held += more;
            self.behind += more;
        }
    }
}
