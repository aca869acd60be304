//! Preconditioned conjugate gradients.
//!
//! In the flexible form (Notay, Flexible conjugate gradients, SIAM J. Sci. Comput. 22 (2000), with one direction kept),
//! since a preconditioner of single precision is symmetric up to its rounding only. The error is measured in the norm of
//! energy: `r' M r` for the residual r estimates the energy of the error as well as M stands for the inverse of A, and
//! the energy of the solution is the sum of what the steps have brought (Hestenes and Stiefel 1952).
//!
//! Promises: the same bits for any number of threads. Does not check the solution: `checked` residuals do.

use rayon::prelude::*;

use super::level::dot;

/// Numbers in one task of a vector operation.
const CHUNK: usize = 8192;
/// Iterations over which the rate is measured.
const WINDOW: usize = 40;

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ending {
    /// The error has the size that was asked for.
    Converged,
    /// Too many iterations, or hardly any progress.
    TooSlow,
    /// A direction with no positive energy: the matrix, or the preconditioner, is not positive definite.
    NotPositiveDefinite,
}

/// What was done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outcome {
    pub(super) iterations: usize,
    pub(super) ending: Ending,
    /// Estimated energy norm of the error relative to that of the solution.
    pub(super) error: f64,
}

/// A linear map of vectors of one length.
pub(super) trait LinearMap {
    /// `y = A x`.
    fn apply(&mut self, x: &[f64], y: &mut [f64]);
}

impl<F: FnMut(&[f64], &mut [f64])> LinearMap for F {
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self(x, y);
    }
}

/// When a solution is good enough: with whichever comes first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal<'a> {
    /// Error relative to the solution, in the norm of energy.
    pub(super) error: f64,
    /// 2-norm of the residual in scaled equations, by equation their scale; zero for a solution that is judged by its error
    /// alone.
    pub(super) left: f64,
    pub(super) scale: &'a [f64],
    /// Most iterations.
    pub(super) most: usize,
}

impl Goal<'_> {
    /// Whether so small an error, or this residual, is good enough.
    fn is_met(&self, error: f64, residual: &[f64]) -> bool {
        error <= self.error || self.left > 0.0 && scaled_norm(residual, self.scale) <= self.left
    }
}

/// Work space.
#[derive(Debug, Clone, Default)]
pub(super) struct ConjugateGradients {
    r: Vec<f64>,
    z: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
}

impl ConjugateGradients {
    /// The residual of the last solution, by the recursion.
    pub(super) fn residual(&self) -> &[f64] {
        &self.r
    }

    /// Solves `A x = b` from zero until the goal is met.
    pub(super) fn solve(
        &mut self,
        a: &mut dyn LinearMap,
        m: &mut dyn LinearMap,
        b: &[f64],
        x: &mut [f64],
        goal: Goal<'_>,
    ) -> Outcome {
        let n = b.len();
        for vector in [&mut self.r, &mut self.z, &mut self.p, &mut self.q] {
            vector.resize(n, 0.0);
        }
        x.fill(0.0);
        self.r.copy_from_slice(b);
        m.apply(&self.r, &mut self.z);
        self.p.copy_from_slice(&self.z);
        let mut rz = dot(&self.r, &self.z);
        let (mut energy, mut iterations, mut errors) = (0.0f64, 0, Vec::new());
        let ended = |iterations, ending, error| Outcome { iterations, ending, error };
        loop {
            if rz <= 0.0 || rz.is_nan() {
                let ending = if rz == 0.0 { Ending::Converged } else { Ending::NotPositiveDefinite };
                return ended(iterations, ending, 0.0);
            }
            a.apply(&self.p, &mut self.q);
            let pq = dot(&self.p, &self.q);
            if pq <= 0.0 || pq.is_nan() {
                return ended(iterations, Ending::NotPositiveDefinite, f64::INFINITY);
            }
            let alpha = rz / pq;
            add(alpha, &self.p, x);
            add(-alpha, &self.q, &mut self.r);
            energy += alpha * rz;
            iterations += 1;
            m.apply(&self.r, &mut self.z);
            let next = dot(&self.r, &self.z);
            let beta = -alpha * dot(&self.z, &self.q) / rz;
            let error = (next.max(0.0) / energy).sqrt();
            if goal.is_met(error, &self.r) {
                return ended(iterations, Ending::Converged, error);
            }
            errors.push(error);
            let is_slow = iterations >= goal.most || is_hopeless(&errors, goal.error, goal.most);
            if is_slow || !error.is_finite() {
                return ended(iterations, Ending::TooSlow, error);
            }
            let z = self.z.par_chunks(CHUNK);
            self.p.par_chunks_mut(CHUNK).zip(z).for_each(|(p, z)| {
                p.iter_mut().zip(z).for_each(|(p, z)| *p = *z + beta * *p);
            });
            rz = next;
        }
    }
}

/// Whether the rate of the last iterations does not lead to the tolerance in as many as are allowed.
fn is_hopeless(errors: &[f64], tolerance: f64, most: usize) -> bool {
    let n = errors.len();
    if n < 2 * WINDOW || !n.is_multiple_of(WINDOW) {
        return false;
    }
    let smallest = |part: &[f64]| part.iter().copied().fold(f64::INFINITY, f64::min);
    let (before, now) = (smallest(&errors[..n - WINDOW]), smallest(&errors[n - WINDOW..]));
    let needed = (now / tolerance).ln() / (before / now).ln() * WINDOW as f64;
    now >= before || needed > (most - n) as f64
}

/// 2-norm of a residual in scaled equations, in one order for any number of threads.
pub(super) fn scaled_norm(residual: &[f64], scale: &[f64]) -> f64 {
    let part = |(r, s): (&[f64], &[f64])| r.iter().zip(s).map(|(r, s)| (r * s) * (r * s)).sum::<f64>();
    let parts: Vec<f64> = residual.par_chunks(CHUNK).zip(scale.par_chunks(CHUNK)).map(part).collect();
    parts.iter().sum::<f64>().sqrt()
}

/// `y = y + factor x`.
fn add(factor: f64, x: &[f64], y: &mut [f64]) {
    y.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).for_each(|(y, x)| {
        y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x);
    });
}
