//! Dense triangular sweeps with one vector, over the panels of the fronts.
//!
//! A panel is (k + r) x k by columns: a k x k triangle above an r x k rectangle. Sums run in one fixed order, several
//! columns or lanes at a time so that the compiler vectorises them.
//!
//! Does not factor and does not check pivots.

/// Lanes of a dot product.
const LANES: usize = 8;

/// Diagonal of a triangular matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Diagonal {
    /// Stored on the diagonal.
    Stored,
    /// All ones, not stored.
    Unit,
}

/// `y = y - factor * column`.
fn subtract(column: &[f64], factor: f64, y: &mut [f64]) {
    for (out, value) in y.iter_mut().zip(column) {
        *out -= factor * value;
    }
}

/// `y = y - A x`, A by columns with the length of `y`, four columns at a time.
pub(super) fn subtract_product(a: &[f64], x: &[f64], y: &mut [f64]) {
    let n = y.len();
    if n == 0 {
        return;
    }
    let mut columns = a.chunks_exact(4 * n);
    let mut factors = x.chunks_exact(4);
    for (four, f) in (&mut columns).zip(&mut factors) {
        let (c0, rest) = four.split_at(n);
        let (c1, rest) = rest.split_at(n);
        let (c2, c3) = rest.split_at(n);
        for (i, out) in y.iter_mut().enumerate() {
            *out -= (c0[i] * f[0] + c1[i] * f[1]) + (c2[i] * f[2] + c3[i] * f[3]);
        }
    }
    for (column, &factor) in columns.remainder().chunks_exact(n).zip(factors.remainder()) {
        subtract(column, factor, y);
    }
}

/// Sum of products in [`LANES`] partial sums.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (mut first, mut second) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    for (x, y) in (&mut first).zip(&mut second) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let tail: f64 = first.remainder().iter().zip(second.remainder()).map(|(x, y)| x * y).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + tail
}

/// `y = y - Aᵀ x`, A by columns with the length of `x`.
pub(super) fn subtract_transposed_product(a: &[f64], x: &[f64], y: &mut [f64]) {
    if x.is_empty() {
        return;
    }
    for (column, out) in a.chunks_exact(x.len()).zip(y) {
        *out -= dot(column, x);
    }
}

/// Solves `T x = b` with the lower triangle of a panel and subtracts the rectangle times x from `below`.
pub(super) fn lower_sweep(panel: &[f64], diagonal: Diagonal, x: &mut [f64], below: &mut [f64]) {
    let (k, r) = (x.len(), below.len());
    let m = k + r;
    // Four columns at a time: their small triangle first, then the rows below all of them in one pass.
    let mut first = 0;
    while first + 4 <= k {
        let columns = &panel[first * m..(first + 4) * m];
        for j in 0..4 {
            if diagonal == Diagonal::Stored {
                x[first + j] /= columns[j * m + first + j];
            }
            for i in j + 1..4 {
                x[first + i] -= columns[j * m + first + i] * x[first + j];
            }
        }
        let f = [x[first], x[first + 1], x[first + 2], x[first + 3]];
        let c: [&[f64]; 4] = [0, 1, 2, 3].map(|j| &columns[j * m + first + 4..(j + 1) * m]);
        let n_inside = k - first - 4;
        subtract_four(c.map(|column| &column[..n_inside]), f, &mut x[first + 4..]);
        subtract_four(c.map(|column| &column[n_inside..]), f, below);
        first += 4;
    }
    for j in first..k {
        let column = &panel[j * m..(j + 1) * m];
        if diagonal == Diagonal::Stored {
            x[j] /= column[j];
        }
        let factor = x[j];
        subtract(&column[j + 1..k], factor, &mut x[j + 1..]);
        subtract(&column[k..], factor, below);
    }
}

fn subtract_four(c: [&[f64]; 4], f: [f64; 4], y: &mut [f64]) {
    let n = y.len();
    let [c0, c1, c2, c3] = c.map(|column| &column[..n]);
    for (i, out) in y.iter_mut().enumerate() {
        *out -= (c0[i] * f[0] + c1[i] * f[1]) + (c2[i] * f[2] + c3[i] * f[3]);
    }
}

