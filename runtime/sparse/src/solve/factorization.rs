//! What the checks need of a factorisation, whatever its method.
//!
//! Does not look at residuals: `checked` does.

use std::sync::Arc;

use super::SolveError;
use super::triangular_solve::Transpose;
use crate::csr::{Csr, Pattern};

/// A relative pivot below this calls for a look at the null space.
const SUSPICIOUS_PIVOT: f64 = 1e-9;
/// What a factorisation says about its smallest pivot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pivot {
    ratio: f64,
}

impl Pivot {
    pub(super) const HEALTHY: Pivot = Pivot { ratio: 1.0 };
    pub(super) const UNKNOWN: Pivot = Pivot { ratio: 0.0 };

    /// The smallest one relative to its column.
    pub(super) fn of(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Whether the null space must be looked at.
    pub(super) fn is_suspicious(self) -> bool {
        self.ratio.is_nan() || self.ratio < SUSPICIOUS_PIVOT
    }
}

/// A factorisation whose solutions are not checked yet.
pub(super) trait Factorization {
    /// Whether half of the matrix is never read.
    const NEEDS_SYMMETRY: bool;

    /// The analysed pattern.
    fn pattern(&self) -> &Arc<Pattern>;

    /// Factors a matrix on exactly that pattern.
    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError>;

    /// Solves in place with the last factor.
    fn solve(&mut self, transpose: Transpose, x: &mut [f64]);

    /// Whether the determinant of the matrix factored last is negative; `None` where the factor does not tell.
    fn is_negative(&self) -> Option<bool>;

    /// Whether the matrix factored last is positive definite, as far as the factor tells: a negative determinant says that it
    /// is not.
    fn is_definite(&self) -> Option<bool> {
        self.is_negative().filter(|negative| *negative).map(|_| false)
    }

    /// Whether the factor of the matrix factored last is that of a symmetric one.
    fn is_symmetric(&self) -> bool {
        Self::NEEDS_SYMMETRY
    }

    /// Krylov iterations with this factor that cost as much as a new factor, in the multiplications of one and the values
    /// that are loaded for the other; none where that is not known.
    fn worthwhile_iterations(&self) -> usize {
        0
    }

    /// Turns to a more robust method for the same matrix; false when there is none.
    fn retry(&mut self, _matrix: &Csr) -> Result<bool, SolveError> {
        Ok(false)
    }

    /// After a failed factorisation: the error with what can be added to it, and a candidate for a null vector.
    fn null_vector_at(&mut self, _matrix: &Csr, error: &SolveError) -> (SolveError, Option<Vec<f64>>) {
        (error.clone(), None)
    }
}
