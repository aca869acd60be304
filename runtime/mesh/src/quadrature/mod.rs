//! Quadrature rules on the reference cells, and their points seen from the cells beside a facet.
//!
//! Promises: weights are positive, points lie in the cell, [`rule`] is exact for polynomials of
//! its degree (total degree on simplices, degree in each variable on tensor cells). Every rule is
//! a pure function of its arguments.

mod line;
mod rule;
mod simplex;
mod tensor;

use crate::cell::{CellKind, facet_correspondences};
pub use rule::Rule;

/// Most points along one direction.
pub const MAX_POINTS_PER_DIRECTION: usize = 64;

/// Why there is no such rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QuadratureError {
    /// A rule needs at least one point.
    #[error("a quadrature rule needs at least one point")]
    NoPoints,
    /// The degree needs more points than supported.
    #[error(
        "{per_direction} quadrature points along each direction are asked for, at most {MAX_POINTS_PER_DIRECTION} are supported"
    )]
    TooManyPoints {
        /// Points along each direction that would be needed.
        per_direction: usize,
    },
    /// No nodal rule with positive weights.
    #[error("no nodal rule of degree {degree} with positive weights on a {kind}; use `degree n`")]
    NoNodalRule {
        /// Requested cell.
        kind: CellKind,
        /// Degree of the element.
        degree: usize,
    },
}

/// A rule exact for `degree`: Gauss-Legendre with the fewest points on tensor cells, a symmetric
/// rule up to degree 6 and a collapsed Gauss-Jacobi rule above on triangles and tetrahedra. Degree
/// 0 gives one point.
///
/// # Errors
/// [`QuadratureError::TooManyPoints`].
pub fn rule(kind: CellKind, degree: usize) -> Result<Rule, QuadratureError> {
    match simplex::symmetric(kind, degree) {
        Some(rule) => Ok(rule),
        None => gauss(kind, degree / 2 + 1),
    }
}

/// The Gauss rule of `n` points along each direction, exact for degree `2 n - 1`; collapsed from
/// the cube on triangles and tetrahedra.
///
/// # Errors
/// [`QuadratureError`] when `n` is 0 or above [`MAX_POINTS_PER_DIRECTION`].
pub fn gauss(kind: CellKind, n: usize) -> Result<Rule, QuadratureError> {
    if n == 0 {
        return Err(QuadratureError::NoPoints);
    }
    if n > MAX_POINTS_PER_DIRECTION {
        return Err(QuadratureError::TooManyPoints { per_direction: n });
    }
    let (points, weights) = match kind {
        CellKind::Triangle | CellKind::Tetrahedron => simplex::collapsed(kind.dim(), n),
        _ => tensor::gauss(kind.dim(), n),
    };
    Ok(Rule { kind, degree: 2 * n - 1, points, weights })
}

/// The nodal rule: the vertices, each with the integral of its hat function. Exact for degree 1.
#[must_use]
pub fn vertex(kind: CellKind) -> Rule {
    let n = kind.n_vertices();
    Rule { kind, degree: 1, points: kind.vertices().to_vec(), weights: vec![kind.reference_volume() / n as f64; n] }
}

/// The nodal rule of a Lagrange element: its nodes, in its order, each with the integral of its basis function.
/// Degree 1 is [`vertex`]; degree 2 on tensor cells is Simpson's rule, exact for degree 3 in each variable.
///
/// # Errors
/// [`QuadratureError::NoNodalRule`] on triangles and tetrahedra above degree 1, where the integrals of the vertex
/// functions are not positive, and above degree 2.
pub fn nodal(kind: CellKind, degree: usize) -> Result<Rule, QuadratureError> {
    const SIMPSON: [(f64, f64); 3] = [(0.0, 1.0 / 6.0), (0.5, 2.0 / 3.0), (1.0, 1.0 / 6.0)];
    let tensor = !kind.is_simplex() || kind == CellKind::Segment;
    match degree {
        0 | 1 => Ok(vertex(kind)),
        2 if tensor && kind.dim() > 0 => {
            let dim = kind.dim();
            let (mut points, mut weights) = (Vec::new(), Vec::new());
            for k in 0..3usize.pow(u32::try_from(dim).expect("at most 3")) {
                let (mut point, mut weight, mut rest) = ([0.0; 3], 1.0, k);
                for x in point.iter_mut().take(dim) {
                    let (at, w) = SIMPSON[rest % 3];
                    *x = at;
                    weight *= w;
                    rest /= 3;
                }
                points.push(point);
                weights.push(weight);
            }
            Ok(Rule { kind, degree: 3, points, weights })
        }
        _ => Err(QuadratureError::NoNodalRule { kind, degree }),
    }
}

/// Points of a rule of a facet's kind, as reference points of the cell with that local facet.
/// Surface measure: the weights go with `|dx/ds x dx/dr|` of the facet parameters.
#[must_use]
pub fn facet_points(kind: CellKind, local_facet: usize, rule: &Rule) -> Vec<[f64; 3]> {
    let map = kind.facet_map(local_facet);
    rule.points.iter().map(|point| map.apply(*point)).collect()
}

/// Points of a facet rule given in the parameters of a facet here, as reference points of the cell
/// of `kind` there, whose local facet `local_facet` corresponds with orientation key `key`.
#[must_use]
pub fn oriented_points(kind: CellKind, local_facet: usize, key: u8, rule: &Rule) -> Vec<[f64; 3]> {
    let facet = kind.facets()[local_facet];
    let correspondence = facet_correspondences(facet.kind)[key as usize];
    let vertices = kind.vertices();
    let place = |parameters: &[f64; 3]| {
        let hats = facet.kind.hat_values(*parameters);
        let mut point = [0.0; 3];
        for (i, there) in correspondence.iter().enumerate().take(facet.vertices.len()) {
            let vertex = vertices[facet.vertices[*there as usize]];
            for d in 0..3 {
                point[d] += hats[i] * vertex[d];
            }
        }
        point
    };
    rule.points.iter().map(place).collect()
}

#[cfg(test)]
mod tests;
