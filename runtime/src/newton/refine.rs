//! Corrections where the residual is rounding already: iterative refinement of the state.
//!
//! A residual as small as the rounding of `K u` says nothing more of the state where bodies give way a billion times
//! easier in one direction than in another (long and thin cells): what rounds is the stiff part, what is wanted the
//! soft one. There the linear terms are evaluated at their points ([`System::set_pointwise`]), which leaves errors that
//! move nothing, and the same Newton steps go on until their corrections no longer shrink (Higham 2002, chapter 12, with
//! the size of the corrections in place of the residual).
//!
//! Promises: the state whose correction was the smallest, and the size of that correction in the history. Does not
//! refine where the tolerance was reached.

use super::{NewtonError, NewtonOptions, StepHistory, Watch, correct, measure, step_to};
use crate::{finite::largest, strategy::Strategy, system::System};

/// Most corrections.
const MOST: usize = 20;
/// Corrections that may pass without one of half the size of the smallest before.
const PATIENCE: usize = 2;
/// A correction so small is rounding of the unknowns themselves.
const ENOUGH: f64 = 4.0 * f64::EPSILON;

/// True if the residual at `u`, the state measured last, is the rounding of the matrix of the linear terms.
pub(super) fn helps(system: &System, u: &[f64]) -> bool {
    let all = system.magnitudes(u);
    let (linear, scales) = (system.linear_magnitudes(), system.scales(&all));
    let fields = (0..system.fields.len()).filter_map(|k| Some((system.range(k)?, scales[k])));
    let sizes = fields.filter(|(_, scale)| *scale > 0.0).flat_map(|(range, scale)| range.map(move |d| (d, scale)));
    let largest = sizes.max_by(|a, b| (all[a.0] / a.1).total_cmp(&(all[b.0] / b.1)));
    largest.is_some_and(|(d, _)| linear[d] > 0.5 * all[d])
}

/// Refines `u`; a state that cannot be improved stays as it is.
///
/// # Errors
/// [`NewtonError`] where the equations cannot be evaluated at the state that is left.
pub(super) fn refine(
    (system, strategy): (&mut System, &mut Strategy),
    u: &mut [f64],
    (held, weights, options): (bool, &[f64], NewtonOptions),
    history: &mut StepHistory,
    watch: &mut dyn Watch,
) -> Result<(), NewtonError> {
    system.set_pointwise(true);
    let (mut best, mut since) = ((f64::INFINITY, u.to_vec()), 0);
    while history.refined < MOST && since < PATIENCE {
        let Ok(size) = one(system, strategy, u, (held, weights), history, watch) else { break };
        since = if size < 0.5 * best.0 { 0 } else { since + 1 };
        if size < best.0 {
            best = (size, u.to_vec());
        }
        if size <= options.tolerance.max(ENOUGH) {
            break;
        }
    }
    u.copy_from_slice(&best.1);
    history.correction = best.0.is_finite().then_some(best.0);
    // what is known of residual and branches belongs to the state that is kept
    measure(system, u, weights, held)?;
    Ok(())
}

/// One correction; its largest entry relative to the largest of its kind.
fn one(
    system: &mut System,
    strategy: &mut Strategy,
    u: &mut [f64],
    (held, weights): (bool, &[f64]),
    history: &mut StepHistory,
    watch: &mut dyn Watch,
) -> Result<f64, NewtonError> {
    let start = u.to_vec();
    let here = measure(system, u, weights, held)?;
    system.tangent(u, held)?;
    let mut direction = Vec::new();
    correct(system, strategy, (&here.residual, 0.0), &mut direction, history)?;
    let mut by_dof = vec![0.0; u.len()];
    system.numbering.free_dofs.iter().zip(&direction).for_each(|(d, x)| by_dof[*d as usize] = *x);
    let size = largest(system.relative_sizes(u, &by_dof).into_iter().map(|(_, size)| size));
    step_to(system, &start, &direction, 1.0, u);
    let next = measure(system, u, weights, held)?;
    if held {
        system.search_pieces(u, false)?;
        system.follow_pieces(history.iterations.len());
    }
    history.refined += 1;
    history.push(watch, history.iterations.len(), &next, 1.0, system);
    Ok(size)
}
