//! The equations of a run that has ended, brought back to its steps: what both directions of differentiation stand on.

use std::collections::BTreeMap;

use wfl::Diagnostic;
use wfl_compiler::types::RateOrder;
use wfl_discrete::{lumped::Probe, rates::Rates, system::FIXED, window::Window};
use wfl_problem::{Explicit, Solving};
use wfl_run::{Outcome, Passed, PassedStep, Trajectory};

use super::{Differentiated, refused::not_made, steps::Steps};

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
    /// When its steps ended, and what they are.
    pub(super) trajectory: &'a Trajectory,
    /// The steps themselves.
    pub(super) steps: Steps<'a>,
    pub(super) solving: Solving<'s>,
    /// By field its values behind the last step.
    last: Vec<Vec<f64>>,
}

impl<'a, 's> Standing<'a, 's> {
    /// A run that has ended, with its equations at its end.
    pub(super) fn new(of: (Differentiated<'a>, &'a Trajectory), solving: Solving<'s>) -> Self {
        let (of, trajectory) = of;
        let steps = Steps::new(of, trajectory);
        Self { trajectory, steps, last: solving.system.data().to_vec(), solving }
    }

    /// Brings the equations to what measures read at the end of a step.
    pub(super) fn at_end_of(&mut self, n: usize) -> Result<(), Box<Diagnostic>> {
        self.at(n)?;
        self.put_states_behind(n)?;
        let step = self.steps.step(n)?;
        if self.is_within(&step) { self.go_to_end(&step) } else { Ok(()) }
    }

    /// Brings the states to those behind a step.
    pub(super) fn put_states_behind(&mut self, n: usize) -> Result<(), Box<Diagnostic>> {
        if n + 1 < self.trajectory.steps.len() {
            let next = self.steps.step(n + 1)?;
            self.put_states(&next.states);
        } else {
            let last = std::mem::take(&mut self.last);
            self.put_states(&last);
            self.last = last;
        }
        Ok(())
    }

    /// Brings the equations to a step: data, states and the past as its equations read them.
    pub(super) fn at(&mut self, n: usize) -> Result<(), Box<Diagnostic>> {
        // the one before is asked for first: it may be in a part that is computed again
        let before = n.checked_sub(1).map(|k| self.steps.step(k)).transpose()?;
        let step = &*self.steps.step(n)?;
        let (past, at) = match &before {
            Some(past) => (past.at_end(), past.window),
            None => (self.trajectory.start.as_slice(), step.window),
        };
        let bad = |e: wfl_discrete::system::SystemError| not_made(&e.to_string());
        self.put_states(&step.states);
        self.solving.set_data(at).map_err(bad)?;
        self.solving.system.end_step(past);
        self.solving.system.set_rates(step.rates.as_ref());
        if step.kind == Passed::Explicit {
            return self.at_explicit(n);
        }
        let window = self.window_of(step);
        self.solving.set_data(window).map_err(bad)?;
        if step.kind != Passed::Given {
            self.solving.system.begin_step(window).map_err(bad)?;
        }
        Ok(())
    }

    /// The same for an explicit step: rates half a step before its end, and no second ones.
    fn at_explicit(&mut self, n: usize) -> Result<(), Box<Diagnostic>> {
        let (before, step) = (&*self.steps.step(n - 1)?, &*self.steps.step(n)?);
        let h = step.window.increment;
        let mut half = vec![0.0; step.u.len()];
        for of in before.rates.iter().flat_map(Rates::fields) {
            for (k, d) in of.dofs.clone().enumerate() {
                let is_fixed = self.solving.system.numbering.free[d] == FIXED;
                half[d] =
                    if is_fixed { (step.u[d] - before.u[d]) / h } else { of.kept[0][k] + 0.5 * h * of.kept[1][k] };
            }
        }
        self.take_rates(&half, &vec![0.0; half.len()]);
        self.solving.set_data(step.window).map_err(|e| not_made(&e.to_string()))?;
        self.solving.system.set_laws(step.window);
        Ok(())
    }

    fn take_rates(&mut self, first: &[f64], second: &[f64]) {
        if let Some(rates) = self.solving.system.rates_mut() {
            rates.take(first, second);
        }
    }

    /// Where time starts, first rates as they are and no second ones.
    pub(super) fn hold_accelerations_zero(&mut self) -> Result<(), Box<Diagnostic>> {
        let n = self.solving.system.numbering.n_dofs;
        let mut first = vec![0.0; n];
        for of in self.steps.step(0)?.rates.iter().flat_map(Rates::fields) {
            first[of.dofs.clone()].copy_from_slice(&of.kept[0]);
        }
        self.take_rates(&first, &vec![0.0; n]);
        Ok(())
    }

    /// The rates that mass and damping on the diagonal were found with, where time starts.
    pub(super) fn probes(&mut self, explicit: &Explicit) -> Result<Vec<Probe>, Box<Diagnostic>> {
        let step = &*self.steps.step(0)?;
        self.at(0)?;
        let first = self.solving.steps.first_window();
        explicit.lumped.probes(self.solving.system, &step.u, first).map_err(|e| not_made(&e.to_string()))
    }

    /// The rate of a probe, and no other one.
    pub(super) fn take_probe(&mut self, probe: &Probe) {
        let zero = vec![0.0; probe.rate.len()];
        match probe.order {
            RateOrder::First => self.take_rates(&probe.rate, &zero),
            RateOrder::Second => self.take_rates(&zero, &probe.rate),
        }
    }

    /// Rates of zero, from which a probe starts.
    pub(super) fn take_rest(&mut self, probe: &Probe) {
        let zero = vec![0.0; probe.rate.len()];
        self.take_rates(&zero, &zero);
    }

    /// True if values and rates at the end of a step are others than those that its equations stand with.
    pub(super) fn is_within(&self, step: &PassedStep) -> bool {
        self.offset(step) != 0.0 || step.kind == Passed::Explicit
    }

    /// How far before its end the equations of a step stand, as a part of it: 0 for most schemes.
    pub(super) fn offset(&self, step: &PassedStep) -> f64 {
        let rates = step.rates.as_ref().filter(|_| step.kind != Passed::Given);
        rates.map_or(0.0, |rates| rates.scheme().offset())
    }

    /// A step where its equations stand.
    pub(super) fn window_of(&self, step: &PassedStep) -> Window {
        step.window.with_offset(self.offset(step))
    }

    /// Brings data and rates from where the equations of a step stand to its end.
    pub(super) fn go_to_end(&mut self, step: &PassedStep) -> Result<(), Box<Diagnostic>> {
        if step.kind == Passed::Explicit {
            self.solving.system.set_rates(step.rates.as_ref());
        } else if let Some((rates, past)) = self.solving.system.rates_and_past() {
            rates.finish(&mut step.u.clone(), &past.unknowns);
        }
        self.solving.set_data(step.window).map_err(|e| not_made(&e.to_string()))
    }

    /// What laws take of a step, at its end or where its equations stand.
    pub(super) fn step_of(&self, window: Window) -> Window {
        self.solving.system.with_present_rates(window)
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
