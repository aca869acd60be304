//! Tensor products of Gauss-Legendre rules on `[0, 1]^dim`, points lexicographic, x fastest.

use super::line::gauss_jacobi;

/// Points and weights with `n` points along each of `dim` directions; one point for `dim` 0.
pub(super) fn gauss(dim: usize, n: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let line = gauss_jacobi(n, 0);
    let count = n.pow(dim as u32);
    let (mut points, mut weights) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for position in 0..count {
        let (mut point, mut weight, mut rest) = ([0.0; 3], 1.0, position);
        for x in point.iter_mut().take(dim) {
            let (t, w) = line[rest % n];
            (*x, weight, rest) = (t, weight * w, rest / n);
        }
        points.push(point);
        weights.push(weight);
    }
    (points, weights)
}
