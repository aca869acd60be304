//! A symmetric matrix that is applied and not stored.
//!
//! Who implements it knows meshes and laws; here are vectors of unknowns, by row or by place of a [`NodeLayout`].

use std::sync::Arc;

use rayon::prelude::*;
use wfl_host::memory::TooMuchMemory;

use super::blocks::{Blocks, ROWS_PER_TASK, Real, Rows};
use super::level::Product;
use crate::csr::Csr;

/// The first coarser level of an operator: elements of degree 1 on the same cells.
#[derive(Debug, Clone)]
pub struct CoarserLevel {
    /// The matrix over its unknowns.
    pub matrix: Csr,
    /// By row: node times components plus component, increasing. Nodes are those of the interpolation of the layout that stand
    /// in their own lists alone, in their order.
    pub places: Vec<u32>,
    /// How many nodes there are.
    pub n_nodes: usize,
}

/// The finest level of an operator.
///
/// Promises of who implements it: the same bits for any number of threads, and the same linear map every time.
pub trait FinestLevel: Send + Sync {
    /// `y = scale A x` in single precision, both by place of the layout; `y = x` at places that are not solved for.
    fn apply(&self, x: &[f32], y: &mut [f32]);

    /// Bytes that it holds.
    fn bytes(&self) -> usize;
}

/// What the levels of an operator are made of: they may be those of a matrix near it.
pub struct OperatorLevels {
    /// The finest one.
    pub finest: Arc<dyn FinestLevel>,
    /// A power of two that brings the largest entry to about 1.
    pub scale: f64,
    /// By node of the layout a matrix of its components, row by row: the diagonal blocks of the matrix, one over
    /// the scale on the diagonal where a place is not solved for.
    pub blocks: Vec<f64>,
    /// The first coarser one.
    pub coarser: CoarserLevel,
}

/// A symmetric matrix over the unknowns of a layout that is applied and not stored.
///
/// Promises of who implements it: the same bits for any number of threads, and the same linear map every time.
pub trait Operator: Send + Sync {
    /// Number of rows and columns.
    fn n_rows(&self) -> usize;

    /// `y = A x`, both by row.
    fn apply(&self, x: &[f64], y: &mut [f64]);

    /// The diagonal, about.
    fn diagonal(&self) -> &[f64];

    /// By row the sum of the magnitudes of the entries, about from above.
    fn row_sums(&self) -> &[f64];

    /// By row `|A| |x|`, about from above: the row sum times the largest of the unknowns that the row couples with.
    fn sizes(&self, x: &[f64], out: &mut [f64]);

    /// What its levels are made of, made now; `None` where that cannot be.
    fn levels(&self) -> Option<OperatorLevels>;

    /// The matrix itself, assembled now: where a solution needs a factor, or is to be explained. `None` where it cannot be made.
    fn matrix(&self) -> Option<Arc<Csr>>;

    /// Bytes that it holds.
    fn bytes(&self) -> usize;
}

/// The finest level: stored in blocks of single precision, or applied.
pub(super) enum Finest {
    Stored(Blocks<f32>),
    Applied(Applied),
}

/// A level that is applied, with room for a product.
pub(super) struct Applied {
    level: Arc<dyn FinestLevel>,
    size: usize,
    product: Vec<f32>,
}

impl Finest {
    /// A copy of a matrix.
    ///
    /// # Errors
    /// [`TooMuchMemory`].
    pub(super) fn stored(matrix: &dyn Rows) -> Result<Self, TooMuchMemory> {
        Blocks::rounded(matrix).map(Self::Stored)
    }

    /// A level over so many nodes of so many components.
    pub(super) fn applied(level: Arc<dyn FinestLevel>, n_nodes: usize, size: usize) -> Self {
        Self::Applied(Applied { level, size, product: vec![0.0; n_nodes * size] })
    }
}

impl Product<f32> for Finest {
    fn size(&self) -> usize {
        match self {
            Self::Stored(blocks) => blocks.shape[0],
            Self::Applied(applied) => applied.size,
        }
    }

    fn n_unknowns(&self) -> usize {
        match self {
            Self::Stored(blocks) => blocks.n_unknowns(),
            Self::Applied(applied) => applied.product.len(),
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Self::Stored(blocks) => blocks.bytes(),
            Self::Applied(applied) => applied.level.bytes() + size_of_val(&applied.product[..]),
        }
    }

    fn for_each_row(&mut self, x: &[f32], out: &mut [f32], then: impl Fn(usize, &[f32], &mut [f32]) + Sync) {
        match self {
            Self::Stored(blocks) => blocks.for_each_row(x, out, then),
            Self::Applied(applied) => applied.for_each_row(x, out, then),
        }
    }
}

impl Applied {
    fn for_each_row(&mut self, x: &[f32], out: &mut [f32], then: impl Fn(usize, &[f32], &mut [f32]) + Sync) {
        self.level.apply(x, &mut self.product);
        let (size, product) = (self.size, &self.product);
        out.par_chunks_mut(size * ROWS_PER_TASK).enumerate().for_each(|(chunk, out)| {
            for (offset, out) in out.chunks_exact_mut(size).enumerate() {
                let row = chunk * ROWS_PER_TASK + offset;
                then(row, &product[row * size..][..size], out);
            }
        });
    }
}

impl<T: Real, X: Real> Product<X> for Blocks<T> {
    fn size(&self) -> usize {
        self.shape[0]
    }

    fn n_unknowns(&self) -> usize {
        self.n_unknowns()
    }

    fn bytes(&self) -> usize {
        self.bytes()
    }

    fn for_each_row(&mut self, x: &[X], out: &mut [X], then: impl Fn(usize, &[X], &mut [X]) + Sync) {
        Self::for_each_row(self, x, out, then);
    }
}
