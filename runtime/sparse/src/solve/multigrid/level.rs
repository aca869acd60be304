//! One level of the multigrid preconditioner: its matrix and the smoother.
//!
//! The smoother is a Chebyshev polynomial of `D⁻¹ A`, D the diagonal blocks, that is small on the upper part of the
//! spectrum (M. Adams, M. Brezina, J. Hu, R. Tuminaro, Parallel multigrid smoothing, J. Comput. Phys. 188 (2003)); the
//! recursion is that of Saad, Iterative methods for sparse linear systems, algorithm 12.1. It is symmetric, and the same
//! bits for any number of threads.

use rayon::prelude::*;

use super::blocks::{ROWS_PER_TASK, Real, RowBuffer, Rows};
use crate::solve::SolveError;

/// Products of the polynomial with the matrix.
pub(super) const DEGREE: usize = 3;
/// The smoother acts on the part of the spectrum from the largest eigenvalue down to it by this factor.
const RANGE: f64 = 20.0;
/// What an estimate of the largest eigenvalue from below is multiplied by.
const ABOVE: f64 = 1.1;
/// Steps of Lanczos' method for it: leaves a few percent.
const LANCZOS: usize = 10;
/// Numbers in one task of a vector operation.
const CHUNK: usize = 8192;

/// A square matrix by nodes, as a level needs it.
pub(super) trait Product<T: Real> {
    /// Unknowns of a node.
    fn size(&self) -> usize;

    /// Rows of single entries.
    fn n_unknowns(&self) -> usize;

    /// Bytes that it holds.
    fn bytes(&self) -> usize;

    /// For each row of blocks `then(row, A x, out)`, where `out` is the part of a vector that belongs to the row.
    fn for_each_row(&mut self, x: &[T], out: &mut [T], then: impl Fn(usize, &[T], &mut [T]) + Sync);

    /// `y = A x`.
    fn multiply(&mut self, x: &[T], y: &mut [T]) {
        self.for_each_row(x, y, |_, sum, out| out.copy_from_slice(sum));
    }

    /// `r = b - A x`.
    fn residual(&mut self, b: &[T], x: &[T], r: &mut [T]) {
        self.for_each_row(x, r, |row, sum, out| {
            for ((out, b), sum) in out.iter_mut().zip(&b[row * sum.len()..]).zip(sum) {
                *out = *b - *sum;
            }
        });
    }
}

/// A level with a matrix of this kind.
pub(super) struct Level<T, A> {
    pub(super) a: A,
    /// Inverses of the diagonal blocks.
    inverse: Vec<T>,
    /// Largest eigenvalue of `D⁻¹ A`, from above.
    pub(super) largest: f64,
    direction: Vec<T>,
}

impl<T: Real, A: Product<T>> Level<T, A> {
    /// Takes a matrix, as it is and with the inverses of its diagonal blocks.
    pub(super) fn new(a: A, inverse: &[f64]) -> Self {
        let direction = vec![T::default(); a.n_unknowns()];
        let inverse = inverse.iter().map(|value| T::of(*value)).collect();
        let mut this = Self { a, inverse, largest: 1.0, direction };
        this.largest = ABOVE * this.largest_eigenvalue();
        this
    }

    /// Puts another block on the diagonal of a row into the smoother; false where it has no inverse.
    pub(super) fn set_diagonal(&mut self, row: usize, block: &[f64]) -> bool {
        let size = self.a.size();
        let mut inverse = [0.0; 36];
        let has_inverse = invert(block, size, &mut inverse[..size * size]).is_ok();
        if has_inverse {
            let out = &mut self.inverse[row * size * size..][..size * size];
            out.iter_mut().zip(&inverse).for_each(|(out, value)| *out = T::of(*value));
        }
        has_inverse
    }

    /// Bytes of matrix and vectors.
    pub(super) fn bytes(&self) -> usize {
        self.a.bytes() + size_of::<T>() * (self.inverse.len() + self.direction.len())
    }

    /// `x` = polynomial applied to `b`.
    pub(super) fn smooth_from_zero(&mut self, b: &[T], x: &mut [T]) {
        let size = self.a.size();
        let factor = T::of(1.0 / self.middle());
        let inverse = &self.inverse;
        self.direction.par_chunks_mut(size * ROWS_PER_TASK).enumerate().for_each(|(chunk, out)| {
            for (offset, out) in out.chunks_exact_mut(size).enumerate() {
                let row = chunk * ROWS_PER_TASK + offset;
                block_times(&inverse[row * size * size..][..size * size], &b[row * size..][..size], |c, sum| {
                    out[c] = factor * sum;
                });
            }
        });
        x.copy_from_slice(&self.direction);
        self.further_steps(b, x);
    }

