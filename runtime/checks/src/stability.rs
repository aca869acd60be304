//! Whether an equilibrium is stable: how many directions there are in which the energy decreases.
//!
//! Where the tangent is symmetric the equations are those of a stationary point of an energy, and the state is a minimum
//! where the tangent is positive definite. Its negative eigenvalues are counted by the signs of pivots (Sylvester; Bathe,
//! Finite Element Procedures, 2014, 8.2.5 and 11.4). Fields that act as forces have one negative eigenvalue by unknown
//! in any state, stable or not: a multiplier, or a pressure, whose own diagonal has no positive entry; they are taken off.
//! A tangent that is not symmetric with a determinant of the other sign than that of a stable body has a real negative
//! eigenvalue, too. An equation means the same when it is multiplied by a number: what makes a tangent symmetric is applied
//! before eigenvalues are counted, and the sign of a determinant is compared with the one that the signs of the rows give it.
//!
//! Promises: what is called unstable is so, of the discrete equations; nothing of the run is changed but the kind of factor that
//! the next step is solved with. Costs nothing where the factor at hand is Cholesky's. Does not judge linear scenes, in
//! which no load changes the tangent, nor scenes with rates, whose states are no equilibria.

use std::sync::Arc;

use super::row_signs::{Groups, RowSigns, Signs, signs};
use wfl_compiler::types::{FieldKind, UniformSlot};
use wfl_discrete::system::{Branches, FIXED, System};
use wfl_linear::LinearSolver;
use wfl_sparse::csr::Csr;

/// Directions in which an equilibrium is not stable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unstable {
    /// So many, in each of which an energy of the unknowns decreases.
    Directions(usize),
    /// So many beside unknowns that act as forces (multipliers, pressures), or in equations of other signs than those of an energy.
    Beside(usize),
    /// An odd number: the tangent is not symmetric.
    Odd,
}

/// When a state is looked at whose factor says nothing: counts cost as much as a few iterations.
#[must_use]
pub fn is_due(step: usize, is_last: bool) -> bool {
    is_last || (step + 1).is_power_of_two()
}

/// What may be spent on the question whether a state is stable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spend {
    /// A factor, also where none says that it may not be.
    Factor,
    /// Nothing, but where there is a suspicion.
    Nothing,
}

/// That a state may not be stable.
pub struct Doubt<'a> {
    system: &'a System,
    u: &'a [f64],
    groups: Groups,
    /// A factor says so, and not only that nobody has looked.
    is_suspicious: bool,
    is_symmetric: bool,
}

/// The equations of the first step and the first values.
type Start<'a> = &'a dyn Fn() -> Option<(System, Vec<f64>)>;

/// Whether it is worth a tangent to know if the state `u` is stable; `rows` is what the run knows of the signs of its equations, from its
/// `start`.
#[must_use]
pub fn doubted<'a>(
    system: &'a System,
    u: &'a [f64],
    solver: &LinearSolver,
    spend: Spend,
    rows: &mut RowSigns,
    start: Start<'_>,
) -> Option<Doubt<'a>> {
    let known = solver.is_definite();
    let is_settled = known == Some(true) || system.is_linear() || has_rates(system);
    if is_settled || !system.team().is_alone() || !solver.is_ours() {
        return None;
    }
    let groups = Groups::of(system);
    // a factor of the whole that is not Cholesky's has met a tangent that is not positive definite
    let is_doubtful = known == Some(false) || solver.factors_all() && solver.lost_definiteness();
    // the levels of GMRES tell of the bodies, or of the motion, at the next step
    let is_due = spend == Spend::Factor && solver.factors_all() && !solver.iterates_by_gmres();
    let is_symmetric = solver.may_be_symmetric();
    // what the start says of rows is asked for where nothing else tells; the sign at hand may be that of the iterate before the last
    let mut has_turned = || {
        let at_hand = solver.has_negative_determinant().filter(|_| system.has_nonlinear_bodies());
        at_hand.and_then(|negative| Some(negative != groups.parity(rows.at(&groups, start))?))
    };
    let is_suspicious = match is_symmetric {
        true => is_doubtful || !is_due && has_turned() == Some(true),
        false => has_turned().unwrap_or(is_doubtful),
    };
    (is_due || is_suspicious).then_some(Doubt { system, u, groups, is_suspicious, is_symmetric })
}

