//! Points and weights of a rule.

use crate::cell::CellKind;

/// A quadrature rule: `sum weights[p] f(points[p])` approximates the integral of `f` over the
/// reference cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The cell.
    pub kind: CellKind,
    /// Degree of exactness.
    pub degree: usize,
    /// Reference points; unused coordinates are zero.
    pub points: Vec<[f64; 3]>,
    /// Weights, of sum [`CellKind::reference_volume`].
    pub weights: Vec<f64>,
}

impl Rule {
    /// Number of points.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.points.len()
    }
}
