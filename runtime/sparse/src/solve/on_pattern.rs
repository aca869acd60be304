//! A matrix on one pattern that takes the values of others.
//!
//! Promises that an entry outside the pattern is an error with its place. Does not look at values.

use std::sync::Arc;

use super::SolveError;
use crate::csr::{Csr, Pattern};

/// A matrix on a pattern that stays.
pub(super) struct OnPattern {
    pub(super) matrix: Csr,
    /// For a narrower pattern seen last: where its entries go.
    narrower: Option<(Arc<Pattern>, Vec<usize>)>,
}

impl OnPattern {
    /// Without values.
    pub(super) fn new(pattern: &Arc<Pattern>) -> Self {
        Self { matrix: Csr::zeros(Arc::clone(pattern)), narrower: None }
    }

    /// Copies the values of a matrix, whose pattern may be narrower.
    ///
    /// # Errors
    /// [`SolveError::Shape`], [`SolveError::OutsidePattern`].
    pub(super) fn take(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        let wanted = self.matrix.pattern();
        if Arc::ptr_eq(wanted, matrix.pattern()) || **wanted == **matrix.pattern() {
            self.matrix.values_mut().copy_from_slice(matrix.values());
            return Ok(());
        }
        let n = self.matrix.n_rows();
        if (matrix.n_rows(), matrix.n_cols()) != (n, n) {
            let found = if matrix.n_rows() == n { matrix.n_cols() } else { matrix.n_rows() };
            return Err(SolveError::Shape { what: "rows and columns of the matrix", expected: n, found });
        }
        let is_known = matches!(&self.narrower, Some((pattern, _)) if Arc::ptr_eq(pattern, matrix.pattern()));
        if !is_known {
            let places = matrix.pattern().positions_in(wanted).ok_or_else(|| outside(matrix.pattern(), wanted))?;
            self.narrower = Some((Arc::clone(matrix.pattern()), places));
        }
        let (_, places) = self.narrower.as_ref().expect("it is known or has just been found");
        self.matrix.values_mut().fill(0.0);
        for (&place, value) in places.iter().zip(matrix.values()) {
            self.matrix.values_mut()[place] = *value;
        }
        Ok(())
    }
}

/// The first entry that a pattern lacks.
fn outside(pattern: &Pattern, wanted: &Pattern) -> SolveError {
    for row in 0..pattern.n_rows() {
        for &column in pattern.row(row) {
            if wanted.position(row, column as usize).is_none() {
                return SolveError::OutsidePattern { row, column: column as usize };
            }
        }
    }
    SolveError::Internal { what: "comparison of patterns" }
}