/// The directions in which a state that is doubted is not stable; `None` where there are none, or where that is not known.
#[must_use]
pub fn unstable(
    doubt: &Doubt<'_>,
    solver: &mut LinearSolver,
    rows: &mut RowSigns,
    start: Start<'_>,
) -> Option<Unstable> {
    let Doubt { system, u, groups, is_suspicious, is_symmetric } = doubt;
    let mut tangent = system.new_tangent();
    system.tangent(u, Branches::AsWritten, &mut tangent).ok()?;
    if solver.finds_definite(&tangent) {
        return None;
    }
    let whole = system.whole_matrix(&tangent).ok()?;
    // nothing is lower than a minimum, however its equations are written
    let as_written = if *is_symmetric { LinearSolver::if_symmetric(whole.clone()).map(Arc::new) } else { None };
    let as_written = as_written.and_then(|matrix| solver.inertia(&matrix));
    if as_written.as_ref().is_some_and(|inertia| inertia.negative == 0) {
        return None;
    }
    let signs = signs(&whole, groups, rows.at(groups, start));
    match symmetric(system, whole, groups, &signs) {
        Ok(Symmetric { matrix, is_as_written }) => {
            let own = || if is_as_written { solver.inertia(&matrix) } else { solver.inertia_beside(&matrix) };
            let inertia = as_written.filter(|_| is_as_written).or_else(own);
            let (negative, of_forces) = (inertia?.negative, of_forces(system, &matrix));
            let found = if is_as_written && of_forces == 0 { Unstable::Directions } else { Unstable::Beside };
            (negative > of_forces).then(|| found(negative - of_forces))
        }
        Err(whole) if *is_suspicious => {
            let is_negative = system.has_nonlinear_bodies().then(|| solver.sign_of(&whole)).flatten();
            has_odd_roots(is_negative?, groups.parity(&signs)?).then_some(Unstable::Odd)
        }
        Err(_) => None,
    }
}

/// True where a term reads a rate or the increment.
fn has_rates(system: &System) -> bool {
    // `Rate(e)` divides by the increment, and has no slot of its own
    let is_rate = |slot: &UniformSlot| matches!(slot, UniformSlot::Rate(_) | UniformSlot::TimeStep);
    system.terms.iter().any(|term| term.law.prologue.slots.iter().any(is_rate))
}

/// A tangent as that of an energy, with positive stiffnesses of bodies.
struct Symmetric {
    matrix: Arc<Csr>,
    /// No row had to be multiplied.
    is_as_written: bool,
}

/// The tangent of equations each of which may be multiplied by a number so that they are those of an energy; the tangent itself
/// where they are none.
fn symmetric(system: &System, whole: Csr, groups: &Groups, signs: &[Option<bool>]) -> Result<Symmetric, Csr> {
    let of_group = |factors: &[f64], group: usize| {
        groups.of_row.iter().zip(factors).find(|(g, _)| **g as usize == group).is_some_and(|(_, factor)| *factor < 0.0)
    };
    let Some(factors) = LinearSolver::symmetrising(&whole, &groups.of_row) else { return Err(whole) };
    let symmetrised = |group: usize| signs[group].map(|turned| turned != of_group(&factors, group));
    let signs: Signs = (0..signs.len()).map(symmetrised).collect();
    let turned = groups.turned(system, &whole, &signs);
    let factors: Vec<f64> = factors.iter().zip(turned).map(|(factor, turned)| factor * turned).collect();
    let is_as_written = factors.iter().all(|factor| *factor == 1.0);
    let mut multiplied = whole.clone();
    if !is_as_written {
        multiplied.multiply_rows(&factors);
    }
    let Some(matrix) = LinearSolver::if_symmetric(multiplied) else { return Err(whole) };
    Ok(Symmetric { matrix: Arc::new(matrix), is_as_written })
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

/// Whether real growth rates of a tangent that is not symmetric are odd in number, from whether its determinant is negative, and
/// whether the signs with which its rows are written make that of a stable body so.
///
/// With a mass M on the displacements, a motion that grows as exp(s t) is a root lambda = s^2 > 0 of the polynomial
/// det(K + lambda M), which has the sign of its first coefficient for large lambda. Where det K has the other one, the roots in
/// between are odd in number. With rows of the right signs (`row_signs`) the first coefficient is positive.
fn has_odd_roots(is_negative: bool, would_be: bool) -> bool {
    is_negative != would_be
}
