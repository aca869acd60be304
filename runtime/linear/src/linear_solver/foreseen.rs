//! What is known of the factor of a scene before anything is assembled.
//!
//! Whether a symmetric matrix is definite, and whether one is symmetric in scaled equations, the numbers tell.

use wfl_discrete::{pruning::Pruning, system::System};

use super::super::plan::FactorKind;

/// The factor that a system asks for, before anything is assembled.
pub(super) fn factor(system: &System) -> FactorKind {
    match system.is_symmetric() && system.uses(Pruning::Symmetric) {
        false if groups(system).is_some() => FactorKind::Undecided,
        false => FactorKind::General,
        true if has_diagonal(system) => FactorKind::Definite,
        true => FactorKind::Indefinite,
    }
}

/// The field of each free dof, where there are several.
pub(super) fn groups(system: &System) -> Option<Vec<u32>> {
    if system.fields.len() < 2 || !system.uses(Pruning::Symmetric) {
        return None;
    }
    let field = |dof: &u32| system.numbering.describe(&system.fields, *dof as usize).0 as u32;
    Some(system.numbering.free_dofs.iter().map(field).collect())
}

/// Whether every unknown may have an entry on the diagonal; multipliers and the pressure of an incompressible flow have none.
fn has_diagonal(system: &System) -> bool {
    let (bulk, changing) = (system.bulk().pattern(), system.changing_pattern());
    (0..bulk.n_rows()).all(|dof| bulk.position(dof, dof).is_some() || changing.position(dof, dof).is_some())
}
