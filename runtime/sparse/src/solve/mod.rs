//! Linear solvers.
//!
//! The door is [`CheckedCondensed`] for a constant symmetric bulk with a part that changes, [`CheckedLlt`] for
//! symmetric positive definite matrices, [`CheckedMultigrid`] for those that are too large for a factor,
//! [`FilteredMultigrid`] behind [`CheckedLibrary`] for contact on them, [`CheckedLdlt`] for symmetric ones that are not
//! definite, [`CheckedLu`] for the rest, [`CheckedDense`] for small ones. All of them are
//! [`LinearSolver`]s.
//!
//! Promises: a solution is returned only with a small true residual; everything else is a typed error that names dofs
//! in the caller's numbering; equal input gives equal bytes for any number of threads; memory is kept between
//! factorisations. No number is ever added to a diagonal to hide a singular matrix.
//! Does not assemble, number dofs or apply boundary conditions. Threads come from rayon's current pool.

mod backward_error;
mod checked;
mod condensed;
mod contributions;
mod dense;
mod factorization;
mod faer_lu;
mod filtered;
mod frontal_lu;
mod inertia;
mod krylov;
mod ldlt;
mod library;
mod llt;
mod lu;
mod memory;
mod multifrontal;
mod multigrid;
mod null_space;
mod older_factor;
mod on_pattern;
mod ordering;
mod packed;
#[cfg(test)]
mod problems;
mod row_owners;
mod scaling;
mod singularity;
mod symbolic;
mod symmetry;
#[cfg(test)]
mod tests;
mod triangular_solve;

pub use checked::{CheckedDense, CheckedLdlt, CheckedLlt, CheckedLu};
pub use condensed::{CheckedAtPoints, CheckedCondensed, DENSE_LIMIT, Elimination, Reference};
pub use filtered::{CheckedContact, CheckedSaddle, FilteredMultigrid, OnContact};
pub use inertia::{Inertia, inertia};
pub use krylov::{Stop, gmres};
pub use ldlt::symmetrising;
pub use library::{CheckedLibrary, Engine, Equations, Library, Linked, Traits};
pub use memory::SolverMemory;
pub use multigrid::{
    CheckedMultigrid, CoarserLevel, FinestLevel, Interpolation, NearNullSpace, NodeLayout, Operator, OperatorLevels,
    Source, scale_of,
};
pub use null_space::{LargestEntries, NullSpace, largest_entries, null_space, triangular};
pub use ordering::{Ordering, order};
pub use row_owners::RowOwners;
pub use symmetry::Symmetry;

use crate::csr::{Csr, CsrError};
use wfl_dense::Par;
use wfl_host::memory::TooMuchMemory;

/// Precision of the factors of a bulk that stands alone and of the capacitance matrix of the contact forces. Residuals and
/// results are of double precision in all cases, and every solution is checked by its true residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Mixed where that is faster.
    #[default]
    Auto,
    /// Double.
    Double,
    /// Single, with residuals in double precision around it; double from the first factor on that it does not serve.
    Mixed,
}

impl Precision {
    /// Names as they are written in commands.
    pub const NAMES: [(&str, Precision); 3] =
        [("auto", Precision::Auto), ("f64", Precision::Double), ("f32+f64", Precision::Mixed)];

    /// The precision with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| *known == name).map(|(_, precision)| *precision)
    }
}

/// How a system with one symmetric matrix is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinearMethod {
    /// As it costs least.
    #[default]
    Auto,
    /// With a factor.
    Direct,
    /// By conjugate gradients with multigrid.
    Iterative,
}

/// How a system is solved and checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverOptions {
    /// Threads to use, from rayon's current pool. Does not change any result.
    pub threads: usize,
    /// Largest accepted backward error `‖b - A x‖ / (‖A‖ ‖x‖ + ‖b‖)` (maximum norms; no unit).
    pub residual_limit: f64,
    /// Where iterations with an older factor stop: 2-norm of the residual relative to that of the right-hand side.
    pub iteration_tolerance: f64,
    /// Steps of iterative refinement that may follow a solve.
    pub max_refinements: usize,
    /// Refine until it stops helping, with residuals in double-double: the solution is then exact to rounding as long
    /// as the condition number is below about 1e15. Otherwise refinement starts only when it is needed.
    pub extended_residual: bool,
    /// Of the factors of the bulk and of the capacitance matrix.
    pub precision: Precision,
    /// Of systems with one matrix.
    pub method: LinearMethod,
    /// Right-hand sides that are expected for one matrix: a factor pays by their number.
    pub solutions: usize,
    /// A library that solves in place of the solvers here.
    pub library: Option<Linked>,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            threads: 1,
            residual_limit: 1e-10,
            iteration_tolerance: 1e-10,
            max_refinements: 5,
            extended_residual: false,
            precision: Precision::Auto,
            method: LinearMethod::Auto,
            solutions: 1,
            library: None,
        }
    }
}

