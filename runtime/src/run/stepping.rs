//! From one requested value of the step variable to the next, in as many parts as Newton needs.
//!
//! A step that does not converge is tried again from the last converged state with half the increment, as often as the
//! scene allows; after two parts that converge the increment doubles. Parts are dyadic, so requested values are hit
//! exactly, and terms see the true increment of each part. The first step has no earlier state: there the load grows
//! instead. With u0 the first guess and F the residual of the scene, `F(u) - (1 - s) F(u0) = 0` has the solution u0 at
//! s = 0 and is the scene at s = 1; prescribed values move with s from those of u0. That needs no knowledge of what
//! the loads are.
//!
//! A step whose attempts come to nothing for long is given up ([`FRUITLESS`]): what more parts may take is bounded.
//!
//! Promises: every attempt is listed; after a failure unknowns and memory are those of the last converged part.
//! Does not write anything and does not decide whether a run continues.

use std::time::Instant;

use thiserror::Error;

use crate::{
    assemble::BranchCounts,
    checks::{Response, explained},
    newton::{LinearSolver, LoadStep, NewtonError, NewtonOptions, Rounding, Spent, StepHistory, solve_step},
    rates::Rates,
    run::{
        Attempt, AttemptEnd, Clock, Path, Progress,
        balance::Balance,
        friction::Friction,
        leg::Leg,
        memory::Memory,
        progress::Forward,
        rates::{self, StepTime},
        remembered::Adaptive,
        stability::Stability,
        state::Snapshot,
        trajectory::{Passed, Trajectory},
    },
    scene::{Scene, Solving},
    solve::SolverOptions,
    system::{FIXED, Form, LinearTerms, Residual, System, Tangent},
};

/// Converged parts in a row after which the increment doubles.
const EASY_PARTS: u32 = 2;

/// Iterations of a step in attempts that come to nothing, in units of the most iterations of one attempt (`max_iter`),
/// after which no smaller part is tried. The steps of `docs/newton.md` take none.
pub const FRUITLESS: usize = 10;

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
    /// The step variable at its end.
    pub(super) time: f64,
    /// The last increment of the step variable.
    pub(super) increment: f64,
    /// Every attempt.
    pub(super) attempts: Vec<Attempt>,
}

/// What a load path starts from.
pub(super) struct LoadStart {
    u: Vec<f64>,
    residual: Vec<f64>,
}

/// The target of one attempt.
pub(super) struct Target<'a> {
    pub(super) time: f64,
    pub(super) increment: f64,
    pub(super) load: Option<(&'a LoadStart, f64)>,
    /// Iterations after which it ends, where the scene allows more.
    pub(super) iterations: usize,
}

/// Solves steps one after the other and remembers how large their parts may be.
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
    /// The present increment is 2^-level of a step.
    pub(super) level: u32,
    /// Parts of this size that converged in a row.
    pub(super) easy: u32,
    solver_options: SolverOptions,
    /// What the last attempt cost.
    pub(super) spent: Spent,
    /// The states after the last part that converged, not taken over yet.
    pub(super) next_states: Vec<Vec<f64>>,
    /// What steps that the run chooses remember.
    pub(super) adaptive: Option<Adaptive>,
    /// The balance of energy of a scene that asks for it.
    pub(super) balance: Option<Balance>,
    /// What is watched of explicit steps.
    pub(super) stability: Stability,
    /// What is kept of friction, where that is asked for.
    pub(super) friction: Option<Friction>,
    /// The steps so far, where somebody wants them.
    pub(super) trajectory: Option<Trajectory>,
    /// By term the branches at the end of a step for which nothing was solved.
    pub(super) branches: Option<Vec<BranchCounts>>,
    /// An error of the linear solver gets its reason: that takes longer than another attempt.
    pub(super) explains: bool,
}

impl Stepper {
    pub(super) fn new(solver_options: SolverOptions) -> Self {
        Self {
            solver: None,
            response: None,
            tangent: None,
            residual: None,
            linear: LinearTerms::ByMatrix,
            level: 0,
            easy: 0,
            solver_options,
            spent: Spent::default(),
            next_states: Vec::new(),
            adaptive: None,
            balance: None,
            stability: Stability::default(),
            friction: None,
            trajectory: None,
            branches: None,
            explains: true,
        }
    }

    /// What later steps depend on beside the unknowns.
    pub(super) fn memory(&self, scene: &Solving<'_>) -> Memory {
        match &self.tangent {
            Some(tangent) => Memory::of(scene, tangent),
            None => Memory::of(scene, &scene.system.new_tangent()),
        }
    }

