//! Which terms are laws of finite strain, and how far a way may be followed before they crush or blow up a cell.
//!
//! How a law is written says little. A rotation R of the deformed body turns its first Piola-Kirchhoff stress with it,
//! P(R F) = R P(F), and that of no law of small strains, of a velocity or of a gradient of something else does. That is
//! tried at the first point of some cells, once for a scene. Promises: reads states, changes none.

use wfl_compiler::{Class, types::FieldKind};
use wfl_mesh::mesh::CellId;

use super::System;
use crate::{
    assemble::{AssembledTerm, FieldValues, Gradient, VolumeLimit},
    gradients::{identity, largest, product, rotation, sum},
};

/// What rounding may leave of P(R F) - R P(F), in parts of the largest stress: stresses of nearly incompressible bodies
/// cancel to 1e-6 of their parts.
const ROUNDING: f64 = 1e-8;
/// Cells of a term that are looked at, spread evenly over it.
const CELLS: usize = 4;

/// A term of finite strain, and the displacement that it is one of, by their positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FiniteStrain {
    /// The term.
    pub term: usize,
    /// The field.
    pub field: usize,
}

impl System {
    /// The terms of finite strain; found at the state `u` where this is first asked.
    pub fn finite_strain(&self, u: &[f64]) -> &[FiniteStrain] {
        self.finite_strain.get_or_init(|| self.find_finite_strain(u))
    }

    fn find_finite_strain(&self, u: &[f64]) -> Vec<FiniteStrain> {
        let dim = self.mesh.dim();
        let bodies = |t: &AssembledTerm| t.on_cells() && t.law.class >= Class::Nonlinear;
        // one-dimensional bodies do not rotate
        if dim < 2 {
            return Vec::new();
        }
        let values = self.values(u);
        let displacement = |k: &usize| {
            let f = &self.fields[*k];
            f.kind == FieldKind::Unknown && f.n_components == dim && self.range(*k).is_some()
        };
        let pairs = (0..self.terms.len()).filter(|t| bodies(&self.terms[*t])).flat_map(|term| {
            (0..self.fields.len()).filter(displacement).map(move |field| FiniteStrain { term, field })
        });
        pairs.filter(|pair| self.is_objective(*pair, values.view())).collect()
    }

    /// True if the stress of the term turns with the body wherever that was tried.
    fn is_objective(&self, pair: FiniteStrain, values: FieldValues<'_>) -> bool {
        let term = &self.terms[pair.term];
        let found: Vec<Option<bool>> =
            some_cells(self, term).into_iter().map(|cell| self.turns_with(pair, cell, values)).collect();
        let is_refused = self.team().any(found.contains(&Some(false)));
        self.team().any(found.contains(&Some(true))) && !is_refused
    }

    /// The same at a point; `None` where there is no stress.
    fn turns_with(&self, pair: FiniteStrain, cell: CellId, values: FieldValues<'_>) -> Option<bool> {
        let dim = self.mesh.dim();
        let rotated = product(&rotation(dim), &deformation(dim));
        let asked = [deformation(dim), rotated].map(|f| sum(&f, &identity(dim), -1.0));
        let fluxes = self.terms[pair.term].flux_at_gradient(&self.mesh, values, cell, pair.field, &asked)?;
        let [stress, of_rotated] = fluxes.as_slice() else { return None };
        let size = largest(stress);
        if size == 0.0 || !size.is_finite() {
            return None;
        }
        Some(largest(&sum(of_rotated, &product(&rotation(dim), stress), -1.0)) <= ROUNDING * size)
    }

    /// How far the way between two states may be followed, in units of its length, before a volume of a body of finite
    /// strain changes by more than the limit; `limit.most` where there is no such body.
    #[must_use]
    pub fn way_of_volumes(&self, from: &[f64], to: &[f64], limit: VolumeLimit) -> f64 {
        let bodies = self.finite_strain(from);
        if bodies.is_empty() {
            return limit.most;
        }
        let (a, b) = (self.values(from), self.values(to));
        let way = |pair: &FiniteStrain| {
            self.terms[pair.term].way_of_volumes(&self.mesh, [a.view(), b.view()], pair.field, limit)
        };
        let longest = bodies.iter().map(way).fold(limit.most, f64::min);
        self.team().range(longest, longest)[0]
    }
}

/// Some cells of a term, by their places in the mesh, so that ranks look at the same ones.
fn some_cells(system: &System, term: &AssembledTerm) -> Vec<CellId> {
    let domain = &term.integrator.domain;
    let places = domain.places(&system.mesh);
    let stride = places.iter().map(|p| p.n).sum::<usize>().div_ceil(CELLS).max(1);
    let cells = domain.groups.iter().zip(&places).flat_map(|(g, places)| {
        let cells = g.here.cells.iter().zip(&places.of);
        cells.filter_map(|(cell, place)| Some((*cell, places.before + (*place)?)))
    });
    cells.filter(|(_, place)| place % stride == 0).map(|(cell, _)| cell).collect()
}

/// A deformation of no symmetry; its determinant is near 1.
fn deformation(dim: usize) -> Gradient {
    let f = [[1.06, 0.11, -0.05], [-0.07, 0.93, 0.08], [0.09, -0.04, 1.03]];
    std::array::from_fn(|i| std::array::from_fn(|j| if i < dim && j < dim { f[i][j] } else { 0.0 }))
}
