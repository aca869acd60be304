//! A step whose equations the caller solves: it is begun, and what the caller has found becomes its end.
//!
//! Promises: the equations of a step that was begun have the end of the last step as their past; a step that is left, or
//! whose end cannot be taken, leaves nothing.

use wfl_discrete::window::Window;
use wfl_newton::NewtonError;
use wfl_problem::Solving;

use super::{
    rates,
    requests::StepRequest,
    state::Snapshot,
    stepping::{self, Integrator, Making, Reached, StepError, Stepper},
};

/// A step that the caller has begun, with the unknowns that it ends with.
pub(super) struct ByCaller {
    request: StepRequest,
    /// With the stage at which its equations stand.
    window: Window,
    /// The linear terms have another matrix in it.
    changed: bool,
    /// Where the run stood before.
    before: Snapshot,
    /// What the caller has found, by dof; at first the prescribed values of the step beside the state before it.
    pub(super) u: Vec<f64>,
}

impl ByCaller {
    /// Brings the equations to a step, with the end `u` of the last one as their past. At the first step of a scene with rates,
    /// where time starts, the state is given. After an error the equations are those of before.
    pub(super) fn begin(
        stepper: &mut Stepper,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        request: StepRequest,
    ) -> Result<Self, NewtonError> {
        let before = stepper.snapshot(scene, u);
        let mut own = u.to_vec();
        match entered(scene, &mut own, request) {
            Ok((window, changed)) => Ok(Self { request, window, changed, before, u: own }),
            Err(error) => {
                stepper.go_back(scene, u, &before);
                Err(error)
            }
        }
    }

    /// The place of the step in the run.
    pub(super) fn request(&self) -> StepRequest {
        self.request
    }

    /// Leaves the step: nothing of it is left.
    pub(super) fn leave(self, stepper: &mut Stepper, scene: &mut Solving<'_>, u: &mut [f64]) {
        stepper.go_back(scene, u, &self.before);
    }
}

impl Integrator for ByCaller {
    fn advance(&mut self, making: Making<'_, '_>, _: StepRequest) -> Result<Reached, StepError> {
        let Making { stepper, scene, u, .. } = making;
        u.copy_from_slice(&self.u);
        let finite = scene.system.check_finite("value", u, u).map_err(|error| NewtonError::from(error).into());
        if let Err(error) = finite.and_then(|()| stepper.keep_states(scene, self.window, u)) {
            stepper.go_back(scene, u, &self.before);
            return Err(error);
        }
        // the active set is that of another state: a step that is solved next chooses its own
        scene.contact.set_warm(false);
        if self.changed {
            // a factor of the matrix before serves no step that is solved later
            stepper.solver = None;
        }
        Ok(Reached::unsolved(self.window))
    }
}

/// Brings the equations to a step: where they stand, and whether the matrix of linear terms is another one. `u` is the state before
/// it, and gets the prescribed values of the step.
fn entered(scene: &mut Solving<'_>, u: &mut [f64], request: StepRequest) -> Result<(Window, bool), NewtonError> {
    let mut window = request.window;
    stepping::begin(scene, request, u)?;
    if request.number == 0 && scene.steps.from_start {
        rates::start(scene, u, window)?;
    } else {
        window = rates::enter(scene, window);
        rates::prescribe(scene, window, u).map_err(|bad| NewtonError::Given(Box::new(bad)))?;
    }
    scene.set_data(window)?;
    let changed = scene.system.begin_step(window)?;
    scene.contact.begin_step(scene.system.step());
    Ok((window, changed))
}
