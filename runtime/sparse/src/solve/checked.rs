//! The wrapper around every solver: finite values, backward-error check, iterative refinement, class of a failure.
//!
//! Promises: what is returned as a solution has a backward error below the limit, measured with the matrix itself and
//! not with its factor; a failure is one of the classes of [`SolveError`], with dofs in the caller's numbering.
//! What is small and large is defined in `backward_error`, what is singular in `singularity`.

use std::sync::Arc;

use super::backward_error::{BackwardErrorCheck, inverse_norm_estimate};
use super::dense::{Dense, Kind};
use super::factorization::{Factorization, Pivot};
use super::inertia::Inertia;
use super::ldlt::Ldlt;
use super::llt::Llt;
use super::lu::SparseLu;
use super::older_factor::OlderFactor;
use super::on_pattern::OnPattern;
use super::singularity::Found;
use super::symmetry::check_symmetry;
use super::triangular_solve::Transpose;
use super::{Kept, LinearSolver, SolveError, SolveReport, SolverOptions};
use crate::csr::{Csr, Pattern};

/// Shift, relative to the diagonal, with which a matrix without a factor is looked at.
const SHIFT: f64 = 1e-9;

/// Any factorisation with its solutions checked.
pub(super) struct Checked<F> {
    factorization: F,
    check: BackwardErrorCheck,
    /// The matrix to solve with, on the analysed pattern.
    matrix: OnPattern,
    is_factored: bool,
    /// The factor is that of an earlier matrix.
    is_older: bool,
    older: OlderFactor,
    null_space_is_clear: bool,
}

impl<F: Factorization> Checked<F> {
    pub(super) fn new(factorization: F, options: SolverOptions) -> Self {
        let matrix = OnPattern::new(factorization.pattern());
        let check = BackwardErrorCheck::new(matrix.matrix.n_rows(), options);
        Self {
            factorization,
            check,
            matrix,
            is_factored: false,
            is_older: false,
            older: OlderFactor::new(),
            null_space_is_clear: false,
        }
    }

    /// The class of a failed factorisation.
    fn classify(&mut self, error: SolveError) -> SolveError {
        let (error, candidate) = self.factorization.null_vector_at(&self.matrix.matrix, &error);
        if let Some(vector) = candidate {
            return self.check.as_singular(&[&self.matrix.matrix], vector).unwrap_or(error);
        }
        if !matches!(error, SolveError::VanishingPivot { .. }) {
            return error;
        }
        explain_singular(&mut self.check, &self.matrix.matrix, None, error)
    }

    /// Nothing is known of the matrix.
    fn forget_null_space(&mut self) {
        self.null_space_is_clear = false;
        self.check.set_weak(false);
    }

    /// Inverse iteration with the factor, once for each factor.
    fn check_null_space(&mut self) -> Result<(), SolveError> {
        if self.null_space_is_clear {
            return Ok(());
        }
        let factorization = &mut self.factorization;
        let solver = &mut |transpose, x: &mut [f64]| factorization.solve(transpose, x);
        match self.check.find_null_vector(&[&self.matrix.matrix], solver) {
            Found::Singular(error) => {
                self.is_factored = false;
                Err(error)
            }
            other => {
                self.null_space_is_clear = true;
                self.check.set_weak(matches!(other, Found::Weak));
                Ok(())
            }
        }
    }
}

/// Looks for a null vector of a matrix that could not be factored, with the factor of a slightly shifted one, which
/// serves this search alone. The error that says that the matrix is singular, or the one given.
pub(super) fn explain_singular(
    check: &mut BackwardErrorCheck,
    matrix: &Csr,
    coordinates: Option<&[[f64; 3]]>,
    error: SolveError,
) -> SolveError {
    let scale = check.scale().iter().zip(0..);
    let shifts: Vec<_> = scale.map(|(scale, dof)| (dof, dof, SHIFT / (scale * scale))).collect();
    let shifted = Csr::from_triplets(matrix.n_rows(), matrix.n_rows(), &shifts).and_then(|shift| matrix.plus(&shift));
    let Ok(shifted) = shifted else { return error };
    let Ok(mut solver) = SparseLu::analyze(shifted.pattern(), coordinates, check.options().threads) else {
        return error;
    };
    if solver.factor(&shifted).is_err() {
        return error;
    }
    match check.find_null_vector(&[matrix], &mut |transpose, x| solver.solve(transpose, x)) {
        Found::Singular(found) => found,
        _ => error,
    }
}

