//! Quadrature rules on the reference cells, and their points seen from the cells beside a facet.
//!
//! Promises: weights are positive, points lie in the cell, [`rule`] is exact for polynomials of
//! its degree: total degree on simplices, degree in each variable on tensor cells, on wedges total degree on the triangle
//! times the degree along z, on pyramids degree in each of x/(1 - z), y/(1 - z) and 1 - z. Every rule is
//! a pure function of its arguments.

mod composite;
mod line;
mod nodal;
mod pyramid;
mod rule;
mod simplex;
mod tensor;

use crate::cell::{Basis, CellKind, facet_correspondences};
pub use composite::composite;
pub use nodal::{beside_axis, nodal, one_per_node, vertex};
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
/// rule up to degree 6 and a collapsed Gauss-Jacobi rule above on triangles and tetrahedra, the rule of a triangle times
/// that of a segment on wedges, a collapsed one on pyramids. Degree 0 gives one point.
///
/// # Errors
/// [`QuadratureError::TooManyPoints`].
pub fn rule(kind: CellKind, degree: usize) -> Result<Rule, QuadratureError> {
    if kind.basis() == Basis::Wedge {
        let (triangle, segment) = (self::rule(CellKind::Triangle, degree)?, self::rule(CellKind::Segment, degree)?);
        return Ok(product(kind, &triangle, &segment));
    }
    match simplex::symmetric(kind, degree) {
        Some(rule) => Ok(rule),
        None => gauss(kind, degree / 2 + 1),
    }
}

/// The rule of a triangle at each point of that of a segment.
fn product(kind: CellKind, triangle: &Rule, segment: &Rule) -> Rule {
    let all = || segment.points.iter().zip(&segment.weights);
    let at = |z: f64| triangle.points.iter().map(move |p| [p[0], p[1], z]);
    Rule {
        kind,
        degree: triangle.degree.min(segment.degree),
        points: all().flat_map(|(z, _)| at(z[0])).collect(),
        weights: all().flat_map(|(_, v)| triangle.weights.iter().map(move |w| w * v)).collect(),
    }
}

/// The Gauss rule of `n` points along each direction, exact for degree `2 n - 1`; collapsed from
/// the cube on triangles, tetrahedra and pyramids, and on the triangles of wedges.
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
    let (points, weights) = match kind.basis() {
        Basis::Simplex if kind.dim() > 1 => simplex::collapsed(kind.dim(), n),
        Basis::Simplex | Basis::Tensor => tensor::gauss(kind.dim(), n),
        Basis::Wedge => return Ok(product(kind, &gauss(CellKind::Triangle, n)?, &gauss(CellKind::Segment, n)?)),
        Basis::Pyramid => pyramid::collapsed(n),
    };
    Ok(Rule { kind, degree: 2 * n - 1, points, weights })
}

/// Points of a rule of a facet's kind, as reference points of the cell with that local facet.
/// Surface measure: the weights go with `|dx/ds x dx/dr|` of the facet parameters.
#[must_use]
pub fn facet_points(kind: CellKind, local_facet: usize, rule: &Rule) -> Vec<[f64; 3]> {
    let map = kind.facet_map(local_facet);
    rule.points.iter().map(|point| kind.facet_point(local_facet, map.apply(*point))).collect()
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
        kind.facet_point(local_facet, point)
    };
    rule.points.iter().map(place).collect()
}

#[cfg(test)]
mod tests;
