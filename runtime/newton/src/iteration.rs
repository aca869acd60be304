//! The iterations of one attempt at a step.

mod ending;

use super::{
    Evaluated, LARGEST_TOLERANCE, LoadStep, Method, NewtonError, StepHistory, Stop,
    began::Began,
    downhill::Downhill,
    hold::Hold,
    inexact::Inexact,
    initial_guess::Predicted,
    line_search::LineSearch,
    load_step::{Done, LARGEST_FORCING, Measured, Norm},
    path_following::Path,
    schedule::{ALL_OF_STIFFNESS, BUDGET_OF_PATHS, Schedule},
    swallowed,
};
use wfl_contact::Contact;
use wfl_discrete::system::LinearTerms;
use wfl_sparse::solve::SolveError;

/// What a linear solve may leave: part of the residual to come, and part of the tolerance (forcing terms, Eisenstat and
/// Walker 1996).
const OF_THE_NEXT: f64 = 0.1;
const OF_THE_TOLERANCE: f64 = 1e-3;

/// How many iterations go on from states that hide more: as many as a line search takes to leave a slope that is a million
/// times too steep, and Newton's method behind it.
const DOUBTS: usize = 30;

/// How many iterations may be made with a body held that the tangent leaves loose: what holds it may close in each of the first ones,
/// one after another, and a body that nothing holds is told after as many.
const HELD: usize = 4;

/// Where an attempt is.
struct Attempt<'u> {
    u: &'u mut [f64],
    /// The state that it began with.
    start: Vec<f64>,
    /// By field its largest unknown there, with those of its group.
    largest: Vec<f64>,
    here: Measured,
    norm: Norm,
    schedule: Schedule,
    /// The path that is followed, in stages that follow one, and the way downhill in those that go there.
    path: Option<Path>,
    downhill: Downhill,
    /// The best state so far, with its relative residual.
    best: (f64, Vec<f64>),
    direction: Vec<f64>,
    history: StepHistory,
    /// Why the first tangent was singular where contact was open at some points, and contact as it was.
    not_held: Option<(NewtonError, Contact)>,
    /// Of the states whose residual counts as rounding and is much of the forces the one that hides least, with that part, and
    /// the iterations that went on from the first one.
    doubtful: Option<(f64, Vec<f64>)>,
    doubts: usize,
    /// Of the states from which a correction was lost the one that hides least: if nothing better is found it is what there is.
    lost: Option<(f64, Vec<f64>)>,
    /// Each method has met a singular tangent on its way.
    ended: bool,
    /// Iterations that held what the first tangent left loose, why it was singular with contact as it was, and what the next one
    /// holds.
    held: usize,
    loose: Option<(NewtonError, Contact, bool)>,
    holds: Option<Hold>,
}

/// Solves a step from `u`, or from `predicted` where that is better.
pub(super) fn iterate(
    step: &mut LoadStep<'_>,
    u: &mut [f64],
    predicted: Option<&Predicted>,
) -> Result<StepHistory, NewtonError> {
    (step.linear, step.reached) = (LinearTerms::ByMatrix, None);
    step.contact.set_overstress(0.0);
    step.contact.set_softness(1.0);
    let schedule = Schedule::new(step, u, predicted.map(|predicted| &predicted.state[..]));
    step.contact.set_compliant(schedule.method() == Method::Compliance);
    let weights = vec![1.0; step.system.fields.len()];
    let mut norm = Norm::new(weights, schedule.freezes());
    norm.began = Began::here(step.has_single_equations(), step.measures_what_happens());
    let mut history = StepHistory::default();
    let largest = step.system.largest_of_alike(u);
    let here = begin(step, u, predicted, &mut norm, &mut history)?;
    let (best, start) = ((here.relative, u.to_vec()), u.to_vec());
    let (path, downhill, direction) = (None, Downhill::default(), Vec::new());
    let mut attempt = Attempt {
        u,
        start,
        largest,
        here,
        norm,
        schedule,
        path,
        downhill,
        best,
        direction,
        history,
        not_held: None,
        doubtful: None,
        doubts: 0,
        lost: None,
        ended: false,
        held: 0,
        loose: None,
        holds: None,
    };
    attempt.run(step)?;
    Ok(attempt.history)
}