/// The class of a bulk that is not positive definite with these dofs held fixed.
pub(super) fn explain_bulk(
    bulk: &Csr,
    dofs: &[u32],
    coordinates: Option<&[[f64; 3]]>,
    options: SolverOptions,
    error: SolveError,
) -> SolveError {
    let mut is_held = vec![false; bulk.n_rows()];
    dofs.iter().for_each(|&dof| is_held[dof as usize] = true);
    let mut triplets = Vec::new();
    for row in 0..bulk.n_rows() {
        if is_held[row] {
            triplets.push((row as u32, row as u32, 1.0));
            continue;
        }
        let (columns, values) = bulk.row(row);
        let kept = columns.iter().zip(values).filter(|(column, _)| !is_held[**column as usize]);
        triplets.extend(kept.map(|(&column, &value)| (row as u32, column, value)));
    }
    let explain = || {
        let held = Csr::from_triplets(bulk.n_rows(), bulk.n_rows(), &triplets)?;
        let llt = Llt::analyze(held.pattern(), coordinates, options.threads)?;
        Checked::new(llt, options).factor(&held)
    };
    explain().err().unwrap_or(error)
}

impl<F: Factorization> LinearSolver for Checked<F> {
    fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        (self.is_factored, self.is_older) = (false, false);
        self.older.set_worn(false);
        self.forget_null_space();
        self.matrix.take(matrix)?;
        self.check.set_matrix(&[&self.matrix.matrix])?;
        if F::NEEDS_SYMMETRY {
            check_symmetry(&self.matrix.matrix)?;
        }
        match self.factorization.factor(&self.matrix.matrix) {
            Ok(pivot) => {
                self.is_factored = true;
                if pivot.is_suspicious() { self.check_null_space() } else { Ok(()) }
            }
            Err(error) => match self.classify(error) {
                SolveError::VanishingPivot { .. } if self.factorization.retry(&self.matrix.matrix)? => {
                    self.is_factored = true;
                    self.check_null_space()
                }
                error => Err(error),
            },
        }
    }

    fn keep_factor(&mut self, matrix: &Csr) -> Result<bool, SolveError> {
        if !(self.is_factored && self.older.serves(&self.factorization)) {
            return Ok(false);
        }
        self.matrix.take(matrix)?;
        self.check.set_matrix(&[&self.matrix.matrix])?;
        if F::NEEDS_SYMMETRY {
            check_symmetry(&self.matrix.matrix)?;
        }
        self.is_older = true;
        Ok(true)
    }

    fn expire(&mut self) {
        self.older.set_worn(true);
    }

    fn solve_with_kept(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<Kept<'_>, SolveError> {
        if !(self.is_factored && self.is_older) {
            return Ok(Kept::None);
        }
        self.check.check_rhs(rhs, x)?;
        let (factorization, matrix) = (&mut self.factorization, &self.matrix.matrix);
        match self.older.solve(factorization, matrix, &mut self.check, rhs, x, tolerance) {
            Some(report) => Ok(Kept::Solved(report)),
            None => Ok(Kept::Useless(&self.matrix.matrix)),
        }
    }

    fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
        if !self.is_factored || self.is_older {
            return Err(SolveError::NotFactored);
        }
        self.check.check_rhs(rhs, x)?;
        let factorization = &mut self.factorization;
        let matrix = [&self.matrix.matrix];
        let first = self.check.solve(&matrix, &mut |x| factorization.solve(Transpose::No, x), rhs, x, 0.0);
        match first {
            Ok(report) => {
                let was_weak = self.check.is_weak();
                if self.check.has_grown(rhs, x) {
                    self.check_null_space()?;
                }
                if self.check.is_weak() == was_weak {
                    return Ok(report);
                }
                let (factorization, matrix) = (&mut self.factorization, &self.matrix.matrix);
                self.check.solve(&[matrix], &mut |x| factorization.solve(Transpose::No, x), rhs, x, 0.0)
            }
            Err(error @ SolveError::ResidualTooLarge { .. }) => {
                self.check_null_space()?;
                if !self.factorization.retry(&self.matrix.matrix)? {
                    return Err(error);
                }
                self.forget_null_space();
                let factorization = &mut self.factorization;
                let mut report = self.check.solve(
                    &[&self.matrix.matrix],
                    &mut |x| factorization.solve(Transpose::No, x),
                    rhs,
                    x,
                    0.0,
                )?;
                report.refactored = true;
                Ok(report)
            }
            Err(error) => Err(error),
        }
    }

    fn condition_estimate(&mut self) -> Result<f64, SolveError> {
        if !self.is_factored {
            return Err(SolveError::NotFactored);
        }
        let factorization = &mut self.factorization;
        let inverse =
            inverse_norm_estimate(self.matrix.matrix.n_rows(), &mut |transpose, x| factorization.solve(transpose, x));
        Ok(inverse * self.matrix.matrix.norm_1())
    }

    fn is_negative(&self) -> Option<bool> {
        self.factorization.is_negative().filter(|_| self.is_factored && !self.is_older)
    }

    fn is_definite(&self) -> Option<bool> {
        self.factorization.is_definite().filter(|_| self.is_factored && !self.is_older)
    }

    fn is_symmetric(&self) -> Option<bool> {
        self.is_factored.then(|| self.factorization.is_symmetric())
    }
}

