//! A step that the run chooses: as long as the error allows.
//!
//! An attempt that comes to nothing, or whose error is too large, leaves unknowns, states and contact as they were, and a
//! shorter one follows. The extrapolation of earlier solutions is the first guess; where Newton finds nothing from there,
//! it starts once more from the last solution. Promises: every attempt is listed; after an error unknowns and memory are
//! those of the step before. Does not write anything.

use super::{
    Attempt, AttemptEnd, Clock, Path, Progress,
    control::{Control, Matrix},
    remembered::{Adaptive, joined},
    requests::StepRequest,
    stepping::{self, Reached, StepError, Stepper, Target},
};
use crate::{
    checks::{Solved, rounding_of_unknowns},
    newton::StepHistory,
    rates::Rates,
    scene::{Auto, Solving},
    system::{FIXED, Form},
    window::Window,
};

/// Iterations after which a shorter step is tried, where one may help. Steps of an earthquake cycle take 2; of those that
/// were four times too long some took 1500 and found nothing (`examples/friction/bp1.wfl` with n=2 tol=1e-3 years=300).
const FEW: usize = 20;
/// So many attempts of a step may come to nothing before the whole schedule of Newton's method is gone through: then it is
/// not its length.
const SHORTER: usize = 4;

/// So many attempts may end with a singular tangent before the step is given up: a body that nothing holds is held by no
/// shorter step. Two where nothing was solved yet.
const SINGULAR: usize = 4;
const SINGULAR_AT_FIRST: usize = 2;

/// How an attempt at a step ended.
enum Tried {
    /// With the relative error, where it is too large and the increment cannot be smaller.
    Accepted(StepHistory, Option<f64>),
    Rejected(f64),
    Nothing(Result<StepHistory, StepError>, Vec<f64>),
}

impl Stepper {
    /// Solves the next step, at most as far as it is requested and not longer than `limit`; `u` holds the state before and then
    /// the one after. The caller takes over the states and then calls [`Self::remember`].
    pub(super) fn advance(
        &mut self,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        request: StepRequest,
        limit: f64,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
        let rules = scene.steps.auto.clone().expect("steps that the run chooses");
        let (at, stop) = (request.from.expect("a step behind another one"), request.window.end);
        stepping::begin(scene, request, u)?;
        if scene.tables.corners.contains(&at) {
            self.adaptive(&rules).turn(&rules);
            scene.system.rates_mut().into_iter().for_each(Rates::turn);
        }
        let before = self.snapshot(scene, u);
        let (mut attempts, mut guess, mut fruitless, mut singular) = (Vec::new(), true, 0, 0);
        let most_singular = if self.adaptive(&rules).past.solutions.is_empty() { SINGULAR_AT_FIRST } else { SINGULAR };
        loop {
            let to = self.adaptive(&rules).control.aim(&rules, at, stop, limit);
            let window = Window::new(to, to - at);
            let increment = window.increment;
            let guessed = guess && self.guess(scene, &rules, increment, u);
            // without a shorter step to go to it is worth every iteration
            let is_last = fruitless >= SHORTER || Control::is_least(&rules, at, increment);
            let iterations = if is_last { usize::MAX } else { FEW };
            let target = Target { window, load: None, iterations };
            let result = self.attempt_with_order(scene, u, &target, clock, progress);
            let tried = self.judge(scene, &rules, increment, result, u);
            attempts.push(self.listed(&tried, increment));
            let failed = match tried {
                Tried::Accepted(history, _) => return Ok(taken(history, window, attempts)),
                Tried::Rejected(_) => None,
                Tried::Nothing(result, state) => {
                    singular += usize::from(!guessed && is_singular(&result));
                    let ends = !guessed && (singular >= most_singular || Control::is_least(&rules, at, increment));
                    // while the tangent is that of this attempt
                    let result = if ends { self.with_reason(scene, result, &state) } else { result };
                    Some((result, state, ends))
                }
            };
            self.go_back(scene, u, &before);
            guess = true;
            let Some((result, state, ends)) = failed else { continue };
            fruitless += 1;
            match result {
                Err(StepError::Newton(error)) if error.ends_the_run() => {
                    return Err(error.into());
                }
                _ if guessed => guess = false,
                result if ends => {
                    u.copy_from_slice(&state);
                    return result.map(|history| taken(history, window, attempts));
                }
                _ => self.adaptive(&rules).control.fail(increment),
            }
        }
    }

    /// The end of an attempt, with its reason where that is an error of the linear solver.
    fn with_reason(
        &self,
        scene: &Solving<'_>,
        result: Result<StepHistory, StepError>,
        state: &[f64],
    ) -> Result<StepHistory, StepError> {
        result.map_err(|error| match error {
            StepError::Newton(error) => self.explained(scene, error, state).into(),
            other => other,
        })
    }

    /// One attempt with the present order.
    fn attempt_with_order(
        &mut self,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        target: &Target<'_>,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<StepHistory, StepError> {
        if let (Some(rates), Some(adaptive)) = (scene.system.rates_mut(), &self.adaptive) {
            rates.take_order(adaptive.control.order as usize);
        }
        self.explains = false;
        self.attempt(scene, u, target, clock, progress)
    }

