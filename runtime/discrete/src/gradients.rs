//! Gradients of displacements as laws are tried with: rows are components, columns directions; what a space does not have is
//! zero. Knows no laws.

use crate::assemble::Gradient;

/// The identity.
#[must_use]
pub fn identity(dim: usize) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j && i < dim { 1.0 } else { 0.0 }))
}

/// A rotation by about 50 degrees: about the axis (1, 2, 2)/3 in space, with the cosine 0.64 (Rodrigues' formula).
#[must_use]
pub fn rotation(dim: usize) -> Gradient {
    let (c, s) = (0.64, (1.0f64 - 0.64 * 0.64).sqrt());
    if dim == 2 {
        return [[c, -s, 0.0], [s, c, 0.0], [0.0; 3]];
    }
    let a = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
    let cross = [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]];
    let unit = identity(3);
    std::array::from_fn(|i| std::array::from_fn(|j| c * unit[i][j] + s * cross[i][j] + (1.0 - c) * a[i] * a[j]))
}

/// a b
#[must_use]
pub fn product(a: &Gradient, b: &Gradient) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// a'
#[must_use]
pub fn transposed(a: &Gradient) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// a + factor b
#[must_use]
pub fn sum(a: &Gradient, b: &Gradient, factor: f64) -> Gradient {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + factor * b[i][j]))
}

/// The root of the sum of squares.
#[must_use]
pub fn norm(a: &Gradient) -> f64 {
    a.iter().flatten().map(|x| x * x).sum::<f64>().sqrt()
}

/// The largest size of an entry; not a number where one is none.
#[must_use]
pub fn largest(a: &Gradient) -> f64 {
    a.iter().flatten().fold(0.0, |m: f64, x| if x.is_nan() || m.is_nan() { f64::NAN } else { m.max(x.abs()) })
}
