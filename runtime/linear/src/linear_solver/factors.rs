//! Which factor a whole matrix gets: Cholesky's where it is symmetric and positive definite (LLT), one with pivots of both signs
//! where it is symmetric as it is or in scaled equations (LDLT), or that of any matrix (LU).
//!
//! LDLT makes half of the multiplications of LU and keeps half of the numbers, so it is taken wherever it can be; each of its
//! matrices is looked at, and LU takes over by itself. Does not condense.

use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{CheckedLdlt, CheckedLibrary, CheckedLlt, CheckedLu, SolveError, Symmetry};

use super::super::plan::FactorKind;
use super::{Factor, LinearSolver};

impl LinearSolver {
    /// How whole matrices are factored as far as is known.
    pub(super) fn factor_kind(&self) -> FactorKind {
        match self.solver.as_ref().and_then(|solver| solver.is_symmetric()) {
            _ if self.symmetric => FactorKind::Definite,
            Some(true) if self.may_be_symmetric => FactorKind::Indefinite,
            Some(true) => FactorKind::Multiplied,
            Some(false) => FactorKind::General,
            None if self.may_be_symmetric => FactorKind::Indefinite,
            None if self.groups.is_some() => FactorKind::Undecided,
            None => FactorKind::General,
        }
    }

    /// Factors a matrix by the method that it asks for.
    pub(super) fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        self.factorisations += 1;
        let is_linked = self.library.is_some();
        if self.symmetric && !is_linked && !has_positive_diagonal(matrix) {
            (self.symmetric, self.solver) = (false, None);
        }
        if self.solver.is_none() {
            self.solver = Some(self.fresh(matrix)?);
        }
        let first = self.solver.as_mut().expect("made above").factor(matrix);
        match first {
            Err(SolveError::NotPositiveDefinite { .. } | SolveError::NotSymmetric { .. }) if self.symmetric => {
                // the memory of the one goes before that of the other comes
                (self.symmetric, self.solver) = (false, None);
                let mut other = self.fresh(matrix)?;
                other.factor(matrix)?;
                self.solver = Some(other);
                Ok(())
            }
            other => other,
        }
    }

    pub(super) fn fresh(&self, matrix: &Csr) -> Result<Box<dyn Factor + Send>, SolveError> {
        let coordinates = Some(self.coordinates.as_slice());
        if let (Some(linked), Some(equations)) = (self.library, &self.equations) {
            let solver = CheckedLibrary::new(
                linked,
                equations,
                Symmetry::known(self.symmetric),
                &self.coordinates,
                self.options,
            )?;
            return Ok(Box::new(solver));
        }
        let (pattern, options) = (matrix.pattern(), self.options);
        Ok(if self.symmetric {
            Box::new(CheckedLlt::new(pattern, coordinates, options)?)
        } else if self.may_be_symmetric || self.groups.is_some() {
            Box::new(CheckedLdlt::new(pattern, coordinates, self.groups.as_deref(), options)?)
        } else {
            Box::new(CheckedLu::new(pattern, coordinates, options)?)
        })
    }
}

/// Whether all entries on the diagonal are above zero.
fn has_positive_diagonal(matrix: &Csr) -> bool {
    (0..matrix.n_rows()).all(|dof| matrix.get(dof, dof) > 0.0)
}
