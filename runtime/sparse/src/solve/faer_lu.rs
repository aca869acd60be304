//! General sparse LU with partial pivoting over the whole matrix, by faer (column ordering COLAMD).
//!
//! This is the robust and slow method, used where pivots from within a front do not suffice. faer reports neither
//! singular matrices nor some of its own failures. Therefore rows and columns are scaled first, and every caller checks the
//! true residual.

use std::sync::Arc;

use wfl_dense::{General, GeneralError, Side};

use super::SolveError;
use super::scaling::equilibration;
use super::triangular_solve::Transpose;
use crate::csr::{Csr, Pattern};
use wfl_host::memory::refused_by_the_system;

/// A reusable general sparse factorisation.
pub(super) struct FaerLu {
    /// The matrix by columns: the structure is analysed once, the values are written again for every factorisation.
    general: General,
    sources: Vec<usize>,
    /// Row of each value of `general`.
    rows: Vec<u32>,
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
}

impl FaerLu {
    /// Analyses a square pattern.
    pub(super) fn analyze(pattern: &Arc<Pattern>) -> Result<Self, SolveError> {
        if pattern.n_entries() >= i32::MAX as usize {
            return Err(SolveError::TooLarge { what: "a sparse matrix" });
        }
        let (by_columns, sources) = pattern.transpose();
        let n = pattern.n_rows();
        let starts: Vec<u32> = by_columns.row_starts().iter().map(|&start| start as u32).collect();
        let rows = by_columns.columns().to_vec();
        let general = General::new(n, starts, rows.clone())
            .map_err(|error| told(error, n, "the analysis of a general sparse factorisation"))?;
        let (row_scale, column_scale) = (vec![1.0; n], vec![1.0; n]);
        Ok(Self { general, sources, rows, row_scale, column_scale })
    }

    /// Factors a matrix on the analysed pattern.
    pub(super) fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        (self.row_scale, self.column_scale) = equilibration(matrix, None);
        let columns = matrix.pattern().columns();
        for ((value, &source), &row) in self.general.values_mut().iter_mut().zip(&self.sources).zip(&self.rows) {
            let column = columns[source] as usize;
            *value = matrix.values()[source] * self.row_scale[row as usize] * self.column_scale[column];
        }
        self.general.factor().map_err(|error| told(error, matrix.n_rows(), "a general sparse factorisation"))
    }

    /// Solves in place; fills x with NaN when faer fails.
    ///
    /// # Panics
    /// Without a successful factorisation.
    pub(super) fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        let (side, before, after) = match transpose {
            Transpose::No => (Side::Plain, &self.row_scale, &self.column_scale),
            Transpose::Yes => (Side::Transposed, &self.column_scale, &self.row_scale),
        };
        x.iter_mut().zip(before).for_each(|(value, scale)| *value *= scale);
        self.general.solve(side, x);
        x.iter_mut().zip(after).for_each(|(value, scale)| *value *= scale);
    }
}

/// The error of a matrix of n unknowns.
fn told(error: GeneralError, n: usize, what: &'static str) -> SolveError {
    match error {
        GeneralError::NoMemory => refused_by_the_system(None, what).into(),
        GeneralError::Singular(column) => SolveError::VanishingPivot { dof: column.min(n - 1), ratio: 0.0 },
        GeneralError::Internal => SolveError::Internal { what },
    }
}
