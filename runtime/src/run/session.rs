//! A run in the hands of its caller: one step at a time, to values of the step variable that the scene lists or the caller
//! chooses, or with the equations alone for a caller who solves them.
//!
//! Promises: the steps of a scene give the bits that [`super::run`] gives; after an error unknowns and memory are those
//! of the last step that was done. Writes no files.

use rayon::ThreadPool;

use super::{
    Asked, Outcome, Progress, Run, RunError, RunOptions, STACK, StepError, StepResult,
    rates::{self, StepTime},
    stepping::{self, Leg},
};
use crate::{
    csr::Csr,
    newton::{NewtonError, StepHistory},
    output::Hash,
    scene::Scene,
    system::{Branches, Form},
};

/// A run between two steps. The scene is handed to every call: always the one that the session was made with.
pub struct Session {
    run: Run,
    options: RunOptions,
    pool: Option<ThreadPool>,
    /// The step that [`Self::begin`] has prepared: the step variable and its increment.
    begun: Option<(f64, f64)>,
}

impl Session {
    /// A run before its first step: the unknowns are those of `start`. Folder and files of the options are not used.
    ///
    /// # Errors
    /// [`RunError::Start`].
    pub fn new(scene: &mut Scene, options: RunOptions) -> Result<Self, RunError> {
        let run = Run::new(scene, &options, Hash::of(b""))?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads.max(1)).stack_size(STACK).build().ok();
        Ok(Self { run, options, pool, begun: None })
    }

    /// The steps that were done.
    #[must_use]
    pub fn steps(&self) -> &[StepResult] {
        &self.run.steps
    }

    /// All unknowns, prescribed ones included, field after field, node after node, component fastest.
    #[must_use]
    pub fn unknowns(&self) -> &[f64] {
        &self.run.u
    }

    /// Sets the unknowns that the next step starts from; they count as the end of the last step.
    ///
    /// # Panics
    /// If there are not as many numbers as unknowns.
    pub fn set_unknowns(&mut self, u: &[f64]) {
        self.run.u.copy_from_slice(u);
        if let Some(solver) = &mut self.run.stepper.solver {
            solver.starts_elsewhere();
        }
    }

    /// The value of the step variable of the next step that the scene lists; of steps that the run chooses it is not
    /// known.
    #[must_use]
    pub fn next_value(&self, scene: &Scene) -> Option<f64> {
        self.run.next_asked(scene).filter(|asked| asked.count.is_some()).map(|asked| asked.leg.to)
    }

    /// Solves the next step that the scene lists. `None` where none is left, or after one that did not converge unless
    /// the scene goes on after such.
    ///
    /// # Errors
    /// [`RunError`]; a step that does not converge is no error.
    pub fn step(&mut self, scene: &mut Scene, progress: &mut dyn Progress) -> Result<Option<&StepResult>, RunError> {
        let failed = self.run.steps.last().is_some_and(|s| !s.history.converged());
        match self.run.next_asked(scene) {
            Some(asked) if !failed || scene.steps.go_on => self.solve(scene, asked, progress).map(Some),
            _ => Ok(None),
        }
    }

    /// Solves a step to a value of the step variable that the caller chooses. The first step of a scene with rates is
    /// where time starts: its state is given.
    ///
    /// # Errors
    /// [`RunError`]; a step that does not converge is no error.
    pub fn step_to(
        &mut self,
        scene: &mut Scene,
        time: f64,
        progress: &mut dyn Progress,
    ) -> Result<&StepResult, RunError> {
        let number = self.run.steps.len();
        let leg = Leg { from: self.last_value(), to: time, first_increment: self.first_increment(scene, time) };
        self.solve(scene, Asked { number, count: Some(number + 1), leg }, progress)
    }

    fn solve(&mut self, scene: &mut Scene, asked: Asked, progress: &mut dyn Progress) -> Result<&StepResult, RunError> {
        self.begun = None;
        let Self { run, options, pool, .. } = self;
        let step = on(pool.as_ref(), || run.step(scene, asked, progress))?;
        progress.step_done(&step);
        run.add(step, scene, options);
        Ok(run.steps.last().expect("added above"))
    }

    /// The value of the step variable of the last step.
    fn last_value(&self) -> Option<f64> {
        self.run.steps.last().map(|s| s.time)
    }

    /// The increment that the first step counts as: that of the scene, or for values that the caller chooses, of the first
    /// two that differ.
    fn first_increment(&self, scene: &Scene, time: f64) -> f64 {
        let steps = &self.run.steps;
        match (scene.steps.values.len() > 1, steps.first(), steps.get(1)) {
            (true, ..) | (false, None, _) => scene.steps.first_increment(),
            (false, Some(first), None) => time - first.time,
            (false, Some(first), Some(second)) => second.time - first.time,
        }
    }

    /// Begins a step for a caller who solves it: the unknowns become the past, known fields and laws are brought to the
    /// value of the step variable, and prescribed values are written into the unknowns, which are returned. At the first
    /// step of a scene with rates, where time starts, the unknowns stay as they are given.
    ///
    /// # Errors
    /// [`RunError::Newton`] for a given value that is not finite, and for terms that cannot be assembled;
    /// [`RunError::NoEquations`] for explicit steps.
    pub fn begin(&mut self, scene: &mut Scene, time: f64) -> Result<&[f64], RunError> {
        if scene.explicit.is_some() {
            return Err(RunError::NoEquations);
        }
        let leg = Leg { from: self.last_value(), to: time, first_increment: self.first_increment(scene, time) };
        let increment = leg.from.map_or(leg.first_increment, |from| leg.increment(from));
        let number = self.run.steps.len();
        let given = number == 0 && scene.steps.from_start;
        let Self { run, pool, .. } = self;
        let begun = on(pool.as_ref(), || {
            stepping::begin(scene, leg, &run.u)?;
            let at = StepTime { time, increment };
            if given {
                rates::start(scene, &run.u, at)?;
            }
            let stands = if given { at } else { rates::enter(scene, at) };
            super::set_data(scene, stands.time, increment)?;
            let changed = scene.system.begin_step(stands.time, increment)?;
            scene.contact.begin_step(scene.system.known.step(stands.time, increment));
            if changed {
                // a factor of the matrix before serves no step that is solved later
                run.stepper.solver = None;
            }
            if given {
                return Ok(());
            }
            let bad = |bad| NewtonError::Given(Box::new(bad));
            rates::prescribe(scene, at, &mut run.u).map_err(bad)
        });
        begun.map_err(|error| RunError::Newton { step: number, time, error })?;
        self.begun = Some((time, increment));
        Ok(&self.run.u)
    }

    /// True between [`Self::begin`] and the end of that step.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// The residual of the equations as they are written, by free dof, in the unit of forces; positive where the inner
    /// forces exceed the loads. [`Self::begin`] says at which step.
    ///
    /// # Errors
    /// [`NewtonError::Term`] for a number that is not finite.
    ///
    /// # Panics
    /// If `u` has not as many numbers as there are unknowns.
    pub fn residual(&self, scene: &Scene, u: &[f64]) -> Result<Vec<f64>, NewtonError> {
        let all = on(self.pool.as_ref(), || scene.system.residual(u, &Form::AS_WRITTEN))?;
        let mut free = Vec::new();
        scene.system.numbering.gather(&all.values, &mut free);
        Ok(free)
    }

    /// The residual by dof in the axes of the scene, prescribed dofs included: there it is the reaction, the force that
    /// the support exerts. Of dofs that follow others the sum stands at their leaders.
    ///
    /// # Errors
    /// As [`Self::residual`].
    ///
    /// # Panics
    /// As [`Self::residual`].
    pub fn forces(&self, scene: &Scene, u: &[f64]) -> Result<Vec<f64>, NewtonError> {
        let mut all = on(self.pool.as_ref(), || scene.system.residual(u, &Form::AS_WRITTEN))?.values;
        scene.system.numbering.frames.turn_back(&mut all);
        Ok(all)
    }

    /// The derivative of [`Self::residual`] in the free unknowns, each kink on the branch that the residual has at `u`.
    ///
    /// # Errors
    /// [`NewtonError`] for a number that is not finite, or a matrix that does not fit.
    ///
    /// # Panics
    /// As [`Self::residual`].
    pub fn tangent(&self, scene: &Scene, u: &[f64]) -> Result<Csr, NewtonError> {
        let system = &scene.system;
        on(self.pool.as_ref(), || {
            let mut tangent = system.new_tangent();
            system.tangent(u, Branches::AsWritten, &mut tangent)?;
            let sum = system.bulk().plus(&tangent.changing).map_err(crate::system::SystemError::from)?;
            Ok(sum)
        })
    }

    /// Takes the state `u`, by dof, as the end of the step that was begun last: states are renewed, measures taken.
    ///
    /// # Errors
    /// [`RunError::State`] for the update of a state that is not finite; [`RunError::Newton`] for an `u` that is not.
    ///
    /// # Panics
    /// If no step was begun, or `u` has not as many numbers as there are unknowns.
    pub fn accept(
        &mut self,
        scene: &mut Scene,
        u: &[f64],
        progress: &mut dyn Progress,
    ) -> Result<&StepResult, RunError> {
        let (time, increment) = self.begun.take().expect("a step was begun");
        let number = self.run.steps.len();
        let Self { run, options, pool, .. } = self;
        let finite = scene.system.check_finite("value", u, u);
        finite.map_err(|error| RunError::Newton { step: number, time, error: error.into() })?;
        run.u.copy_from_slice(u);
        let step = on(pool.as_ref(), || {
            let next = run.stepper.keep_states(scene, StepTime { time, increment }, &run.u);
            next.map_err(|error| match error {
                StepError::Newton(error) => RunError::Newton { step: number, time, error },
                StepError::State { state, value, position } => {
                    RunError::State { step: number, time, state, value, position }
                }
            })?;
            // the active set is that of another state: a step that is solved next chooses its own
            scene.contact.set_warm(false);
            let (history, branches) = (StepHistory::given(), run.branches(scene));
            let step = StepResult { time, increment, history, branches, ..StepResult::default() };
            run.ended(scene, step, progress)
        })?;
        progress.step_done(&step);
        run.add(step, scene, options);
        Ok(run.steps.last().expect("added above"))
    }

    /// Ends the run.
    #[must_use]
    pub fn outcome(self, scene: &Scene) -> Outcome {
        self.run.outcome(scene, &self.options, None)
    }
}

/// Work in a pool, where there is one.
fn on<T: Send>(pool: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}
