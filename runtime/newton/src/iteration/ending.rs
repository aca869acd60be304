//! Why an attempt ends at a state, and what is done there.

use super::super::{
    Evaluated, LoadStep, Method, NewtonError, Stop,
    load_step::{Done, HIDDEN},
    refinement,
    rest::Rest,
};
use super::{Attempt, DOUBTS, doubt};
use wfl_sparse::solve::SolveError;

impl Attempt<'_> {
    /// Why the iteration stops here, if it does. A floor is that of the tangent at this state and of the laws as they are written:
    /// the tangent before may have been at a state far away, with a floor above every residual, and a branch that is held
    /// at a point that has left it has a slope of its own. Where the floor hides much of the forces the iteration goes on for a
    /// while; if that leads nowhere, the state that hides least is what there is.
    pub(super) fn confirmed(&mut self, step: &mut LoadStep<'_>) -> Evaluated<Option<Stop>> {
        let stop = self.stops(step);
        self.history.hidden = 0.0;
        if stop.is_some_and(|stop| stop != Stop::Floor) {
            return Ok(stop);
        }
        if stop.is_some() {
            step.assemble_tangent(self.u, false)?;
            self.here = step.measure(self.u, &self.norm)?;
            let stop = self.stops(step);
            let is_floor = stop == Some(Stop::Floor) && self.here.relative > HIDDEN;
            let hidden = if is_floor { step.hidden(self.u, &self.here)? } else { 0.0 };
            self.history.hidden = if hidden > HIDDEN { hidden } else { 0.0 };
            if stop.is_some() && (hidden <= HIDDEN || step.system.is_linear()) {
                return Ok(stop);
            }
            if stop.is_some() {
                doubt(&mut self.doubtful, hidden, self.u);
            }
        }
        if self.doubts < DOUBTS {
            return Ok(None);
        }
        let Some((hidden, u)) = self.doubtful.take() else { return Ok(None) };
        self.u.copy_from_slice(&u);
        // other methods may have been tried since
        step.contact.set_compliant(false);
        step.contact.set_overstress(0.0);
        step.contact.set_softness(1.0);
        self.norm.frozen = false;
        step.assemble_tangent(self.u, false)?;
        self.here = step.measure(self.u, &self.norm)?;
        // the digits of the state are asked of the factor of its tangent
        let mut direction = Vec::new();
        let _ = step.correct(&self.here.residual, 0.0, &mut direction, &mut self.history);
        let method = self.schedule.method();
        step.record(&mut self.history, &self.here, Done { method, step: 0.0, changed: 0, corrections: 0 });
        // nor does what was met on the way say anything of this state
        let _ = step.solver.take_other_sign();
        self.history.hidden = hidden;
        Ok(Some(Stop::Floor))
    }

    /// Goes to the state of rest where the unknowns have vanished and that solves the equations; whether it does.
    pub(super) fn comes_to_rest(&mut self, step: &mut LoadStep<'_>) -> bool {
        // of what was at rest an iteration that gains nothing has found no more than rounding of other fields, or what moves it
        let stalls = self.history.iterations.len() > 1 && !self.falls();
        let beside = |largest: &f64| if *largest == 0.0 && stalls { f64::INFINITY } else { *largest };
        let largest: Vec<f64> = self.largest.iter().map(beside).collect();
        let Some(rest) = Rest::of(step, self.u, &largest) else { return false };
        let Ok(found) = step.measure(&rest.state, &self.norm) else { return false };
        if !rest.solves(step.system, &found.written.values) || found.stop(step.options).is_none() {
            return false;
        }
        self.u.copy_from_slice(&rest.state);
        self.here = found;
        let method = self.schedule.method();
        step.record(&mut self.history, &self.here, Done { method, step: 1.0, changed: 0, corrections: 0 });
        true
    }

    /// Why the iteration stops here, by the tangent at hand: also below a bound of what rounds, once that no longer helps.
    pub(super) fn stops(&self, step: &LoadStep<'_>) -> Option<Stop> {
        let is_rounding = || (self.here.bounded && !self.falls()).then_some(Stop::Floor);
        // of what cancels inside the law of a single equation nobody knows the rounding: it is left once a correction gains nothing
        let is_small = || (self.here.is_small && self.gained_nothing()).then_some(Stop::Floor);
        // digits of what the step does beside what is stored: left to rounding, and once a correction gains little
        let is_corrected = self.history.iterations.last().is_some_and(|last| last.number > 0);
        let is_done = || self.here.bounded || is_corrected && !self.falls();
        let is_within = || (self.here.is_within(step.options) && is_done()).then_some(Stop::Tolerance);
        let stop = self.here.stop(step.options).or_else(is_within).or_else(is_rounding).or_else(is_small);
        // without a force the tolerance is one of what cancels: of a body that moves freely more than rounding is left there
        let is_more = self.here.no_force && self.here.relative > self.here.floor;
        stop.filter(|_| !is_more || !self.falls())
    }

    /// Whether the last iteration left the residual no smaller than it was: a law that is steep is approached in small gains.
    pub(super) fn gained_nothing(&self) -> bool {
        let mut last = self.history.iterations.iter().rev();
        let is_corrected = last.next().is_some_and(|last| last.number > 0);
        is_corrected && last.next().is_some_and(|before| self.here.relative >= before.residual)
    }

    /// Goes back to where a correction began, a state within the tolerance, where it has found no better one.
    pub(super) fn take_back(&mut self, step: &mut LoadStep<'_>, start: &[f64]) -> Evaluated<()> {
        self.u.copy_from_slice(start);
        if self.norm.frozen {
            step.contact.freeze_as_written(step.system, self.u);
        }
        step.assemble_tangent(self.u, self.norm.frozen)?;
        self.here = step.measure(self.u, &self.norm)?;
        let method = self.schedule.method();
        step.record(&mut self.history, &self.here, Done { method, step: 0.0, changed: 0, corrections: 0 });
        Ok(())
    }

    /// Whether the last iteration made the residual less than half of what it was.
    pub(super) fn falls(&self) -> bool {
        let before = self.history.iterations.iter().rev().nth(1);
        before.is_some_and(|before| self.here.relative < 0.5 * before.residual)
    }

    /// Refines a state whose residual is rounding, where that helps.
    pub(super) fn finish(&mut self, step: &mut LoadStep<'_>, stop: Stop) -> Result<(), NewtonError> {
        step.contact.set_softness(1.0);
        if self.loose.is_some() {
            // with what was held along the way a solution may be one of many
            step.assemble_tangent(self.u, self.norm.frozen)?;
            let mut direction = Vec::new();
            let still = step.correct(&self.here.residual, 0.0, &mut direction, &mut self.history);
            if matches!(still, Err(NewtonError::Solve(SolveError::Singular { .. })))
                && let Some(error) = self.loose_at_first(step)?
            {
                return Err(error);
            }
        }
        if self.history.iterations.last().is_some_and(|last| last.method == Method::Downhill) {
            // the factor at hand is that of another method's tangent: what is judged of the state is solved with its own
            step.assemble_tangent(self.u, false)?;
            step.factor()?;
        }
        let is_corrected = self.history.iterations.last().is_some_and(|last| last.number > 0);
        let is_zero = stop == Stop::Tolerance && is_corrected && self.here.relative == 0.0;
        let stop = if is_zero && refinement::hides(step, self.u, &self.here) { Stop::Floor } else { stop };
        self.history.stop = Some(stop);
        if stop == Stop::Floor && step.options.search && refinement::helps(step, self.u, &self.here) {
            refinement::refine(step, self.u, &self.norm, &mut self.history)?;
            // what refinement goes on from is no measure of what it reaches
            self.history.hidden = 0.0;
        } else {
            step.reached = Some(std::mem::take(&mut self.here.written));
        }
        Ok(())
    }

    /// Ends without room for another iteration: at the state that hides least, where there is one.
    pub(super) fn give_up(&mut self, step: &mut LoadStep<'_>) -> Result<(), NewtonError> {
        self.doubts = DOUBTS;
        self.doubtful = self.doubtful.take().or(self.lost.take());
        let stop = self.confirmed(step)?;
        if stop.is_none()
            && let Some(error) = self.found_loose(step)?
        {
            return Err(error);
        }
        self.history.stop = Some(stop.unwrap_or(Stop::MaxIterations));
        Ok(())
    }
}
