//! The coarsest level, which is factored.

use std::sync::Arc;

use super::blocks::{Blocks, RowBuffer, Rows};
use crate::csr::{Csr, Pattern};
use crate::solve::SolveError;
use crate::solve::factorization::Factorization;
use crate::solve::llt::Llt;
use crate::solve::lu::SparseLu;
use crate::solve::triangular_solve::Transpose;

/// Part of the diagonal that is added to a coarsest matrix that looks singular, to look for its null vector: little, so
/// that inverse iteration converges at once.
const SHIFT: f64 = 1e-9;
/// Steps of inverse iteration for it.
const INVERSE_ITERATIONS: usize = 3;

/// A factor of the coarsest matrix.
pub(super) enum Factor {
    /// Of one that is symmetric and positive definite.
    Definite(Llt),
    /// Of the sum of a constant and a changing part.
    Any(SparseLu),
}

impl Factor {
    pub(super) fn solve(&mut self, x: &mut [f64]) {
        match self {
            Self::Definite(factor) => factor.solve(Transpose::No, x),
            Self::Any(factor) => factor.solve(Transpose::No, x),
        }
    }
}

/// The coarsest level.
pub(super) struct Coarsest {
    pub(super) factor: Factor,
    /// Right-hand side and solution.
    pub(super) x: Vec<f64>,
    suspicion: Option<Suspicion>,
}

/// A coarsest matrix that may be singular.
struct Suspicion {
    matrix: Csr,
    /// Why it has no factor; `None` where it has one, with a tiny pivot.
    error: Option<SolveError>,
}

impl Coarsest {
    /// Factors a matrix that is symmetric.
    ///
    /// # Errors
    /// [`SolveError::TooMuchMemory`].
    pub(super) fn new(a: &dyn Rows) -> Result<Self, SolveError> {
        let matrix = entries(a)?;
        let mut factor = Llt::analyze(matrix.pattern(), None, rayon::current_num_threads())?;
        let x = vec![0.0; matrix.n_rows()];
        let suspicion = match factor.factor(&matrix) {
            Ok(pivot) => pivot.is_suspicious().then_some(Suspicion { matrix, error: None }),
            Err(error @ SolveError::NotPositiveDefinite { .. }) => Some(Suspicion { matrix, error: Some(error) }),
            Err(error) => return Err(error),
        };
        Ok(Self { x, factor: Factor::Definite(factor), suspicion })
    }

    /// Prepares for matrices with these blocks, symmetric or not.
    ///
    /// # Errors
    /// [`SolveError::TooMuchMemory`].
    pub(super) fn of_any(a: &Blocks<f64>) -> Result<Self, SolveError> {
        let matrix = entries(a)?;
        let factor = SparseLu::analyze(matrix.pattern(), None, rayon::current_num_threads())?;
        Ok(Self { x: vec![0.0; matrix.n_rows()], factor: Factor::Any(factor), suspicion: None })
    }

    /// Factors the next matrix.
    ///
    /// # Errors
    /// [`SolveError`] where it has no factor.
    pub(super) fn take(&mut self, a: &Blocks<f64>) -> Result<(), SolveError> {
        let matrix = entries(a)?;
        match &mut self.factor {
            Factor::Definite(factor) => factor.factor(&matrix).map(|_| ()),
            Factor::Any(factor) => factor.factor(&matrix).map(|_| ()),
        }
    }

    /// Where the matrix looks singular, its softest motion: inverse iteration with the factor of a matrix with a larger
    /// diagonal, in the norm of what was added, so that a null vector of the one is found by the other.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] where the matrix is not even semi-definite.
    pub(super) fn softest_motion(&mut self) -> Result<Option<Vec<f64>>, SolveError> {
        let Factor::Definite(factor) = &mut self.factor else { return Ok(None) };
        let Some(suspicion) = &self.suspicion else { return Ok(None) };
        let mut shifted = suspicion.matrix.clone();
        let diagonal: Vec<f64> = (0..shifted.n_rows()).map(|row| shifted.get(row, row).abs()).collect();
        for (row, size) in diagonal.iter().enumerate() {
            if !shifted.add_to(row, row, SHIFT * size) {
                return Err(SolveError::NotPositiveDefinite { dof: 0, pivot: 0.0 });
            }
        }
        factor.factor(&shifted)?;
        // golden-ratio numbers: fixed, and orthogonal to no vector in particular
        let start = |i: usize| (i as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
        let mut motion: Vec<f64> = (1..=diagonal.len()).map(start).collect();
        for _ in 0..INVERSE_ITERATIONS {
            motion.iter_mut().zip(&diagonal).for_each(|(value, size)| *value *= size);
            factor.solve(Transpose::No, &mut motion);
            let size = crate::norm::largest(motion.iter().copied());
            motion.iter_mut().for_each(|value| *value /= size);
        }
        Ok(Some(motion))
    }

    /// Takes the factor of a matrix that looks singular as it is.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] where it has none.
    pub(super) fn trust(&mut self) -> Result<(), SolveError> {
        match (self.suspicion.take(), &mut self.factor) {
            (Some(Suspicion { error: Some(error), .. }), _) => Err(error),
            (Some(Suspicion { matrix, error: None }), Factor::Definite(factor)) => factor.factor(&matrix).map(|_| ()),
            _ => Ok(()),
        }
    }
}

/// A matrix of blocks in single entries.
fn entries(a: &dyn Rows) -> Result<Csr, SolveError> {
    let (n, size) = (a.n_nodes(), a.size());
    let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    let mut buffer = RowBuffer::default();
    for node in 0..n {
        let (of_row, blocks) = a.row(node, &mut buffer);
        for c in 0..size {
            for (column, block) in of_row.iter().zip(blocks.chunks_exact(size * size)) {
                columns.extend((0..size as u32).map(|d| column * size as u32 + d));
                values.extend_from_slice(&block[c * size..][..size]);
            }
            starts.push(columns.len());
        }
    }
    Ok(Csr::new(Arc::new(Pattern::new(n * size, n * size, starts, columns)?), values)?)
}
