//! Rules whose points are nodes of continuous fields, or as many as these have nodes.
//!
//! A law that binds a field at each point of a rule (contact) does so once for each node under these rules. With more
//! points it binds the field more often than the field can follow, however fine the mesh is.

use super::{
    QuadratureError, Rule,
    line::{gauss_jacobi, lobatto_line},
    rule, simplex,
};
use crate::cell::CellKind;

/// The nodal rule: the vertices, each with the integral of its hat function. Exact for degree 1.
#[must_use]
pub fn vertex(kind: CellKind) -> Rule {
    Rule { kind, degree: 1, points: kind.vertices().to_vec(), weights: kind.vertex_weights() }
}

/// The nodal rule of a Lagrange element: its nodes, in its order, each with the integral of its basis function.
/// Degree 1 is [`vertex`]; degree 2 on tensor cells is Simpson's rule, exact for degree 3 in each variable.
///
/// # Errors
/// [`QuadratureError::NoNodalRule`] above degree 1 on cells with triangles, where the integrals of the vertex
/// functions are not positive, and above degree 2.
pub fn nodal(kind: CellKind, degree: usize) -> Result<Rule, QuadratureError> {
    match degree {
        0 | 1 => Ok(vertex(kind)),
        2 if kind.is_product_of_segments() => Ok(lobatto(kind, 3)),
        _ => Err(QuadratureError::NoNodalRule { kind, degree }),
    }
}

/// The rule with one point for each node of continuous Lagrange elements of a degree, as far as there is one with positive
/// weights. Degree 1: the vertices. On tensor cells the Gauss-Lobatto rule of `degree + 1` points in each direction (degree
/// 2: the nodes), exact for degree `2 degree - 1` in each variable. On triangles of degree 2 the midpoints of the edges,
/// whose basis functions alone have an integral; exact for degree 2. On triangles of degree 3, tetrahedra, wedges and pyramids a rule of
/// degree `2 degree - 2`, which has about as many points as there are nodes a cell.
#[must_use]
pub fn one_per_node(kind: CellKind, degree: usize) -> Rule {
    match degree {
        _ if kind.dim() == 0 => vertex(kind),
        0 | 1 => vertex(kind),
        _ if kind.is_product_of_segments() => lobatto(kind, degree + 1),
        2 if kind == CellKind::Triangle => simplex::edge_midpoints(),
        _ => rule(kind, 2 * degree - 2).unwrap_or_else(|_| vertex(kind)),
    }
}

/// The rule of a segment at whose other end than `end` (0 or 1) the integrand vanishes like the distance to it: a face that
/// touches the axis of a body of revolution. One point for each node, that of the axis inside.
///
/// Above degree 1 the Gauss-Radau rule of `degree + 1` points, exact for degree `2 degree`. Beside trapezoidal rules, degree
/// 1, it is another one: for the integrand `r p` they give the inner node of each face `h^2 p/6` less than the integral of
/// its hat function and the outer one as much more, so that nodes between two faces are right; the point at 1/3 gives the
/// node on the axis what is its own, `h^2 p/6`, and the end the share of a trapezoidal rule, `h^2 p/2`. A rule of degree 2
/// here leaves the first node a force a sixth too small, and its pressure a fifth too large.
#[must_use]
pub fn beside_axis(degree: usize, end: usize) -> Rule {
    let mut line: Vec<(f64, f64)> = if degree == 1 {
        vec![(1.0 / 3.0, 0.75), (1.0, 5.0 / 12.0)]
    } else {
        gauss_jacobi(degree, 1).into_iter().map(|(t, weight)| (t, weight / (1.0 - t))).collect()
    };
    if degree != 1 {
        let rest = 1.0 - line.iter().map(|(_, weight)| weight).sum::<f64>();
        line.push((1.0, rest));
    }
    let place = |t: f64| if end == 1 { t } else { 1.0 - t };
    Rule {
        kind: CellKind::Segment,
        degree: if degree == 1 { 0 } else { 2 * degree },
        points: line.iter().map(|(t, _)| [place(*t), 0.0, 0.0]).collect(),
        weights: line.iter().map(|(_, weight)| *weight).collect(),
    }
}

/// Products of Gauss-Lobatto rules of `n` points, lexicographic, x fastest.
fn lobatto(kind: CellKind, n: usize) -> Rule {
    let (line, dim) = (lobatto_line(n), kind.dim());
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for k in 0..n.pow(u32::try_from(dim).expect("at most 3")) {
        let (mut point, mut weight, mut rest) = ([0.0; 3], 1.0, k);
        for x in point.iter_mut().take(dim) {
            let (at, w) = line[rest % n];
            *x = at;
            weight *= w;
            rest /= n;
        }
        points.push(point);
        weights.push(weight);
    }
    Rule { kind, degree: 2 * n - 3, points, weights }
}
