//! Rules on the pyramid: the cube collapsed at its apex.
//!
//! With `x = w a`, `y = w b`, `z = 1 - w` the volume is `w^2 da db dz`: Gauss-Legendre points in a and b, Gauss-Jacobi ones
//! of the weight `(1 - z)^2` in z. Exact for `w^m a^i b^j` with m, i and j up to `2 n - 1`, which has the polynomials of
//! that degree and the products of Lagrange functions.

use super::line::gauss_jacobi;

/// Points and weights with `n` points along each direction.
pub(super) fn collapsed(n: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let (along, up) = (gauss_jacobi(n, 0), gauss_jacobi(n, 2));
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for (z, up) in &up {
        for (b, beside) in &along {
            for (a, weight) in &along {
                points.push([(1.0 - z) * a, (1.0 - z) * b, *z]);
                weights.push(weight * beside * up);
            }
        }
    }
    (points, weights)
}

/// The same with `n` points along each direction in each of `parts` even parts of the base, and as many layers of even
/// height. In a layer the weight `(1 - z)^2` is a polynomial, for which one point more is taken.
pub(super) fn composite(n: usize, parts: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let even = |line: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
        let size = 1.0 / parts as f64;
        (0..parts)
            .flat_map(|p| line.iter().map(move |(t, w)| (size * (p as f64 + t), size * w)).collect::<Vec<_>>())
            .collect()
    };
    let (along, up) = (even(gauss_jacobi(n, 0)), even(gauss_jacobi(n + 1, 0)));
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for (z, up) in &up {
        let w = 1.0 - z;
        for (b, beside) in &along {
            for (a, weight) in &along {
                points.push([w * a, w * b, *z]);
                weights.push(weight * beside * up * w * w);
            }
        }
    }
    (points, weights)
}
