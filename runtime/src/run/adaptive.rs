//! A step that the run chooses: as long as the error allows.
//!
//! An attempt that comes to nothing, or whose error is too large, leaves unknowns, states and contact as they were, and a
//! shorter one follows. The extrapolation of earlier solutions is the first guess; where Newton finds nothing from there,
//! it starts once more from the last solution. Promises: every attempt is listed; after an error unknowns and memory are
//! those of the step before. Does not write anything.

use super::{
    Attempt, AttemptEnd, Clock, Path, Progress,
    control::Control,
    remembered::{Adaptive, joined},
    stepping::{self, Leg, Reached, StepError, Stepper, Target},
};
use crate::{
    newton::StepHistory,
    rates::Rates,
    scene::{Auto, Scene},
    system::FIXED,
};

/// Iterations after which a shorter step is tried, where one may help. Steps of an earthquake cycle take 2; of those that
/// were four times too long some took 1500 and found nothing (`examples/friction/bp1.wfl` with n=2 tol=1e-3 years=300).
const FEW: usize = 20;
/// So many attempts of a step may come to nothing before the whole schedule of Newton's method is gone through: then it is
/// not its length.
const SHORTER: usize = 4;

/// Where a step begins, and where it ends at the latest.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    pub(super) at: f64,
    pub(super) stop: f64,
    /// Of the increment, behind the state at its beginning.
    pub(super) limit: f64,
}

/// How an attempt at a step ended.
enum Tried {
    /// With the relative error, where it is too large and the increment cannot be smaller.
    Accepted(StepHistory, Option<f64>),
    Rejected(f64),
    Nothing(Result<StepHistory, StepError>, Vec<f64>),
}

impl Stepper {
    /// Solves the next step; `u` holds the state before and then the one after. The caller takes over the states and then
    /// calls [`Self::remember`].
    pub(super) fn advance(
        &mut self,
        scene: &mut Scene,
        u: &mut [f64],
        reach: Reach,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
        let rules = scene.steps.auto.clone().expect("steps that the run chooses");
        let Reach { at, stop, limit } = reach;
        stepping::begin(scene, Leg { from: Some(at), to: stop, first_increment: rules.first }, u)?;
        if scene.tables.corners.contains(&at) {
            self.adaptive(&rules).turn(&rules);
            scene.system.known.rates.iter_mut().for_each(Rates::turn);
        }
        let known_before = scene.system.known.clone();
        let (mut attempts, mut guess, mut fruitless) = (Vec::new(), true, 0);
        loop {
            let to = self.adaptive(&rules).control.aim(&rules, at, stop, limit);
            let increment = to - at;
            let before = (u.to_vec(), self.memory(scene));
            let guessed = guess && self.guess(scene, &rules, increment, u);
            let target = Target { time: to, increment, load: None };
            let patient = fruitless >= SHORTER || Control::is_least(&rules, at, increment);
            let result = self.attempt_within(patient, scene, u, &target, clock, progress);
            let tried = self.judge(scene, &rules, increment, result, u);
            attempts.push(self.listed(&tried, increment));
            let failed = match tried {
                Tried::Accepted(history, _) => {
                    parts_of(&mut attempts, increment);
                    return Ok(Reached { history, time: to, increment, attempts });
                }
                Tried::Rejected(_) => None,
                Tried::Nothing(result, state) => Some((result, state)),
            };
            u.copy_from_slice(&before.0);
            let known = self.recall(scene, &before.1);
            debug_assert!(known, "the memory is that of this system");
            guess = true;
            let Some((result, state)) = failed else { continue };
            fruitless += 1;
            match result {
                Err(StepError::Newton(error)) if error.ends_the_run() => {
                    scene.system.known = known_before;
                    return Err(error.into());
                }
                _ if guessed => guess = false,
                result if Control::is_least(&rules, at, increment) => {
                    scene.system.known = known_before;
                    u.copy_from_slice(&state);
                    parts_of(&mut attempts, increment);
                    return result.map(|history| Reached { history, time: to, increment, attempts });
                }
                _ => self.adaptive(&rules).control.fail(increment),
            }
        }
    }

    /// One attempt with the present order; one that is not patient ends after a few iterations.
    fn attempt_within(
        &mut self,
        patient: bool,
        scene: &mut Scene,
        u: &mut [f64],
        target: &Target<'_>,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<StepHistory, StepError> {
        if let (Some(rates), Some(adaptive)) = (&mut scene.system.known.rates, &self.adaptive) {
            rates.take_order(adaptive.control.order as usize);
        }
        let most = scene.newton.max_iterations;
        scene.newton.max_iterations = if patient { most } else { most.min(FEW) };
        let result = self.attempt(scene, u, target, clock, progress);
        scene.newton.max_iterations = most;
        result
    }

    fn adaptive(&mut self, rules: &Auto) -> &mut Adaptive {
        self.adaptive.get_or_insert_with(|| Adaptive::new(rules))
    }

    /// Writes what is expected into the free unknowns; false where nothing is known of the past.
    fn guess(&mut self, scene: &Scene, rules: &Auto, increment: f64, u: &mut [f64]) -> bool {
        let Some(mut expected) = self.adaptive(rules).expected(scene, increment) else { return false };
        let known = &scene.system.known;
        if let (Some(rates), Some(past)) = (&known.rates, &known.previous) {
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
        scene: &Scene,
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
        let known = &scene.system.known;
        if let (Some(rates), Some(past)) = (&known.rates, &known.previous) {
            rates.extrapolate(&mut end, &past.unknowns);
        }
        let solution = joined(&end, self.next_states.iter().map(Vec::as_slice));
        let errors = self.adaptive(rules).errors(scene, rules, increment, &solution);
        let least = Control::is_least(rules, scene.system.step().0 - increment, increment);
        let keeps = scene.system.bulk_follows_steps();
        let control = &mut self.adaptive(rules).control;
        // an error that is no number is too large
        let too_large = errors.filter(|e| e.largest() > 1.0 || e.largest().is_nan());
        match too_large {
            Some(errors) if !least => {
                control.reject(increment, errors);
                Tried::Rejected(errors.largest())
            }
            _ => {
                control.accept(increment, errors, keeps);
                Tried::Accepted(history, too_large.map(|e| e.largest()))
            }
        }
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
    pub(super) fn remember(&mut self, scene: &Scene, increment: f64, u: &[f64]) {
        if let Some(rules) = &scene.steps.auto {
            self.adaptive(rules).add(scene, rules, increment, u);
        }
    }
}

/// Ends of attempts in units of the increment that was taken at last.
fn parts_of(attempts: &mut [Attempt], taken: f64) {
    attempts.iter_mut().for_each(|a| a.part.1 /= taken);
}
