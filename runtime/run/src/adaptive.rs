//! A step that the run chooses: as long as the error allows.
//!
//! An attempt that comes to nothing, or whose error is too large, leaves unknowns, states and contact as they were, and a
//! shorter one follows. The extrapolation of earlier solutions is the first guess; where Newton finds nothing from there,
//! it starts once more from the last solution. Promises: every attempt is listed; after an error unknowns and memory are
//! those of the step before. Does not write anything.

use wfl_checks::{Solved, uncertainty_of_unknowns};
use wfl_discrete::{
    rates::Rates,
    system::{Branches, FIXED, Form},
    window::Window,
};
use wfl_newton::{Spent, StepHistory};
use wfl_problem::{Scene, Solving, TablesOf};

use super::{
    Attempt, AttemptEnd, Path,
    control::{Control, Matrix},
    gained::Gained,
    lagging::lag,
    remembered::{Adaptive, Estimate, Lag, joined},
    requests::StepRequest,
    stepping::{Integrator, Making, Reached, StepError, Stepper, Target},
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

/// The order with which energy is gained or lost: where contact begins within a step that grows as the square of its length, in the
/// damping of BDF2 as the fourth power.
const OF_ENERGY: usize = 2;

/// The order of a method whose error grows as the square of the length of a step, as that of a lag counts.
const OF_LAG: usize = 1;

/// How an attempt at a step ended.
enum Tried {
    /// With the relative error, where it is too large and the increment cannot be smaller.
    Accepted(StepHistory, Option<f64>),
    Rejected(f64),
    Nothing(Result<StepHistory, StepError>, Vec<f64>),
}

impl Integrator for Adaptive {
    /// The caller takes over the states and then calls [`Adaptive::add`].
    fn advance(&mut self, making: Making<'_, '_>, request: StepRequest) -> Result<Reached, StepError> {
        let Making { stepper, scene, u, clock, progress } = making;
        let Scene { steps, tables, .. } = scene.scene;
        let rules = steps.auto.as_ref().expect("steps that the run chooses");
        let (at, stop) = (request.from.expect("a step behind another one"), request.window.end);
        let limit = request.limit.min(self.driven(tables, at, stop));
        if tables.corners.contains(&at) {
            self.turn(rules);
            scene.system.rates_mut().into_iter().for_each(Rates::turn);
        }
        if self.gained.is_none() {
            self.gained = Gained::start(scene, Window::instant(at), u)?;
        }
        let before = stepper.snapshot(scene, u);
        let (mut attempts, mut guess, mut fruitless, mut singular) = (Vec::new(), true, 0, 0);
        let most_singular = if self.past.solutions.is_empty() { SINGULAR_AT_FIRST } else { SINGULAR };
        loop {
            let to = self.control.aim(rules, at, stop, limit);
            let (window, increment) = (Window::new(to, to - at), to - at);
            let guessed = guess && self.guess(scene, increment, u);
            // without a shorter step to go to it is worth every iteration
            let is_last = fruitless >= SHORTER || Control::is_least(rules, at, increment);
            let iterations = if is_last { usize::MAX } else { FEW };
            let target = Target { window, load: None, iterations, explains: false };
            scene.system.rates_mut().into_iter().for_each(|rates| rates.take_order(self.control.order as usize));
            let result = stepper.attempt(scene, u, &target, clock, progress);
            let tried = self.judge(stepper, scene, increment, result, u);
            attempts.push(listed(&tried, increment, stepper.spent));
            let failed = match tried {
                Tried::Accepted(history, _) => return Ok(taken(history, window, attempts)),
                Tried::Rejected(_) => None,
                Tried::Nothing(result, state) => {
                    singular += usize::from(!guessed && is_singular(&result));
                    let ends = !guessed && (singular >= most_singular || Control::is_least(rules, at, increment));
                    // while the tangent is that of this attempt
                    let reason = |error| stepper.with_reason(scene, error, &state);
                    let result = if ends { result.map_err(reason) } else { result };
                    Some((result, state, ends))
                }
            };
            stepper.go_back(scene, u, &before);
            guess = true;
            let Some((result, state, ends)) = failed else { continue };
            fruitless += 1;
            match result {
                Err(StepError::Newton(error)) if error.ends_the_run() => return Err(error.into()),
                _ if guessed => guess = false,
                result if ends => {
                    u.copy_from_slice(&state);
                    return result.map(|history| taken(history, window, attempts));
                }
                _ => self.control.fail(increment),
            }
        }
    }
}

impl Adaptive {
    /// The increment that leaves out nothing of what drives a scene; infinite where that is more than the next one.
    fn driven(&self, tables: &TablesOf, at: f64, stop: f64) -> f64 {
        let to = stop.min(at + self.control.next);
        let reached = tables.forcing.reach(at, to);
        if reached < to { reached - at } else { f64::INFINITY }
    }

    /// Writes what is expected into the free unknowns; false where nothing is known of the past.
    fn guess(&self, scene: &Solving<'_>, increment: f64, u: &mut [f64]) -> bool {
        let Some(mut expected) = self.expected(scene, increment) else { return false };
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

    /// Whether a solution is one that the rules allow, which the next increment follows from.
    fn judge(
        &mut self,
        stepper: &mut Stepper,
        scene: &mut Solving<'_>,
        increment: f64,
        result: Result<StepHistory, StepError>,
        u: &[f64],
    ) -> Tried {
        let history = match result {
            Ok(history) if history.converged() => history,
            nothing => return Tried::Nothing(nothing, u.to_vec()),
        };
        let rules = scene.scene.steps.auto.as_ref().expect("steps that the run chooses");
        let mut end = u.to_vec();
        if let (Some(rates), Some(past)) = (scene.system.rates(), scene.system.past()) {
            rates.extrapolate(&mut end, &past.unknowns);
        }
        let solution = joined(&end, stepper.next_states.iter().map(Vec::as_slice));
        let estimate = self.estimate(stepper, scene, increment, &history, [&solution, u]);
        let (mut errors, of_fields) = estimate.map(|e| (e.errors, [e.excused, e.missed])).unzip();
        if let Some((errors, unknowns)) = errors.as_mut().zip(lag(stepper, scene, u)) {
            let left = scene.scene.steps.last() - scene.system.step().end;
            errors.count(self.of_lag(scene, rules, &solution, &Lag { unknowns, increment, left }), OF_LAG);
        }
        let held = errors.map_or(0.0, |e| e.largest());
        let behind = match self.gained.as_ref().map(|gained| gained.behind(scene, &end, rules.error)).transpose() {
            Ok(behind) => behind,
            // between two states there may be none for a law: a logarithm of what is negative there
            Err(error) => return Tried::Nothing(Err(error.into()), u.to_vec()),
        };
        let part = behind.as_ref().map_or(0.0, |(_, part)| *part);
        errors.iter_mut().for_each(|errors| errors.count(part / rules.error, OF_ENERGY));
        let least = Control::is_least(rules, scene.system.step().start(), increment);
        let matrix = if scene.system.bulk_follows_steps() { Matrix::Kept } else { Matrix::New };
        // an error that is no number is too large
        let too_large = errors.filter(|e| e.largest() > 1.0 || e.largest().is_nan());
        match too_large {
            Some(errors) if !least => {
                self.control.reject(increment, errors);
                Tried::Rejected(errors.largest())
            }
            _ => {
                self.control.accept(increment, errors, matrix);
                let [excused, missed] = of_fields.unwrap_or_default();
                self.uncertainty.taken(held, &excused, &missed);
                self.leave(scene, &history);
                self.gained = behind.map(|(gained, _)| gained);
                Tried::Accepted(history, too_large.map(|e| e.largest()))
            }
        }
    }

    /// The estimated errors of a solution at `u`, without what rounding and the tolerance of Newton's method may have made of them.
    fn estimate(
        &mut self,
        stepper: &mut Stepper,
        scene: &Solving<'_>,
        increment: f64,
        history: &StepHistory,
        [solution, u]: [&[f64]; 2],
    ) -> Option<Estimate> {
        let rules = scene.scene.steps.auto.as_ref().expect("steps that the run chooses");
        let largest = |estimate: &Option<Estimate>| estimate.as_ref().map_or(0.0, |e| e.errors.largest());
        let estimate = self.errors(scene, rules, increment, solution, &[]);
        let found = largest(&estimate);
        if !self.uncertainty.is_asked(found) {
            return estimate;
        }
        // where no system was solved, the factor at hand is of an earlier state, and a resumed run has none
        let solved = !history.solves.is_empty();
        let left = self.left_over();
        let own = if solved { rounding(stepper, scene, u, left) } else { Some(vec![0.0; u.len()]) };
        // a field that is zero but for rounding has no error to be made smaller
        let own = own.map(|own| with_states(own, stepper, scene, [&self.start, u])).unwrap_or_default();
        let own = self.uncertain(scene, rules, &own);
        let estimate = self.errors(scene, rules, increment, solution, &own);
        self.uncertainty.explains = largest(&estimate) < found;
        estimate
    }
}

/// The part of their change since the start by which unknowns are moved to see the rounding of states: far above rounding, far below any
/// error that is demanded.
const MOVED: f64 = 1e-12;
/// The least by which they are moved, in units of the rounding of their values: a part of one may be none.
const UNITS: f64 = 16.0;
/// How often they are moved, each time by another part: rounding is zero by chance.
const MOVES: [f64; 3] = [1.0, -0.61, 1.37];

/// By dof what rounding may change of the unknowns at `u`, and a residual of the part `left` of the forces.
fn rounding(stepper: &mut Stepper, scene: &Solving<'_>, u: &[f64], left: f64) -> Option<Vec<f64>> {
    let system = &scene.system;
    let residual = system.residual(u, &Form { linear: stepper.linear, ..Form::AS_WRITTEN }).ok()?;
    let (solver, tangent) = (stepper.solver.as_mut()?, stepper.tangent.as_mut()?);
    // that at hand is of the iterate before, where a point may have stuck that slides now
    system.tangent(u, Branches::AsWritten, tangent).ok()?;
    solver.update(system, tangent, true).ok()?;
    let state = Solved { system, contact: scene.contact, tangent, u, residual: &residual };
    uncertainty_of_unknowns(state, solver, left)
}

/// That with the same of the states behind it, which follow from the unknowns: one that is a difference of unknowns may be
/// nothing but their rounding. The run started from `start`.
fn with_states(rounding: Vec<f64>, stepper: &Stepper, scene: &Solving<'_>, [start, u]: [&[f64]; 2]) -> Vec<f64> {
    let system = &scene.system;
    let mut all = rounding;
    let mut of_states = vec![0.0f64; stepper.next_states.iter().map(Vec::len).sum()];
    let moves = if of_states.is_empty() { &[][..] } else { &MOVES };
    for part in moves.iter().copied() {
        let by = |d: usize| if d.is_multiple_of(2) { part } else { -part };
        let least = |d: usize| (MOVED * (u[d] - start[d]).abs()).max(UNITS * f64::EPSILON * u[d].abs());
        let moved: Vec<f64> = (0..u.len()).map(|d| u[d] + by(d) * all[d].max(least(d))).collect();
        let next = scene.scene.states.iter().flat_map(|state| state.next(system, system.step(), &moved));
        for (largest, (a, b)) in of_states.iter_mut().zip(next.zip(stepper.next_states.iter().flatten())) {
            *largest = largest.max((a - b).abs());
        }
    }
    all.extend(of_states);
    all
}

fn listed(tried: &Tried, increment: f64, spent: Spent) -> Attempt {
    let end = match tried {
        Tried::Accepted(_, None) => AttemptEnd::Converged,
        Tried::Accepted(_, Some(error)) => AttemptEnd::Forced(*error),
        Tried::Rejected(error) => AttemptEnd::Rejected(*error),
        Tried::Nothing(Ok(_), _) => AttemptEnd::NotConverged,
        Tried::Nothing(Err(e), _) => AttemptEnd::Failed(e.to_string()),
    };
    let Spent { iterations, linear_solves, .. } = spent;
    Attempt { path: Path::Chosen, part: (0.0, increment), iterations, linear_solves, end }
}

/// True if an attempt ended with a singular tangent.
fn is_singular(result: &Result<StepHistory, StepError>) -> bool {
    matches!(result, Err(StepError::Newton(error)) if error.is_singular())
}

/// A step that ends here; ends of attempts are in units of its increment.
fn taken(history: StepHistory, window: Window, mut attempts: Vec<Attempt>) -> Reached {
    attempts.iter_mut().for_each(|a| a.part.1 /= window.increment);
    Reached { history, window, attempts, branches: None }
}
