//! Whether a matrix is singular: null vectors, and how far away the nearest singular matrix is.
//!
//! An ill-conditioned matrix is not a singular one: a long thin body, or a soft one welded to a stiff one, has a direction
//! in which it gives way easily, and a solution. What decides is whether the rounding of the entries can make the matrix
//! singular. With v and w the vectors that inverse iteration with A and with its transposed find, the smallest change
//! of all entries, relative to themselves, that makes A singular is to first order
//!
//! ```text
//! |wᵀ A v| / (|w|ᵀ |A| |v|)
//! ```
//!
//! (Demmel 1992, "The componentwise distance to the nearest singular matrix"; the product is summed in double-double). It
//! does not depend on the units of unknowns and equations, and an error of v or w enters squared. A matrix counts as
//! singular where it is no more than [`SINGULAR`]: the entries themselves are not known any better.
//!
//! Promises: looks at the matrix and not at its factor. Does not know how systems are solved.

use super::backward_error::BackwardErrorCheck;
use super::triangular_solve::Transpose;
use super::{NullVector, SolveError};
use crate::csr::{Csr, residual_and_size, residual_compensated};

/// An entry is a sum over the cells around it of sums over points: each of a few products, with half a roundoff each.
const SINGULAR: f64 = f64::EPSILON;
/// A vector with `‖S A v‖` above this part of `‖S |A| |v|‖` (maximum norms, S scales A to a unit diagonal) is none of a
/// matrix that is worth a second look.
const SUSPECT: f64 = 64.0 * f64::EPSILON;
/// Steps of inverse iteration.
const INVERSE_ITERATIONS: usize = 3;

/// A solver with a matrix and with its transposed; one that cannot do the latter leaves what is no number.
pub(super) type TwoWays<'a> = dyn FnMut(Transpose, &mut [f64]) + 'a;

/// What a search for a null vector found.
#[derive(Debug)]
pub(super) enum Found {
    /// No direction in which the matrix is weak.
    Nothing,
    /// The matrix is ill-conditioned, and not singular.
    Weak,
    /// The error that says that it is singular.
    Singular(SolveError),
}

impl BackwardErrorCheck {
    /// Inverse iteration from a fixed start.
    pub(super) fn find_null_vector(&mut self, parts: &[&Csr], solver: &mut TwoWays<'_>) -> Found {
        let Some(v) = self.softest(Transpose::No, solver) else { return Found::Nothing };
        if self.distance(parts, &v, None) > SUSPECT {
            return Found::Nothing;
        }
        let w = self.softest(Transpose::Yes, solver);
        self.judge_direction(parts, v, w.as_deref()).map_or(Found::Weak, Found::Singular)
    }

    /// The error for a null vector of a symmetric matrix, if it is one.
    pub(super) fn as_singular(&mut self, parts: &[&Csr], v: Vec<f64>) -> Option<SolveError> {
        let w = v.clone();
        self.judge_direction(parts, v, Some(&w))
    }

    fn judge_direction(&mut self, parts: &[&Csr], v: Vec<f64>, w: Option<&[f64]>) -> Option<SolveError> {
        let ratio = self.distance(parts, &v, w);
        if ratio.is_nan() || ratio > SINGULAR {
            return None;
        }
        let mode = NullVector::new(v);
        Some(SolveError::Singular { dof: mode.largest().unwrap_or(0), ratio, mode })
    }

    /// The vector that a solver magnifies most, of size 1 in scaled unknowns; `None` where it gives no numbers.
    fn softest(&self, transpose: Transpose, solver: &mut TwoWays<'_>) -> Option<Vec<f64>> {
        // Golden-ratio numbers: fixed, and orthogonal to no mode in particular.
        let start = |dof: usize| ((dof + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
        let scale = self.scale();
        let mut v: Vec<f64> = (0..scale.len()).map(|dof| start(dof) * scale[dof]).collect();
        for _ in 0..INVERSE_ITERATIONS {
            // The right-hand side lives in scaled equations.
            v.iter_mut().zip(scale).for_each(|(value, scale)| *value /= scale * scale);
            solver(transpose, &mut v);
            let size = self.scaled_size(&v);
            if !(size.is_finite() && size > 0.0) {
                return None;
            }
            v.iter_mut().for_each(|value| *value /= size);
        }
        Some(v)
    }

    /// `|wᵀ A v| / (|w|ᵀ |A| |v|)`; without a w the largest scaled entry of `A v` over that of `|A| |v|`.
    fn distance(&self, parts: &[&Csr], v: &[f64], w: Option<&[f64]>) -> f64 {
        let (threads, zeros) = (self.options().threads, vec![0.0; v.len()]);
        let (mut product, mut size) = (zeros.clone(), zeros.clone());
        residual_and_size(parts, &zeros, v, &mut product, &mut size, threads);
        residual_compensated(parts, &zeros, v, &mut product, threads);
        let Some(w) = w else {
            let scaled = |entries: &[f64]| self.largest(entries.iter().zip(self.scale()).map(|(x, s)| x * s));
            return scaled(&product) / scaled(&size);
        };
        let total = |entries: &[f64], weight: fn(f64) -> f64| {
            let own = |row: &usize| self.owners().is_none_or(|owners| owners.owns(*row));
            self.team().total((0..w.len()).filter(own).map(|row| weight(w[row]) * entries[row]).sum())
        };
        total(&product, |w| w).abs() / total(&size, f64::abs)
    }
}