/// Solves `Tᵀ x = b - Rᵀ below` with the lower triangle T and the rectangle R of a panel.
pub(super) fn lower_transposed_sweep(panel: &[f64], diagonal: Diagonal, x: &mut [f64], below: &[f64]) {
    let k = x.len();
    let m = k + below.len();
    for j in (0..k).rev() {
        let column = &panel[j * m..(j + 1) * m];
        let sum = x[j] - (dot(&column[j + 1..k], &x[j + 1..]) + dot(&column[k..], below));
        x[j] = if diagonal == Diagonal::Stored { sum / column[j] } else { sum };
    }
}

/// Solves `U x = b` with the upper triangle of the top of a panel with m rows.
pub(super) fn upper_sweep(panel: &[f64], m: usize, x: &mut [f64]) {
    for j in (0..x.len()).rev() {
        let column = &panel[j * m..j * m + x.len()];
        x[j] /= column[j];
        let factor = x[j];
        subtract(&column[..j], factor, &mut x[..j]);
    }
}

/// Solves `Uᵀ x = b` with the upper triangle of the top of a panel with m rows.
pub(super) fn upper_transposed_sweep(panel: &[f64], m: usize, x: &mut [f64]) {
    for j in 0..x.len() {
        let column = &panel[j * m..j * m + x.len()];
        x[j] = (x[j] - dot(&column[..j], &x[..j])) / column[j];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic numbers in (-1, 1).
    fn numbers(n: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 11) as f64 / (1u64 << 53) as f64) * 2.0 - 1.0
        };
        (0..n).map(|_| next()).collect()
    }

    fn close(a: &[f64], b: &[f64]) {
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() <= 1e-10 * (1.0 + y.abs()), "{a:?} {b:?}");
        }
    }

    #[test]
    fn sweeps_solve_their_triangles() {
        for k in 1..14 {
            for r in [0, 1, 5, 17] {
                let m = k + r;
                let mut panel = numbers(m * k, (k * 31 + r) as u64);
                for j in 0..k {
                    panel[j * m + j] += 4.0;
                }
                let at = |i: usize, j: usize| panel[j * m + i];
                let wanted = numbers(k, 7);
                let below = numbers(r, 9);
                for diagonal in [Diagonal::Stored, Diagonal::Unit] {
                    let d = |j: usize| if diagonal == Diagonal::Stored { at(j, j) } else { 1.0 };
                    let lower = |i: usize, j: usize| match i.cmp(&j) {
                        std::cmp::Ordering::Less => 0.0,
                        std::cmp::Ordering::Equal => d(j),
                        std::cmp::Ordering::Greater => at(i, j),
                    };
                    let mut x: Vec<f64> = (0..k).map(|i| (0..k).map(|j| lower(i, j) * wanted[j]).sum()).collect();
                    let mut y = below.clone();
                    lower_sweep(&panel, diagonal, &mut x, &mut y);
                    close(&x, &wanted);
                    let reduced: Vec<f64> =
                        (0..r).map(|i| below[i] - (0..k).map(|j| at(k + i, j) * wanted[j]).sum::<f64>()).collect();
                    close(&y, &reduced);
                    let mut x: Vec<f64> = (0..k)
                        .map(|j| {
                            (0..k).map(|i| lower(i, j) * wanted[i]).sum::<f64>()
                                + (0..r).map(|i| at(k + i, j) * below[i]).sum::<f64>()
                        })
                        .collect();
                    lower_transposed_sweep(&panel, diagonal, &mut x, &below);
                    close(&x, &wanted);
                }
                let mut x: Vec<f64> = (0..k).map(|i| (i..k).map(|j| at(i, j) * wanted[j]).sum()).collect();
                upper_sweep(&panel, m, &mut x);
                close(&x, &wanted);
                let mut x: Vec<f64> = (0..k).map(|j| (0..=j).map(|i| at(i, j) * wanted[i]).sum()).collect();
                upper_transposed_sweep(&panel, m, &mut x);
                close(&x, &wanted);
                let mut y = below.clone();
                let rectangle = numbers(r * k, 3);
                subtract_product(&rectangle, &wanted, &mut y);
                let direct: Vec<f64> =
                    (0..r).map(|i| below[i] - (0..k).map(|j| rectangle[j * r + i] * wanted[j]).sum::<f64>()).collect();
                close(&y, &direct);
            }
        }
    }
}
