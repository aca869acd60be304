//! The moduli of bodies whose stiffness is that of an isotropic or a cubic material with its axes along those of the scene.
//!
//! C11, C12 and C44 are all that such a stiffness has; it is isotropic if 2 C44 = C11 - C12. A shear strain that was counted
//! twice or half (an engineering strain for a component of the tensor, or the other way round) makes a cubic material of an
//! isotropic one, and nothing else does so with a factor of exactly 2 or 4. Taken from the tangent at a point of the cells
//! at the state without displacement. Does not judge.

use nalgebra::DMatrix;
use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp, InputSlot},
};
use wfl_discrete::{assemble::AssembledTerm, system::System};

use crate::definite::{sampled_cells, stiff_terms, stiffness};

/// What rounding may leave, in parts of the largest entry: entries are sums over some ten points, known to some hundred
/// roundoffs.
const ROUNDING: f64 = 1e-9;

/// A body with the stiffness of a cubic material (stress).
#[derive(Clone, Debug, PartialEq)]
pub struct CubicBody {
    /// The displacement.
    pub field: String,
    /// Its terms there.
    pub terms: Vec<String>,
    /// Stress along an axis by strain along it.
    pub c11: f64,
    /// By strain along another one.
    pub c12: f64,
    /// Shear stress by twice the shear strain: the shear modulus.
    pub c44: f64,
    /// Where.
    pub position: [f64; 3],
    /// The terms are linear, read neither the past nor states, and the field shares none of its terms with another one.
    pub is_plain: bool,
}

/// The displacements whose stiffness is cubic at the first cell that is looked at.
#[must_use]
pub fn cubic_bodies(system: &System) -> Vec<CubicBody> {
    let dim = system.mesh.dim();
    let vector = |k: &usize| {
        let f = &system.fields[*k];
        f.kind == FieldKind::Unknown && f.n_components == dim && !f.is_at_points() && system.range(*k).is_some()
    };
    // a rank that has no cell of a body says nothing of it, so that all are asked with the whole mesh alone
    let all = (0..system.fields.len()).filter(|k| dim > 1 && vector(k));
    system.mesh.check_whole(|| all.filter_map(|field| cubic_body(system, field)).collect())
}

fn cubic_body(system: &System, field: usize) -> Option<CubicBody> {
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&zero);
    let terms = stiff_terms(system, field);
    let cell = terms.iter().find_map(|t| sampled_cells(system, t).into_iter().next())?;
    let at = stiffness(system, field, &terms, cell, values.view())?;
    let [c11, c12, c44] = moduli(&at.matrix, system.mesh.dim())?;
    let own = |t: &&AssembledTerm| t.law.tests.iter().any(|s| s.field.index() == field && s.op == FieldOp::Grad);
    let is_plain = system.terms.iter().filter(|t| t.on_cells()).filter(own).all(|t| is_plain(t, field));
    let name = system.fields[field].name.clone();
    Some(CubicBody { field: name, terms: at.terms, c11, c12, c44, position: at.position, is_plain })
}

fn is_plain(term: &AssembledTerm, field: usize) -> bool {
    let own = |slot: &InputSlot| match slot {
        InputSlot::Field(b) => b.field.index() == field,
        InputSlot::Previous(_) | InputSlot::History(..) => false,
        _ => true,
    };
    term.law.class <= Class::Linear && term.law.inputs.iter().all(own)
}

/// C11, C12 and C44 of a stiffness over the entries of the gradient, if it has no others.
fn moduli(stiffness: &DMatrix<f64>, dim: usize) -> Option<[f64; 3]> {
    let (c11, c12, c44) = (stiffness[(0, 0)], stiffness[(0, dim + 1)], stiffness[(1, 1)]);
    let limit = ROUNDING * stiffness.amax();
    let n = dim * dim;
    let fits = |p: usize, q: usize| {
        let ((i, j), (k, l)) = ((p % dim, p / dim), (q % dim, q / dim));
        let expected = match (i == j, k == l) {
            (true, true) if i == k => c11,
            (true, true) => c12,
            (false, false) if (i, j) == (k, l) || (i, j) == (l, k) => c44,
            _ => 0.0,
        };
        (stiffness[(p, q)] - expected).abs() <= limit
    };
    (limit > 0.0 && (0..n).all(|p| (0..n).all(|q| fits(p, q)))).then_some([c11, c12, c44])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moduli_come_back_from_the_stiffness_and_an_unsymmetric_one_has_none() {
        for dim in [2usize, 3] {
            let n = dim * dim;
            let of = |c44: f64, swapped: f64| {
                DMatrix::from_fn(n, n, |p, q| {
                    let ((i, j), (k, l)) = ((p % dim, p / dim), (q % dim, q / dim));
                    match (i == j, k == l) {
                        (true, true) => {
                            if i == k {
                                7.0
                            } else {
                                3.0
                            }
                        }
                        (false, false) if (i, j) == (k, l) => c44,
                        (false, false) if (i, j) == (l, k) => swapped,
                        _ => 0.0,
                    }
                })
            };
            assert_eq!(moduli(&of(2.0, 2.0), dim), Some([7.0, 3.0, 2.0]));
            assert_eq!(moduli(&of(2.0, 0.0), dim), None);
        }
    }
}
