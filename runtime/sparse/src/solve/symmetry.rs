//! Whether a matrix is symmetric, as its terms promise.

use super::SolveError;
use super::row_owners::RowOwners;
use crate::csr::Csr;

/// What is known of matrices before there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// They are symmetric, and may be taken for positive definite ones until one is not.
    Symmetric,
    /// Nothing.
    General,
}

impl Symmetry {
    /// Of matrices that are known to be symmetric, or are not.
    #[must_use]
    pub fn known(is_symmetric: bool) -> Self {
        if is_symmetric { Self::Symmetric } else { Self::General }
    }
}

/// Relative asymmetry that rounding in assembly explains.
const ASYMMETRY: f64 = 1e-10;

/// Refuses a matrix whose halves differ by more than rounding.
pub(super) fn check_symmetry(matrix: &Csr) -> Result<(), SolveError> {
    match matrix.first_asymmetry(ASYMMETRY, &|_| true) {
        None => Ok(()),
        Some(at) => Err(not_symmetric(matrix, at)),
    }
}

/// The same of a matrix on several ranks: each looks at the entries between its own rows, all say the same.
///
/// # Errors
/// [`SolveError::NotSymmetric`].
pub(super) fn check_own_symmetry(matrix: &Csr, owners: &RowOwners) -> Result<(), SolveError> {
    let bad = matrix.first_asymmetry(ASYMMETRY, &|row| owners.owns(row));
    if owners.team.all(bad.is_none()) {
        return Ok(());
    }
    Err(not_symmetric(matrix, bad.unwrap_or_default()))
}

fn not_symmetric(matrix: &Csr, at: (usize, usize)) -> SolveError {
    let (row, column) = at;
    SolveError::NotSymmetric { row, column, value: matrix.get(row, column), transposed: matrix.get(column, row) }
}
