//! The condensed solver as one of those that take a matrix and a right-hand side; the sign of its determinant.
//!
//! Promises: as `condensed`. What the sign means `runtime/run/src/others.rs` says.

use super::{CheckedCondensed, State};
use crate::csr::Csr;
use crate::solve::backward_error::inverse_norm_estimate;
use crate::solve::{LinearSolver, SolveError, SolveReport};

impl CheckedCondensed {
    /// Whether the determinant of the bulk with this changing part (n x n) is negative.
    ///
    /// # Errors
    /// As [`CheckedCondensed::update`].
    pub fn sign_with(&mut self, changing: &Csr) -> Result<Option<bool>, SolveError> {
        self.update(changing)?;
        if self.state == State::Stale {
            self.refactor()?;
        }
        Ok(self.is_negative())
    }

    /// Makes the factor that of the matrix, where there is one.
    pub(super) fn make_fresh(&mut self) -> Result<(), SolveError> {
        match self.state {
            State::Empty => Err(SolveError::NotFactored),
            State::Stale => self.refactor(),
            State::Fresh => Ok(()),
        }
    }
}

impl LinearSolver for CheckedCondensed {
    /// Sets the changing part, as [`CheckedCondensed::update`].
    fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        self.update(matrix)
    }

    fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
        CheckedCondensed::solve(self, rhs, x)
    }

    fn condition_estimate(&mut self) -> Result<f64, SolveError> {
        self.make_fresh()?;
        let engine = &mut self.engine;
        let inverse = inverse_norm_estimate(self.bulk.n_rows(), &mut |transpose, x| engine.solve(transpose, x));
        Ok(inverse * self.bulk.plus(&self.changing.matrix)?.norm_1())
    }

    fn is_negative(&self) -> Option<bool> {
        (self.state != State::Empty).then(|| self.engine.is_negative())
    }

    fn is_definite(&self) -> Option<bool> {
        match self.state {
            State::Empty => None,
            _ if self.engine.is_definite() => Some(true),
            _ => self.engine.is_negative().then_some(false),
        }
    }
}