    /// The same of all ranks, made by all together.
    pub(super) fn memory_of_all(&self, scene: &Solving<'_>) -> Memory {
        match &self.tangent {
            Some(tangent) => Memory::of_all(scene, tangent),
            None if scene.explicit.is_some() => Memory::without_tangent(scene),
            None => Memory::of_all(scene, &scene.system.new_tangent()),
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

    /// Solves the step; `u` holds the state before and then the one after.
    pub(super) fn reach(
        &mut self,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        leg: Leg,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
        let mut parts = Parts::new(leg, if scene.system.is_linear() { 0 } else { scene.steps.halve });
        begin(scene, leg, u)?;
        let mut start = self.snapshot(scene, u);
        self.level = self.level.min(parts.halve);
        // behind the parts that have passed
        let mut passed: Option<Snapshot> = None;
        loop {
            let span = parts.next(self.level);
            let target = parts.target(span);
            let at = StepTime { time: target.time, increment: target.increment };
            self.explains = span.to - span.from == parts.whole;
            let result = self.attempt(scene, u, &target, clock, progress);
            parts.list(span, &result, self.spent);
            match result {
                Ok(history) if history.converged() => {
                    let history = parts.pass(span, history);
                    self.grow(parts.whole, parts.position);
                    if parts.position == parts.whole {
                        return Ok(self.reached(parts, history, at.increment));
                    }
                    if parts.path == Path::Steps {
                        self.keep_sums(&mut start);
                        self.slide(scene, u);
                        self.keep_passed(scene, at, u, Passed::Part);
                        self.leave(scene, at, u)?;
                        scene.system.end_step(u);
                    }
                    passed = Some(self.snapshot(scene, u));
                }
                Err(StepError::Newton(error)) if error.ends_the_run() => {
                    self.end_at(scene, u, &start);
                    return Err(error.into());
                }
                failed => {
                    parts.keep_whole(span, failed, u);
                    self.go_back(scene, u, passed.as_ref().unwrap_or(&start));
                    if !self.halves(scene, &mut parts, u) {
                        self.go_back(scene, u, &start);
                        return self.give_up(scene, u, parts, clock, progress);
                    }
                }
            }
        }
    }

    /// Halves the increment after an attempt that came to nothing; false where that is not to be tried.
    fn halves(&mut self, scene: &Solving<'_>, parts: &mut Parts, u: &[f64]) -> bool {
        if parts.path == Path::Load && parts.load.is_none() {
            parts.load = load_start(scene.system, u);
        }
        parts.fruitless += self.spent.iterations;
        let patient = parts.fruitless <= FRUITLESS * scene.newton.max_iterations;
        if !patient || self.level == parts.halve || (parts.path == Path::Load && parts.load.is_none()) {
            return false;
        }
        self.level += 1;
        self.easy = 0;
        true
    }

    /// The attempt at the whole step is what is told of a step that was not solved.
    fn give_up(
        &mut self,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        mut parts: Parts,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
        self.level = 0;
        let failed = parts.failed_whole.take();
        let target = parts.target(parts.all());
        let increment = target.increment;
        let (result, state) = match failed {
            Some(failed) => failed,
            None => {
                self.explains = true;
                let result = self.attempt(scene, u, &target, clock, progress);
                parts.list(parts.all(), &result, self.spent);
                (result, u.to_vec())
            }
        };
        u.copy_from_slice(&state);
        scene.system.begin_rates(increment);
        result.map(|history| self.reached(parts, history, increment))
    }

    /// Doubles the increment where enough parts have converged and the doubled part would not pass the end.
    fn grow(&mut self, whole: u64, position: u64) {
        self.easy += 1;
        let doubled = 2 * (whole >> self.level);
        if self.level > 0 && self.easy >= EASY_PARTS && position.is_multiple_of(doubled) {
            self.level -= 1;
            self.easy = 0;
        }
    }

    fn reached(&mut self, parts: Parts, history: StepHistory, increment: f64) -> Reached {
        if parts.path == Path::Load {
            // parts of a load say nothing about increments of the step variable
            (self.level, self.easy) = (0, 0);
        }
        Reached { history, time: parts.leg.to, increment, attempts: parts.attempts }
    }

    pub(super) fn attempt(
        &mut self,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        target: &Target<'_>,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<StepHistory, StepError> {
        let (time, increment) = (target.time, target.increment);
        self.spent = Spent::default();
        let at = rates::enter(scene, StepTime { time, increment });
        self.prepare(scene, at, clock, progress)?;
        let from = u.to_vec();
        let prescribed = rates::prescribe(scene, StepTime { time, increment }, u);
        prescribed.map_err(|bad| NewtonError::Given(Box::new(bad)))?;
        let mut offset = Vec::new();
        if let Some((start, s)) = target.load {
            scene.system.numbering.part_of_prescribed(&start.u, s, u);
            offset.extend(start.residual.iter().map(|r| (s - 1.0) * r));
        }
        scene.system.start_from_predictor(u);
        let begin = Instant::now();
        let mut watch = Forward { progress };
        let carries = scene.system.rates().is_some_and(Rates::carries_rounding);
        let newton = scene.newton;
        let mut step = LoadStep {
            system: scene.system,
            contact: scene.contact,
            solver: self.solver.as_mut().expect("prepared above"),
            tangent: self.tangent.as_mut().expect("prepared above"),
            offset: &offset,
            linear: LinearTerms::ByMatrix,
            options: NewtonOptions { max_iterations: newton.max_iterations.min(target.iterations), ..newton },
            watch: &mut watch,
            spent: Spent::default(),
            rounding: carries.then(Rounding::default),
            reached: None,
        };
        let result = solve_step(&mut step, &from, u);
        (self.linear, self.spent) = (step.linear, step.spent);
        // a state with rates is moved once more below
        self.residual = step.reached.take().filter(|_| target.load.is_none() && scene.system.rates().is_none());
        let rounding = step.rounding;
        clock.factor += self.spent.factor;
        clock.solve += self.spent.solve;
        clock.assemble += begin.elapsed().as_secs_f64() - self.spent.factor - self.spent.solve;
        let history = result.map_err(|error| if self.explains { self.explained(scene, error, u) } else { error })?;
        // a state that is written, measured or continued is finite
        scene.system.check_finite("value", u, u).map_err(NewtonError::from)?;
        if let (Some(rounding), Some(rates)) = (rounding, scene.system.rates_mut()) {
            rates.carry_rounding(u, &rounding.of(u));
            scene.system.numbering.follow(u);
        }
        // parts of a load lead to the first state, they are none themselves
        if history.converged() && target.load.is_none() {
            self.next_states = next_states(scene, at.time, increment, u)?;
        }
        Ok(history)
    }

    /// An error of the linear solver with its reason, where the tangent is singular.
    pub(super) fn explained(&self, scene: &Solving<'_>, error: NewtonError, u: &[f64]) -> NewtonError {
        match &self.tangent {
            Some(tangent) => explained(error, scene.system, scene.contact, tangent, u),
            None => error,
        }
    }

    /// Computes the states that follow from `u`; [`Self::renew`] takes them over.
    pub(super) fn keep_states(&mut self, scene: &mut Solving<'_>, at: StepTime, u: &[f64]) -> Result<(), StepError> {
        self.next_states = next_states(scene, at.time, at.increment, u)?;
        Ok(())
    }

    /// Takes over the states that follow from the last part that converged.
    pub(super) fn renew(&mut self, scene: &mut Solving<'_>) {
        for (state, values) in scene.scene.states.iter().zip(self.next_states.drain(..)) {
            scene.system.set_data(state.field, values);
        }
    }

    /// The first step of a scene with rates: its state is given, nothing is solved.
    pub(super) fn given(
        &mut self,
        scene: &mut Solving<'_>,
        u: &[f64],
        leg: Leg,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
        begin(scene, leg, u)?;
        let at = StepTime { time: leg.to, increment: leg.first_increment };
        rates::start(scene, u, at)?;
        if let Some(explicit) = &scene.explicit {
            progress.solver(&explicit.describe(&scene.steps));
            let (history, attempts) = (StepHistory::given(), Vec::new());
            return Ok(Reached { history, time: leg.to, increment: leg.first_increment, attempts });
        }
        // the matrix is that of the first step; its rates are those at the start
        scene.system.begin_rates(at.increment);
        self.prepare(scene, at, clock, progress)?;
        scene.system.hold_rates();
        Ok(Reached {
            history: StepHistory::given(),
            time: leg.to,
            increment: leg.first_increment,
            attempts: Vec::new(),
        })
    }

    /// Brings known fields, terms and the linear solver to a value of the step variable.
    pub(super) fn prepare(
        &mut self,
        scene: &mut Solving<'_>,
        at: StepTime,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<(), NewtonError> {
        let StepTime { time, increment } = at;
        scene.set_data(time, increment)?;
        let begin = Instant::now();
        if self.solver.is_none() && LinearSolver::needs_no_matrix(scene.system, &self.solver_options) {
            scene.system.leave_matrix()?;
        }
        let changed = scene.system.begin_step(time, increment)?;
        scene.contact.begin_step(scene.system.step_at(time, increment));
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
pub(super) fn begin(scene: &mut Solving<'_>, leg: Leg, u: &[f64]) -> Result<(), NewtonError> {
    if leg.from.is_none() {
        scene.set_data(leg.to, leg.first_increment)?;
    }
    scene.system.end_step(u);
    Ok(())
}

/// The next values of the states, all from the same old ones.
fn next_states(scene: &mut Solving<'_>, time: f64, increment: f64, u: &[f64]) -> Result<Vec<Vec<f64>>, StepError> {
    let Solving { system, scene: Scene { states, .. }, .. } = scene;
    let next: Vec<Vec<f64>> = states.iter().map(|s| s.next(system, time, increment, u)).collect();
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

/// The residual that a load path takes away step by step: that of the first guess at the free dofs. `None` where it is
/// not finite: then there is nothing to start from.
fn load_start(system: &System, u: &[f64]) -> Option<LoadStart> {
    let mut residual = system.residual(u, &Form::AS_WRITTEN).ok()?.values;
    for (r, free) in residual.iter_mut().zip(&system.numbering.free) {
        if *free == FIXED {
            *r = 0.0;
        }
    }
    system.numbering.frames.turn_back(&mut residual);
    Some(LoadStart { u: u.to_vec(), residual })
}

/// A part of a step, in units of the smallest one that is allowed.
#[derive(Clone, Copy)]
struct Span {
    from: u64,
    to: u64,
}

/// A step on its way through its parts.
struct Parts {
    leg: Leg,
    path: Path,
    /// The smallest part is 2^-halve of the step, which is `whole` of them.
    halve: u32,
    whole: u64,
    /// What is done.
    position: u64,
    /// What a load path starts from, as soon as one is needed.
    load: Option<LoadStart>,
    attempts: Vec<Attempt>,
    /// The attempt at the whole step, if it came to nothing, with the state it left.
    failed_whole: Option<(Result<StepHistory, StepError>, Vec<f64>)>,
    /// What the parts before the last one have to tell.
    turns: usize,
    displaced: bool,
    /// Iterations of attempts that came to nothing.
    fruitless: usize,
}

impl Parts {
    fn new(leg: Leg, halve: u32) -> Self {
        Self {
            leg,
            path: if leg.from.is_some() { Path::Steps } else { Path::Load },
            halve,
            whole: 1u64 << halve,
            position: 0,
            load: None,
            attempts: Vec::new(),
            failed_whole: None,
            turns: 0,
            displaced: false,
            fruitless: 0,
        }
    }

    fn next(&self, level: u32) -> Span {
        Span { from: self.position, to: self.position + (self.whole >> level) }
    }

    fn all(&self) -> Span {
        Span { from: 0, to: self.whole }
    }

    fn list(&mut self, span: Span, result: &Result<StepHistory, StepError>, spent: Spent) {
        let end = match result {
            Ok(h) if h.converged() => AttemptEnd::Converged,
            Ok(_) => AttemptEnd::NotConverged,
            Err(e) => AttemptEnd::Failed(e.to_string()),
        };
        let part = (self.part(span.from), self.part(span.to));
        let Spent { iterations, linear_solves, .. } = spent;
        self.attempts.push(Attempt { path: self.path, part, iterations, linear_solves, end });
    }

    /// A part is done; its history tells of the parts before, too.
    fn pass(&mut self, span: Span, mut history: StepHistory) -> StepHistory {
        self.position = span.to;
        self.turns += history.turns;
        history.turns = self.turns;
        self.displaced |= history.displaced;
        history.displaced = self.displaced;
        history
    }

    /// Keeps an attempt at the whole step that came to nothing.
    fn keep_whole(&mut self, span: Span, failed: Result<StepHistory, StepError>, u: &[f64]) {
        if span.from == 0 && span.to == self.whole {
            self.failed_whole = Some((failed, u.to_vec()));
        }
    }

    /// A number of smallest parts as a part of the step.
    fn part(&self, at: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "powers of two up to 2^30")]
        return at as f64 / self.whole as f64;
    }

    fn target(&self, span: Span) -> Target<'_> {
        let leg = self.leg;
        let Some(from) = leg.from else {
            let load = if span.to == self.whole { None } else { self.load.as_ref() };
            let load = load.map(|l| (l, self.part(span.to)));
            return Target { time: leg.to, increment: leg.first_increment, load, iterations: usize::MAX };
        };
        let at = |k: u64| match k {
            0 => from,
            k if k == self.whole => leg.to,
            k => from + self.part(k) * (leg.to - from),
        };
        let increment = (self.part(span.to) - self.part(span.from)) * leg.increment(from);
        Target { time: at(span.to), increment, load: None, iterations: usize::MAX }
    }
}