    /// Smooths the error of `x`.
    pub(super) fn smooth(&mut self, b: &[T], x: &mut [T]) {
        self.step(b, x, 0.0, 1.0 / self.middle());
        self.further_steps(b, x);
    }

    fn middle(&self) -> f64 {
        0.5 * self.largest * (1.0 + 1.0 / RANGE)
    }

    fn further_steps(&mut self, b: &[T], x: &mut [T]) {
        let half = 0.5 * self.largest * (1.0 - 1.0 / RANGE);
        let sigma = self.middle() / half;
        let mut rho = 1.0 / sigma;
        for _ in 1..DEGREE {
            let next = 1.0 / (2.0 * sigma - rho);
            self.step(b, x, next * rho, 2.0 * next / half);
            rho = next;
        }
    }

    /// `d = keep d + factor D⁻¹ (b - A x)`, `x = x + d`.
    fn step(&mut self, b: &[T], x: &mut [T], keep: f64, factor: f64) {
        let (keep, factor) = (T::of(keep), T::of(factor));
        let (inverse, size) = (&self.inverse, self.a.size());
        self.a.for_each_row(x, &mut self.direction, |row, sum, out| {
            let mut residual = [T::default(); 6];
            for ((residual, sum), b) in residual.iter_mut().zip(sum).zip(&b[row * size..]) {
                *residual = *b - *sum;
            }
            block_times(&inverse[row * size * size..][..size * size], &residual[..size], |c, sum| {
                out[c] = keep * out[c] + factor * sum;
            });
        });
        x.par_chunks_mut(CHUNK).zip(self.direction.par_chunks(CHUNK)).for_each(|(x, d)| {
            x.iter_mut().zip(d).for_each(|(x, d)| *x += *d);
        });
    }

    /// The largest eigenvalue of `D⁻¹ A` from below, by Lanczos' method in the form of conjugate gradients (Saad,
    /// section 6.7.3) from a fixed start.
    fn largest_eigenvalue(&mut self) -> f64 {
        let n = self.a.n_unknowns();
        let size = self.a.size();
        let inverse = &self.inverse;
        let jacobi = |r: &[T], z: &mut [T]| {
            for (row, out) in z.chunks_exact_mut(size).enumerate() {
                let inverse = &inverse[row * size * size..][..size * size];
                block_times(inverse, &r[row * size..][..size], |c, sum| out[c] = sum);
            }
        };
        // golden-ratio numbers: fixed, and orthogonal to no vector in particular
        let mut r: Vec<T> = (1..=n).map(|i| T::of((i as f64 * 0.618_033_988_749_894_9).fract() - 0.5)).collect();
        let mut z = vec![T::default(); n];
        jacobi(&r, &mut z);
        let (mut p, mut q) = (z.clone(), z.clone());
        let mut rz = dot(&r, &z);
        let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut before = 0.0;
        for _ in 0..LANCZOS {
            self.a.multiply(&p, &mut q);
            let alpha = rz / dot(&p, &q);
            if !(alpha.is_finite() && alpha > 0.0) {
                break;
            }
            diagonal.push(1.0 / alpha + before);
            r.iter_mut().zip(&q).for_each(|(r, q)| *r -= T::of(alpha) * *q);
            jacobi(&r, &mut z);
            let next = dot(&r, &z);
            let beta = next / rz;
            if !(beta.is_finite() && beta > 0.0) {
                break;
            }
            beside.push(beta.sqrt() / alpha);
            before = beta / alpha;
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = *z + T::of(beta) * *p);
            rz = next;
        }
        largest_of_tridiagonal(&diagonal, &beside).max(f64::MIN_POSITIVE)
    }
}

/// Largest eigenvalue of a symmetric tridiagonal matrix, by bisection on the signs of its pivots; 1 for none.
fn largest_of_tridiagonal(diagonal: &[f64], beside: &[f64]) -> f64 {
    if diagonal.is_empty() {
        return 1.0;
    }
    let off = |i: usize| beside.get(i).copied().unwrap_or(0.0).abs();
    let (mut low, mut high) = (0.0f64, 0.0f64);
    for i in 0..diagonal.len() {
        let left = if i > 0 { off(i - 1) } else { 0.0 };
        let right = if i + 1 < diagonal.len() { off(i) } else { 0.0 };
        high = high.max(diagonal[i] + left + right);
        low = low.max(diagonal[i]);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let mut pivot = 1.0;
        let above = (0..diagonal.len()).any(|i| {
            let coupling = if i > 0 { off(i - 1) } else { 0.0 };
            pivot = middle - diagonal[i] - if i > 0 { coupling * coupling / pivot } else { 0.0 };
            pivot <= 0.0
        });
        if above { low = middle } else { high = middle }
    }
    high
}

