//! A run that has ended, as the checks of its end see it.

use wfl_newton::Stop;
use wfl_problem::Solving;

use super::{Run, StepResult};

/// A run that has ended, for those who look at it.
#[derive(Clone, Copy)]
pub(super) struct Ended<'a> {
    pub(super) scene: &'a Solving<'a>,
    pub(super) run: &'a Run,
    /// It came to the end of its steps.
    pub(super) is_done: bool,
}

impl Ended<'_> {
    /// Whether every step that was solved was looked at: none was given, or done by another process.
    pub(super) fn has_seen_all(&self) -> bool {
        let solved = |s: &&StepResult| s.history.converged() && s.history.stop != Some(Stop::Given);
        self.run.watched.n() == self.run.steps.iter().filter(solved).count() && self.run.watched.n() > 0
    }
}
