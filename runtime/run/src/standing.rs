//! A run takes its state as a value, and goes back to one: within a step to its snapshot, between steps to a state.

use wfl_discrete::window::Window;
use wfl_linear::LinearSolver;
use wfl_newton::NewtonError;
use wfl_problem::Solving;

use super::{
    Run,
    parts::Listed,
    state::{Changes, Snapshot, State, Sums},
    stepping::Stepper,
};
use crate::Progress;

impl Stepper {
    /// What an attempt at a step from `u` may change.
    pub(super) fn snapshot(&self, scene: &Solving<'_>, u: &[f64]) -> Snapshot {
        let changes = if scene.explicit.is_some() {
            Changes::Rates(scene.system.rates().cloned())
        } else {
            Changes::All { memory: self.memory(scene), known: scene.system.known().clone() }
        };
        Snapshot { u: u.to_vec(), changes, sums: None }
    }

    /// Keeps what was summed before the first part of a step that passes, in the snapshot of its start.
    pub(super) fn keep_sums(&self, start: &mut Snapshot) {
        start.sums.get_or_insert_with(|| Sums { balance: self.balance.clone(), friction: self.friction.clone() });
    }

    /// Leaves nothing of what was attempted since.
    pub(super) fn go_back(&mut self, scene: &mut Solving<'_>, u: &mut [f64], to: &Snapshot) {
        u.copy_from_slice(&to.u);
        if let Some(sums) = &to.sums {
            (self.balance, self.friction) = (sums.balance.clone(), sums.friction.clone());
        }
        let fits = match &to.changes {
            Changes::Rates(rates) => {
                scene.system.set_rates(rates.as_ref());
                true
            }
            Changes::All { memory, known } => {
                scene.system.set_known(known);
                match &mut self.tangent {
                    Some(tangent) => memory.recall(scene, tangent),
                    None => memory.recall_without_tangent(scene),
                }
            }
        };
        debug_assert!(fits, "the snapshot is of these equations");
    }
}

impl Run {
    /// Where the run stands, made by all ranks together.
    pub(super) fn state(&self, scene: &Solving<'_>) -> State {
        let rates = scene.system.rates().zip(scene.system.past());
        let Self { stepper, integrators, .. } = self;
        let Listed { level, easy } = integrators.listed;
        State {
            u: self.u.clone(),
            memory: stepper.memory_of_all(scene),
            rates: rates.map(|(rates, past)| rates.memory(&self.u, &past.unknowns)).unwrap_or_default(),
            solver: stepper.solver.as_ref().map(LinearSolver::memory).unwrap_or_default(),
            level,
            easy,
            adaptive: integrators.adaptive.as_ref().map(|adaptive| adaptive.of_all(scene.system.team())),
            balance: stepper.balance.as_ref().map(|balance| balance.of_all(scene.system.team())),
            friction: stepper.friction.as_ref().map(|friction| friction.memory.clone()),
        }
    }

    /// Goes on from a state behind this step: equations and stepper are new. False, and the run is of no
    /// use, if the state belongs to another scene.
    ///
    /// # Errors
    /// [`NewtonError`] where the terms cannot be assembled any more.
    pub(super) fn set_state(
        &mut self,
        scene: &mut Solving<'_>,
        state: State,
        window: Window,
        progress: &mut dyn Progress,
    ) -> Result<bool, NewtonError> {
        let State { u, memory, rates, solver, level, easy, mut adaptive, mut balance, friction } = state;
        if u.len() != self.u.len() || scene.system.rates_mut().is_some_and(|own| !own.recall(&rates)) {
            return Ok(false);
        }
        let fits = if let Some(explicit) = &scene.explicit {
            progress.solver(&explicit.describe(&scene.steps));
            true
        } else {
            self.stepper.prepare(scene, window, &mut self.clock, progress)?;
            let own = self.stepper.solver.as_mut().expect("prepared above");
            let fits = own.recall(&solver)?;
            own.starts_elsewhere();
            fits
        };
        let remembers = friction.as_ref().is_none_or(|memory| memory.fits(scene.contact));
        let fits = fits
            && self.stepper.recall_of_all(scene, &memory)
            && balance.is_some() == scene.energy.is_some()
            && adaptive.is_some() == scene.steps.auto.is_some()
            && friction.is_some() == self.stepper.friction.is_some()
            && remembers;
        if !fits {
            return Ok(false);
        }
        if let Some((own, memory)) = self.stepper.friction.as_mut().zip(friction) {
            own.memory = memory;
        }
        let gained =
            adaptive.iter_mut().filter_map(|adaptive| adaptive.gained.as_mut()).map(|gained| &mut gained.balance);
        balance.iter_mut().chain(gained).for_each(|balance| balance.keep_own(scene.system));
        self.stepper.balance = balance;
        (self.integrators.adaptive, self.integrators.listed) = (adaptive, Listed { level, easy });
        self.u = u;
        Ok(true)
    }
}
