//! General sparse LU with partial pivoting over the whole matrix, through faer (column ordering COLAMD).
//!
//! This is the robust and slow method, used where pivots from within a front do not suffice. faer reports neither
//! singular matrices nor some of its own failures. Therefore panics are caught, rows and columns are scaled first, and
//! every caller checks the true residual.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use faer::Conj;
use faer::MatMut;
use faer::linalg::solvers::SolveCore;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};

use super::SolveError;
use super::scaling::equilibration;
use super::triangular_solve::Transpose;
use crate::csr::{Csr, Pattern};
use wfl_host::memory::refused_by_the_system;

/// A reusable general sparse factorisation.
pub(super) struct FaerLu {
    /// The matrix by columns: the structure is analysed once, the values are written again for every factorisation.
    matrix: SparseColMat<u32, f64>,
    sources: Vec<usize>,
    /// Row of each value of `matrix`.
    rows: Vec<u32>,
    symbolic: SymbolicLu<u32>,
    factor: Option<Lu<u32, f64>>,
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
}

impl FaerLu {
    /// Analyses a square pattern.
    pub(super) fn analyze(pattern: &Arc<Pattern>) -> Result<Self, SolveError> {
        let out_of_memory = refused_by_the_system(None, "the analysis of a general sparse factorisation");
        if pattern.n_entries() >= i32::MAX as usize {
            return Err(SolveError::TooLarge { what: "a sparse matrix" });
        }
        let (by_columns, sources) = pattern.transpose();
        let n = pattern.n_rows();
        let starts: Vec<u32> = by_columns.row_starts().iter().map(|&start| start as u32).collect();
        let rows = by_columns.columns().to_vec();
        let structure = SymbolicSparseColMat::new_checked(n, n, starts, None, rows.clone());
        let symbolic = catch_unwind(AssertUnwindSafe(|| SymbolicLu::try_new(structure.as_ref())))
            .map_err(|_| SolveError::Internal { what: "analysis of a general sparse factorisation" })?
            .map_err(|_| out_of_memory)?;
        let matrix = SparseColMat::new(structure, vec![0.0; sources.len()]);
        let (row_scale, column_scale) = (vec![1.0; n], vec![1.0; n]);
        Ok(Self { matrix, sources, rows, symbolic, factor: None, row_scale, column_scale })
    }

    /// Factors a matrix on the analysed pattern.
    pub(super) fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        self.factor = None;
        (self.row_scale, self.column_scale) = equilibration(matrix, None);
        let columns = matrix.pattern().columns();
        for ((value, &source), &row) in self.matrix.val_mut().iter_mut().zip(&self.sources).zip(&self.rows) {
            let column = columns[source] as usize;
            *value = matrix.values()[source] * self.row_scale[row as usize] * self.column_scale[column];
        }
        let symbolic = self.symbolic.clone();
        let outcome = catch_unwind(AssertUnwindSafe(|| Lu::try_new_with_symbolic(symbolic, self.matrix.as_ref())));
        match outcome {
            Ok(Ok(factor)) => {
                self.factor = Some(factor);
                Ok(())
            }
            Ok(Err(LuError::SymbolicSingular { index })) => {
                Err(SolveError::VanishingPivot { dof: index.min(matrix.n_rows() - 1), ratio: 0.0 })
            }
            Ok(Err(LuError::Generic(_))) => Err(refused_by_the_system(None, "a general sparse factorisation").into()),
            Err(_) => Err(SolveError::Internal { what: "a general sparse factorisation" }),
        }
    }

    /// Solves in place; fills x with NaN when faer fails.
    ///
    /// # Panics
    /// Without a successful factorisation.
    pub(super) fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        let factor = self.factor.as_ref().expect("a factor is used after it was made");
        let (before, after) = match transpose {
            Transpose::No => (&self.row_scale, &self.column_scale),
            Transpose::Yes => (&self.column_scale, &self.row_scale),
        };
        x.iter_mut().zip(before).for_each(|(value, scale)| *value *= scale);
        let n = x.len();
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let vector = MatMut::from_column_major_slice_mut(&mut *x, n, 1);
            match transpose {
                Transpose::No => factor.solve_in_place_with_conj(Conj::No, vector),
                Transpose::Yes => factor.solve_transpose_in_place_with_conj(Conj::No, vector),
            }
        }));
        if outcome.is_err() {
            x.fill(f64::NAN);
        }
        x.iter_mut().zip(after).for_each(|(value, scale)| *value *= scale);
    }
}
