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
use wfl_linear::LinearSolver;
use wfl_sparse::csr::Csr;

/// Masses that stand for infinite ones, in units of the largest sum of a row. Roots lie below one of it where constraints act
/// along what they hold, and friction, which pulls askew, makes them larger by the factor of its skewness.
const HEAVY: f64 = 1e4;

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

/// Fields that act as forces: multipliers, and those whose own diagonal has no positive entry. A force acts on something: one of
/// the latter that stands beside other forces alone is what these act on, such as the way of a rigid platen that a
/// multiplier ties to a body.
fn forces(system: &System, matrix: &Csr) -> Vec<usize> {
    let fields = 0..system.fields.len();
    let is_multiplier = |field: usize| system.fields[field].kind == FieldKind::Multiplier;
    let without_stiffness: Vec<bool> =
        fields.clone().map(|k| free(system, k).all(|row| matrix.get(row, row) <= 0.0)).collect();
    let mut field_of_row = vec![0; matrix.n_rows()];
    fields.clone().for_each(|field| free(system, field).for_each(|row| field_of_row[row] = field));
    let acts_on_some = |field: usize| {
        let is_entry = |(column, value): (&u32, &f64)| {
            let other = field_of_row[*column as usize];
            *value != 0.0 && other != field && !is_multiplier(other) && !without_stiffness[other]
        };
        let acts = |row: usize| {
            let (columns, values) = matrix.row(row);
            columns.iter().zip(values).any(is_entry)
        };
        free(system, field).any(acts)
    };
    let acts_as_force = |field: &usize| is_multiplier(*field) || without_stiffness[*field] && acts_on_some(*field);
    fields.filter(acts_as_force).collect()
}

/// Free unknowns of a field.
fn free(system: &System, field: usize) -> impl Iterator<Item = usize> {
    let range = system.range(field).into_iter().flatten();
    range.map(|dof| system.numbering.free[dof]).filter(|free| *free != FIXED).map(|free| free as usize)
}

/// Free unknowns of the fields that act as forces.
fn of_forces(system: &System, matrix: &Csr) -> usize {
    forces(system, matrix).into_iter().map(|field| free(system, field).count()).sum()
}

/// An odd number of real growth rates of a tangent that is not symmetric.
///
/// With a mass M on the displacements, a motion that grows as exp(s t) is a root lambda = s^2 > 0 of the polynomial
/// det(K + lambda M), which has the sign of its first coefficient for large lambda. Where det K has the other one, the roots in
/// between are odd in number. Multipliers have no mass, so that the first coefficient has a sign of its own, which is that of
/// a determinant with lambda so large that all roots lie below.
fn by_determinant(system: &System, solver: &LinearSolver, tangent: &Tangent) -> Option<Unstable> {
    if !system.has_nonlinear_bodies() {
        return None;
    }
    let is_negative = if system.fields.iter().any(|f| f.kind == FieldKind::Multiplier) {
        let matrix = system.whole_matrix(tangent).ok()?;
        let is_negative = solver.sign_of(&matrix)?;
        is_negative != solver.sign_of(&with_masses(system, matrix)?)?
    } else {
        solver.beside(system).ok()?.is_negative(system, tangent).ok()??
    };
    is_negative.then_some(Unstable::Odd)
}

/// The matrix and a mass of the unknowns that are no forces, larger than all that it could balance.
fn with_masses(system: &System, mut matrix: Csr) -> Option<Csr> {
    let mass = HEAVY * matrix.norm_inf();
    let as_forces = forces(system, &matrix);
    for field in (0..system.fields.len()).filter(|field| !as_forces.contains(field)) {
        for row in free(system, field) {
            matrix.add_to(row, row, mass).then_some(())?;
        }
    }
    Some(matrix)
}
