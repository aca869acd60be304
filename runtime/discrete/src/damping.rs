//! Damping between components and fields in explicit steps: the velocity at the end of the step is solved for.
//!
//! With D the mass, C the damping of linear terms, r_half the velocity in the middle of the step: (D + h/2 C) s = -R(u, r_half), by
//! GMRES with the diagonal as its preconditioner. The diagonal of C alone at the end and the rest in the middle would be two velocities
//! in one dashpot: it would brake a motion that both of its ends share, and feed one that it only turns. Promises: the rates of the
//! system are left zero.

use wfl_sparse::solve::{Stop, gmres};

use crate::{
    longest_step::Operator,
    lumped::Lumped,
    system::{FIXED, System, SystemError},
    window::Window,
};

/// Of what the right-hand side misses: far below what a step of second order errs by, and above the rounding of the sums.
const TOLERANCE: f64 = 1e-12;
/// Directions that are kept, and most iterations: the damping of a step is far less than the mass, where the step is one that a wave
/// allows, and a dashpot of any size joins few dofs.
const RESTART: usize = 40;
const MOST: usize = 2000;

/// Changes accelerations, by dof in local frames, from those with the damping on the diagonal alone to those with all of it; false
/// where they are not found.
///
/// # Errors
/// [`SystemError`] where a term cannot be evaluated.
pub fn with_damping_beside(
    lumped: &Lumped,
    system: &mut System,
    window: Window,
    acceleration: &mut [f64],
) -> Result<bool, SystemError> {
    let half = 0.5 * window.increment;
    let damping = Operator::linear_damping(system, window)?;
    let mut prescribed: Vec<f64> = (0..acceleration.len())
        .map(|d| if system.numbering.free[d] == FIXED { acceleration[d] } else { 0.0 })
        .collect();
    system.numbering.frames.turn_back(&mut prescribed);
    let mut of_prescribed = damping.over_free(system, &prescribed)?;
    // of several ranks each has found its rows
    if let Some(owners) = system.owners() {
        owners.update(&mut of_prescribed);
    }
    let divisors: Vec<f64> =
        system.numbering.free_dofs.iter().map(|d| lumped.divisor(*d as usize, window.increment)).collect();
    let mut b = Vec::new();
    system.numbering.gather(acceleration, &mut b);
    b.iter_mut().zip(of_prescribed.iter().zip(&divisors)).for_each(|(b, (y, d))| *b -= half * y / d);
    let mut failed = None;
    let mut x = vec![0.0; b.len()];
    let mut multiply = |x: &[f64], y: &mut [f64]| match damping.apply(system, lumped, x) {
        Ok(applied) => {
            let parts = applied.iter().zip(&divisors).zip(x);
            y.iter_mut().zip(parts).for_each(|(y, ((c, d), x))| *y = x + half * c / d);
        }
        Err(error) => {
            failed = Some(error);
            y.fill(0.0);
        }
    };
    let is_found = gmres(&mut multiply, &b, &mut x, Stop { reduction: TOLERANCE, restart: RESTART, iterations: MOST });
    if let Some(error) = failed {
        return Err(error);
    }
    for (d, x) in system.numbering.free_dofs.iter().zip(&x) {
        acceleration[*d as usize] = *x;
    }
    Ok(is_found)
}
