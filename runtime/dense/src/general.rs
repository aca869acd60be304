//! Sparse LU with partial pivoting over the whole matrix, by faer (column ordering COLAMD).
//!
//! Faer reports neither singular matrices nor some of its own failures: its panics are caught here, and callers check residuals.

use std::panic::{AssertUnwindSafe, catch_unwind};

use faer::linalg::solvers::SolveCore;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut};

/// Why there is no factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GeneralError {
    /// The machine refuses memory.
    NoMemory,
    /// No pivot is possible from this column on, whatever the values are.
    Singular(usize),
    /// Faer failed.
    Internal,
}

/// Which system is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// `A x = b`.
    Plain,
    /// `Aᵀ x = b`.
    Transposed,
}

/// A matrix whose structure is analysed once, and its factor.
pub struct General {
    matrix: SparseColMat<u32, f64>,
    symbolic: SymbolicLu<u32>,
    factor: Option<Lu<u32, f64>>,
}

impl General {
    /// Analyses the structure of a square matrix of n unknowns by columns; rows of a column rise.
    ///
    /// # Errors
    /// The machine refuses memory, or faer fails.
    pub fn new(n: usize, starts: Vec<u32>, rows: Vec<u32>) -> Result<Self, GeneralError> {
        let n_entries = rows.len();
        let structure = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let symbolic = catch_unwind(AssertUnwindSafe(|| SymbolicLu::try_new(structure.as_ref())))
            .map_err(|_| GeneralError::Internal)?
            .map_err(|_| GeneralError::NoMemory)?;
        Ok(Self { matrix: SparseColMat::new(structure, vec![0.0; n_entries]), symbolic, factor: None })
    }

    /// The values by columns, to be written.
    pub fn values_mut(&mut self) -> &mut [f64] {
        self.matrix.val_mut()
    }

    /// Factors the matrix with its present values; without a factor there is none afterwards.
    ///
    /// # Errors
    /// See [`GeneralError`].
    pub fn factor(&mut self) -> Result<(), GeneralError> {
        self.factor = None;
        let symbolic = self.symbolic.clone();
        match catch_unwind(AssertUnwindSafe(|| Lu::try_new_with_symbolic(symbolic, self.matrix.as_ref()))) {
            Ok(Ok(factor)) => {
                self.factor = Some(factor);
                Ok(())
            }
            Ok(Err(LuError::SymbolicSingular { index })) => Err(GeneralError::Singular(index)),
            Ok(Err(LuError::Generic(_))) => Err(GeneralError::NoMemory),
            Err(_) => Err(GeneralError::Internal),
        }
    }

    /// Solves in place; fills x with NaN where faer fails.
    ///
    /// # Panics
    /// Without a factor.
    pub fn solve(&self, side: Side, x: &mut [f64]) {
        let factor = self.factor.as_ref().expect("a factor is used after it was made");
        let n = x.len();
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let vector = MatMut::from_column_major_slice_mut(&mut *x, n, 1);
            match side {
                Side::Plain => factor.solve_in_place_with_conj(Conj::No, vector),
                Side::Transposed => factor.solve_transpose_in_place_with_conj(Conj::No, vector),
            }
        }));
        if outcome.is_err() {
            x.fill(f64::NAN);
        }
    }
}
