//! Running a scene: steps, Newton, measures, files, report.
//!
//! `stepping` gets from one requested value to the next, `files` writes what the scene asks for, `report` says what
//! was done. Promises: every step that was tried is in the report, also when the run ends with an error; files are
//! written in the order of the steps by a thread of their own, so that the solver does not wait for the disc.

mod checkpoint;
mod files;
mod folder;
mod memory;
mod quantities;
mod report;
mod resuming;
mod stepping;

use std::{
    path::PathBuf,
    sync::mpsc::{SyncSender, sync_channel},
    time::{Duration, Instant},
};

pub use checkpoint::{CHECKPOINT_FILE, CheckpointError};
pub use folder::{finished, may_begin};
pub use memory::Memory;
pub use stepping::{Attempt, AttemptEnd, FRUITLESS, Path};
use thiserror::Error;
use wfl_compiler::ir::Origin;

use crate::{
    assemble::BranchCounts,
    checks::{self, Accuracy, NarrowZone, Others, PhysicsCheck, Solved, TurnedCells},
    contact::{FrictionWork, friction_work},
    finite::{BadGiven, BadMeasure, BadOutput},
    newton::{Iteration, NewtonError, StepHistory, Stop, Watch},
    output::{About, Hash, OrderedMap, OutputDir, OutputError, Report, State, write_report},
    pruning::Saving,
    scene::{Scene, node_positions, set_data},
    solve::{Precision, SolverOptions},
    system::{Form, Residual},
};
use checkpoint::Log;
use files::{CheckpointCost, Files, StepFiles};
use stepping::{Leg, Reached, StepError, Stepper};

/// Steps that may wait for their files to be written before the solver waits too.
const STEPS_TO_WRITE: usize = 1;
/// A checkpoint is made after the first step that ends so long after the last one: what a kill costs at most, but for
/// the step it meets. On a slow disc it is [`CHECKPOINT_SHARE`] times what the last checkpoint took.
const CHECKPOINT_EVERY: Duration = Duration::from_millis(100);
/// Of the time of a run checkpoints take at most one part in so many.
const CHECKPOINT_SHARE: u32 = 20;
/// Bytes of stack of the threads of a run: as many as the first thread of a program has.
const STACK: usize = 8 << 20;

/// How a scene is run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The scene's name: its file without folder and ending.
    pub name: String,
    /// Where results go; `None` writes nothing.
    pub out: Option<PathBuf>,
    /// Go on from the checkpoint in `out`, if there is one.
    pub resume: bool,
    /// The texts of the scene by name: results are only good for their own.
    pub texts: OrderedMap<Hash>,
    /// What else was given that changes numbers, by name: knobs, prunings that are put back.
    pub settings: OrderedMap<String>,
    /// Threads of assembly and solver.
    pub threads: usize,
    /// Precision of the factor of the matrix of the contact forces.
    pub precision: Precision,
    /// Version of the program.
    pub version: String,
    /// Seconds spent on parsing before.
    pub parse_seconds: f64,
    /// Seconds spent on looking at the scene before.
    pub check_seconds: f64,
    /// Start of the process.
    pub started: Instant,
    /// Warnings to keep in the report.
    pub warnings: Vec<String>,
    /// What the report says about the scene.
    pub about: About,
    /// What the report says about savings, measured before.
    pub savings: Vec<Saving>,
    /// The unknowns of every step stay in memory, not only those of the last one.
    pub keep_states: bool,
}

impl RunOptions {
    /// A run that writes no files and keeps the unknowns of its last step only.
    #[must_use]
    pub fn without_files(threads: usize, started: Instant) -> Self {
        Self {
            name: String::new(),
            out: None,
            resume: false,
            texts: OrderedMap::new(),
            settings: OrderedMap::new(),
            threads,
            precision: Precision::Auto,
            version: String::new(),
            parse_seconds: 0.0,
            check_seconds: 0.0,
            started,
            warnings: Vec::new(),
            about: About::default(),
            savings: Vec::new(),
            keep_states: false,
        }
    }
}

