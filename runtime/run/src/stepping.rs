//! What all ways of making a step share: what they have in common between steps, and one attempt to solve a part of a step.
//!
//! Promises: an attempt changes nothing but what a `Snapshot` holds. Does not write anything and does
//! not decide whether a run continues.

use std::time::Instant;

use thiserror::Error;
use wfl_checks::{Response, explained};
use wfl_discrete::{
    assemble::BranchCounts,
    rates::Rates,
    system::{LinearTerms, Residual, Tangent},
    window::Window,
};
use wfl_linear::LinearSolver;
use wfl_newton::{LoadStep, NewtonError, NewtonOptions, Rounding, Spent, StepHistory, solve_step};
use wfl_problem::{Scene, Solving};
use wfl_sparse::solve::SolverOptions;

use crate::{
    Attempt, Clock, Progress, balance::Balance, friction::Friction, memory::Memory, progress::Forward, rates,
    requests::StepRequest, trajectory::Trajectory,
};

/// Why a part of a step has no result.
#[derive(Debug, Error)]
pub(super) enum StepError {
    /// It could not be solved.
    #[error(transparent)]
    Newton(#[from] NewtonError),
    /// The update of a state gave a number that is not finite.
    #[error("the update of `{state}` gives {value} at {position:?}")]
    State {
        /// The state.
        state: String,
        /// What it became.
        value: f64,
        /// Where.
        position: [f64; 3],
    },
}

/// How a step ended.
pub(super) struct Reached {
    /// The attempt that reached the end, or of those that failed the one at the whole step.
    pub(super) history: StepHistory,
    /// Its last part, to the end that it has reached.
    pub(super) window: Window,
    /// Every attempt.
    pub(super) attempts: Vec<Attempt>,
    /// By term the branches at its end, where they are at hand although nothing was solved.
    pub(super) branches: Option<Vec<BranchCounts>>,
}

impl Reached {
    /// A step to the end of a window for which nothing was solved.
    pub(super) fn unsolved(window: Window) -> Self {
        Self { history: StepHistory::given(), window, attempts: Vec::new(), branches: None }
    }
}

/// What a step is made with and of.
pub(super) struct Making<'a, 's> {
    pub(super) stepper: &'a mut Stepper,
    pub(super) scene: &'a mut Solving<'s>,
    /// By dof the unknowns: at the end of the step before, and then at that of the step.
    pub(super) u: &'a mut [f64],
    pub(super) clock: &'a mut Clock,
    pub(super) progress: &'a mut dyn Progress,
}

/// A way from the end of a step to the end of the next one.
pub(super) trait Integrator {
    /// Makes the step that is requested, or where the run chooses as much of it as is right; the equations have its start as
    /// their past. After an error unknowns and memory are those before.
    fn advance(&mut self, making: Making<'_, '_>, request: StepRequest) -> Result<Reached, StepError>;
}

/// What a load path starts from.
pub(super) struct LoadStart {
    pub(super) u: Vec<f64>,
    pub(super) residual: Vec<f64>,
}

/// The target of one attempt.
pub(super) struct Target<'a> {
    /// The step, or the part of it, that is tried.
    pub(super) window: Window,
    /// What a load path starts from, and which part of the load acts.
    pub(super) load: Option<(&'a LoadStart, f64)>,
    /// Iterations after which it ends, where the scene allows more.
    pub(super) iterations: usize,
    /// An error of the linear solver gets its reason: that takes longer than another attempt.
    pub(super) explains: bool,
}

/// What the ways of making a step share: solver, tangent, and what is summed over the steps.
pub(super) struct Stepper {
    pub(super) solver: Option<LinearSolver>,
    /// What rounding of linear equations makes of the unknowns, for the matrix of the last step.
    pub(super) response: Option<Response>,
    /// The tangent that was assembled last.
    pub(super) tangent: Option<Tangent>,
    /// The residual at the state that the last attempt reached, if it is at hand.
    pub(super) residual: Option<Residual>,
    /// How linear terms were evaluated at the end of the last part.
    pub(super) linear: LinearTerms,
    solver_options: SolverOptions,
    /// What the last attempt cost.
    pub(super) spent: Spent,
    /// The states after the last part that converged, not taken over yet.
    pub(super) next_states: Vec<Vec<f64>>,
    /// The balance of energy of a scene that asks for it.
    pub(super) balance: Option<Balance>,
    /// What is kept of friction, where that is asked for.
    pub(super) friction: Option<Friction>,
    /// The steps so far, where somebody wants them.
    pub(super) trajectory: Option<Trajectory>,
}

impl Stepper {
    pub(super) fn new(solver_options: SolverOptions) -> Self {
        Self {
            solver: None,
            response: None,
            tangent: None,
            residual: None,
            linear: LinearTerms::ByMatrix,
            solver_options,
            spent: Spent::default(),
            next_states: Vec::new(),
            balance: None,
            friction: None,
            trajectory: None,
        }
    }

