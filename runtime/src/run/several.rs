//! Whether a state of Coulomb friction has others beside it.
//!
//! The equations of linear bodies in contact are a map F of the unknowns that is affine by pieces. Where the bodies are
//! held and the method is coercive, F u = f keeps its solutions within bounds while friction grows from nothing, where
//! the solution is unique, so that its degree stays that of the bodies tied together: the signs of the determinants of
//! the tangents at all regular solutions sum up to the sign of the tied ones (Brouwer; Ortega and Rheinboldt 1970,
//! ch. 6). A solution whose determinant has the other sign is therefore never alone: at least two more have that of the
//! tied bodies. Where friction alone holds a body the degree is not known, but is no less than nothing: one more.
//!
//! Promises: what it says is proved by two determinants; nothing of the run is changed. Does not find every such state:
//! most states that are one of several have the sign of the tied bodies. Looks only where the factor at hand, which may
//! be that of an iterate before, has a determinant of another sign than the first one of the run, which is tied, so that it
//! costs nothing elsewhere.

use crate::{newton::NewtonError, strategy::Strategy, system::System};

/// True if `u`, a solution of `system`, is proved to be one of several.
///
/// # Errors
/// [`NewtonError`] where the tangent there has a number that is not finite.
pub(super) fn is_one_of_several(system: &mut System, strategy: &mut Strategy, u: &[f64]) -> Result<bool, NewtonError> {
    if !(system.has_friction() && system.is_affine_when_held() && strategy.may_have_turned()) {
        return Ok(false);
    }
    let memory = system.memory();
    let signs = signs(system, strategy, u);
    let known = system.recall(&memory);
    debug_assert!(known, "the memory is that of this system");
    let Some([tied, here]) = signs? else { return Ok(false) };
    strategy.set_tied_sign(tied);
    Ok(here != tied)
}

/// Whether the determinants of the tied bodies and of the tangent at `u` are negative. A tangent without a factor proves
/// nothing.
fn signs(system: &mut System, strategy: &Strategy, u: &[f64]) -> Result<Option<[bool; 2]>, NewtonError> {
    let Ok(mut solver) = strategy.beside(system) else { return Ok(None) };
    system.hold_tied(u)?;
    system.tangent(u, true)?;
    let tied = solver.is_negative(system).unwrap_or(None);
    system.tangent(u, false)?;
    let here = solver.is_negative(system).unwrap_or(None);
    Ok(tied.zip(here).map(|(tied, here)| [tied, here]))
}
