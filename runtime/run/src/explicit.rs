//! A step by central differences on a lumped mass: nothing is solved, the mass stands on the diagonal.
//!
//! With r the velocity, s the acceleration, D the mass and C the damping on the diagonal:
//! r_half = r_n + h/2 s_n, u = u_n + h r_half, (D + h/2 C) s = -R(u, r_half), r = r_half + h/2 s.
//! Where linear damping acts between components or fields, C is all of it, and s is solved for (`discrete/src/damping.rs`).
//! Terms and updates of states read r_half as `Dot_u`, so that h `Dot_u` is the change of u over the step; measures and
//! outputs read r. Prescribed values are met at the end of the step, their rates are differences. Promises: after an error
//! unknowns and rates are those of the step before.
//!
//! Source: T. J. R. Hughes, The Finite Element Method (1987), 9.1; the damping on the diagonal acts at the end of the step.

use std::time::Instant;

use wfl_discrete::{assemble::BranchCounts, damping::with_damping_beside, system::FIXED, window::Window};
use wfl_newton::NewtonError;
use wfl_problem::Solving;

use super::{
    requests::StepRequest,
    stability::Stability,
    stepping::{Integrator, Making, Reached, StepError, Stepper},
};

/// Steps by central differences, and how far they are from instability.
#[derive(Default)]
pub(super) struct CentralDifferences {
    pub(super) stability: Stability,
}

impl Integrator for CentralDifferences {
    fn advance(&mut self, making: Making<'_, '_>, request: StepRequest) -> Result<Reached, StepError> {
        let Making { stepper, scene, u, clock, .. } = making;
        let begin = Instant::now();
        let before = stepper.snapshot(scene, u);
        let made = self.step(stepper, scene, u, request.window);
        clock.assemble += begin.elapsed().as_secs_f64();
        match made {
            Ok(branches) => Ok(Reached { branches: Some(branches), ..Reached::unsolved(request.window) }),
            Err(error) => {
                stepper.go_back(scene, u, &before);
                Err(error)
            }
        }
    }
}

impl CentralDifferences {
    /// Makes the step; gives by term the branches in it.
    fn step(
        &mut self,
        stepper: &mut Stepper,
        scene: &mut Solving<'_>,
        u: &mut [f64],
        window: Window,
    ) -> Result<Vec<BranchCounts>, StepError> {
        let explicit = scene.scene.explicit.as_ref().expect("a scene of explicit steps");
        let h = window.increment;
        let before = u.to_vec();
        let [first, second] = scene.system.rates().map(|r| r.ended(u, u)).expect("explicit steps have rates");
        let mut half: Vec<f64> = first.iter().zip(&second).map(|(r, s)| r + 0.5 * h * s).collect();
        u.iter_mut().zip(&half).for_each(|(x, r)| *x += h * r);
        scene.prescribed.apply(window, u).map_err(|bad| NewtonError::Given(Box::new(bad)))?;
        let Solving { system, .. } = scene;
        system.numbering.follow(u);
        // what is not free moves as it is prescribed, and was accelerated from the velocity half a step before
        let frames = &system.numbering.frames;
        let turned = |mut v: Vec<f64>| {
            frames.turn(&mut v);
            v
        };
        let fixed: Vec<bool> = system.numbering.free.iter().map(|f| *f == FIXED).collect();
        let moved = turned(u.iter().zip(&before).map(|(x, b)| (x - b) / h).collect());
        let old_half = turned(first.iter().zip(&second).map(|(r, s)| r - 0.5 * h * s).collect());
        if fixed.contains(&true) {
            frames.turn(&mut half);
            half.iter_mut().zip(&moved).zip(&fixed).filter(|(_, f)| **f).for_each(|((r, m), _)| *r = *m);
            frames.turn_back(&mut half);
        }
        take_rates(scene, &half, &vec![0.0; u.len()]);
        scene.set_data(window).map_err(NewtonError::from)?;
        let system = &mut scene.system;
        system.set_laws(window);
        let (residual, branches) = system.residual_at_points(u).map_err(NewtonError::from)?;
        let lumped = &explicit.lumped;
        let mut acceleration: Vec<f64> = (0..u.len())
            .map(|d| if fixed[d] { (moved[d] - old_half[d]) / h } else { -residual[d] / lumped.divisor(d, h) })
            .collect();
        if lumped.couples {
            if !with_damping_beside(lumped, system, window, &mut acceleration).map_err(NewtonError::from)? {
                return Err(NewtonError::Dashpots.into());
            }
            take_rates(scene, &half, &vec![0.0; u.len()]);
            scene.system.set_laws(window);
        }
        let system = &mut scene.system;
        system.numbering.frames.turn_back(&mut acceleration);
        system.update_copies(&mut acceleration);
        system.numbering.follow(&mut acceleration);
        stepper.keep_states(scene, window, u)?;
        let velocity: Vec<f64> = half.iter().zip(&acceleration).map(|(r, s)| r + 0.5 * h * s).collect();
        take_rates(scene, &velocity, &acceleration);
        self.stability.look(scene, explicit, u, window, &branches)?;
        Ok(branches)
    }
}

/// Rates, by dof, that terms read until the next ones are taken.
fn take_rates(scene: &mut Solving<'_>, first: &[f64], second: &[f64]) {
    if let Some(rates) = scene.system.rates_mut() {
        rates.take(first, second);
    }
}
