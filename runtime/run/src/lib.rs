//! Running a scene: steps, Newton, measures, files, report.
//!
//! `integrators` says how a step is made, `stepping` is what these ways share, `files` writes what the scene asks for, `report` says what
//! was done. Promises: every step that was tried is in the report, also when the run ends with an error; files are
//! written in the order of the steps by a thread of their own, so that the solver does not wait for the disc; a run that goes
//! on from a checkpoint, and one that was never stopped, have the same bits. Does not change the scene, which it is handed
//! prepared, does not differentiate, and does not choose meshes.
#![forbid(unsafe_code)]

mod adaptive;
mod again;
mod attempts;
mod balance;
mod beginning;
mod by_caller;
mod checkpoint;
mod control;
mod ended;
mod events;
mod explicit;
mod fields;
mod files;
mod findings;
mod folder;
mod friction;
mod gained;
mod growth;
mod integrators;
mod judged;
mod keeping;
mod lagging;
mod leaving;
mod memory;
mod options;
mod others;
mod outcome;
mod partial;
mod parts;
mod past;
mod progress;
mod quantities;
mod rates;
mod remembered;
mod report;
mod requests;
mod resuming;
mod ringing;
mod session;
mod stability;
mod standing;
mod state;
mod stepping;
mod trajectory;
mod watched;

use std::{sync::mpsc::sync_channel, time::Instant};

pub use attempts::{Attempt, AttemptEnd, Path};
use by_caller::ByCaller;
use checkpoint::Log;
pub use checkpoint::{CHECKPOINT_FILE, CheckpointError, Holders};
pub use events::Episode;
use events::{Sides, lasts};
pub use fields::{field_cells, field_grid, field_grids};
use files::{Files, StepFiles};
pub use folder::{finished, may_begin};
use friction::Friction;
use integrators::Integrators;
use judged::KnownOfOthers;
use keeping::Keeper;
pub use memory::Memory;
pub use options::RunOptions;
pub use outcome::{KeptStep, KeptTable, Outcome, save};
use partial::{OfLastPart, Whole};
pub use parts::FRUITLESS;
pub use progress::{Progress, Quiet};
pub use rates::{As, Mass, mass_at_start, prescribed_differences};
pub use report::put_expectations;
use requests::StepRequest;
pub use session::{Session, Standing};
pub use state::State as RunState;
use stepping::{Integrator, Making, Reached, StepError, Stepper};
use thiserror::Error;
pub use trajectory::{Passed, PassedStep, Trajectory};
use watched::{Seen, Watched};
use wfl_checks::{Accuracy, NarrowZone, Others, PhysicsCheck, RowSigns, TurnedCells, Unstable, Zigzag};
use wfl_contact::{Creep, FrictionWork, SlidPast};
use wfl_discrete::{
    assemble::BranchCounts,
    finite::{BadGiven, BadMeasure, BadOutput},
    window::Window,
};
use wfl_newton::{NewtonError, StepHistory};
use wfl_output::{Hash, OutputDir, OutputError, State, write_report};
use wfl_problem::{Scene, Solving, Turnover};

/// Steps that may wait for their files to be written before the solver waits too.
const STEPS_TO_WRITE: usize = 1;
/// Bytes of stack of the threads of a run: as many as the first thread of a program has.
const STACK: usize = 8 << 20;