/// Goes to the better one of the states `u` and `predicted`. Prescribed values are written into one layer of cells of `u`,
/// which may turn them inside out: then the prediction alone can be measured.
fn begin(
    step: &mut LoadStep<'_>,
    u: &mut [f64],
    predicted: Option<&Predicted>,
    norm: &mut Norm,
    history: &mut StepHistory,
) -> Result<Measured, NewtonError> {
    let mut start = step.measure(u, norm);
    // what a step began with is asked of the state that was there, not of a prediction
    norm.began = match &start {
        Ok(here) => step.began(here),
        Err(_) => Began::default(),
    };
    if let Ok(here) = &start {
        step.record(history, here, Done { method: Method::Start, step: 1.0, changed: 0, corrections: 0 });
    }
    if let Some(Predicted { state, corrections, is_needed }) = predicted
        && let Ok(found) = step.measure(state, norm)
        && start.as_ref().map_or(true, |here| *is_needed || found.norm < here.norm)
    {
        u.copy_from_slice(state);
        let done = Done { method: Method::Predictor, step: 1.0, changed: 0, corrections: *corrections };
        step.record(history, &found, done);
        start = Ok(found);
    }
    Ok(start?)
}

impl Attempt<'_> {
    fn run(&mut self, step: &mut LoadStep<'_>) -> Result<(), NewtonError> {
        let (mut room, mut room_of_paths) = (step.options.max_iterations, BUDGET_OF_PATHS);
        let mut room_of_stiffness = ALL_OF_STIFFNESS;
        let (mut before, mut least, mut left, mut number) = (None, None, false, 0);
        while room > 0 && !self.ended {
            number += 1;
            if step.watch.stops() {
                return Err(NewtonError::Stopped);
            }
            // paths and contact that gets stiffer have limits of their own
            let rooms = match self.schedule.method() {
                _ if self.path.is_some() && room_of_paths > 0 => &mut room_of_paths,
                Method::Stiffening if room_of_stiffness > 0 => &mut room_of_stiffness,
                _ => &mut room,
            };
            *rooms -= 1;
            let solves = number == 1 && step.solves_once && self.here.relative > self.here.floor;
            let stop = if solves { None } else { self.confirmed(step)? };
            // what rounding may leave is a bound, and may be what a step has to do: it is tried once
            let tries = number == 1 && stop == Some(Stop::Floor) && !self.here.no_force;
            if let Some(stop) = stop.filter(|_| !tries) {
                return self.finish(step, stop);
            }
            self.doubts += usize::from(self.doubtful.is_some());
            if self.comes_to_rest(step) {
                return self.finish(step, Stop::Rest);
            }
            self.prepare(step, std::mem::take(&mut left))?;
            let forcing = match step.system.is_linear() {
                // no other iteration need follow
                true => OF_THE_TOLERANCE / self.here.excess,
                false => forcing(self.here.relative, before, self.here.relative / self.here.excess),
            };
            let inexact = Inexact::of(step, self.schedule.method(), self.here.relative, before, least);
            before = Some(self.here.relative);
            least = Some(least.map_or(self.here.relative, |least: f64| least.min(self.here.relative)));
            let within = self.here.is_within(step.options).then(|| self.u.to_vec());
            match self.correct(step, forcing, inexact) {
                Ok(followed) => self.advance(step, followed)?,
                Err(NewtonError::Solve(_)) if within.is_some() => return self.finish(step, Stop::Tolerance),
                Err(NewtonError::Solve(SolveError::Singular { .. })) if tries => return self.finish(step, Stop::Floor),
                Err(error) => left = self.leave(step, error, number)?,
            }
            if let Some(start) = within
                && !self.here.is_within(step.options)
            {
                self.take_back(step, &start)?;
                return self.finish(step, Stop::Tolerance);
            }
        }
        if self.here.is_within(step.options) {
            return self.finish(step, Stop::Tolerance);
        }
        self.give_up(step)
    }

    /// Brings contact to the method of this iteration and assembles the tangent; `left` says that the last method was
    /// left for an error.
    fn prepare(&mut self, step: &mut LoadStep<'_>, left: bool) -> Result<(), NewtonError> {
        let is_new = self.schedule.next(&self.history) | left;
        step.contact.set_friction(self.schedule.friction());
        if is_new {
            self.switch(step)?;
        }
        step.renew_tangent(self.u, self.norm.frozen)?;
        if let Some(Hold { free, stiffness }) = self.holds.take() {
            let is_there = step.tangent.changing.add_to(free, free, stiffness);
            debug_assert!(is_there, "the pattern stays within an attempt");
        }
        if self.doubtful.is_some() {
            // a correction along a slope beside which the bodies are rounding moves nothing; without one there is nothing to make flatter
            let _ = step.system.soften(step.tangent);
        }
        self.norm.weights = step.weights();
        step.equation_weights(&self.here, &mut self.norm);
        self.here.norm = step.weighted_norm(&self.here.residual, &self.norm);
        Ok(())
    }

    /// Makes contact ready for another method. A path is begun where one is to be followed.
    fn switch(&mut self, step: &mut LoadStep<'_>) -> Result<(), NewtonError> {
        let method = self.schedule.method();
        self.path = None;
        self.norm.frozen = method.freezes();
        step.contact.set_softness(1.0);
        if method.is_path() {
            step.contact.set_compliant(false);
            step.contact.set_overstress(0.0);
            if method == Method::PathFromStart {
                self.u.copy_from_slice(&self.start);
            }
            step.contact.freeze_as_written(step.system, self.u);
            let residual = step.system.residual(self.u, &step.form())?;
            self.path = Some(Path::new(&residual.values));
        } else {
            if method.freezes() && !self.schedule.continues() {
                step.contact.set_warm(false);
                step.contact.initialise(step.system, self.u, None);
            }
            step.contact.set_overstress(0.0);
            if method == Method::Overstress {
                step.contact.stick_everywhere();
            }
            step.contact.set_compliant(method == Method::Compliance);
            if method == Method::Stiffening {
                self.soften(step)?;
            }
        }
        self.here = step.measure(self.u, &self.norm)?;
        Ok(())
    }

    /// Makes contact no stiffer than the bodies, with the active set of the state at hand.
    fn soften(&mut self, step: &mut LoadStep<'_>) -> Evaluated<()> {
        step.contact.stick_everywhere();
        step.assemble_tangent(self.u, true)?;
        let softness = step.softness_of_bodies();
        self.schedule.soften(softness);
        if softness == 1.0 {
            // there is nothing to make stiffer
            self.schedule.give_up();
        }
        step.contact.freeze_as_written(step.system, self.u);
        step.contact.set_softness(self.schedule.softness());
        Ok(())
    }

    /// Follows the path, or finds a correction: then nothing is returned.
    fn correct(
        &mut self,
        step: &mut LoadStep<'_>,
        forcing: f64,
        inexact: Option<Inexact>,
    ) -> Result<Option<(f64, Measured)>, NewtonError> {
        if self.schedule.method() == Method::Downhill {
            return self.go_downhill(step).map(Some);
        }
        let (direction, history) = (&mut self.direction, &mut self.history);
        match (&mut self.path, inexact) {
            (Some(path), _) => path.advance(step, self.u, &self.here, &self.norm, history).map(Some),
            (None, Some(inexact)) => {
                inexact.correct(step, (self.u, &self.here), &self.norm, direction, history).map(|()| None)
            }
            (None, None) => step.correct(&self.here.residual, forcing, direction, history).map(|()| None),
        }
    }

    /// A step downhill in the energy; none, and no other, where there is no way.
    fn go_downhill(&mut self, step: &mut LoadStep<'_>) -> Result<(f64, Measured), NewtonError> {
        let from = self.u.to_vec();
        let mut last = self.history.iterations.iter().rev().map(|i| i.fingerprint);
        self.downhill.is_settled = last.next() == last.next();
        if let Some(taken) = self.downhill.advance(step, self.u, &self.here, &self.norm)? {
            return Ok(taken);
        }
        self.schedule.give_up();
        self.u.copy_from_slice(&from);
        Ok((0.0, step.measure(self.u, &self.norm)?))
    }

    /// Goes on from the best state with another method after an error of the linear solver, if that may help: at the
    /// start it is the scene that lacks something, unless contact is open at some points alone, which may hold the bodies
    /// once they are closed; on the way one state says little about the scene, and it is an error only if each method meets
    /// one. Whether it is another method.
    fn leave(&mut self, step: &mut LoadStep<'_>, error: NewtonError, number: usize) -> Result<bool, NewtonError> {
        let singular = matches!(error, NewtonError::Solve(SolveError::Singular { .. }));
        if number == 1 && singular && self.is_open_in_part(step) {
            self.not_held = Some((error, step.contact.clone()));
            step.contact.stick_everywhere();
            self.here = step.measure(self.u, &self.norm)?;
            return Ok(false);
        }
        // what the first state leaves loose may be held by what the iteration finds: heat that crosses as contact presses
        if singular && (number == 1 || self.held > 0) && self.held < HELD && self.not_held.is_none() {
            self.holds = Hold::of(step, &error).filter(|_| !step.system.is_linear() && step.system.team().is_alone());
            if self.holds.is_some() {
                self.held += 1;
                let (contact, frozen) = (&*step.contact, self.norm.frozen);
                self.loose.get_or_insert_with(|| (error, contact.clone(), frozen));
                return Ok(false);
            }
        }
        // another error, such as too little memory, is told as what it is
        if singular && let Some(first) = self.loose_at_first(step)? {
            return Err(first);
        }
        use SolveError::{ResidualTooLarge, VanishingPivot};
        let is_unsolved =
            singular || matches!(error, NewtonError::Solve(VanishingPivot { .. } | ResidualTooLarge { .. }));
        let on_the_way = number > 1 && (is_unsolved || self.path.is_some() && error.is_of_the_state());
        let is_loose = number == 2 && self.not_held.is_some() && singular;
        if is_loose || !on_the_way || !self.schedule.leave_singular() {
            let first = if singular { self.found_loose(step)? } else { None };
            // a tangent that is singular on the way alone is no fault of the scene: the step has not been solved, and is told as such
            let is_of_the_way = on_the_way && is_unsolved && first.is_none() && step.contact.is_empty();
            if !is_of_the_way {
                return Err(first.unwrap_or(error));
            }
            self.ended = true;
        }
        self.u.copy_from_slice(&self.best.1);
        Ok(true)
    }

    /// Where holding what was loose helped nothing: goes back to the first state, and says why it is loose.
    fn loose_at_first(&mut self, step: &mut LoadStep<'_>) -> Evaluated<Option<NewtonError>> {
        let Some((error, contact, frozen)) = self.loose.take() else { return Ok(None) };
        (*step.contact, self.norm.frozen) = (contact, frozen);
        self.u.copy_from_slice(&self.start);
        step.assemble_tangent(self.u, frozen)?;
        Ok(Some(error))
    }

    /// Where closing all contact helped nothing: goes back to the state at which bodies were found loose, and says so.
    fn found_loose(&mut self, step: &mut LoadStep<'_>) -> Evaluated<Option<NewtonError>> {
        let Some((error, contact)) = self.not_held.take() else { return Ok(None) };
        (*step.contact, self.norm.frozen) = (contact, true);
        self.u.copy_from_slice(&self.start);
        step.assemble_tangent(self.u, true)?;
        Ok(Some(error))
    }

    /// Whether some points of contact are open and others closed, in bodies that one guess of all points does not crumple.
    fn is_open_in_part(&self, step: &LoadStep<'_>) -> bool {
        let counts = self.history.iterations.last().and_then(|last| last.contact);
        let in_part = counts.is_some_and(|[open, slip, stick]| open > 0 && slip + stick > 0);
        // behind a converged step smaller increments are what helps
        in_part && self.norm.frozen && !step.contact.is_warm() && !step.system.has_nonlinear_bodies()
    }

    /// Takes the step of this iteration; `followed` is where a path has led.
    fn advance(&mut self, step: &mut LoadStep<'_>, followed: Option<(f64, Measured)>) -> Result<(), NewtonError> {
        let mut changed = 0;
        let alpha = if let Some((part, next)) = followed {
            self.here = next;
            if self.path.as_ref().is_some_and(Path::is_lost) {
                self.schedule.give_up();
            }
            part
        } else {
            if self.here.relative > LARGEST_TOLERANCE
                && swallowed::lengthen(step.system, self.u, &self.here.residual, &mut self.direction)
            {
                // with the tangent of this state all may be rounding here; else another part is open, and it is nothing to go back to
                let here = step.measure(self.u, &self.norm)?;
                if here.settled {
                    doubt(&mut self.lost, step.hidden(self.u, &here)?, self.u);
                }
            }
            let search = LineSearch {
                direction: &self.direction,
                norm: &self.norm,
                method: self.schedule.method(),
                undamped: self.schedule.is_undamped(),
                before: self.here.norm,
            };
            let (alpha, next) = search.advance(step, self.u, &self.here)?;
            self.here = next;
            if self.norm.frozen && self.here.stop(step.options).is_none() {
                changed = self.update_active_set(step, alpha)?;
            }
            alpha
        };
        self.norm.began.meets(&self.here.left);
        let done = Done { method: self.schedule.method(), step: alpha, changed, corrections: 1 };
        step.record(&mut self.history, &self.here, done);
        if self.here.relative < self.best.0 {
            self.best = (self.here.relative, self.u.to_vec());
        }
        Ok(())
    }

    /// Chooses the active set that follows after a step of this length, and what is left of the residual with it.
    fn update_active_set(&mut self, step: &mut LoadStep<'_>, alpha: f64) -> Evaluated<usize> {
        let changes = step.contact.update(self.schedule.iterations());
        self.schedule.hear(alpha, changes.share(), self.here.relative);
        step.contact.set_overstress(self.schedule.overstress());
        step.contact.set_softness(self.schedule.softness());
        self.here.residual = step.system.frozen_residual(&self.here.written, self.u, step.contact.active_set())?;
        Ok(changes.changed)
    }
}

