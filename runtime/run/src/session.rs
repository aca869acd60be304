//! A run in the hands of its caller: one step at a time, to values of the step variable that the scene lists or the caller
//! chooses, or with the equations alone for a caller who solves them.
//!
//! Promises: the steps of a scene give the bits that [`super::run`] gives; after an error unknowns and memory are those
//! of the last step that was done. Writes no files.

use rayon::ThreadPool;
use wfl_discrete::{
    finite::BadOutput,
    system::{Branches, Form},
};
use wfl_newton::NewtonError;
use wfl_output::Hash;
use wfl_problem::{Equations, Scene};
use wfl_sparse::csr::Csr;

use super::{
    Outcome, Progress, Run, RunError, RunOptions, RunState, STACK, StepResult, Trajectory,
    by_caller::ByCaller,
    folder,
    requests::{self, StepRequest},
    watched::Watched,
};

/// A run between two steps. The scene is handed to every call: always the one that the session was made with.
pub struct Session {
    run: Run,
    equations: Equations,
    options: RunOptions,
    pool: Option<ThreadPool>,
    /// The step that [`Self::begin`] has prepared.
    begun: Option<ByCaller>,
    /// The equations stand at the step that was begun, or at the last one that was done.
    stands: bool,
}

/// Where a session has stood: [`Session::go_back`] returns there.
#[derive(Clone, Debug)]
pub struct Standing {
    /// What the run is: scene, parameters, files.
    of: Hash,
    steps: Vec<StepResult>,
    state: Box<RunState>,
    watched: Watched,
    bad: Vec<BadOutput>,
}

impl Standing {
    /// Where a run with these options stood behind some steps.
    pub(super) fn of(scene: &Scene, options: &RunOptions, at: (Vec<StepResult>, RunState, Watched)) -> Self {
        let (steps, state, watched) = at;
        let of = folder::identity(scene, options).hash();
        Self { of, steps, state: Box::new(state), watched, bad: Vec::new() }
    }

    /// The number of steps that were done.
    #[must_use]
    pub fn n_steps(&self) -> usize {
        self.steps.len()
    }

    /// All that the next step depends on beside the scene.
    #[must_use]
    pub fn state(&self) -> &RunState {
        &self.state
    }
}