/// Events of a run.
pub trait Progress: Send {
    /// The solver has been chosen.
    fn solver(&mut self, _description: &str) {}
    /// Where the run continues: after the steps of a checkpoint (the last one given), or at the beginning without one.
    fn resumed(&mut self, _last: Option<&StepResult>) {}
    /// A step begins: its number from 0, how many there are, the step variable.
    fn step(&mut self, _number: usize, _count: usize, _time: f64) {}
    /// After each iteration.
    fn iteration(&mut self, _iteration: &Iteration) {}
    /// A `Print` of a term: its name, where it is written, and its value at one of the points.
    fn printed(&mut self, _term: &str, _origin: Option<Origin>, _position: [f64; 3], _value: &[f64]) {}
    /// A step has ended.
    fn step_done(&mut self, _step: &StepResult) {}
}

/// Tells nothing.
pub struct Quiet;

impl Progress for Quiet {}

/// One step of a run.
#[derive(Clone, Debug, Default)]
pub struct StepResult {
    /// The step variable.
    pub time: f64,
    /// The last increment of the step variable: smaller than that of the scene after a step in parts.
    pub increment: f64,
    /// What Newton did in the last part.
    pub history: StepHistory,
    /// Every attempt at a part of the step; none for a state that is given.
    pub attempts: Vec<Attempt>,
    /// What finite precision leaves of the unknowns, where a tangent was solved and the step converged.
    pub accuracy: Option<Accuracy>,
    /// Conditions of mechanics at a converged state.
    pub checks: Vec<PhysicsCheck>,
    /// Cells of bodies of finite strain that turned inside out, by term.
    pub turned: Vec<TurnedCells>,
    /// Zones of contact that cover no face; empty for a step that another process did.
    pub narrow: Vec<NarrowZone>,
    /// Energy that friction took from the motion in this step (force times length), negative where it gave some back;
    /// `None` without friction.
    pub friction: Option<FrictionWork>,
    /// What is known of other states that solve the same equations; looked for until that is proved.
    pub others: Others,
    /// Measures by name.
    pub measures: Vec<(String, f64)>,
    /// Those of them that are not finite; empty for a step that another process did.
    pub bad_measures: Vec<BadMeasure>,
    /// By term: the branches of its kinks at its end; empty as [`Self::state`] is.
    pub branches: Vec<BranchCounts>,
    /// All unknowns at its end; empty for steps before the last one unless [`RunOptions::keep_states`] says otherwise,
    /// and for a step that another process did before this one went on from a checkpoint.
    pub state: Vec<f64>,
}

impl StepResult {
    /// Linear systems that were solved for the step: predictors and attempts that came to nothing included.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.attempts.iter().map(|a| a.linear_solves).sum()
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
        self.attempts.iter().filter(|a| a.end != AttemptEnd::Converged).map(|a| a.iterations).sum()
    }
}

/// What a run ends with.
#[derive(Debug)]
pub struct Outcome {
    /// The steps that were tried.
    pub steps: Vec<StepResult>,
    /// The report, also written to `report.json`.
    pub report: Report,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Expectations of the scene: place and whether they hold.
    pub expectations: Vec<(wfl::Expect, Option<bool>)>,
    /// Messages of the expectations.
    pub diagnostics: Vec<wfl::Diagnostic>,
    /// What the numbers themselves give cause to doubt, with its code.
    pub warnings: Vec<(&'static str, String)>,
}

impl Outcome {
    /// The measures that are not finite, each with the step variable where it first was; the place is not known for a
    /// step that another process did.
    #[must_use]
    pub fn bad_measures(&self) -> Vec<(f64, &str, f64, Option<&BadMeasure>)> {
        let mut out: Vec<(f64, &str, f64, Option<&BadMeasure>)> = Vec::new();
        for step in &self.steps {
            for (name, value) in step.measures.iter().filter(|m| !m.1.is_finite()) {
                if out.iter().all(|known| known.1 != name) {
                    let place = step.bad_measures.iter().find(|bad| bad.name == *name);
                    out.push((step.time, name, *value, place));
                }
            }
        }
        out
    }