    /// The increment that leaves out nothing of what drives a scene; infinite where that is more than the next one.
    pub(super) fn driven(&mut self, scene: &Solving<'_>, at: f64, stop: f64) -> f64 {
        let Some(rules) = &scene.steps.auto else { return f64::INFINITY };
        let to = stop.min(at + self.adaptive(rules).control.next);
        let reached = scene.tables.forcing.reach(at, to);
        if reached < to { reached - at } else { f64::INFINITY }
    }

    fn adaptive(&mut self, rules: &Auto) -> &mut Adaptive {
        self.adaptive.get_or_insert_with(|| Adaptive::new(rules))
    }

    /// Writes what is expected into the free unknowns; false where nothing is known of the past.
    fn guess(&mut self, scene: &Solving<'_>, rules: &Auto, increment: f64, u: &mut [f64]) -> bool {
        let Some(mut expected) = self.adaptive(rules).expected(scene, increment) else { return false };
        if let (Some(rates), Some(past)) = (scene.system.rates(), scene.system.past()) {
            rates.draw_back(&mut expected, &past.unknowns);
        }
        let free = &scene.system.numbering.free;
        for (value, (expected, _)) in u.iter_mut().zip(expected.iter().zip(free)).filter(|(_, (_, f))| **f != FIXED) {
            *value = *expected;
        }
        scene.system.numbering.follow(u);
        true
    }

    fn judge(
        &mut self,
        scene: &Solving<'_>,
        rules: &Auto,
        increment: f64,
        result: Result<StepHistory, StepError>,
        u: &[f64],
    ) -> Tried {
        let history = match result {
            Ok(history) if history.converged() => history,
            nothing => return Tried::Nothing(nothing, u.to_vec()),
        };
        let mut end = u.to_vec();
        if let (Some(rates), Some(past)) = (scene.system.rates(), scene.system.past()) {
            rates.extrapolate(&mut end, &past.unknowns);
        }
        let solution = joined(&end, self.next_states.iter().map(Vec::as_slice));
        let mut errors = self.adaptive(rules).errors(scene, rules, increment, &solution, &[]);
        // where no system was solved, the factor at hand is of an earlier state, and a resumed run has none
        if errors.is_some_and(|e| e.largest() > 1.0) && !history.solves.is_empty() {
            // a field that is zero but for rounding has no error to be made smaller
            let rounding = self.rounding(scene, u).unwrap_or_default();
            errors = self.adaptive(rules).errors(scene, rules, increment, &solution, &rounding);
        }
        let least = Control::is_least(rules, scene.system.step().start(), increment);
        let matrix = if scene.system.bulk_follows_steps() { Matrix::Kept } else { Matrix::New };
        let control = &mut self.adaptive(rules).control;
        // an error that is no number is too large
        let too_large = errors.filter(|e| e.largest() > 1.0 || e.largest().is_nan());
        match too_large {
            Some(errors) if !least => {
                control.reject(increment, errors);
                Tried::Rejected(errors.largest())
            }
            _ => {
                control.accept(increment, errors, matrix);
                Tried::Accepted(history, too_large.map(|e| e.largest()))
            }
        }
    }

    /// By dof what rounding may change of the unknowns at `u`.
    fn rounding(&mut self, scene: &Solving<'_>, u: &[f64]) -> Option<Vec<f64>> {
        let system = &scene.system;
        let residual = system.residual(u, &Form { linear: self.linear, ..Form::AS_WRITTEN }).ok()?;
        let (solver, tangent) = (self.solver.as_mut()?, self.tangent.as_ref()?);
        let state = Solved { system, contact: scene.contact, tangent, u, residual: &residual };
        rounding_of_unknowns(state, solver)
    }

    fn listed(&self, tried: &Tried, increment: f64) -> Attempt {
        let end = match tried {
            Tried::Accepted(_, None) => AttemptEnd::Converged,
            Tried::Accepted(_, Some(error)) => AttemptEnd::Forced(*error),
            Tried::Rejected(error) => AttemptEnd::Rejected(*error),
            Tried::Nothing(Ok(_), _) => AttemptEnd::NotConverged,
            Tried::Nothing(Err(e), _) => AttemptEnd::Failed(e.to_string()),
        };
        let (iterations, linear_solves) = (self.spent.iterations, self.spent.linear_solves);
        Attempt { path: Path::Chosen, part: (0.0, increment), iterations, linear_solves, end }
    }

    /// Takes the end of a step, with its states, as what later ones are expected from.
    pub(super) fn remember(&mut self, scene: &Solving<'_>, increment: f64, u: &[f64]) {
        if let Some(rules) = &scene.steps.auto {
            self.adaptive(rules).add(scene, rules, increment, u);
        }
    }
}

/// True if an attempt ended with a singular tangent.
fn is_singular(result: &Result<StepHistory, StepError>) -> bool {
    matches!(result, Err(StepError::Newton(error)) if error.is_singular())
}

/// A step that ends here; ends of attempts are in units of its increment.
fn taken(history: StepHistory, window: Window, mut attempts: Vec<Attempt>) -> Reached {
    attempts.iter_mut().for_each(|a| a.part.1 /= window.increment);
    Reached { history, window, attempts }
}
