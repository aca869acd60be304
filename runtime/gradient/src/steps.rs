//! The steps of a run, those that it has left out computed again.

use std::{
    cell::{Cell, RefCell},
    sync::Arc,
};

use wfl::Diagnostic;
use wfl_run::{PassedStep, Trajectory};

use super::{Differentiated, refused::not_made};

/// Parts of a run that stay in memory once they are computed again: a step reads the one before it, and its states behind it
/// are those of the next one.
const PARTS: usize = 2;

/// The number of the first step of a part, and its steps.
type Part = (usize, Vec<Arc<PassedStep>>);

/// The steps of a run.
pub(super) struct Steps<'a> {
    of: Differentiated<'a>,
    trajectory: &'a Trajectory,
    parts: RefCell<Vec<Part>>,
    again: Cell<usize>,
}

impl<'a> Steps<'a> {
    pub(super) fn new(of: Differentiated<'a>, trajectory: &'a Trajectory) -> Self {
        Self { of, trajectory, parts: RefCell::default(), again: Cell::default() }
    }

    /// How many were computed again.
    pub(super) fn again(&self) -> usize {
        self.again.get()
    }

    /// A step with all that is kept of it.
    pub(super) fn step(&self, n: usize) -> Result<Arc<PassedStep>, Box<Diagnostic>> {
        let own = &self.trajectory.steps[n];
        if !own.is_left_out {
            return Ok(Arc::clone(own));
        }
        if let Some(step) = self.known(n) {
            return Ok(step);
        }
        let made = self.trajectory.computed_again(self.of.scene, &self.of.outcome.steps, n);
        let part = made.map_err(|e| not_made(&format!("steps are computed again: {e}")))?;
        self.again.set(self.again.get() + part.1.len());
        let mut parts = self.parts.borrow_mut();
        if parts.len() == PARTS {
            parts.remove(0);
        }
        parts.push(part);
        drop(parts);
        let same =
            |step: &Arc<PassedStep>| step.window.end.to_bits() == own.window.end.to_bits() && step.kind == own.kind;
        self.known(n).filter(same).ok_or_else(|| not_made("steps that were computed again are not those of the run"))
    }

    fn known(&self, n: usize) -> Option<Arc<PassedStep>> {
        let parts = self.parts.borrow();
        parts.iter().find_map(|(first, steps)| steps.get(n.checked_sub(*first)?).cloned())
    }
}