/// One step of a run.
#[derive(Clone, Debug, Default)]
pub struct StepResult {
    /// Its last part: it ends where the step does, and is shorter than the step of the scene after a step in parts.
    pub window: Window,
    /// What Newton did in the last part.
    pub history: StepHistory,
    /// Every attempt at a part of the step; none for a state that is given.
    pub attempts: Vec<Attempt>,
    /// What finite precision leaves of the unknowns, where a tangent was solved and the step converged.
    pub accuracy: Option<Accuracy>,
    /// The part of the forces on bodies that does not balance and that rounding hides, where it is much; 0 elsewhere.
    pub hidden: f64,
    /// Conditions of mechanics at a converged state.
    pub checks: Vec<PhysicsCheck>,
    /// Cells of bodies of finite strain that turned inside out, by term.
    pub turned: Vec<TurnedCells>,
    /// Zones of contact that cover no face.
    pub narrow: Vec<NarrowZone>,
    /// Pressures that alternate from point to point.
    pub zigzags: Vec<Zigzag>,
    /// Energy that friction took from the motion in this step (force times length), negative where it gave some back;
    /// `None` without friction.
    pub friction: Option<FrictionWork>,
    /// What friction has lost of the slip of points that stick; `None` for laws that lose nothing.
    pub creep: Option<Creep>,
    /// Contact terms on two bodies that have slid by more than a face.
    pub slid: Vec<SlidPast>,
    /// What is known of other states that solve the same equations; looked for until that is proved.
    pub others: Others,
    /// Directions in which the state is not stable; of the first step that has some.
    pub unstable: Option<Unstable>,
    /// What was seen of strains, pressures, rates, images and sizes.
    pub(crate) seen: Seen,
    /// What the scene says that the next increment is at most; infinite where it says nothing. Positive numbers count.
    pub limit: f64,
    /// By event of the scene its larger side and its smaller one.
    pub events: Vec<[f64; 2]>,
    /// By series of the scene its rows: step variable, coordinates of a point, values.
    pub series: Vec<Vec<Vec<f64>>>,
    /// Measures by name.
    pub measures: Vec<(String, f64)>,
    /// Those of them that are not finite; empty for a step that another process did.
    pub bad_measures: Vec<BadMeasure>,
    /// Measures that have the change over its last part; empty for a step that another process did.
    pub(crate) partial: Vec<OfLastPart>,
    /// What moves in the balances of the scene; empty for a step that another process did.
    pub(crate) moved: Vec<Turnover>,
    /// By term: the branches of its kinks at its end; empty as [`Self::state`] is.
    pub branches: Vec<BranchCounts>,
    /// All unknowns at its end; empty for steps before the last one unless [`RunOptions::keep_states`] says otherwise,
    /// and for a step that another process did before this one went on from a checkpoint.
    pub state: Vec<f64>,
}

impl StepResult {
    /// Leaves what is needed of a step that is not the last one, in no more memory than that takes.
    fn shrink(&mut self) {
        (self.state, self.branches) = (Vec::new(), Vec::new());
        self.history.iterations.shrink_to_fit();
        self.history.solves.shrink_to_fit();
        self.attempts.shrink_to_fit();
        self.checks.shrink_to_fit();
        self.measures.shrink_to_fit();
    }

    /// Which events of the scene last at its end.
    #[must_use]
    pub fn lasting(&self) -> Vec<bool> {
        self.events.iter().map(|sides| lasts(*sides)).collect()
    }

    /// Linear systems that were solved for the step: predictors and attempts that came to nothing included.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.attempts.iter().map(|a| a.linear_solves).sum()
    }

    /// The same without attempts at increments that were too long: they leave nothing in the state.
    pub(crate) fn iterations_of_state(&self) -> usize {
        self.attempts.iter().filter(|a| !a.is_left_behind()).map(|a| a.linear_solves).sum()
    }

    /// The attempts where one was not enough.
    #[must_use]
    pub fn parts(&self) -> &[Attempt] {
        if self.attempts.len() > 1 { &self.attempts } else { &[] }
    }

    /// Newton iterations of the attempts that came to nothing, which [`FRUITLESS`] limits; 0 where one attempt was
    /// enough.
    #[must_use]
    pub fn fruitless(&self) -> usize {
        self.attempts
            .iter()
            .filter(|a| !matches!(a.end, AttemptEnd::Converged | AttemptEnd::Forced(_)))
            .map(|a| a.iterations)
            .sum()
    }
}

