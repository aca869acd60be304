//! Steps of a run that has ended, computed again from a mark: with the bits that they had.

use std::sync::Arc;

use wfl_problem::{Scene, Solving};

use super::{PassedStep, Quiet, Run, RunError, RunOptions, Session, Standing, StepResult, Trajectory};

impl Run {
    /// Leaves a mark behind a step of the scene, where one is due.
    pub(super) fn leave_mark(&mut self, scene: &Solving<'_>) {
        if self.stepper.trajectory.as_ref().is_some_and(Trajectory::wants_mark) {
            let (done, state, watched) = (self.steps.len(), self.state(scene), self.watched.clone());
            if let Some(kept) = &mut self.stepper.trajectory {
                kept.mark(done, state, watched);
            }
        }
    }
}

impl Trajectory {
    /// The steps between the marks before and behind step `n`, computed again, and the number of the first of them. `done` are
    /// the steps of the scene.
    ///
    /// # Errors
    /// As the run.
    pub fn computed_again(
        &self,
        scene: &Scene,
        done: &[StepResult],
        n: usize,
    ) -> Result<(usize, Vec<Arc<PassedStep>>), RunError> {
        let (part, told) = (self.part_of(n), self.options.as_deref());
        let options = told.map(|told| RunOptions { trajectory_bytes: None, out: None, resume: false, ..told.clone() });
        let (Some(options), Some(mark)) = (options, self.marks.iter().find(|mark| mark.first == part.start)) else {
            return Ok((part.start, Vec::new()));
        };
        let mut session = Session::new(scene, options)?;
        if let Some(at) = &mark.at {
            let (state, watched) = (**at).clone();
            let to = Standing::of(scene, session.options(), (done[..mark.done].to_vec(), state, watched));
            session.go_back(scene, &to, &mut Quiet)?;
        }
        while session.passed().is_some_and(|passed| passed.steps.len() < part.len()) {
            if session.step(scene, &mut Quiet)?.is_none() {
                break;
            }
        }
        Ok((part.start, session.passed().map_or_else(Vec::new, |passed| passed.steps.clone())))
    }
}
