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
    if matrix.is_symmetric(ASYMMETRY) {
        return Ok(());
    }
    let bound = ASYMMETRY * matrix.max_abs();
    for row in 0..matrix.n_rows() {
        let (columns, values) = matrix.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            let column = column as usize;
            let transposed = matrix.get(column, row);
            if (value - transposed).abs() > bound {
                return Err(SolveError::NotSymmetric { row, column, value, transposed });
            }
        }
    }
    Ok(())
}

/// The same of a matrix on several ranks: each looks at the entries between its own rows, all say the same.
///
/// # Errors
/// [`SolveError::NotSymmetric`].
pub(super) fn check_own_symmetry(matrix: &Csr, owners: &RowOwners) -> Result<(), SolveError> {
    let bound = ASYMMETRY * owners.team.largest(matrix.max_abs());
    let own = (0..matrix.n_rows()).filter(|row| owners.owns(*row));
    let entries = own.flat_map(|row| {
        let (columns, values) = matrix.row(row);
        columns.iter().zip(values).map(move |(column, value)| (row, *column as usize, *value))
    });
    let mut between = entries.filter(|(_, column, _)| owners.owns(*column));
    let bad = between.find(|(row, column, value)| (value - matrix.get(*column, *row)).abs() > bound);
    if owners.team.all(bad.is_none()) {
        return Ok(());
    }
    let (row, column, value) = bad.unwrap_or_default();
    Err(SolveError::NotSymmetric { row, column, value, transposed: matrix.get(column, row) })
}
