//! What is told while a run goes on.
//!
//! Promises: a listener may be empty in every part. Does not change a run, but for asking it to stop.

use wfl_compiler::ir::Origin;
use wfl_newton::{Iteration, Watch};

use super::StepResult;

/// Events of a run.
pub trait Progress: Send {
    /// The solver has been chosen.
    fn solver(&mut self, _description: &str) {}
    /// Where the run continues: after the steps of a checkpoint (the last one given), or at the beginning without one.
    fn resumed(&mut self, _last: Option<&StepResult>) {}
    /// A step begins: its number from 0, how many there are, the step variable at its end. Of steps that the run chooses
    /// their number and end are not known: the step variable is that of its beginning.
    fn step(&mut self, _number: usize, _count: Option<usize>, _time: f64) {}
    /// After each iteration.
    fn iteration(&mut self, _iteration: &Iteration) {}
    /// A `Print` of a term: its name, where it is written, and its value at one of the points.
    fn printed(&mut self, _term: &str, _origin: Option<Origin>, _position: [f64; 3], _value: &[f64]) {}
    /// A step has ended.
    fn step_done(&mut self, _step: &StepResult) {}
    /// True if the run is to end before its next iteration, with
    /// [`NewtonError::Stopped`](wfl_newton::NewtonError::Stopped).
    fn stops(&mut self) -> bool {
        false
    }
}

/// Tells nothing.
pub struct Quiet;

impl Progress for Quiet {}

/// Tells the iterations of an attempt.
pub(super) struct Forward<'p> {
    pub(super) progress: &'p mut dyn Progress,
}

impl Watch for Forward<'_> {
    fn iteration(&mut self, iteration: &Iteration) {
        self.progress.iteration(iteration);
    }

    fn stops(&mut self) -> bool {
        self.progress.stops()
    }
}