/// What is known about a solution.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SolveReport {
    /// Backward error `‖b - A x‖ / (‖A‖ ‖x‖ + ‖b‖)` in maximum norms: the larger of that of the matrix as it is and
    /// that of the matrix scaled to a unit diagonal.
    pub relative_residual: f64,
    /// Largest `|b - A x|_i / (|A| |x| + |b|)_i` over the rows (Oettli and Prager 1964).
    pub componentwise_residual: f64,
    /// Steps of iterative refinement that were made.
    pub refinements: usize,
    /// Krylov iterations that were made, with an older factor or with a preconditioner.
    pub krylov_iterations: usize,
    /// Whether the matrix was factored during this solve.
    pub refactored: bool,
}

/// An approximate null vector, by dof, with largest magnitude 1.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NullVector {
    values: Vec<f64>,
}

impl NullVector {
    /// Components by dof; empty when no vector could be found.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Dofs whose component is at least this part of the largest one, increasing. For a rigid-body mode these are
    /// dofs of the body that moves.
    pub fn dofs_above(&self, fraction: f64) -> Vec<u32> {
        let moves = |value: &f64| value.abs() >= fraction && *value != 0.0;
        (0..self.values.len() as u32).filter(|&dof| moves(&self.values[dof as usize])).collect()
    }

    /// Scales to largest magnitude 1; empty when that is impossible.
    fn new(mut values: Vec<f64>) -> Self {
        let largest = values.iter().fold(0.0, |largest: f64, value| value.abs().max(largest));
        if !(largest > 0.0 && values.iter().all(|value| value.is_finite())) {
            return Self::default();
        }
        values.iter_mut().for_each(|value| *value /= largest);
        Self { values }
    }

    /// The dof with the largest component.
    fn largest(&self) -> Option<usize> {
        (0..self.values.len()).find(|&dof| self.values[dof].abs() == 1.0)
    }
}

/// Why a system could not be solved. Dofs are in the caller's numbering.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// Two sizes that must agree do not.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// What was measured.
        what: &'static str,
        /// Size that was needed.
        expected: usize,
        /// Size that was found.
        found: usize,
    },
    /// The matrix has entries where the analysed pattern has none.
    #[error("entry ({row}, {column}) of the matrix lies outside the analysed pattern")]
    OutsidePattern {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
    },
    /// The matrix has a NaN or infinite entry.
    #[error("entry ({row}, {column}) of the matrix is not finite")]
    NonFiniteMatrix {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
    },
    /// The right-hand side has a NaN or infinite entry.
    #[error("entry {dof} of the right-hand side is not finite")]
    NonFiniteRightHandSide {
        /// The dof.
        dof: usize,
    },
    /// The matrix is singular to working precision.
    #[error("the matrix is singular at dof {dof} (a change of its entries by {ratio:.0e} of themselves makes it so)")]
    Singular {
        /// Dof with the largest component of the null vector.
        dof: usize,
        /// The change of the entries, relative to themselves, that makes the matrix singular: at most the rounding with
        /// which they are known.
        ratio: f64,
        /// The null vector.
        mode: NullVector,
    },
    /// A matrix that must be positive definite is not.
    #[error("the matrix is not positive definite{}", at_pivot(*dof, *pivot))]
    NotPositiveDefinite {
        /// Dof at whose elimination it was seen.
        dof: usize,
        /// Value of the pivot (NaN when it could not be found).
        pivot: f64,
    },
    /// A matrix that must be symmetric is not.
    #[error("the matrix is not symmetric at ({row}, {column}): {value:e} against {transposed:e}")]
    NotSymmetric {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// Its value.
        value: f64,
        /// Value of the entry across the diagonal.
        transposed: f64,
    },
    /// A pivot vanished although the matrix is not shown to be singular.
    #[error("the pivot at dof {dof} vanishes (relative size {ratio:.1e})")]
    VanishingPivot {
        /// Dof at whose elimination it was seen.
        dof: usize,
        /// Size relative to its column.
        ratio: f64,
    },
    /// The true residual stayed too large.
    #[error("the solution leaves a relative residual of {relative:.1e}, above the limit {limit:.1e}")]
    ResidualTooLarge {
        /// Backward error reached.
        relative: f64,
        /// Requested backward error.
        limit: f64,
    },
    /// An iteration does not get to its end.
    #[error(
        "{iterations} iterations of conjugate gradients leave an error of {reached:.1e} of the solution, more than \
         {wanted:.1e}"
    )]
    TooManyIterations {
        /// Iterations that were made.
        iterations: usize,
        /// Estimated error, in the norm of energy, relative to the solution.
        reached: f64,
        /// What was wanted.
        wanted: f64,
    },
    /// A size that no index can name.
    #[error("{what} has more than 2^31 entries")]
    TooLarge {
        /// What is too large.
        what: &'static str,
    },
    /// The need for memory is above the limit.
    #[error(transparent)]
    TooMuchMemory(#[from] TooMuchMemory),
    /// A solve came before a successful factorisation.
    #[error("no factored matrix to solve with")]
    NotFactored,
    /// A library that is linked in place of the solvers here could not go on.
    #[error("{text}")]
    Library {
        /// What it says, with its name.
        text: String,
    },
    /// The library behind a solver panicked.
    #[error("internal failure in {what}")]
    Internal {
        /// What was being done.
        what: &'static str,
    },
    /// The structure of a matrix is wrong.
    #[error(transparent)]
    Structure(CsrError),
}

