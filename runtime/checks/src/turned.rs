//! Cells that turned inside out: points at which the determinant of F = Id + Grad_u is not positive, in bodies of finite
//! strain.
//!
//! A law that has a finite stress at negative volumes (Saint-Venant-Kirchhoff, or a volumetric energy (J - 1)^2) lets
//! Newton's method converge to states that no body can be in. Laws whose stress is not finite at a negative determinant (a
//! logarithm of it) keep cells from turning themselves and are not looked at, and neither are cells between the points of
//! their rule.

use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues, NegativeVolumes},
    gradients::{identity, sum},
    system::{FiniteStrain, System},
};
use wfl_mesh::mesh::CellId;

use crate::{definite::sampled_cells, worst::Finding};

/// Cells of a body that turned inside out.
#[derive(Clone, Debug, PartialEq)]
pub struct TurnedCells {
    /// The term.
    pub term: String,
    /// The displacement.
    pub field: String,
    /// Which and how far.
    pub volumes: NegativeVolumes,
}

/// The cells that turned inside out at the state `u`, by term of finite strain.
#[must_use]
pub fn turned_cells(system: &System, u: &[f64]) -> Vec<TurnedCells> {
    let bodies = system.finite_strain(u);
    let values = system.values(u);
    let mut found = Vec::new();
    for FiniteStrain { term, field } in bodies {
        let (term, field) = (&system.terms[*term], *field);
        if allows_negative_volumes(system, term, field, values.view())
            && let Some(volumes) = of_all(system, term, term.negative_volumes(&system.mesh, values.view(), field))
        {
            let (term, field) = (term.law.name.clone(), system.fields[field].name.clone());
            found.push(TurnedCells { term, field, volumes });
        }
    }
    found
}

/// From the cells that this rank counts to those of all ranks.
fn of_all(system: &System, term: &AssembledTerm, own: Option<NegativeVolumes>) -> Option<NegativeVolumes> {
    let (team, of) = (system.team(), term.integrator.domain.n_of_all(&system.mesh));
    let n_cells = team.count(own.map_or(0, |own| own.n_cells));
    let own = own.map(|NegativeVolumes { smallest, position, .. }| Finding {
        size: -smallest,
        numbers: position.to_vec(),
        names: Vec::new(),
    });
    let Finding { size, numbers, .. } = Finding::worst(own, team)?;
    Some(NegativeVolumes { n_cells, of, smallest: -size, position: numbers.try_into().ok()? })
}

/// True for a law that has a stress at negative determinants wherever that was tried.
fn allows_negative_volumes(system: &System, term: &AssembledTerm, field: usize, values: FieldValues<'_>) -> bool {
    let mut beyond = identity(system.mesh.dim());
    // turned inside out in one direction
    beyond[0][0] = -0.5;
    let beyond = [sum(&beyond, &identity(system.mesh.dim()), -1.0)];
    let is_finite = |cell: CellId| {
        let fluxes = term.flux_at_gradient(&system.mesh, values, cell, field, &beyond)?;
        Some(fluxes.iter().flatten().flatten().all(|x| x.is_finite()))
    };
    let found: Vec<Option<bool>> = sampled_cells(system, term).into_iter().map(is_finite).collect();
    let is_refused = system.team().any(found.contains(&Some(false)));
    system.team().any(found.contains(&Some(true))) && !is_refused
}
