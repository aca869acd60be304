//! A step that is listed, in as many parts as Newton needs.
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

use wfl_discrete::{
    system::{FIXED, Form, System},
    window::Window,
};
use wfl_newton::{Spent, StepHistory};
use wfl_problem::Solving;

use super::{
    Attempt, AttemptEnd, Clock, Path, Progress,
    requests::StepRequest,
    state::Snapshot,
    stepping::{Integrator, LoadStart, Making, Reached, StepError, Stepper, Target},
    trajectory::Passed,
};

/// Converged parts in a row after which the increment doubles.
const EASY_PARTS: u32 = 2;

/// Iterations of a step in attempts that come to nothing, in units of the most iterations of one attempt (`max_iter`),
/// after which no smaller part is tried. The steps of `docs/newton.md` take none.
pub const FRUITLESS: usize = 10;

/// Steps that are listed: how large their parts may be, as the last ones have shown.
#[derive(Clone, Copy, Default)]
pub(super) struct Listed {
    /// The present increment is 2^-level of a step.
    pub(super) level: u32,
    /// Parts of this size that converged in a row.
    pub(super) easy: u32,
}

impl Integrator for Listed {
    fn advance(&mut self, making: Making<'_, '_>, request: StepRequest) -> Result<Reached, StepError> {
        let Making { stepper, scene, u, clock, progress } = making;
        let mut parts = Parts::new(request, if scene.system.is_linear() { 0 } else { scene.steps.halve });
        let (before, mut start) = (*self, stepper.snapshot(scene, u));
        self.level = self.level.min(parts.halve);
        // behind the parts that have passed
        let mut passed: Option<Snapshot> = None;
        loop {
            let span = parts.next(self.level);
            let target = parts.target(span);
            let window = target.window;
            let result = stepper.attempt(scene, u, &target, clock, progress);
            parts.list(span, &result, stepper.spent);
            match result {
                Ok(history) if history.converged() => {
                    let history = parts.pass(span, history);
                    self.grow(parts.whole, parts.position);
                    if parts.position == parts.whole {
                        return Ok(self.reached(parts, history, window));
                    }
                    if parts.path == Path::Steps {
                        stepper.keep_sums(&mut start);
                        stepper.slide(scene, u);
                        stepper.keep_passed(scene, window, u, Passed::Part);
                        stepper.leave(scene, window, u)?;
                        scene.system.end_step(u);
                    }
                    passed = Some(stepper.snapshot(scene, u));
                }
                Err(StepError::Newton(error)) if error.ends_the_run() => {
                    // nothing is left of a step that is ended from outside: it can be asked for again
                    stepper.go_back(scene, u, &start);
                    *self = before;
                    return Err(error.into());
                }
                failed => {
                    parts.keep_whole(span, failed, u);
                    stepper.go_back(scene, u, passed.as_ref().unwrap_or(&start));
                    if !self.halves(&mut parts, scene, u, stepper.spent) {
                        stepper.go_back(scene, u, &start);
                        self.level = 0;
                        let (history, window) = parts.give_up(stepper, scene, u, clock, progress)?;
                        return Ok(self.reached(parts, history, window));
                    }
                }
            }
        }
    }
}

impl Listed {
    /// Halves the increment after an attempt that came to nothing; false where that is not to be tried.
    fn halves(&mut self, parts: &mut Parts, scene: &Solving<'_>, u: &[f64], spent: Spent) -> bool {
        if parts.path == Path::Load && parts.load.is_none() {
            parts.load = load_start(scene.system, u);
        }
        parts.fruitless += spent.iterations;
        let patient = parts.fruitless <= FRUITLESS * scene.newton.max_iterations;
        if !patient || self.level == parts.halve || (parts.path == Path::Load && parts.load.is_none()) {
            return false;
        }
        self.level += 1;
        self.easy = 0;
        true
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

    fn reached(&mut self, parts: Parts, history: StepHistory, window: Window) -> Reached {
        if parts.path == Path::Load {
            // parts of a load say nothing about increments of the step variable
            *self = Self::default();
        }
        Reached { history, window, attempts: parts.attempts, branches: None }
    }
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

/// A part of a step, in units of the smallest one that is allowed: whole numbers, of which [`Parts::target`] makes its window.
#[derive(Clone, Copy)]
struct Span {
    from: u64,
    to: u64,
}

/// A step on its way through its parts.
struct Parts {
    request: StepRequest,
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
    fn new(request: StepRequest, halve: u32) -> Self {
        Self {
            request,
            path: if request.from.is_some() { Path::Steps } else { Path::Load },
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

    /// The attempt at the whole step is what is told of a step that was not solved.
    fn give_up(
        &mut self,
        stepper: &mut Stepper,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<(StepHistory, Window), StepError> {
        let failed = self.failed_whole.take();
        let target = self.target(self.all());
        let window = target.window;
        let (result, state) = match failed {
            Some(failed) => failed,
            None => {
                let result = stepper.attempt(scene, u, &target, clock, progress);
                self.list(self.all(), &result, stepper.spent);
                (result, u.to_vec())
            }
        };
        u.copy_from_slice(&state);
        scene.system.begin_rates(window.increment);
        Ok((result?, window))
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

    /// The target of an attempt at some of it; what an attempt at all of it ends with gets its reason.
    fn target(&self, span: Span) -> Target<'_> {
        let explains = span.to - span.from == self.whole;
        let StepRequest { from, window, .. } = self.request;
        let Some(from) = from else {
            let load = if span.to == self.whole { None } else { self.load.as_ref() };
            let load = load.map(|l| (l, self.part(span.to)));
            return Target { window, load, iterations: usize::MAX, explains };
        };
        let is_last = span.to == self.whole;
        let end = if is_last { window.end } else { from + self.part(span.to) * (window.end - from) };
        let increment = (self.part(span.to) - self.part(span.from)) * window.increment;
        Target { window: Window::new(end, increment), load: None, iterations: usize::MAX, explains }
    }
}
