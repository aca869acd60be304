//! Corrections where the residual is rounding already: iterative refinement of the state.
//!
//! A residual as small as the rounding of `K u` says nothing more of the state where bodies give way a billion times
//! easier in one direction than in another (long and thin cells): what rounds is the stiff part, what is wanted the
//! soft one. There the linear terms are evaluated at their points ([`LinearTerms::AtPoints`]), which leaves errors that
//! move nothing, and the same Newton steps go on until their corrections no longer shrink (Higham 2002, chapter 12, with
//! the size of the corrections in place of the residual).
//!
//! Promises: the state whose correction was the smallest, and the size of that correction in the history. Does not
//! refine where the tolerance was reached, unless by a residual of zero whose rounding is more than that.

use super::{
    LoadStep, Method, NewtonError, StepHistory,
    load_step::{Done, FLOOR_FACTOR, Measured, Norm},
};
use wfl_discrete::finite::largest;
use wfl_discrete::system::LinearTerms;

/// Most corrections: each halves the last at least, so that these are six digits.
const MOST: usize = 20;
/// Corrections that may pass without one of half the size of the smallest before: one may go astray by rounding, two say that
/// no more is to be gained.
const PATIENCE: usize = 2;
/// A correction so small, relative to the unknowns, is rounding of them; four units of it, as the floor of residuals has.
const ENOUGH: f64 = 4.0 * f64::EPSILON;

/// Part of its right-hand side that the first correction may leave: it tells whether there is anything to correct, for which few digits serve, as
/// they do where digits are estimated. With a factor it leaves rounding, with an iteration this takes a quarter of the time.
const LEFT_OF_FIRST: f64 = 1e-3;

/// True if the residual at `u`, measured as `here`, is the rounding of the matrix of the linear terms.
pub(super) fn helps(step: &LoadStep<'_>, u: &[f64], here: &Measured) -> bool {
    largest_size(step, u, here).is_some_and(|[_, is_linear]| is_linear > 0.5)
}

/// True if a residual at `u` that is zero to the last bit says nothing: what rounds in it is more than the tolerance, and so few numbers
/// may cancel by accident.
pub(super) fn hides(step: &LoadStep<'_>, u: &[f64], here: &Measured) -> bool {
    let rounds = |size: f64| FLOOR_FACTOR * f64::EPSILON * size;
    largest_size(step, u, here).is_some_and(|[size, _]| rounds(size) > step.options.tolerance)
}

/// The largest of what cancels in the forces at `u`, relative to them, and one where more than half of it is that of linear terms.
fn largest_size(step: &LoadStep<'_>, u: &[f64], here: &Measured) -> Option<[f64; 2]> {
    let system = step.system;
    let all = system.sizes(u, &here.written, step.tangent);
    let (linear, scales) = (&here.written.linear_sizes, system.scales(&here.written, &all));
    let bodies = (0..system.n_bodies()).map(|body| (body, scales[body])).filter(|(_, scale)| *scale > 0.0);
    let sizes = bodies.flat_map(|(body, scale)| system.dofs_of_body(body).map(move |d| (d, scale)));
    let sizes = sizes.map(|(d, scale)| [all[d] / scale, f64::from(u8::from(linear[d] > 0.5 * all[d]))]);
    let of_largest = |sizes: &mut dyn Iterator<Item = [f64; 2]>| sizes.max_by(|a, b| a[0].total_cmp(&b[0]));
    // of each rank, then of all
    let own = of_largest(&mut sizes.into_iter());
    let all = system.team().all_numbers(own.as_ref().map_or(&[], |own| own.as_slice()));
    of_largest(&mut all.as_chunks().0.iter().copied())
}

/// Refines `u`; a state that cannot be improved stays as it is.
///
/// # Errors
/// [`NewtonError`] where the equations cannot be evaluated at the state that is left.
pub(super) fn refine(
    step: &mut LoadStep<'_>,
    u: &mut [f64],
    norm: &Norm,
    history: &mut StepHistory,
) -> Result<(), NewtonError> {
    step.linear = LinearTerms::AtPoints;
    let (mut best, mut since) = ((f64::INFINITY, u.to_vec()), 0);
    while history.refined < MOST && since < PATIENCE {
        let left = if history.refined == 0 { LEFT_OF_FIRST } else { 0.0 };
        let Ok(size) = one(step, u, norm, left, history) else { break };
        since = if size < 0.5 * best.0 { 0 } else { since + 1 };
        if size < best.0 {
            best = (size, u.to_vec());
        }
        if size <= step.options.tolerance.max(ENOUGH) {
            break;
        }
    }
    u.copy_from_slice(&best.1);
    history.correction = best.0.is_finite().then_some(best.0);
    Ok(())
}

/// One correction, solved until so much of its right-hand side is left; its largest entry relative to the largest of its kind.
fn one(
    step: &mut LoadStep<'_>,
    u: &mut [f64],
    norm: &Norm,
    left: f64,
    history: &mut StepHistory,
) -> Result<f64, NewtonError> {
    let start = u.to_vec();
    let here = step.measure(u, norm)?;
    step.renew_tangent(u, norm.frozen)?;
    let mut direction = Vec::new();
    step.correct(&here.residual, left, &mut direction, history)?;
    let mut by_dof = vec![0.0; u.len()];
    step.system.numbering.free_dofs.iter().zip(&direction).for_each(|(d, x)| by_dof[*d as usize] = *x);
    // a field that is zero has no digits that could get better
    let is_zero = |body: usize| step.system.is_zero_but_for_rounding(u, &here.written, step.tangent, body);
    let sizes = step.system.relative_sizes(u, &by_dof).into_iter();
    let size = largest(sizes.filter(|(body, size)| *size <= ENOUGH || !is_zero(*body)).map(|(_, size)| size));
    step.go(&start, &direction, 1.0, u);
    let next = step.measure(u, norm)?;
    let mut changed = 0;
    if norm.frozen {
        step.contact.take_full_step(step.system, u);
        changed = step.contact.update(history.iterations.len()).changed;
    }
    history.refined += 1;
    step.record(history, &next, Done { method: Method::Refinement, step: 1.0, changed, corrections: 1 });
    Ok(size)
}
