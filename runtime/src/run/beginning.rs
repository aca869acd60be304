//! Where time starts: the first step of a scene with rates, whose state is given. Nothing is solved for its unknowns; its rates
//! follow from the equations.

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
            // the matrix is that of the first step; its rates are those at the start
            scene.system.begin_rates(window.increment);
            stepper.prepare(scene, window, clock, progress)?;
            scene.system.hold_rates();
        }
        Ok(Reached::unsolved(window))
    }
}
