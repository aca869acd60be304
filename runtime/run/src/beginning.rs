//! Where time starts: the first step of a scene with rates, whose state is given. Nothing is solved for its unknowns; its rates
//! follow from the equations.

use wfl_discrete::window::Window;
use wfl_newton::NewtonError;

use super::{
    rates,
    requests::StepRequest,
    stepping::{Integrator, Making, Reached, StepError},
};

/// The state where time starts.
pub(super) struct Beginning;

impl Integrator for Beginning {
    fn advance(&mut self, making: Making<'_, '_>, request: StepRequest) -> Result<Reached, StepError> {
        let Making { stepper, scene, u, clock, progress } = making;
        let window = request.window;
        rates::start(scene, u, window)?;
        if let Some(explicit) = &scene.explicit {
            progress.solver(&explicit.describe(&scene.steps));
        } else {
            // the matrix is that of the first step, and so are the formulas in it: at the start nothing is solved, and they may have
            // no value there
            let first = Window::new(window.end + window.increment, window.increment);
            scene.system.begin_rates(first.increment);
            stepper.prepare(scene, first, clock, progress)?;
            scene.system.hold_rates();
            scene.stand_at(window).map_err(NewtonError::from)?;
        }
        Ok(Reached::unsolved(window))
    }
}