    /// What there is to say of cells that turned inside out, with the name of their term, each term once.
    #[must_use]
    pub fn turned(&self) -> Vec<(String, String)> {
        report::turned(&self.steps).map(|(t, cells)| (report::turned_text(t, cells), cells.term.clone())).collect()
    }

    /// True if every step converged.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.steps.iter().all(|s| s.history.converged())
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
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The run cannot go on from where it was stopped.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// Tells the iterations of an attempt.
struct Forward<'p> {
    progress: &'p mut dyn Progress,
}

impl Watch for Forward<'_> {
    fn iteration(&mut self, iteration: &Iteration) {
        self.progress.iteration(iteration);
    }
}

/// Runs a scene, in the current pool of threads if it has as many as the options ask for, else in one of its own.
///
/// # Errors
/// [`RunError`]; a step that does not converge is no error: it is marked, and the run stops there unless the scene
/// says `on_fail=go_on`.
pub fn run(scene: &mut Scene, options: &RunOptions, progress: &mut dyn Progress) -> Result<Outcome, RunError> {
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

fn run_here(scene: &mut Scene, options: &RunOptions, progress: &mut dyn Progress) -> Result<Outcome, RunError> {
    let begin = Instant::now();
    let dir = match &options.out {
        Some(path) => Some(OutputDir::open(path)?),
        None => None,
    };
    let identity = folder::identity(scene, options);
    let mut files = Files::new(scene, dir.as_ref());
    let mut run = Run {
        u: start(scene).map_err(|bad| RunError::Start(Box::new(bad)))?,
        stepper: Stepper::new(solver_options(scene, options)),
        steps: Vec::new(),
        clock: Clock::default(),
        log: Log::default(),
        identity: identity.hash(),
        bad: Vec::new(),
    };
    let opening = begin.elapsed().as_secs_f64();
    if let Some(dir) = &dir {
        run.take_up(scene, options, &identity, &mut files, dir, progress)?;
    }
    run.clock.write += opening;
    let ended = run.all_steps(scene, options, &mut files, progress);
    let done = run.steps.len() == scene.steps.values.len() && run.steps.iter().all(|s| s.history.converged());
    let finished = match ended {
        Ok(()) if done => files.finish(scene),
        other => other,
    };
    let last: Vec<(String, f64)> = run.steps.last().map(|s| s.measures.clone()).unwrap_or_default();
    let (expectations, diagnostics) =
        if done && finished.is_ok() { scene.expectations(&last) } else { (Vec::new(), Vec::new()) };
    let mut warnings = report::warnings(&run.steps);
    warnings.extend(run.bad.iter().map(|bad| ("W610", bad.text())));
    let mut report = report::report(scene, options, &run, &expectations);
    report.warnings.extend(warnings.iter().map(|(code, text)| format!("{code}: {text}")));
    report.error = finished.as_ref().err().map(ToString::to_string);
    let mut written = files.written;
    let name = |path: &PathBuf| path.file_name().map(|n| n.to_string_lossy().into_owned());
    report.files = written.iter().filter_map(name).collect();
    if let Some(dir) = &dir {
        // an error of the run itself is the one to tell
        match (dir.sync().and_then(|()| write_report(dir, &report)), &finished) {
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
    Ok(Outcome { steps: run.steps, report, files: written, expectations, diagnostics, warnings })
}

fn solver_options(scene: &Scene, options: &RunOptions) -> SolverOptions {
    SolverOptions {
        threads: options.threads,
        precision: options.precision,
        method: scene.newton.linear,
        solutions: scene.steps.values.len(),
        ..SolverOptions::default()
    }
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
    steps: Vec<StepResult>,
    clock: Clock,
    /// What the checkpoints of this run have written of its steps.
    log: Log,
    /// What the run is.
    identity: Hash,
    /// What was written or printed and is not finite, each quantity once.
    bad: Vec<BadOutput>,
}

impl Run {
    /// The steps that have not been done yet. The files of a step are written while the next one is solved.
    fn all_steps(
        &mut self,
        scene: &mut Scene,
        options: &RunOptions,
        files: &mut Files<'_>,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        if files.dir.is_none() {
            return self.steps_to(None, scene, options, progress);
        }
        let cost = files.cost.clone();
        std::thread::scope(|scope| {
            let (sender, receiver) = sync_channel::<StepFiles>(STEPS_TO_WRITE);
            let writer = scope.spawn(move || {
                let written = receiver.iter().try_for_each(|step| files.write(&step));
                (files, written)
            });
            let solved = self.steps_to(Some((&sender, &cost)), scene, options, progress);
            let begin = Instant::now();
            drop(sender);
            let (files, written) = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            let written = written.and_then(|()| files.update_index());
            self.clock.write += begin.elapsed().as_secs_f64();
            solved.and(written)
        })
    }

    /// Solves the remaining steps and sends what is to be written; ends early, without an error of
    /// its own, when the writer has ended.
    fn steps_to(
        &mut self,
        writer: Option<(&SyncSender<StepFiles>, &CheckpointCost)>,
        scene: &mut Scene,
        options: &RunOptions,
        progress: &mut dyn Progress,
    ) -> Result<(), RunError> {
        let values = scene.steps.values.clone();
        let mut checkpoint_before: Option<Instant> = None;
        for number in self.steps.len()..values.len() {
            let step = self.step(scene, &values, number, progress)?;
            progress.step_done(&step);
            let goes_on = step.history.converged() || scene.steps.go_on;
            if let Some(before) = self.steps.last_mut().filter(|_| !options.keep_states) {
                (before.state, before.branches) = (Vec::new(), Vec::new());
            }
            self.steps.push(step);
            if !goes_on {
                break;
            }
            let Some((writer, cost)) = writer else { continue };
            let begin = Instant::now();
            let (mut step, bad) = files::collect(scene, &self.steps[number], number);
            bad.into_iter().for_each(|bad| self.add_bad(bad));
            let pause = CHECKPOINT_EVERY.max(CHECKPOINT_SHARE * cost.get());
            if values.len() > 1 && checkpoint_before.is_none_or(|before| before.elapsed() >= pause) {
                checkpoint_before = Some(begin);
                let mut log = std::mem::take(&mut self.log);
                step.checkpoint = Some(checkpoint::pack(self, &mut log, scene, self.identity));
                self.log = log;
            }
            let taken = step.is_empty() || writer.send(step).is_ok();
            self.clock.write += begin.elapsed().as_secs_f64();
            if !taken {
                break;
            }
        }
        Ok(())
    }

    fn step(
        &mut self,
        scene: &mut Scene,
        values: &[f64],
        number: usize,
        progress: &mut dyn Progress,
    ) -> Result<StepResult, RunError> {
        let time = values[number];
        progress.step(number, values.len(), time);
        let from = number.checked_sub(1).map(|k| values[k]);
        let leg = Leg { from, to: time, first_increment: values.get(1).map_or(0.0, |next| next - values[0]) };
        let before = scene.contact.has_sliding().then(|| self.u.clone());
        let reached = if number == 0 && scene.steps.from_start {
            self.stepper.given(scene, &self.u, leg, &mut self.clock, progress)
        } else {
            self.stepper.reach(scene, &mut self.u, leg, &mut self.clock, progress)
        };
        let wrap = |run: &Self, scene: &Scene, error| match error {
            StepError::Newton(error) => {
                RunError::Newton { step: number, time, error: run.stepper.explained(scene, error, &run.u) }
            }
            StepError::State { state, value, position } => {
                RunError::State { step: number, time, state, value, position }
            }
        };
        let Reached { history, increment, attempts } = reached.map_err(|error| wrap(self, scene, error))?;
        // the equations are those of the old states; a state that is given has nothing to judge
        let solved = history.converged() && history.stop != Some(Stop::Given);
        let begin = Instant::now();
        let judged = if solved { self.judge(scene, &history) } else { Ok(Judged::default()) };
        let judged = judged.map_err(|error| wrap(self, scene, error.into()))?;
        let Judged { accuracy, checks, turned, narrow, others, residual } = judged;
        let branches = if solved { residual.branches } else { self.branches(scene) };
        let before = before.filter(|_| solved);
        let friction = before.and_then(|before| friction_work(&scene.system, &scene.contact, &before, &self.u));
        self.clock.check += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        self.stepper.renew(scene);
        let (measures, bad_measures) = self.measures(scene, time, increment);
        self.print(scene, time, increment, progress);
        let state = self.u.clone();
        self.clock.measure += begin.elapsed().as_secs_f64();
        Ok(StepResult {
            time,
            increment,
            history,
            attempts,
            accuracy,
            checks,
            turned,
            narrow,
            friction,
            others,
            measures,
            bad_measures,
            branches,
            state,
        })
    }

    /// The branches of the terms at a state that was not solved for, where a file shows them.
    fn branches(&self, scene: &Scene) -> Vec<BranchCounts> {
        if scene.vtk.is_empty() {
            return Vec::new();
        }
        scene.system.residual(&self.u, &Form::AS_WRITTEN).map_or_else(|_| Vec::new(), |residual| residual.branches)
    }

    /// Keeps what is not finite, the first time that it is met.
    fn add_bad(&mut self, bad: BadOutput) {
        if self.bad.iter().all(|known| known.what != bad.what) {
            self.bad.push(bad);
        }
    }

    /// How good the converged state is; `residual` is that of the scene there.
    fn judge(&mut self, scene: &Scene, history: &StepHistory) -> Result<Judged, NewtonError> {
        let form = Form { linear: self.stepper.linear, ..Form::AS_WRITTEN };
        let residual = scene.system.residual(&self.u, &form)?;
        let known = self.steps.iter().map(|s| s.others).max().unwrap_or_default();
        let (solver, tangent) = (self.stepper.solver.as_mut(), self.stepper.tangent.as_ref());
        let (Some(solver), Some(tangent)) = (solver, tangent) else {
            return Ok(Judged { residual, ..Judged::default() });
        };
        let Scene { system, contact, .. } = scene;
        let state = Solved { system, contact, tangent, u: &self.u, residual: &residual };
        let left = history.iterations.last().map_or(0.0, |i| i.residual);
        let (accuracy, conditions) =
            rayon::join(|| checks::digits(state, solver, history.correction), || checks::conditions(state, left));
        let mut found = checks::balance(state, scene.newton.tolerance);
        found.extend(conditions.checks);
        let (narrow, turned) = (conditions.narrow, checks::turned_cells(system, &self.u));
        let others = checks::others(system, contact, solver, &self.u, known)?;
        let doubtful =
            accuracy.as_ref().is_some_and(|a| a.digits() < report::FEW_DIGITS) || found.iter().any(|c| !c.holds());
        if doubtful && checks::rests(system, &self.u, &form)? {
            // what differs from zero is rounding, and so is every number made of it
            return Ok(Judged { others, residual, ..Judged::default() });
        }
        Ok(Judged { accuracy, checks: found, turned, narrow, others, residual })
    }
}

/// What is known of a converged state: the fields of [`StepResult`].
#[derive(Default)]
struct Judged {
    accuracy: Option<Accuracy>,
    checks: Vec<PhysicsCheck>,
    turned: Vec<TurnedCells>,
    narrow: Vec<NarrowZone>,
    others: Others,
    /// The residual there.
    residual: Residual,
}

/// First values of the scene: those of the unknowns by dof, those of states where they are kept.
fn start(scene: &mut Scene) -> Result<Vec<f64>, BadGiven> {
    let mut u = vec![0.0; scene.system.numbering.n_dofs];
    let time = scene.steps.values.first().copied().unwrap_or(0.0);
    for (field, value) in &mut scene.starts {
        let positions = node_positions(&scene.system, *field);
        let values = value.at(&positions, time, 0.0)?;
        match scene.system.numbering.starts[*field] {
            Some(first) => u[first..first + values.len()].copy_from_slice(&values),
            None => scene.system.known.data[*field] = values,
        }
    }
    scene.system.numbering.follow(&mut u);
    Ok(u)
}
