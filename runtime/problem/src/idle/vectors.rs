//! Vectors of the components of a multiplier.

use nalgebra::DMatrix;

/// A coupling is none if it is below this part of the largest of the node.
pub(super) const NONE: f64 = 1e-6;

/// Orthonormal directions of `n` components to which all columns are orthogonal: axes first.
pub(super) fn null_space(n: usize, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let meets = |v: &[f64]| columns.iter().fold(0.0f64, |m, c| m.max(dot(c, v).abs()));
    let mut found: Vec<Vec<f64>> = (0..n).map(|k| unit(n, k)).filter(|v| meets(v) <= NONE).collect();
    let mut products = DMatrix::<f64>::zeros(n, n);
    for c in columns.iter().chain(&found) {
        for i in 0..n {
            for j in 0..n {
                products[(i, j)] += c[i] * c[j];
            }
        }
    }
    let eigen = products.symmetric_eigen();
    let largest = eigen.eigenvalues.iter().fold(0.0f64, |m, x| m.max(*x));
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        if *value <= NONE * NONE * largest {
            found.push(eigen.eigenvectors.column(k).iter().copied().collect());
        }
    }
    found
}

/// The unit vector along a component.
pub(super) fn unit(n: usize, component: usize) -> Vec<f64> {
    (0..n).map(|k| f64::from(u8::from(k == component))).collect()
}

/// The component that a unit vector is along; `None` of others.
pub(super) fn axis(v: &[f64]) -> Option<usize> {
    v.iter().position(|x| x.abs() >= 1.0)
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
