//! Where time starts: the first step of a scene with rates, whose state is given. Nothing is solved for its unknowns; its rates
//! follow from the equations.

use super::{
    Clock, Progress, rates,
    requests::StepRequest,
    stepping::{Integrator, Reached, StepError, Stepper},
};
use crate::scene::Solving;

/// The state where time starts.
pub(super) struct Beginning;

impl Integrator for Beginning {
    fn advance(
        &mut self,
        stepper: &mut Stepper,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        request: StepRequest,
        clock: &mut Clock,
        progress: &mut dyn Progress,
    ) -> Result<Reached, StepError> {
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