/// Why a run stopped.
#[derive(Debug, Error)]
pub enum RunError {
    /// A step could not be solved.
    #[error("step {step} (t = {time}): {error}")]
    Newton {
        /// Number of the step from 0.
        step: usize,
        /// The step variable.
        time: f64,
        /// Why.
        error: NewtonError,
    },
    /// A first value is not finite.
    #[error(transparent)]
    Start(Box<BadGiven>),
    /// The update of a state gave a number that is not finite.
    #[error("step {step} (t = {time}): the update of `{state}` gives {value} at {position:?}")]
    State {
        /// Number of the step from 0.
        step: usize,
        /// The step variable.
        time: f64,
        /// The state.
        state: String,
        /// What it became.
        value: f64,
        /// Where.
        position: [f64; 3],
    },
    /// The caller wants to solve the equations of a step, and the scheme has none.
    #[error("`scheme explicit` has no equations to solve: its steps are made by `step`, not by `begin`")]
    NoEquations,
    /// The caller goes back to where a run of another scene has stood.
    #[error("that is a state of another scene, or of other parameters: this one has never stood there")]
    NotOfThisScene,
    /// The caller asks where a run stands within a step.
    #[error("a step was begun: the run stands again where `accept` ends it")]
    Begun,
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The run cannot go on from where it was stopped.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl RunError {
    /// Of a step by its number, to a value of the step variable.
    fn of_step(error: StepError, step: usize, time: f64) -> Self {
        match error {
            StepError::Newton(error) => Self::Newton { step, time, error },
            StepError::State { state, value, position } => Self::State { step, time, state, value, position },
        }
    }
}

/// Runs a scene, in the current pool of threads if it has as many as the options ask for, else in one of its own.
///
/// # Errors
/// [`RunError`]; a step that does not converge is no error: it is marked, and the run stops there unless the scene
/// says `on_fail=go_on`.
pub fn run(scene: &Scene, options: &RunOptions, progress: &mut dyn Progress) -> Result<Outcome, RunError> {
    let threads = options.threads.max(1);
    // On a thread of the pool work is shared out without waking another one to wait for it.
    if rayon::current_thread_index().is_some() && rayon::current_num_threads() == threads {
        return run_here(scene, options, progress);
    }
    match rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build() {
        Ok(pool) => pool.install(|| run_here(scene, options, progress)),
        Err(_) => run_here(scene, options, progress),
    }
}

fn run_here(scene: &Scene, options: &RunOptions, progress: &mut dyn Progress) -> Result<Outcome, RunError> {
    let begin = Instant::now();
    let mut equations = scene.equations();
    let scene = &mut scene.solving(&mut equations);
    let dir = match &options.out {
        Some(path) => Some(OutputDir::open(path)?),
        None => None,
    };
    let identity = folder::identity(scene, options);
    let mut files = Files::new(scene, dir.as_ref());
    let mut run = Run::new(scene, options, identity.hash())?;
    let opening = begin.elapsed().as_secs_f64();
    if dir.is_some() || options.resume {
        run.take_up(scene, options, &identity, &mut files, progress)?;
    }
    run.clock.write += opening;
    let ended = run.all_steps(scene, options, &mut files, progress);
    let done = run.is_done(scene);
    let finished = match ended {
        Ok(()) if done => files.finish(scene),
        other => other,
    };
    let mut outcome = run.outcome(scene, options, finished.as_ref().err());
    if finished.is_ok() {
        outcome.report.peak_memory_by_rank = report::memory_by_rank(scene.system.team());
    }
    let mut written = files.written;
    if let Some(dir) = &dir {
        let measures = files::write_measures(dir, scene.steps.variable.as_deref(), &outcome.steps);
        let table = measures.map(|table| written.extend(table));
        outcome.report.files = written.iter().filter_map(outcome::file_name).collect();
        files::in_order(scene, &mut outcome.report.files);
        let told = table.and_then(|()| dir.sync()).and_then(|()| write_report(dir, &outcome.report));
        // an error of the run itself is the one to tell
        match (told, &finished) {
            (Ok(path), _) => written.push(path),
            (Err(error), Ok(())) => return Err(error.into()),
            (Err(_), Err(_)) => {}
        }
        let noted = folder::end(dir, if done && finished.is_ok() { State::Finished } else { State::Stopped });
        if finished.is_ok() {
            noted?;
        }
    }
    finished?;
    outcome.files = written;
    Ok(outcome)
}

/// Seconds by what they were spent on.
#[derive(Clone, Copy, Debug, Default)]
struct Clock {
    assemble: f64,
    factor: f64,
    solve: f64,
    write: f64,
    check: f64,
    measure: f64,
}

/// The state of a run between two steps.
struct Run {
    u: Vec<f64>,
    stepper: Stepper,
    integrators: Integrators,
    steps: Vec<StepResult>,
    clock: Clock,
    /// What the checkpoints of this run have written of its steps.
    log: Log,
    /// What the run is.
    identity: Hash,
    /// What was written or printed and is not finite, each quantity once.
    bad: Vec<BadOutput>,
    /// Whether converged states are judged.
    judges: bool,
    known_of_others: KnownOfOthers,
    /// With which signs the equations are written.
    row_signs: RowSigns,
    /// Fields whose laws know no rotations at the first step.
    turning: Vec<String>,
    /// Outputs that stay in memory.
    kept: Vec<KeptStep>,
    /// What is seen over the steps.
    watched: Watched,
}

impl Run {
    /// A run before its first step.
    fn new(scene: &mut Solving<'_>, options: &RunOptions, identity: Hash) -> Result<Self, RunError> {
        let turning = judged::turning_fields(scene, options.judge);
        scene.forget_given();
        let mut stepper = Stepper::new(options.of_solver(scene));
        stepper.friction = Friction::of(scene).filter(|_| options.judge);
        let u = scene.start().map_err(|bad| RunError::Start(Box::new(bad)))?;
        stepper.trajectory = Trajectory::begin(options, &u);
        Ok(Self {
            u,
            stepper,
            integrators: Integrators::new(scene),
            // growing by doubling would hold them twice
            steps: Vec::with_capacity(scene.steps.listed().unwrap_or(0)),
            clock: Clock::default(),
            log: Log::default(),
            identity,
            bad: Vec::new(),
            kept: Vec::new(),
            watched: Watched::default(),
            judges: options.judge,
            known_of_others: KnownOfOthers::default(),
            row_signs: RowSigns::default(),
            turning,
        })
    }

