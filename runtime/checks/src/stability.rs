//! Whether an equilibrium is stable: how many directions there are in which the energy decreases.
//!
//! Where the tangent is symmetric the equations are those of a stationary point of an energy, and the state is a minimum
//! where the tangent is positive definite. Its negative eigenvalues are counted by the signs of pivots (Sylvester; Bathe,
//! Finite Element Procedures, 2014, 8.2.5 and 11.4). Fields that act as forces have one negative eigenvalue by unknown
//! in any state, stable or not: a multiplier, or a pressure, whose own diagonal has no positive entry; they are taken off.
//! A tangent that is not symmetric with a determinant of the other sign than that of a stable body has a real negative
//! eigenvalue, too.
//!
//! Promises: what is called unstable is so, of the discrete equations; nothing of the run is changed but the kind of factor that
//! the next step is solved with. Costs nothing where the factor at hand is Cholesky's. Does not judge linear scenes, in
//! which no load changes the tangent, nor scenes with rates, whose states are no equilibria.

use std::sync::Arc;

use super::Solved;
use wfl_compiler::types::{FieldKind, UniformSlot};
use wfl_discrete::system::{Branches, FIXED, System, Tangent};
use wfl_newton::LinearSolver;
use wfl_sparse::csr::Csr;

/// Directions in which an equilibrium is not stable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unstable {
    /// So many.
    Directions(usize),
    /// An odd number: the tangent is not symmetric.
    Odd,
}

/// When a state is looked at whose factor says nothing: counts cost as much as a few iterations.
#[must_use]
pub fn is_due(step: usize, is_last: bool) -> bool {
    is_last || (step + 1).is_power_of_two()
}

/// The directions in which the state is not stable; `None` where there are none, or where that is not known. `due` says that
/// a factor may be spent on the question.
#[must_use]
pub fn unstable(state: Solved<'_>, solver: &mut LinearSolver, due: bool) -> Option<Unstable> {
    let Solved { system, u, .. } = state;
    // `Rate(e)` divides by the increment, and has no slot of its own
    let is_rate = |slot: &UniformSlot| matches!(slot, UniformSlot::Rate(_) | UniformSlot::TimeStep);
    let has_rates = system.terms.iter().any(|term| term.law.prologue.slots.iter().any(is_rate));
    if system.is_linear() || has_rates || !system.team().is_alone() || !solver.is_ours() {
        return None;
    }
    let known = solver.is_definite();
    // a factor of the whole that is not Cholesky's has met a tangent that is not positive definite
    let suspicious = known == Some(false) || solver.factors_all() && solver.lost_definiteness();
    if known == Some(true) || !(due && solver.factors_all() || suspicious) {
        return None;
    }
    let mut tangent = system.new_tangent();
    system.tangent(u, Branches::AsWritten, &mut tangent).ok()?;
    if solver.finds_definite(&tangent) {
        return None;
    }
    match LinearSolver::symmetric_whole(system, &tangent).map(Arc::new) {
        Some(matrix) => {
            let negative = solver.inertia(&matrix)?.negative;
            let directions = if negative == 0 { 0 } else { negative.saturating_sub(of_forces(system, &matrix)) };
            (directions > 0).then_some(Unstable::Directions(directions))
        }
        None if suspicious => by_determinant(system, solver, &tangent),
        None => None,
    }
}

/// Free unknowns of the fields that act as forces.
fn of_forces(system: &System, matrix: &Csr) -> usize {
    let free = |field: usize| {
        let range = system.range(field).into_iter().flatten();
        range.map(|dof| system.numbering.free[dof]).filter(|free| *free != FIXED)
    };
    let acts_as_force = |field: &usize| {
        let is_multiplier = system.fields[*field].kind == FieldKind::Multiplier;
        is_multiplier || free(*field).all(|row| matrix.get(row as usize, row as usize) <= 0.0)
    };
    (0..system.fields.len()).filter(acts_as_force).map(|field| free(field).count()).sum()
}

/// An odd number of real negative eigenvalues of bodies whose tangent is not symmetric.
fn by_determinant(system: &System, solver: &LinearSolver, tangent: &Tangent) -> Option<Unstable> {
    if !system.has_nonlinear_bodies() || system.fields.iter().any(|f| f.kind == FieldKind::Multiplier) {
        return None;
    }
    let mut beside = solver.beside(system).ok()?;
    let is_negative = beside.is_negative(system, tangent).ok()??;
    is_negative.then_some(Unstable::Odd)
}
