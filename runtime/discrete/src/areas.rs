//! Area vectors of the nodes of quadrilateral faces.
//!
//! A quadrilateral that is no parallelogram has another area vector (normal times measure) at each point. Under a rule whose
//! points are nodes, weights times the area vectors there do not integrate the basis functions, and a constant pressure gives
//! wrong forces. [`NodeAreas`] gives each point the area vector that the integral of its own function has: forces of a
//! constant stress are exact, on faces that are plane and on those that are not. Makes no rules.

use wfl_mesh::{
    element::{Element, Family, Table},
    mesh::{CellKind, Mesh},
    quadrature::{Rule, facet_points, gauss},
};

/// Points and weights are those of a nodal rule up to this.
const ROUNDING: f64 = 1e-12;

/// How the area vectors of points follow from those at Gauss points.
#[derive(Clone, Debug)]
pub struct NodeAreas {
    /// The geometry of the cell at Gauss points of the face, with first derivatives.
    pub(crate) geometry: Table,
    /// Of the product of the derivatives along the face at each Gauss point, `[point][Gauss point]`: weight and basis
    /// function over the weight of the point, with the sign that makes it point outward.
    pub(crate) shares: Vec<f64>,
}

impl NodeAreas {
    /// Those of facet `local` of cells of a kind; `None` unless it is a quadrilateral and the points of the rule are the
    /// nodes of an element, each with the integral of its function.
    #[must_use]
    pub fn new(mesh: &Mesh, kind: CellKind, local: usize, rule: &Rule) -> Option<Self> {
        let degree = match (rule.kind, rule.n_points()) {
            (CellKind::Quadrilateral, 4) => 1,
            (CellKind::Quadrilateral, 9) => 2,
            _ => return None,
        };
        let element = Element::lagrange(rule.kind, degree, Family::Continuous).ok()?;
        let near = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|d| (a[d] - b[d]).abs() < ROUNDING);
        let geometry = mesh.geometry_element(kind);
        // exact: the area vector has twice the degree of the map less one in each parameter
        let points = gauss(rule.kind, (degree + 2 * geometry.degree() - 1) / 2 + 1).ok()?;
        let functions = element.tabulate(&points.points, 0).values;
        let n = rule.n_points();
        let weight = |g: usize, q: usize| points.weights[g] * functions[g * n + q];
        let integral = |q: usize| (0..points.n_points()).map(|g| weight(g, q)).sum::<f64>();
        let is_nodal = (0..n)
            .all(|q| near(&rule.points[q], &element.points()[q]) && (rule.weights[q] - integral(q)).abs() < ROUNDING);
        let outward = dot(cross(kind.facet_map(local).tangents), kind.facet_normal(local)).signum();
        let share = |(q, g): (usize, usize)| outward * weight(g, q) / rule.weights[q];
        is_nodal.then(|| Self {
            geometry: geometry.tabulate(&facet_points(kind, local, &points), 1),
            shares: (0..n).flat_map(|q| (0..points.n_points()).map(move |g| (q, g))).map(share).collect(),
        })
    }

    /// The parts that the Gauss points have in the area vector of point `q`.
    pub(crate) fn of_point(&self, q: usize) -> &[f64] {
        let n = self.geometry.n_points;
        &self.shares[q * n..][..n]
    }
}

/// The vector product.
pub(crate) fn cross([a, b]: [[f64; 3]; 2]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