/// A need for memory is one kind of error, whoever had it.
impl From<CsrError> for SolveError {
    fn from(error: CsrError) -> Self {
        match error {
            CsrError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::Structure(other),
        }
    }
}

/// What a factor of an earlier matrix came to.
pub enum Kept<'a> {
    /// No such factor is in use.
    None,
    /// A solution that has passed the checks.
    Solved(SolveReport),
    /// Nothing: this is the matrix to factor.
    Useless(&'a Csr),
}

/// A solver of `A x = b` for matrices of one pattern.
pub trait LinearSolver {
    /// Factors a matrix; its entries must lie inside the analysed pattern.
    ///
    /// # Errors
    /// Any [`SolveError`] except those about a right-hand side; the solver then holds no matrix.
    fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError>;

    /// Solves `A x = rhs`.
    ///
    /// # Errors
    /// [`SolveError::NotFactored`] before a successful [`LinearSolver::factor`]; otherwise any error that says why no
    /// solution with a small true residual was found. `x` is then unspecified.
    fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError>;

    /// Takes a matrix and keeps the factor of an earlier one, if solutions with that cost less than a factor of this. False
    /// where the matrix is to be factored. Solutions then come from [`LinearSolver::solve_with_kept`].
    ///
    /// # Errors
    /// As [`LinearSolver::factor`].
    fn keep_factor(&mut self, _matrix: &Csr) -> Result<bool, SolveError> {
        Ok(false)
    }

    /// The next matrix is to be factored.
    fn expire(&mut self) {}

    /// Solves `A x = rhs` with the factor of an earlier matrix and Krylov iterations, to a true residual of no more than
    /// `tolerance` of the right-hand side (2-norms of scaled equations).
    ///
    /// # Errors
    /// Those about the right-hand side.
    fn solve_with_kept(&mut self, _rhs: &[f64], _x: &mut [f64], _tolerance: f64) -> Result<Kept<'_>, SolveError> {
        Ok(Kept::None)
    }

    /// An estimate from below of the condition number `‖A‖ ‖A⁻¹‖` in the 1-norm (Hager 1984, Higham 1988): a handful of
    /// solves, usually right within a factor of three.
    ///
    /// # Errors
    /// As [`LinearSolver::solve`].
    fn condition_estimate(&mut self) -> Result<f64, SolveError>;

    /// Whether the determinant of the matrix factored last is negative, by its pivots. `None` without a factor, or
    /// where the factor does not tell.
    fn is_negative(&self) -> Option<bool>;

    /// Whether the matrix factored last is positive definite, as far as the factor tells: Cholesky's does, and a negative
    /// determinant.
    fn is_definite(&self) -> Option<bool> {
        self.is_negative().filter(|negative| *negative).map(|_| false)
    }

    /// Whether the factor in use is that of a symmetric matrix; `None` without one.
    fn is_symmetric(&self) -> Option<bool> {
        None
    }

    /// The method in words, where it is more than the name of the solver.
    fn describe(&self) -> Option<String> {
        None
    }
}

/// Where a matrix was seen not to be positive definite; nothing where no value of a pivot is known: what saw it was no elimination
/// of the matrix itself then, and has no dof.
fn at_pivot(dof: usize, pivot: f64) -> String {
    if pivot.is_nan() { String::new() } else { format!(": pivot {pivot:.3e} at dof {dof}") }
}

/// Multiplications below which a second thread costs more than it gives.
const PARALLEL_OPERATIONS: f64 = 2e7;

/// Threads for so many multiplications. Changes no result: sums run in the same order for any number.
fn worthwhile_threads(threads: usize, operations: f64) -> usize {
    if operations < PARALLEL_OPERATIONS { 1 } else { threads }
}

/// How the dense kernels share so many multiplications.
fn parallelism(threads: usize, operations: f64) -> Par {
    match worthwhile_threads(threads, operations) {
        0 | 1 => Par::Seq,
        threads => Par::rayon(threads),
    }
}