/// `then(c, (M x)_c)` for a small square matrix by rows.
#[inline(always)]
fn block_times<T: Real>(matrix: &[T], x: &[T], mut then: impl FnMut(usize, T)) {
    for (c, row) in matrix.chunks_exact(x.len()).enumerate() {
        let mut sum = T::default();
        row.iter().zip(x).for_each(|(m, x)| sum += *m * *x);
        then(c, sum);
    }
}

/// Sum of products, in double precision and in one order for any number of threads.
pub(super) fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    let part = |(a, b): (&[T], &[T])| {
        let mut sums = [0.0f64; 8];
        let (eights, rest) = (a.as_chunks::<8>(), b.as_chunks::<8>());
        for (a, b) in eights.0.iter().zip(rest.0) {
            (0..8).for_each(|k| sums[k] += a[k].wide() * b[k].wide());
        }
        let left: f64 = eights.1.iter().zip(rest.1).map(|(a, b)| a.wide() * b.wide()).sum();
        sums.iter().sum::<f64>() + left
    };
    let parts: Vec<f64> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(part).collect();
    parts.iter().sum()
}

/// Inverses of the diagonal blocks of a matrix.
///
/// # Errors
/// [`SolveError::NotPositiveDefinite`] with the place of the unknown in the vector.
pub(super) fn inverted_diagonal(a: &dyn Rows) -> Result<Vec<f64>, SolveError> {
    let (n, size) = (a.n_nodes(), a.size());
    let area = size * size;
    let mut inverse = vec![0.0; n * area];
    let failed = |buffer: &mut RowBuffer, (chunk, out): (usize, &mut [f64])| {
        for (offset, out) in out.chunks_exact_mut(area).enumerate() {
            let node = chunk * ROWS_PER_TASK + offset;
            let (columns, blocks) = a.row(node, buffer);
            let own = columns.binary_search(&(node as u32)).ok().map(|place| &blocks[place * area..][..area]);
            if let Err((component, pivot)) = own.map_or(Err((0, 0.0)), |block| invert(block, size, out)) {
                return Some((node * size + component, pivot));
            }
        }
        None
    };
    let found = inverse.par_chunks_mut(area * ROWS_PER_TASK).enumerate().map_init(RowBuffer::default, failed);
    let first: Vec<Option<(usize, f64)>> = found.collect();
    match first.into_iter().flatten().next() {
        Some((dof, pivot)) => Err(SolveError::NotPositiveDefinite { dof, pivot }),
        None => Ok(inverse),
    }
}

/// Inverses of diagonal blocks of `size` rows, node after node, times a number.
///
/// # Errors
/// [`SolveError::NotPositiveDefinite`] with the place of the unknown in the vector.
pub(super) fn inverted_blocks(blocks: &[f64], size: usize, factor: f64) -> Result<Vec<f64>, SolveError> {
    let mut inverse = vec![0.0; blocks.len()];
    let all = blocks.chunks_exact(size * size).zip(inverse.chunks_exact_mut(size * size));
    for (node, (block, out)) in all.enumerate() {
        if let Err((component, pivot)) = invert(block, size, out) {
            return Err(SolveError::NotPositiveDefinite { dof: node * size + component, pivot });
        }
        out.iter_mut().for_each(|entry| *entry *= factor);
    }
    Ok(inverse)
}

/// Gauss-Jordan elimination without a search for pivots, which are to be positive; else the row and the pivot.
fn invert(block: &[f64], n: usize, out: &mut [f64]) -> Result<(), (usize, f64)> {
    let mut work = [0.0f64; 36];
    work[..n * n].copy_from_slice(block);
    out.fill(0.0);
    (0..n).for_each(|i| out[i * n + i] = 1.0);
    for k in 0..n {
        let pivot = work[k * n + k];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err((k, pivot));
        }
        for j in 0..n {
            work[k * n + j] /= pivot;
            out[k * n + j] /= pivot;
        }
        for i in (0..n).filter(|i| *i != k) {
            let factor = work[i * n + k];
            for j in 0..n {
                work[i * n + j] -= factor * work[k * n + j];
                out[i * n + j] -= factor * out[k * n + j];
            }
        }
    }
    Ok(())
}