    /// True if every step of the scene is done and converged.
    fn is_done(&self, scene: &Solving<'_>) -> bool {
        self.next_request(scene).is_none() && self.steps.iter().all(|s| s.history.converged())
    }

    /// Lists a step that was tried.
    fn add(&mut self, step: StepResult, scene: &mut Solving<'_>, options: &RunOptions) {
        if let Some(before) = self.steps.last_mut().filter(|_| !options.keep_states) {
            before.shrink();
        }
        let number = self.steps.len();
        let last = scene.steps.auto.is_some() && scene.steps.is_last(number, step.window.end);
        if options.keep_outputs.contains(&number) || (last && !options.keep_outputs.is_empty()) {
            let begin = Instant::now();
            let (files, bad) = {
                let lasting = step.lasting();
                files::collect(scene, &step, self.place_of(&step, &lasting, number))
            };
            bad.into_iter().for_each(|bad| self.add_bad(bad));
            self.kept.push(KeptStep::new(scene, files));
            self.clock.write += begin.elapsed().as_secs_f64();
        }
        self.steps.push(step);
    }

    /// The steps that have not been done yet. The files of a step are written while the next one is solved.
    fn all_steps(
        &mut self,
        scene: &mut Solving<'_>,
        options: &RunOptions,
        files: &mut Files<'_>,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        if files.dir.is_none() {
            return self.steps_to(Keeper::new(None, scene), scene, options, progress);
        }
        let cost = files.cost.clone();
        std::thread::scope(|scope| {
            let (sender, receiver) = sync_channel::<StepFiles>(STEPS_TO_WRITE);
            let writer = scope.spawn(move || {
                let written = receiver.iter().try_for_each(|step| files.write(&step));
                (files, written)
            });
            let solved = self.steps_to(Keeper::new(Some((&sender, &cost)), scene), scene, options, progress);
            let begin = Instant::now();
            drop(sender);
            let (files, written) = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            let written = written.and_then(|()| files.catch_up());
            self.clock.write += begin.elapsed().as_secs_f64();
            solved.and(written)
        })
    }

    /// The remaining steps; ends early, without an error of its own, when the writer has ended.
    fn steps_to(
        &mut self,
        mut keeper: Keeper<'_>,
        scene: &mut Solving<'_>,
        options: &RunOptions,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        while let Some(request) = self.next_request(scene) {
            let step = self.step(scene, request, progress)?;
            progress.step_done(&step);
            let goes_on = step.history.converged() || scene.steps.go_on;
            self.add(step, scene, options);
            if !goes_on || !self.keep(scene, &mut keeper) {
                break;
            }
        }
        Ok(())
    }

