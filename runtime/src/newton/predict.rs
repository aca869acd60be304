//! A start that has heard of the prescribed values.
//!
//! Prescribed displacements are written into the state before a step; where bodies are not linear, all of their motion
//! is then in one layer of cells, far from any solution: a power law with exponent p needs (p - 1) ln(strain ratio)
//! iterations to forget it. Here the whole body moves first, by the tangent of the state before: one linear solution.
//!
//! Promises: a start with a smaller residual, or none. Does not move anything in scenes whose bodies are linear, for
//! which the first iteration does the same.

use wfl_compiler::Class;

use super::NewtonError;
use crate::{
    strategy::Strategy,
    system::{FIXED, System},
};

/// Part of the motion by which the forces on the free dofs are differenced.
const PART: f64 = 1e-6;
/// What the solution may leave of the right-hand side.
const LEFT: f64 = 1e-6;

/// The state `u` with its free dofs moved along with what is prescribed, from the state `from` of the step before.
/// `None` where nothing is moved, or where `from` has no tangent.
///
/// # Errors
/// [`NewtonError::TooMuchMemory`]: a start without a prediction needs as much.
pub(super) fn predict(
    system: &mut System,
    strategy: &mut Strategy,
    from: &[f64],
    u: &[f64],
) -> Result<Option<Vec<f64>>, NewtonError> {
    match linear_response(system, strategy, from, u) {
        Err(NewtonError::TooMuchMemory(need)) => Err(NewtonError::TooMuchMemory(need)),
        other => Ok(other.unwrap_or(None)),
    }
}

fn linear_response(
    system: &mut System,
    strategy: &mut Strategy,
    from: &[f64],
    u: &[f64],
) -> Result<Option<Vec<f64>>, NewtonError> {
    let bodies = system.terms.iter().any(|t| t.on_cells() && t.law.class >= Class::Nonlinear);
    if !bodies || from == u || (0..u.len()).any(|d| system.numbering.free[d] != FIXED && from[d] != u[d]) {
        return Ok(None);
    }
    let held = system.has_pieces() && system.is_settled();
    let (mut here, mut moved) = (Vec::new(), Vec::new());
    let part: Vec<f64> = from.iter().zip(u).map(|(a, b)| a + PART * (b - a)).collect();
    for (at, out) in [(part.as_slice(), &mut moved), (from, &mut here)] {
        system.residual(at, out)?;
        if held {
            system.held_residual(at, out)?;
        }
    }
    system.tangent(from, held)?;
    strategy.update(system)?;
    let force: Vec<f64> = here.iter().zip(&moved).map(|(r, m)| -r - (m - r) / PART).collect();
    let (mut rhs, mut direction) = (Vec::new(), Vec::new());
    system.numbering.gather(&force, &mut rhs);
    strategy.solve(&rhs, &mut direction, LEFT)?;
    let mut found = u.to_vec();
    system.numbering.advance(u, &direction, 1.0, &mut found);
    Ok(Some(found))
}
