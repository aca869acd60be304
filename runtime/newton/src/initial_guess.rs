//! The state that a step begins with: a predictor, and a displaced start.
//!
//! Predictor: the linearised response to the Dirichlet increment, which is the first Newton correction of a step.
//! Written into the state, prescribed displacements would all be in one layer of cells, far from any solution: cells
//! there turn inside out, and a power law with exponent p needs (p - 1) ln(strain ratio) iterations to forget it. Here
//! the whole body moves, by the tangent of the state before. Promises: a start with a smaller residual, or none. Does
//! not move anything in scenes whose bodies are linear, for which the first iteration does the same.
//!
//! Displaced start: some equations are singular where all unknowns are zero and nowhere else, such as
//! |grad u|^(p-2) grad u. Promises: moves nothing but free dofs of fields on cells that are all zero, by a linear field of
//! small slope, the same in every run. Does not decide whether a step needs it: [`super::solve_step`] does, and says so in
//! the history.

use wfl_compiler::{Class, types::FieldKind};

use super::{LoadStep, NewtonError};
use wfl_discrete::assemble::VolumeLimit;
use wfl_discrete::field::FieldSpace;
use wfl_discrete::system::{Branches, FIXED, Form, System};

/// Part of the motion by which the forces on the free dofs are differenced: of laws that are not linear it misses a part of
/// this size, and rounding leaves ten digits of the difference.
const PART: f64 = 1e-6;
/// What the solution may leave, relative to its right-hand side: no more digits than the differences have.
const LEFT: f64 = 1e-6;

/// Least part of a correction that is worth a tangent of its own: where less than this can be evaluated, smaller
/// increments serve better.
const SHORTEST: f64 = 1.0 / 8.0;

/// Where the first corrections of a step lead to.
pub(super) struct Predicted {
    /// With the prescribed values.
    pub(super) state: Vec<f64>,
    /// The prescribed values alone, without this state, turn cells inside out.
    pub(super) is_needed: bool,
    /// How many there were.
    pub(super) corrections: usize,
}

/// The state that the first corrections of a step lead to: from the end `before` of the last step towards the prescribed
/// values in `u`, which are part of the correction. Where the equations cannot be evaluated at its end (a cell turns
/// inside out) a part of it is taken, prescribed values included, and the next one carries the rest. `None` where nothing
/// is moved, or where no such state is found.
///
/// # Errors
/// [`NewtonError::TooMuchMemory`]: a start without a prediction needs as much. [`NewtonError::Stopped`].
pub(super) fn predict(step: &mut LoadStep<'_>, before: &[f64], u: &[f64]) -> Result<Option<Predicted>, NewtonError> {
    let system = step.system;
    let bodies = system.terms.iter().any(|t| t.on_cells() && t.law.class >= Class::Nonlinear);
    let is_moved = || (0..u.len()).any(|d| system.numbering.free[d] != FIXED && before[d] != u[d]);
    if !bodies || system.team().all(before == u) || system.team().any(is_moved()) {
        return Ok(None);
    }
    let mut at = before.to_vec();
    let mut left: Vec<f64> = before.iter().zip(u).map(|(a, b)| b - a).collect();
    for corrections in 1..=step.options.max_iterations {
        if step.watch.stops() {
            return Err(NewtonError::Stopped);
        }
        let correction = match linear_response(step, &at, &left) {
            Err(error) if error.ends_the_run() => return Err(error),
            Err(_) => return Ok(None),
            Ok(correction) => correction,
        };
        let Some((part, state)) = longest(step, &at, &correction) else { return Ok(None) };
        if part == 1.0 {
            let is_needed = system.way_of_volumes(before, u, VolumeLimit { kept: 0.0, most: 1.0 }) < 1.0;
            return Ok(Some(Predicted { state, is_needed, corrections }));
        }
        at = state;
        left.iter_mut().for_each(|d| *d *= 1.0 - part);
    }
    Ok(None)
}

/// The largest part of a correction, halved from all of it, on which volumes stay within what one iteration may change them
/// by and at whose end the equations can be evaluated.
fn longest(step: &LoadStep<'_>, at: &[f64], correction: &[f64]) -> Option<(f64, Vec<f64>)> {
    let end: Vec<f64> = at.iter().zip(correction).map(|(a, c)| a + c).collect();
    let mut part = step.longest_way(at, &end, 1.0);
    while part >= SHORTEST {
        let state: Vec<f64> = at.iter().zip(correction).map(|(a, c)| a + part * c).collect();
        if step.system.residual(&state, &step.form()).is_ok() {
            return Some((part, state));
        }
        part *= 0.5;
    }
    None
}