    /// One step, as it is requested.
    fn step(
        &mut self,
        scene: &mut Solving<'_>,
        request: StepRequest,
        progress: &mut dyn Progress,
    ) -> Result<StepResult, RunError> {
        let StepRequest { number, count, from, window, .. } = request;
        let chosen_from = from.filter(|_| count.is_none());
        progress.step(number, count, chosen_from.unwrap_or(window.end));
        let mut whole = None;
        let reached = self.advance(scene, request, &mut whole, progress);
        let mut step = self.taken(scene, request, reached, progress)?;
        let begin = Instant::now();
        step.partial = whole.map(|whole| whole.of_last_part(scene, &self.u, &step)).unwrap_or_default();
        self.clock.measure += begin.elapsed().as_secs_f64();
        Ok(step)
    }

    /// From the end of the last step to that of the next one; what measures need of its start, where it may have parts.
    fn advance(
        &mut self,
        scene: &mut Solving<'_>,
        request: StepRequest,
        whole: &mut Option<Whole>,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
        let Self { u, stepper, integrators, clock, .. } = self;
        stepping::begin(scene, request, u)?;
        *whole = Whole::new(scene, request.window);
        integrators.of(scene, &request).advance(Making { stepper, scene, u, clock, progress }, request)
    }

    /// A step that the caller has solved.
    fn step_by(
        &mut self,
        mut caller: ByCaller,
        scene: &mut Solving<'_>,
        progress: &mut dyn Progress,
    ) -> Result<StepResult, RunError> {
        let Self { u, stepper, clock, .. } = self;
        let request = caller.request();
        let reached = caller.advance(Making { stepper, scene, u, clock, progress }, request);
        self.taken(scene, request, reached, progress)
    }

    /// What is known of a step at its end, and what it leaves.
    fn taken(
        &mut self,
        scene: &mut Solving<'_>,
        request: StepRequest,
        reached: Result<Reached, StepError>,
        progress: &mut dyn Progress,
    ) -> Result<StepResult, RunError> {
        let StepRequest { number, window, .. } = request;
        let judged = reached.and_then(|reached| self.judged(scene, reached));
        let stopped = |error| RunError::of_step(self.stepper.with_reason(scene, error, &self.u), number, window.end);
        let step = judged.map_err(stopped)?;
        self.ended(scene, step, progress)
    }

    /// The end of a step: states are renewed, measures taken.
    fn ended(
        &mut self,
        scene: &mut Solving<'_>,
        mut step: StepResult,
        progress: &mut dyn Progress,
    ) -> Result<StepResult, RunError> {
        let begin = Instant::now();
        let (number, window) = (self.steps.len(), step.window);
        if step.history.converged() {
            self.stepper.slide(scene, &self.u);
        }
        // the state where time starts is no step: friction remembers it
        let is_start = number == 0 && scene.steps.from_start;
        let friction = self.stepper.friction.as_mut().and_then(Friction::take).filter(|_| !is_start);
        step.friction = friction.as_ref().map(|f| f.work);
        step.creep = friction.and_then(|f| f.creep);
        self.clock.check += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let kind = if scene.explicit.is_some() && !is_start { Passed::Explicit } else { Passed::of(&step.history) };
        self.stepper.keep_passed(scene, window, &self.u, kind);
        let left = self.stepper.leave(scene, window, &mut self.u);
        left.map_err(|error| RunError::Newton { step: number, time: window.end, error })?;
        self.integrators.remember(scene, window.increment, &self.u);
        (step.limit, step.events) = self.watched(scene, window);
        let lasting = step.lasting();
        step.series = self.series(scene, &step, self.place_of(&step, &lasting, self.steps.len()));
        let taken = self.measures(scene, window);
        (step.measures, step.bad_measures, step.moved) = (taken.measures, taken.bad, taken.moved);
        self.print(scene, window, progress);
        step.state = self.u.clone();
        self.clock.measure += begin.elapsed().as_secs_f64();
        Ok(step)
    }

    /// Keeps what is not finite, the first time that it is met.
    fn add_bad(&mut self, bad: BadOutput) {
        if self.bad.iter().all(|known| known.what != bad.what) {
            self.bad.push(bad);
        }
    }
}