impl Session {
    /// A run before its first step: the unknowns are those of `start`. Folder and files of the options are not used.
    ///
    /// # Errors
    /// [`RunError::Start`].
    pub fn new(scene: &Scene, options: RunOptions) -> Result<Self, RunError> {
        let mut equations = scene.equations();
        let run = Run::new(&mut scene.solving(&mut equations), &options, Hash::of(b""))?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads.max(1)).stack_size(STACK).build().ok();
        Ok(Self { run, equations, options, pool, begun: None, stands: false })
    }

    /// What the run was told.
    pub(super) fn options(&self) -> &RunOptions {
        &self.options
    }

    /// The steps that derivatives follow, where the options ask for them.
    pub(super) fn passed(&self) -> Option<&Trajectory> {
        self.run.stepper.trajectory.as_ref()
    }

    /// The steps that were done.
    #[must_use]
    pub fn steps(&self) -> &[StepResult] {
        &self.run.steps
    }

    /// All unknowns, prescribed ones included, field after field, node after node, component fastest: at the end of the last
    /// step, or where a step was begun those that [`Self::begin`] gave.
    #[must_use]
    pub fn unknowns(&self) -> &[f64] {
        self.begun.as_ref().map_or(&self.run.u, |begun| &begun.u)
    }

    /// The equations at the present step.
    #[must_use]
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// Sets the unknowns that the next step starts from; they count as the end of the last step. A step that was begun is left.
    ///
    /// # Panics
    /// If there are not as many numbers as unknowns.
    pub fn set_unknowns(&mut self, scene: &Scene, u: &[f64]) {
        self.leave(scene);
        self.run.u.copy_from_slice(u);
        if let Some(solver) = &mut self.run.stepper.solver {
            solver.starts_elsewhere();
        }
    }

    /// Leaves the step that was begun last: nothing of it is left.
    fn leave(&mut self, scene: &Scene) {
        let Self { run, equations, begun, stands, .. } = self;
        if let Some(begun) = begun.take() {
            begun.leave(&mut run.stepper, &mut scene.solving(equations), &mut run.u);
            *stands = false;
        }
    }

    /// The value of the step variable of the next step that the scene lists; of steps that the run chooses it is not
    /// known.
    #[must_use]
    pub fn next_value(&self, scene: &Scene) -> Option<f64> {
        self.run.next_request(scene).filter(|next| next.count.is_some()).map(|next| next.window.end)
    }

    /// Solves the next step that the scene lists. `None` where none is left, or after one that did not converge unless
    /// the scene goes on after such.
    ///
    /// # Errors
    /// [`RunError`]; a step that does not converge is no error.
    pub fn step(&mut self, scene: &Scene, progress: &mut dyn Progress) -> Result<Option<&StepResult>, RunError> {
        let failed = self.run.steps.last().is_some_and(|s| !s.history.converged());
        match self.run.next_request(scene) {
            Some(request) if !failed || scene.steps.go_on => self.solve(scene, request, progress).map(Some),
            _ => Ok(None),
        }
    }

    /// Solves a step to a value of the step variable that the caller chooses. The first step of a scene with rates is
    /// where time starts: its state is given.
    ///
    /// # Errors
    /// [`RunError`]; a step that does not converge is no error.
    pub fn step_to(&mut self, scene: &Scene, time: f64, progress: &mut dyn Progress) -> Result<&StepResult, RunError> {
        self.solve(scene, self.request(scene, time), progress)
    }

    /// The next step to a value of the step variable that the caller chooses.
    fn request(&self, scene: &Scene, time: f64) -> StepRequest {
        let (number, from) = (self.run.steps.len(), self.run.last_value());
        let window = requests::between(from, time, self.first_increment(scene, time));
        StepRequest { number, count: Some(number + 1), from, window, limit: f64::INFINITY }
    }

    fn solve(
        &mut self,
        scene: &Scene,
        request: StepRequest,
        progress: &mut dyn Progress,
    ) -> Result<&StepResult, RunError> {
        self.leave(scene);
        self.stands = false;
        let Self { run, equations, options, pool, stands, .. } = self;
        let solving = &mut scene.solving(equations);
        let step = on(pool.as_ref(), || run.step(solving, request, progress))?;
        *stands = true;
        progress.step_done(&step);
        run.add(step, solving, options);
        Ok(run.steps.last().expect("added above"))
    }

    /// The increment that the first step counts as: that of the scene, or for values that the caller chooses, of the first
    /// two that differ.
    fn first_increment(&self, scene: &Scene, time: f64) -> f64 {
        let steps = &self.run.steps;
        match (scene.steps.values.len() > 1, steps.first(), steps.get(1)) {
            (true, ..) | (false, None, _) => scene.steps.first_increment(),
            (false, Some(first), None) => time - first.window.end,
            (false, Some(first), Some(second)) => second.window.end - first.window.end,
        }
    }

    /// Begins a step for a caller who solves it: the unknowns become the past, known fields and laws are brought to the
    /// value of the step variable, and prescribed values are written into the unknowns, which are returned. At the first
    /// step of a scene with rates, where time starts, the unknowns stay as they are given. A step that was begun before and
    /// not accepted is left, so that a shorter one can be tried.
    ///
    /// # Errors
    /// [`RunError::Newton`] for a given value that is not finite, and for terms that cannot be assembled;
    /// [`RunError::NoEquations`] for explicit steps.
    pub fn begin(&mut self, scene: &Scene, time: f64) -> Result<&[f64], RunError> {
        if scene.explicit.is_some() {
            return Err(RunError::NoEquations);
        }
        self.leave(scene);
        self.stands = false;
        let request = self.request(scene, time);
        let Self { run, equations, pool, begun, stands, .. } = self;
        let solving = &mut scene.solving(equations);
        let begins = || ByCaller::begin(&mut run.stepper, solving, &mut run.u, request);
        let step = on(pool.as_ref(), begins);
        let step = step.map_err(|error| RunError::Newton { step: request.number, time, error })?;
        *stands = true;
        Ok(&begun.insert(step).u)
    }

    /// True between [`Self::begin`] and the end of that step.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// True if [`Self::residual`], [`Self::forces`] and [`Self::tangent`] are those of a step: the one that was begun, or the last one that was
    /// done. Behind a step that was left or came to nothing they are those of none.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.stands
    }

    /// The residual of the equations as they are written, by free dof, in the unit of forces; positive where the inner
    /// forces exceed the loads. [`Self::stands`] says whether there is a step.
    ///
    /// # Errors
    /// [`NewtonError::Term`] for a number that is not finite.
    ///
    /// # Panics
    /// If `u` has not as many numbers as there are unknowns.
    pub fn residual(&self, u: &[f64]) -> Result<Vec<f64>, NewtonError> {
        let system = &self.equations.system;
        let all = on(self.pool.as_ref(), || system.residual(u, &Form::AS_WRITTEN))?;
        let mut free = Vec::new();
        system.numbering.gather(&all.values, &mut free);
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
    pub fn forces(&self, u: &[f64]) -> Result<Vec<f64>, NewtonError> {
        let system = &self.equations.system;
        let mut all = on(self.pool.as_ref(), || system.residual(u, &Form::AS_WRITTEN))?.values;
        system.numbering.frames.turn_back(&mut all);
        Ok(all)
    }

    /// The derivative of [`Self::residual`] in the free unknowns, each kink on the branch that the residual has at `u`.
    ///
    /// # Errors
    /// [`NewtonError`] for a number that is not finite, or a matrix that does not fit.
    ///
    /// # Panics
    /// As [`Self::residual`].
    pub fn tangent(&self, u: &[f64]) -> Result<Csr, NewtonError> {
        let system = &self.equations.system;
        on(self.pool.as_ref(), || {
            let mut tangent = system.new_tangent();
            system.tangent(u, Branches::AsWritten, &mut tangent)?;
            Ok(system.whole_matrix(&tangent)?)
        })
    }

    /// Takes the state `u`, by dof, as the end of the step that was begun last: states are renewed, measures taken. After an
    /// error nothing of the step is left.
    ///
    /// # Errors
    /// [`RunError::State`] for the update of a state that is not finite; [`RunError::Newton`] for an `u` that is not.
    ///
    /// # Panics
    /// If no step was begun, or `u` has not as many numbers as there are unknowns.
    pub fn accept(&mut self, scene: &Scene, u: &[f64], progress: &mut dyn Progress) -> Result<&StepResult, RunError> {
        let mut begun = self.begun.take().expect("a step was begun");
        begun.u.copy_from_slice(u);
        self.stands = false;
        let Self { run, equations, options, pool, stands, .. } = self;
        let solving = &mut scene.solving(equations);
        let step = on(pool.as_ref(), || run.step_by(begun, solving, progress))?;
        *stands = true;
        progress.step_done(&step);
        run.add(step, solving, options);
        Ok(run.steps.last().expect("added above"))
    }

    /// Where the run stands: a value to go back to, as often as one likes. It holds a copy of the steps so far.
    ///
    /// # Errors
    /// [`RunError::Begun`] between [`Self::begin`] and [`Self::accept`]: there the unknowns are those of no step.
    pub fn standing(&mut self, scene: &Scene) -> Result<Standing, RunError> {
        if self.begun.is_some() {
            return Err(RunError::Begun);
        }
        let run = &self.run;
        let state = run.state(&scene.solving(&mut self.equations));
        let (of, steps) = (folder::identity(scene, &self.options).hash(), run.steps.clone());
        Ok(Standing { of, steps, state: Box::new(state), watched: run.watched.clone(), bad: run.bad.clone() })
    }

    /// Goes back to where a run of this scene has stood: its steps are those from then on, and the next one has the bits
    /// that it had from there. After an error the run stands where it stood before.
    ///
    /// # Errors
    /// [`RunError::Newton`] where terms cannot be assembled, [`RunError::Start`] for a first value that is not finite,
    /// [`RunError::NotOfThisScene`] for a state of another scene.
    pub fn go_back(&mut self, scene: &Scene, to: &Standing, progress: &mut dyn Progress) -> Result<(), RunError> {
        if to.of != folder::identity(scene, &self.options).hash() {
            return Err(RunError::NotOfThisScene);
        }
        let mut equations = scene.equations();
        let solving = &mut scene.solving(&mut equations);
        let mut run = Run::new(solving, &self.options, Hash::of(b""))?;
        let (n, state) = (to.steps.len(), (*to.state).clone());
        let fits = match to.steps.last() {
            Some(last) => {
                let window = last.window;
                let fits = on(self.pool.as_ref(), || run.set_state(solving, state, window, progress));
                fits.map_err(|error| RunError::Newton { step: n - 1, time: window.end, error })?
            }
            // nothing was done yet: what the caller may have set are the unknowns
            None => {
                let fits = run.u.len() == state.u.len();
                run.u = state.u;
                fits
            }
        };
        if !fits {
            return Err(RunError::NotOfThisScene);
        }
        (run.steps, run.watched, run.bad) = (to.steps.clone(), to.watched.clone(), to.bad.clone());
        run.clock = self.run.clock;
        run.kept = std::mem::take(&mut self.run.kept);
        run.kept.retain(|kept| kept.number < n);
        (self.run, self.equations, self.begun, self.stands) = (run, equations, None, n > 0);
        Ok(())
    }

    /// Ends the run.
    #[must_use]
    pub fn outcome(mut self, scene: &Scene) -> Outcome {
        self.run.outcome(&scene.solving(&mut self.equations), &self.options, None)
    }
}

/// Work in a pool, where there is one.
fn on<T: Send>(pool: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}