/// A dense factorisation of a sparse matrix.
pub(super) struct DenseOfSparse {
    pattern: Arc<Pattern>,
    dense: Dense,
}

impl Factorization for DenseOfSparse {
    const NEEDS_SYMMETRY: bool = false;

    fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError> {
        let n = matrix.n_rows();
        let fill = |values: &mut [f64]| {
            values.fill(0.0);
            for row in 0..n {
                let (columns, entries) = matrix.row(row);
                for (&column, value) in columns.iter().zip(entries) {
                    values[column as usize * n + row] = *value;
                }
            }
        };
        self.dense.factor(Kind::General, fill).map(|(ratio, _)| Pivot::of(ratio))
    }

    fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        self.dense.solve(transpose, x);
    }

    fn is_negative(&self) -> Option<bool> {
        Some(self.dense.is_negative())
    }
}

macro_rules! checked_door {
    ($(#[$documentation:meta])* $name:ident, $inner:ty) => {
        $(#[$documentation])*
        pub struct $name {
            inner: Checked<$inner>,
        }

        impl LinearSolver for $name {
            fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
                self.inner.factor(matrix)
            }

            fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
                self.inner.solve(rhs, x)
            }

            fn keep_factor(&mut self, matrix: &Csr) -> Result<bool, SolveError> {
                self.inner.keep_factor(matrix)
            }

            fn expire(&mut self) {
                self.inner.expire();
            }

            fn solve_with_kept(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<Kept<'_>, SolveError> {
                self.inner.solve_with_kept(rhs, x, tolerance)
            }

            fn condition_estimate(&mut self) -> Result<f64, SolveError> {
                self.inner.condition_estimate()
            }

            fn is_negative(&self) -> Option<bool> {
                self.inner.is_negative()
            }

            fn is_definite(&self) -> Option<bool> {
                self.inner.is_definite()
            }

            fn is_symmetric(&self) -> Option<bool> {
                self.inner.is_symmetric()
            }
        }
    };
}

checked_door! {
    /// Solver for sparse symmetric positive definite matrices.
    CheckedLlt, Llt
}
checked_door! {
    /// Solver for sparse symmetric matrices that need not be definite; LU where a matrix is not symmetric, or pivots do not
    /// serve.
    CheckedLdlt, Ldlt
}
checked_door! {
    /// Solver for general sparse matrices.
    CheckedLu, SparseLu
}
checked_door! {
    /// Solver for general matrices of a few hundred unknowns, by dense LU with partial pivoting.
    CheckedDense, DenseOfSparse
}

impl CheckedLlt {
    /// Orders and analyses a pattern. With `coordinates`, one point (any length unit) a dof, by nested dissection.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square or the coordinates are not one a dof;
    /// [`SolveError::TooMuchMemory`].
    pub fn new(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        Ok(Self { inner: Checked::new(Llt::analyze(pattern, coordinates, options.threads)?, options) })
    }
}

impl CheckedLdlt {
    /// Takes a pattern. With `coordinates`, one point (any length unit) a dof, it is ordered by nested dissection. `groups` have
    /// the group of each dof, from zero, whose equations may be multiplied by one number to make a matrix symmetric.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square, or coordinates or groups are not one a dof;
    /// [`SolveError::TooMuchMemory`].
    pub fn new(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        groups: Option<&[u32]>,
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        Ok(Self { inner: Checked::new(Ldlt::analyze(pattern, coordinates, groups, options.threads)?, options) })
    }

    /// The signs of the eigenvalues of the matrix factored last, by those of its pivots; `None` without a factor, where the
    /// matrix is symmetric in multiplied rows alone, or where LU took over.
    #[must_use]
    pub fn inertia(&self) -> Option<Inertia> {
        self.inner.factorization.inertia().filter(|_| self.inner.is_factored && !self.inner.is_older)
    }
}

impl CheckedLu {
    /// Orders and analyses a pattern. With `coordinates`, one point (any length unit) a dof, by nested dissection.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square or the coordinates are not one a dof;
    /// [`SolveError::TooMuchMemory`].
    pub fn new(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        Ok(Self { inner: Checked::new(SparseLu::analyze(pattern, coordinates, options.threads)?, options) })
    }
}

impl CheckedDense {
    /// Takes the memory for matrices on a pattern: 8 n² bytes.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square, [`SolveError::TooMuchMemory`].
    pub fn new(pattern: &Arc<Pattern>, options: SolverOptions) -> Result<Self, SolveError> {
        let n = pattern.n_rows();
        if pattern.n_cols() != n {
            return Err(SolveError::Shape { what: "columns of a square matrix", expected: n, found: pattern.n_cols() });
        }
        let dense = Dense::new(n, options.threads)?;
        Ok(Self { inner: Checked::new(DenseOfSparse { pattern: Arc::clone(pattern), dense }, options) })
    }
}
