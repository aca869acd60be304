//! The equations of a run that has ended, brought back to its steps: what both directions of differentiation stand on.

use std::collections::BTreeMap;

use wfl::Diagnostic;

use super::refused::not_made;
use crate::{
    Outcome, Passed, PassedStep, Trajectory,
    rates::{Rates, StepAt},
    scene::Solving,
};

/// Linearised equations hold to this part of their right-hand side, or the tangent is not that of the laws.
pub(super) const AGREEMENT: f64 = 1e-6;

/// By step of a trajectory that ends a step of the scene the number of that one.
pub(super) type Ends = BTreeMap<usize, usize>;

/// The steps of a run, and which of them end steps of the scene.
pub(super) fn of_run(outcome: &Outcome) -> Result<(&Trajectory, Ends), Box<Diagnostic>> {
    let trajectory = outcome.trajectory.as_ref().ok_or_else(|| not_made("the steps of the run were not kept"))?;
    let whole = trajectory.steps.iter().enumerate().filter(|(_, s)| s.kind != Passed::Part);
    let ends: Ends = whole.enumerate().map(|(k, (n, _))| (n, k)).collect();
    if ends.len() == outcome.steps.len() {
        Ok((trajectory, ends))
    } else {
        Err(not_made("a run that was resumed has not kept the steps before: run it again from the start"))
    }
}

/// The equations of a run at one of its steps.
pub(super) struct Standing<'a, 's> {
    pub(super) trajectory: &'a Trajectory,
    pub(super) solving: Solving<'s>,
    /// By field its values behind the last step.
    last: Vec<Vec<f64>>,
}

impl<'a, 's> Standing<'a, 's> {
    /// A run that has ended, with its equations at its end.
    pub(super) fn new(trajectory: &'a Trajectory, solving: Solving<'s>) -> Self {
        Self { trajectory, last: solving.system.data().to_vec(), solving }
    }

    /// Brings the equations to what measures read at the end of a step.
    pub(super) fn at_end_of(&mut self, n: usize) -> Result<(), Box<Diagnostic>> {
        self.at(n)?;
        self.put_states_behind(n);
        let trajectory = self.trajectory;
        if self.offset(&trajectory.steps[n]) == 0.0 { Ok(()) } else { self.go_to_end(&trajectory.steps[n]) }
    }

    /// Brings the states to those behind a step.
    pub(super) fn put_states_behind(&mut self, n: usize) {
        let trajectory = self.trajectory;
        if let Some(next) = trajectory.steps.get(n + 1) {
            self.put_states(&next.states);
        } else {
            let last = std::mem::take(&mut self.last);
            self.put_states(&last);
            self.last = last;
        }
    }

    /// Brings the equations to a step: data, states and the past as its equations read them.
    pub(super) fn at(&mut self, n: usize) -> Result<(), Box<Diagnostic>> {
        let steps = &self.trajectory.steps;
        let step = &steps[n];
        let (past, at) = match n.checked_sub(1).map(|k| &steps[k]) {
            Some(past) => (past.at_end(), (past.time, past.increment)),
            None => (self.trajectory.start.as_slice(), (step.time, step.increment)),
        };
        let bad = |e: crate::SystemError| not_made(&e.to_string());
        self.put_states(&step.states);
        self.solving.set_data(at.0, at.1).map_err(bad)?;
        self.solving.system.end_step(past);
        self.solving.system.set_rates(step.rates.as_ref());
        let time = self.time_of(step);
        self.solving.set_data(time, step.increment).map_err(bad)?;
        if step.kind != Passed::Given {
            self.solving.system.begin_step(time, step.increment).map_err(bad)?;
        }
        Ok(())
    }

    /// How far before its end the equations of a step stand, as a part of it: 0 for most schemes.
    pub(super) fn offset(&self, step: &PassedStep) -> f64 {
        let rates = step.rates.as_ref().filter(|_| step.kind != Passed::Given);
        rates.map_or(0.0, |rates| rates.scheme().offset())
    }

    /// The step variable where the equations of a step stand.
    pub(super) fn time_of(&self, step: &PassedStep) -> f64 {
        step.time - self.offset(step) * step.increment
    }

    /// Brings data and rates from where the equations of a step stand to its end.
    pub(super) fn go_to_end(&mut self, step: &PassedStep) -> Result<(), Box<Diagnostic>> {
        if let Some((rates, past)) = self.solving.system.rates_and_past() {
            rates.finish(&mut step.u.clone(), &past.unknowns);
        }
        self.solving.set_data(step.time, step.increment).map_err(|e| not_made(&e.to_string()))
    }

    /// What laws take of a step, at its end or where its equations stand.
    pub(super) fn step_of(&self, time: f64, step: &PassedStep) -> StepAt {
        self.solving.system.step_at(time, step.increment)
    }

    /// The rates of the step.
    pub(super) fn rates(&self) -> Option<&Rates> {
        self.solving.system.rates()
    }

    /// Brings the states to values.
    pub(super) fn put_states(&mut self, states: &[Vec<f64>]) {
        for state in &self.solving.scene.states {
            self.solving.system.data_mut(state.field).clone_from(&states[state.field]);
        }
    }
}