    /// What later steps depend on beside the unknowns.
    pub(super) fn memory(&self, scene: &Solving<'_>) -> Memory {
        match &self.tangent {
            Some(tangent) => Memory::of(scene, tangent),
            None => Memory::without_tangent(scene),
        }
    }

    /// The same of all ranks, made by all together.
    pub(super) fn memory_of_all(&self, scene: &Solving<'_>) -> Memory {
        match &self.tangent {
            Some(tangent) => Memory::of_all(scene, tangent),
            None => Memory::without_tangent(scene),
        }
    }

    /// Goes back to what a checkpoint kept; false if that belongs to another scene.
    pub(super) fn recall_of_all(&mut self, scene: &mut Solving<'_>, memory: &Memory) -> bool {
        if scene.explicit.is_some() {
            return memory.recall_without_tangent(scene);
        }
        let tangent = self.tangent.get_or_insert_with(|| scene.system.new_tangent());
        memory.recall_of_all(scene, tangent)
    }

    /// Tries to solve a part of a step; `u` holds the state before it, or a first guess, and then what was found.
    pub(super) fn attempt(
        &mut self,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        target: &Target<'_>,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<StepHistory, StepError> {
        self.spent = Spent::default();
        let window = rates::enter(scene, target.window);
        let before = u.to_vec();
        // before what is constant in the step is summed: it reads the rates of what is driven
        let prescribed = rates::prescribe(scene, window, u);
        prescribed.map_err(|bad| NewtonError::Given(Box::new(bad)))?;
        self.prepare(scene, window, clock, progress)?;
        let mut offset = Vec::new();
        if let Some((start, s)) = target.load {
            scene.system.numbering.part_of_prescribed(&start.u, s, u);
            offset.extend(start.residual.iter().map(|r| (s - 1.0) * r));
        }
        scene.system.start_from_predictor(u);
        let begin = Instant::now();
        let mut watch = Forward { progress };
        let carries = scene.system.rates().is_some_and(Rates::carries_rounding);
        let (newton, solves_once) = (scene.newton, scene.steps.auto.is_some() && target.load.is_none());
        let mut step = LoadStep {
            system: scene.system,
            contact: scene.contact,
            solver: self.solver.as_mut().expect("prepared above"),
            tangent: self.tangent.as_mut().expect("prepared above"),
            offset: &offset,
            linear: LinearTerms::ByMatrix,
            options: NewtonOptions { max_iterations: newton.max_iterations.min(target.iterations), ..newton },
            solves_once,
            watch: &mut watch,
            spent: Spent::default(),
            rounding: carries.then(Rounding::default),
            reached: None,
        };
        let result = solve_step(&mut step, &before, u);
        (self.linear, self.spent) = (step.linear, step.spent);
        // a state with rates is moved once more below
        self.residual = step.reached.take().filter(|_| target.load.is_none() && scene.system.rates().is_none());
        let rounding = step.rounding;
        clock.factor += self.spent.factor;
        clock.solve += self.spent.solve;
        clock.assemble += begin.elapsed().as_secs_f64() - self.spent.factor - self.spent.solve;
        let history = result.map_err(|error| if target.explains { self.explained(scene, error, u) } else { error })?;
        // a state that is written, measured or continued is finite
        scene.system.check_finite("value", u, u).map_err(NewtonError::from)?;
        if let (Some(rounding), Some(rates)) = (rounding, scene.system.rates_mut()) {
            rates.carry_rounding(u, &rounding.of(u));
            scene.system.numbering.follow(u);
        }
        // parts of a load lead to the first state, they are none themselves
        if history.converged() && target.load.is_none() {
            self.next_states = next_states(scene, window, u)?;
        }
        Ok(history)
    }