/// Keeps a state, of whose forces rounding hides a part, where it is the one that hides least.
fn doubt(doubtful: &mut Option<(f64, Vec<f64>)>, hidden: f64, u: &[f64]) {
    if doubtful.as_ref().is_none_or(|(least, _)| hidden < *least) {
        *doubtful = Some((hidden, u.to_vec()));
    }
}

/// Part of the residual that a linear solve may leave: it must not show beside the next residual, which the speed of
/// the last iteration foretells (Eisenstat and Walker 1996, choice 2), nor beside the tolerance.
fn forcing(here: f64, before: Option<f64>, tolerance: f64) -> f64 {
    let next = before.map_or(1.0, |before| (here / before) * (here / before));
    (OF_THE_NEXT * next).max(OF_THE_TOLERANCE * tolerance / here).min(LARGEST_FORCING)
}

#[cfg(test)]
mod tests {
    use super::forcing;

    #[test]
    fn the_first_linear_solve_is_as_rough_as_any_may_be() {
        assert_eq!(forcing(1.0, None, 1e-10), super::LARGEST_FORCING);
    }

    #[test]
    fn a_linear_solve_does_not_show_beside_the_residual_that_is_foretold() {
        // the residual has fallen to a thousandth, so that it will fall to a millionth
        assert!((forcing(1e-3, Some(1.0), 1e-10) - 1e-7).abs() < 1e-20);
    }

    #[test]
    fn nobody_solves_for_more_than_the_tolerance_shows() {
        // 1e-3 of the tolerance, relative to a residual that is ten times as large
        assert!((forcing(1e-9, Some(1e-3), 1e-10) - 1e-4).abs() < 1e-18);
        assert_eq!(forcing(1e-12, Some(1e-3), 1e-10), super::LARGEST_FORCING);
    }
}
