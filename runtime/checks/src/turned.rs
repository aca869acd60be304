//! Cells that turned inside out: points at which the determinant of F = Id + Grad_u is not positive, in bodies of finite
//! strain.
//!
//! A law that has a finite stress at negative volumes (Saint-Venant-Kirchhoff, or a volumetric energy (J - 1)^2) lets
//! Newton's method converge to states that no body can be in. Which terms are laws of finite strain is not read off from
//! how they are written: a rotation R of the deformed body turns its first Piola-Kirchhoff stress with it, P(R F) = R P(F),
//! and that of no law of small strains, of a velocity or of a gradient of something else does. That is tried at a point of
//! some cells. Laws whose stress is not finite at a negative determinant (a logarithm of it) keep cells from turning
//! themselves and are not looked at, and neither are cells between the points of their rule.

use wfl_compiler::{Class, types::FieldKind};
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues, Gradient, NegativeVolumes},
    system::System,
};
use wfl_mesh::mesh::CellId;

use crate::{definite::sampled_cells, worst::Finding};

/// What rounding may leave of P(R F) - R P(F), in parts of the largest stress: stresses of nearly incompressible bodies
/// cancel to 1e-6 of their parts.
const ROUNDING: f64 = 1e-8;

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
    let dim = system.mesh.dim();
    let bodies = |t: &AssembledTerm| t.on_cells() && t.law.class >= Class::Nonlinear;
    // one-dimensional bodies do not rotate
    if dim < 2 || !system.terms.iter().any(bodies) {
        return Vec::new();
    }
    let values = system.values(u);
    let displacement = |k: &usize| {
        let f = &system.fields[*k];
        f.kind == FieldKind::Unknown && f.n_components == dim && system.range(*k).is_some()
    };
    let mut found = Vec::new();
    for term in system.terms.iter().filter(|t| bodies(t)) {
        for field in (0..system.fields.len()).filter(displacement) {
            if allows_negative_volumes(system, term, field, values.view())
                && let Some(volumes) = of_all(system, term, term.negative_volumes(&system.mesh, values.view(), field))
            {
                found.push(TurnedCells {
                    term: term.law.name.clone(),
                    field: system.fields[field].name.clone(),
                    volumes,
                });
            }
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

/// True for a law of finite strain that has a stress at negative determinants.
fn allows_negative_volumes(system: &System, term: &AssembledTerm, field: usize, values: FieldValues<'_>) -> bool {
    let cells = sampled_cells(system, term).into_iter();
    let found: Vec<Option<bool>> = cells.map(|cell| at_cell(system, term, field, cell, values)).collect();
    let is_refused = system.team().any(found.contains(&Some(false)));
    system.team().any(found.contains(&Some(true))) && !is_refused
}

/// The same at a point; `None` where there is no stress.
fn at_cell(system: &System, term: &AssembledTerm, field: usize, cell: CellId, values: FieldValues<'_>) -> Option<bool> {
    let dim = system.mesh.dim();
    let rotated = product(&rotation(dim), &deformation(dim));
    let asked = [&deformation(dim), &rotated, &turned(dim)].map(|f| sum(f, &identity(dim), -1.0));
    let fluxes = term.flux_at_gradient(&system.mesh, values, cell, field, &asked)?;
    let [stress, of_rotated, beyond] = fluxes.as_slice() else { return None };
    let size = largest(stress);
    if size == 0.0 || !size.is_finite() {
        return None;
    }
    let apart = sum(of_rotated, &product(&rotation(dim), stress), -1.0);
    let finite = beyond.iter().flatten().all(|x| x.is_finite());
    Some(largest(&apart) <= ROUNDING * size && finite)
}

fn identity(dim: usize) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j && i < dim { 1.0 } else { 0.0 }))
}

/// A deformation of no symmetry; its determinant is near 1.
fn deformation(dim: usize) -> Gradient {
    let f = [[1.06, 0.11, -0.05], [-0.07, 0.93, 0.08], [0.09, -0.04, 1.03]];
    std::array::from_fn(|i| std::array::from_fn(|j| if i < dim && j < dim { f[i][j] } else { 0.0 }))
}

/// A body turned inside out in one direction.
fn turned(dim: usize) -> Gradient {
    let mut f = identity(dim);
    f[0][0] = -0.5;
    f
}

/// A rotation by about 50 degrees: about the axis (1, 2, 2)/3 in space, with the cosine 0.64 (Rodrigues' formula).
fn rotation(dim: usize) -> Gradient {
    let (c, s) = (0.64, (1.0f64 - 0.64 * 0.64).sqrt());
    if dim == 2 {
        return [[c, -s, 0.0], [s, c, 0.0], [0.0; 3]];
    }
    let a = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
    let cross = [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]];
    let unit = identity(3);
    std::array::from_fn(|i| std::array::from_fn(|j| c * unit[i][j] + s * cross[i][j] + (1.0 - c) * a[i] * a[j]))
}

fn product(a: &Gradient, b: &Gradient) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// a + factor b
fn sum(a: &Gradient, b: &Gradient, factor: f64) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + factor * b[i][j]))
}

/// The largest size of an entry; not a number where one is none.
fn largest(a: &Gradient) -> f64 {
    a.iter().flatten().fold(0.0, |m: f64, x| if x.is_nan() || m.is_nan() { f64::NAN } else { m.max(x.abs()) })
}
