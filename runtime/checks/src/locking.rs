//! Volumetric locking: nearly incompressible bodies on elements of degree 1.
//!
//! Where the resistance of a body to changes of volume exceeds that to changes of shape by orders of magnitude, elements of
//! degree 1 have hardly a deformation that keeps the volume of each cell: they are too stiff, and their pressures alternate
//! from cell to cell (Hughes, The Finite Element Method, ch. 4; Babuska and Suri 1992). Found from the tangent at points of
//! the cells, so whatever the parameters are called. Rules of one point leave the volume of quadrilaterals and hexahedra
//! free and are not judged, and neither are fields of pressure: what a multiplier enforces is no stiffness.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    system::System,
};
use wfl_mesh::mesh::CellId;

use crate::definite::{PointStiffness, sampled_cells, stiff_terms, stiffness};
use crate::worst::Finding;

/// Lame's first parameter, in units of the second, from which a body counts as nearly incompressible: that of a Poisson number of
/// 0.495, above which the manuals of commercial programs ask for mixed elements.
const LAMBDA_OVER_MU: f64 = 99.0;

/// A nearly incompressible body on elements of degree 1.
#[derive(Clone, Debug, PartialEq)]
pub struct LockedBody {
    /// The field.
    pub field: String,
    /// The terms that act there, by name.
    pub terms: Vec<String>,
    /// Lame's first parameter over the second, of an isotropic body with the same stiffness against volume and shape.
    pub ratio: f64,
    /// Where.
    pub position: [f64; 3],
}

/// The displacements of degree 1 whose bodies are nearly incompressible at the state without displacement, each with the
/// point of the largest ratio that was looked at.
#[must_use]
pub fn locked_bodies(system: &System) -> Vec<LockedBody> {
    let dim = system.mesh.dim();
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    let low = |k: &usize| {
        let f = &system.fields[*k];
        f.kind == FieldKind::Unknown && f.n_components == dim && f.degree() == 1 && system.range(*k).is_some()
    };
    let all = (0..system.fields.len()).filter(|k| dim > 1 && low(k));
    all.filter_map(|k| locked_body(system, k, values.view())).collect()
}

fn locked_body(system: &System, field: usize, values: FieldValues<'_>) -> Option<LockedBody> {
    let terms = stiff_terms(system, field);
    let mut worst: Option<LockedBody> = None;
    for cell in terms.iter().flat_map(|t| sampled_cells(system, t)).collect::<Vec<_>>() {
        let full = |t: &&AssembledTerm| integrates(t, cell);
        let terms: Vec<&AssembledTerm> = terms.iter().copied().filter(full).collect();
        let Some(PointStiffness { matrix, terms, position }) = stiffness(system, field, &terms, cell, values) else {
            continue;
        };
        let ratio = volume_over_shape(&matrix, system.mesh.dim());
        if ratio > LAMBDA_OVER_MU && worst.as_ref().is_none_or(|w| ratio > w.ratio) {
            worst = Some(LockedBody { field: system.fields[field].name.clone(), terms, ratio, position });
        }
    }
    let own = worst.map(|LockedBody { terms, ratio, position: [x, y, z], .. }| Finding {
        size: ratio,
        numbers: vec![x, y, z],
        names: terms,
    });
    let Finding { size, numbers, names } = Finding::worst(own, system.team())?;
    let position = numbers.try_into().ok()?;
    Some(LockedBody { field: system.fields[field].name.clone(), terms: names, ratio: size, position })
}

/// True on cells of one gradient, and for rules of more than one point.
fn integrates(term: &AssembledTerm, cell: CellId) -> bool {
    let groups = &term.integrator.domain.groups;
    let own = groups.iter().find(|g| g.here.cells.contains(&cell));
    own.is_some_and(|g| g.here.kind.straight_is_affine() || g.n_points() > 1)
}

/// lambda / mu of the isotropic law lambda tr(e) 1 + 2 mu e with the resistance that a stiffness over the entries of the
/// gradient has against a change of volume, `2 mu + dim lambda` by unit direction, and against the change of shape that it
/// resists most, `2 mu`. 0 where no change of shape is resisted.
fn volume_over_shape(stiffness: &DMatrix<f64>, dim: usize) -> f64 {
    let n = dim * dim;
    let identity = DVector::from_fn(n, |k, _| if k % (dim + 1) == 0 { 1.0 } else { 0.0 });
    let unit: DVector<f64> = &identity / identity.norm();
    let symmetric = 0.5 * (stiffness + stiffness.transpose());
    let volume = (unit.transpose() * &symmetric * &unit)[(0, 0)];
    let without = DMatrix::identity(n, n) - &unit * unit.transpose();
    let shape = SymmetricEigen::new(&without * symmetric * &without).eigenvalues.max();
    #[expect(clippy::cast_precision_loss, reason = "2 or 3")]
    let dim = dim as f64;
    if shape > 0.0 { 2.0 * (volume / shape - 1.0) / dim } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lame_parameters_come_back_from_the_stiffness_of_an_isotropic_body() {
        for dim in [2usize, 3] {
            let n = dim * dim;
            let (lambda, mu) = (700.0, 3.5);
            let entry = |k: usize| (k % dim, k / dim);
            let same = |a: usize, b: usize| if a == b { 1.0 } else { 0.0 };
            let matrix = DMatrix::from_fn(n, n, |p, q| {
                let ((i, j), (k, l)) = (entry(p), entry(q));
                lambda * same(i, j) * same(k, l) + mu * (same(i, k) * same(j, l) + same(i, l) * same(j, k))
            });
            assert!((volume_over_shape(&matrix, dim) - lambda / mu).abs() < 1e-9);
        }
    }
}
