//! Whether a symmetric tangent is positive definite, and how many directions of negative curvature it has.
//!
//! A factor at hand often says so at no cost: Cholesky's exists for positive definite matrices alone, and with a negative
//! determinant there is a negative direction. Where it does not, the whole tangent is factored once more, by Cholesky first;
//! if that succeeds, later steps are solved with it. Where conjugate gradients solve, a solution with that matrix from a start
//! that is orthogonal to no direction in particular tells whether it is definite, and a factor is asked for counts alone. Counts of LDLᵀ are those of the whole matrix, however its parts are
//! solved with.

use std::sync::Arc;

use super::{Kind, LinearSolver};
use wfl_discrete::system::{System, Tangent};
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{CheckedLlt, CheckedLu, Inertia, LinearSolver as _, SolveError, Source, inertia, symmetrising};

/// What may be left of the difference to the transpose in a symmetric matrix, in parts of the largest entry: rounding of
/// laws whose stresses cancel.
const ASYMMETRY: f64 = 1e-9;

impl LinearSolver {
    /// Whether the tangent that was factored last is positive definite, as far as its factor says so; it may be that of the
    /// iterate before the last.
    #[must_use]
    pub fn is_definite(&self) -> Option<bool> {
        match &self.kind {
            Kind::Condensed(c) => c.is_definite(),
            _ if self.iterates() => self.iteration_is_definite(),
            _ => self.solver.as_ref().and_then(|solver| solver.is_definite()),
        }
    }

    /// Whether the matrix of an iteration is positive definite, where the iteration would not have got to its end otherwise.
    pub(super) fn iteration_is_definite(&self) -> Option<bool> {
        self.iterative.as_ref().filter(|iterative| iterative.shows_definite()).map(|_| true)
    }

    /// Whether our own solvers factor the whole tangent.
    #[must_use]
    pub fn factors_all(&self) -> bool {
        matches!(self.kind, Kind::Full(_))
    }

    /// Whether our own factors are at work.
    #[must_use]
    pub fn is_ours(&self) -> bool {
        self.library.is_none()
    }

    /// Whether another factor has taken the place of Cholesky's, or the determinant of the last tangent is negative.
    #[must_use]
    pub fn lost_definiteness(&self) -> bool {
        self.may_be_symmetric && !self.symmetric || self.is_definite() == Some(false)
    }

    /// Whether the equations are symmetric as they are written, whatever has become of the factors.
    #[must_use]
    pub fn may_be_symmetric(&self) -> bool {
        self.may_be_symmetric
    }

    /// Whether the determinant of the whole tangent that was factored last is negative; it may be that of the iterate before the
    /// last. `None` where parts alone are factored.
    #[must_use]
    pub fn has_negative_determinant(&self) -> Option<bool> {
        if self.factors_all() { self.was_negative() } else { None }
    }

    /// The whole tangent of a system, if it is symmetric.
    #[must_use]
    pub fn symmetric_whole(system: &System, tangent: &Tangent) -> Option<Csr> {
        Self::if_symmetric(system.whole_matrix(tangent).ok()?)
    }

    /// A matrix with the pattern of its transpose, if its values are symmetric.
    #[must_use]
    pub fn if_symmetric(whole: Csr) -> Option<Csr> {
        if !whole.is_symmetric(ASYMMETRY) {
            return None;
        }
        // values may be symmetric where places are not: a coupling that is zero at this state and has no counterpart
        let mut places = whole.transpose();
        if places.pattern() == whole.pattern() {
            return Some(whole);
        }
        places.values_mut().fill(0.0);
        whole.plus(&places).ok()
    }

    /// By row a number that makes a matrix symmetric, one for each group of rows; `None` where there is none.
    #[must_use]
    pub fn symmetrising(whole: &Csr, groups: &[u32]) -> Option<Vec<f64>> {
        if whole.is_symmetric(ASYMMETRY) {
            return Some(vec![1.0; whole.n_rows()]);
        }
        symmetrising(whole, Some(groups))
    }

    /// Leaves a Cholesky factor of a whole matrix in `made`; what was analysed for one made before serves again where its pattern has
    /// the entries of this one.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] and others.
    pub fn cholesky(&self, matrix: &Csr, made: &mut Option<CheckedLlt>) -> Result<(), SolveError> {
        if let Some(before) = made {
            match before.factor(matrix) {
                Err(SolveError::Shape { .. } | SolveError::OutsidePattern { .. }) => {}
                done => return done,
            }
        }
        let new = CheckedLlt::new(matrix.pattern(), Some(self.coordinates.as_slice()), self.options)?;
        made.insert(new).factor(matrix)
    }

    /// The signs of the eigenvalues of a symmetric matrix over the unknowns of this solver; `None` where its factor does not
    /// fit into the memory.
    pub fn inertia(&mut self, matrix: &Arc<Csr>) -> Option<Inertia> {
        if self.looks_definite(&Source::Stored(Arc::clone(matrix))) == Some(true) {
            self.symmetric = self.may_be_symmetric;
            return Some(Inertia { positive: matrix.n_rows(), ..Inertia::default() });
        }
        let mut made = None;
        match self.cholesky(matrix, &mut made) {
            Ok(()) => {
                if matches!(self.kind, Kind::Full(_)) && self.may_be_symmetric && !self.symmetric {
                    self.symmetric = true;
                    self.solver = made.map(|made| Box::new(made) as _);
                }
                Some(Inertia { positive: matrix.n_rows(), ..Inertia::default() })
            }
            Err(SolveError::TooMuchMemory(_)) => None,
            Err(_) => inertia(matrix, Some(self.coordinates.as_slice())).ok(),
        }
    }

    /// As [`Self::inertia`], of a matrix that is not the tangent: what is solved with stays.
    #[must_use]
    pub fn inertia_beside(&self, matrix: &Csr) -> Option<Inertia> {
        match self.cholesky(matrix, &mut None) {
            Ok(_) => Some(Inertia { positive: matrix.n_rows(), ..Inertia::default() }),
            Err(SolveError::TooMuchMemory(_)) => None,
            Err(_) => inertia(matrix, Some(self.coordinates.as_slice())).ok(),
        }
    }

    /// Whether the determinant of a whole matrix over the unknowns of this solver is negative; `None` where its factor does not
    /// fit into the memory or does not tell.
    #[must_use]
    pub fn sign_of(&self, matrix: &Csr) -> Option<bool> {
        let mut made = CheckedLu::new(matrix.pattern(), Some(self.coordinates.as_slice()), self.options).ok()?;
        made.factor(matrix).ok()?;
        made.is_negative()
    }
}