/// The Newton correction at the state `at`, by dof: that of the residual at hand and of the prescribed motion `given`,
/// which is part of it.
fn linear_response(step: &mut LoadStep<'_>, at: &[f64], given: &[f64]) -> Result<Vec<f64>, NewtonError> {
    let system = step.system;
    let frozen = !step.contact.is_empty() && step.contact.is_warm();
    let branches = if frozen { Branches::Frozen(step.contact.active_set()) } else { Branches::AsWritten };
    let form = Form { branches, offset: step.offset, ..Form::AS_WRITTEN };
    let moved: Vec<f64> = at.iter().zip(given).map(|(a, g)| a + PART * g).collect();
    let there = system.residual(&moved, &form)?.values;
    let here = system.residual(at, &form)?.values;
    step.renew_tangent(at, frozen)?;
    step.factor()?;
    let force: Vec<f64> = here.iter().zip(&there).map(|(r, t)| -r - (t - r) / PART).collect();
    let (mut rhs, mut direction) = (Vec::new(), Vec::new());
    system.numbering.gather(&force, &mut rhs);
    step.solve(&rhs, &mut direction, LEFT)?;
    let mut correction = vec![0.0; at.len()];
    system.numbering.advance(given, &direction, 1.0, &mut correction);
    Ok(correction)
}

/// Slope of the displaced start, in units of the field over the extent of the mesh: far from zero, where the tangent is
/// singular, and small beside what bodies are deformed by.
const SLOPE: f64 = 1e-2;
/// Factor that sets the components and directions of the slope apart: the golden section, far from every ratio of small
/// numbers.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// True if `u` is the state of rest and a term on cells is smooth and not linear in it.
pub(super) fn may_be_degenerate(system: &System, u: &[f64]) -> bool {
    let at_rest = system.numbering.free_dofs.iter().all(|d| u[*d as usize] == 0.0);
    system.team().all(at_rest) && system.terms.iter().any(|t| t.on_cells() && t.law.class == Class::Nonlinear)
}

/// Displaces the free dofs of the fields on cells. True if there are any.
pub(super) fn displace(system: &System, u: &mut [f64]) -> bool {
    let (low, high) = system.mesh.bounds();
    let largest = system.team().largest(u.iter().fold(0.0f64, |m, x| m.max(x.abs())));
    let size = if largest > 0.0 { largest } else { 1.0 };
    let mut moved = false;
    for (k, field) in system.fields.iter().enumerate() {
        let Some(range) = system.range(k) else { continue };
        if field.kind != FieldKind::Unknown || !matches!(field.space, FieldSpace::Nodal(_)) {
            continue;
        }
        for d in range.clone().filter(|d| system.numbering.free[*d] != FIXED) {
            let (node, component) = ((d - range.start) / field.n_components, (d - range.start) % field.n_components);
            let at = field.node_position(node);
            let along = (0..3).filter(|c| high[*c] > low[*c]).map(|c| {
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let part = ((component + 1) as f64 * GOLDEN + c as f64 * GOLDEN * GOLDEN).fract();
                (0.5 + part) * (at[c] - low[c]) / (high[c] - low[c])
            });
            u[d] = SLOPE * size * along.sum::<f64>();
            moved = true;
        }
    }
    system.team().any(moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_block::{Block, CUBIC, LAPLACE, PENALTY};

    #[test]
    fn smooth_bodies_at_rest_may_be_degenerate_and_moved_ones_are_not() {
        let block = Block::new(1, &[CUBIC], &[]);
        let mut u = vec![0.0; 8];
        assert!(may_be_degenerate(&block.system, &u));
        let free = block.system.numbering.free_dofs[0] as usize;
        u[free] = 1e-300;
        assert!(!may_be_degenerate(&block.system, &u));
        assert!(!may_be_degenerate(&Block::new(1, &[LAPLACE], &[PENALTY]).system, &[0.0; 8]));
    }

    #[test]
    fn a_displaced_start_moves_free_dofs_a_little_and_the_same_way_each_time() {
        let block = Block::new(1, &[CUBIC], &[]);
        let displaced = |top: f64| {
            let mut u = block.moved([0.0; 2], [top, 0.0]);
            assert!(displace(&block.system, &mut u));
            u
        };
        let (u, again, larger) = (displaced(0.0), displaced(0.0), displaced(100.0));
        assert_eq!(u, again);
        for (d, free) in block.system.numbering.free.iter().enumerate() {
            if *free == FIXED {
                assert_eq!(u[d], 0.0, "prescribed");
            } else {
                assert!(u[d].abs() < 0.04 && (larger[d] - 100.0 * u[d]).abs() < 1e-12, "{d}: {u:?}");
            }
        }
        assert!(u.iter().any(|x| *x != 0.0));
    }
}
