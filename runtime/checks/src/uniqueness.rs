//! Whether a state of Coulomb friction has others beside it.
//!
//! The equations of linear bodies in contact are a map F of the unknowns that is affine by pieces. Where the bodies are
//! held and the method is coercive, F u = f keeps its solutions within bounds while friction grows from nothing, where
//! the solution is unique, so that its degree stays that of the bodies tied together: the signs of the determinants of
//! the tangents at all regular solutions sum up to the sign of the tied ones (Brouwer; Ortega and Rheinboldt 1970,
//! ch. 6). A solution whose determinant has the other sign is therefore never alone: at least two more have that of the
//! tied bodies. Where friction alone holds a body the degree is not known, but is no less than nothing: one more.
//!
//! A tangent of the other sign on the way to a state says less: pieces of both orientations exist, so that F takes some
//! values several times (Kuhn and Loewen 1987), but perhaps not this one.
//!
//! Promises: what is called proved is, by two determinants; nothing of the run is changed. Does not find every such state:
//! most states that are one of several have the sign of the tied bodies. Looks only where the factor at hand, which may
//! be that of an iterate before, has a determinant of another sign than the first one of the run, which is tied, so that it
//! costs nothing elsewhere.

use wfl_contact::Contact;
use wfl_discrete::system::{Branches, System};
use wfl_linear::LinearSolver;
use wfl_newton::NewtonError;

/// Whether the equations of a state have other solutions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Others {
    /// Nothing says so.
    #[default]
    Unknown,
    /// There are loads with several states.
    Possible,
    /// The state has others beside it.
    Proved,
}

/// What is known of other solutions beside `u`, one of `system`; `known` is what earlier steps have said.
///
/// # Errors
/// [`NewtonError`] where the tangent there has a number that is not finite.
pub fn others(
    system: &System,
    contact: &Contact,
    solver: &mut LinearSolver,
    u: &[f64],
    known: Others,
) -> Result<Others, NewtonError> {
    let met = solver.take_other_sign();
    if known == Others::Proved || !(contact.has_friction() && system.is_affine_when_frozen()) {
        return Ok(Others::Unknown);
    }
    let possible = if met { Others::Possible } else { Others::Unknown };
    if !solver.may_have_turned() {
        return Ok(possible);
    }
    let Some([tied, here]) = signs(system, contact, solver, u)? else { return Ok(possible) };
    solver.set_tied_sign(tied);
    Ok(if here == tied { possible } else { Others::Proved })
}

/// Whether the determinants of the tied bodies and of the tangent at `u` are negative. A tangent without a factor proves
/// nothing.
fn signs(
    system: &System,
    contact: &Contact,
    solver: &LinearSolver,
    u: &[f64],
) -> Result<Option<[bool; 2]>, NewtonError> {
    let Ok(mut solver) = solver.beside(system) else { return Ok(None) };
    let tied = contact.tied(system, u);
    let mut tangent = system.new_tangent();
    system.tangent(u, Branches::Frozen(&tied), &mut tangent)?;
    let tied = solver.is_negative(system, &tangent).unwrap_or(None);
    system.tangent(u, Branches::AsWritten, &mut tangent)?;
    let here = solver.is_negative(system, &tangent).unwrap_or(None);
    Ok(tied.zip(here).map(|(tied, here)| [tied, here]))
}