    /// An error of the linear solver with its reason, where the tangent is singular.
    fn explained(&self, scene: &Solving<'_>, error: NewtonError, u: &[f64]) -> NewtonError {
        match &self.tangent {
            Some(tangent) => explained(error, scene.system, scene.contact, tangent, u),
            None => error,
        }
    }

    /// Why a part of a step has no result, with the reason where the tangent is singular.
    pub(super) fn with_reason(&self, scene: &Solving<'_>, error: StepError, u: &[f64]) -> StepError {
        match error {
            StepError::Newton(error) => self.explained(scene, error, u).into(),
            other => other,
        }
    }

    /// Computes the states that follow from `u`; [`Self::renew`] takes them over.
    pub(super) fn keep_states(&mut self, scene: &mut Solving<'_>, window: Window, u: &[f64]) -> Result<(), StepError> {
        self.next_states = next_states(scene, window, u)?;
        Ok(())
    }

    /// Takes over the states that follow from the last part that converged.
    pub(super) fn renew(&mut self, scene: &mut Solving<'_>) {
        for (state, values) in scene.scene.states.iter().zip(self.next_states.drain(..)) {
            scene.system.set_data(state.field, values);
        }
    }

    /// Brings known fields, terms and the linear solver to a step.
    pub(super) fn prepare(
        &mut self,
        scene: &mut Solving<'_>,
        window: Window,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<(), NewtonError> {
        scene.set_data(window)?;
        let begin = Instant::now();
        if self.solver.is_none() && LinearSolver::needs_no_matrix(scene.system, &self.solver_options) {
            scene.system.leave_matrix()?;
        }
        if self.solver.is_none() && LinearSolver::needs_faces_apart(scene.system, &self.solver_options) {
            scene.system.keep_faces_apart()?;
        }
        let changed = scene.system.begin_step(window)?;
        scene.contact.begin_step(scene.system.step());
        self.tangent.get_or_insert_with(|| scene.system.new_tangent());
        clock.assemble += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        match self.solver.take() {
            None => {
                let mut made = LinearSolver::new(scene.system, self.solver_options)?;
                if !scene.starts.is_empty() {
                    made.starts_elsewhere();
                }
                if scene.system.is_linear() {
                    made.bulk_changed(scene.system)?;
                }
                progress.solver(&made.describe());
                self.solver = Some(made);
            }
            Some(mut old) => {
                old.expire();
                if changed {
                    old.bulk_changed(scene.system)?;
                }
                self.solver = Some(old);
            }
        }
        clock.factor += begin.elapsed().as_secs_f64();
        Ok(())
    }
}

/// The end of the last step becomes the past; before the first step the past is the start.
pub(super) fn begin(scene: &mut Solving<'_>, request: StepRequest, u: &[f64]) -> Result<(), NewtonError> {
    if request.from.is_none() {
        scene.set_data(request.window)?;
    }
    scene.system.end_step(u);
    Ok(())
}

/// The next values of the states, all from the same old ones.
fn next_states(scene: &mut Solving<'_>, window: Window, u: &[f64]) -> Result<Vec<Vec<f64>>, StepError> {
    let Solving { system, scene: Scene { states, .. }, .. } = scene;
    let next: Vec<Vec<f64>> = states.iter().map(|s| s.next(system, window, u)).collect();
    for (state, values) in states.iter().zip(&next) {
        let field = &system.fields[state.field];
        let bad = values.iter().position(|v| !v.is_finite());
        if let Some(rank) = system.team().first(bad.is_some()) {
            let told = |bad: usize| {
                let [x, y, z] = field.node_position(bad / field.n_components);
                vec![values[bad], x, y, z]
            };
            let own = bad.filter(|_| rank == system.team().rank()).map_or_else(Vec::new, told);
            let [value, x, y, z] = system.team().numbers_of(rank, &own)[..] else { unreachable!("four numbers") };
            return Err(StepError::State { state: field.name.clone(), value, position: [x, y, z] });
        }
    }
    Ok(next)
}
