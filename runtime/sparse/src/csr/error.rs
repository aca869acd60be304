//! What can be wrong with a sparse matrix.

use wfl_host::memory::TooMuchMemory;

/// What can be wrong with the structure or the shape of a sparse matrix.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CsrError {
    /// The arrays do not describe a matrix.
    #[error("row {row}: {what}")]
    Structure {
        /// Row (or dof) at which it was seen.
        row: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// Two shapes that must agree do not.
    #[error("{what}: expected {} x {}, found {} x {}", expected.0, expected.1, found.0, found.1)]
    Shape {
        /// The operation.
        what: &'static str,
        /// Rows and columns that were needed.
        expected: (usize, usize),
        /// Rows and columns that were found.
        found: (usize, usize),
    },
    /// More rows or columns than 32-bit indices can name.
    #[error("{size} rows or columns do not fit 32-bit indices")]
    TooLarge {
        /// The offending size.
        size: usize,
    },
    /// The matrix does not fit into the memory.
    #[error(transparent)]
    TooMuchMemory(#[from] TooMuchMemory),
}
