//! What is made once where terms are applied without a matrix.

use std::sync::{Arc, OnceLock};

use wfl_sparse::csr::Csr;
use wfl_sparse::solve::NodeLayout;

use crate::assemble::{AssembledTerm, Skeleton};

/// What stands in the place of matrices.
pub(super) struct WithoutMatrix {
    /// The unknowns by node.
    pub(super) layout: NodeLayout,
    /// The pattern of the changing terms that are not applied, by dof in the axes of the scene; `None` where there are none.
    pub(super) rest: Option<Csr>,
    /// By term what is made once.
    pub(super) terms: Vec<OfTerm>,
}

/// What is made once of a term that is applied.
#[derive(Default)]
pub(super) struct OfTerm {
    pub(super) double: OnceLock<Arc<Skeleton<f64>>>,
    pub(super) single: OnceLock<Arc<Skeleton<f32>>>,
    /// On fewer points, where those are enough for means over cells.
    pub(super) on_levels: OnceLock<Option<AssembledTerm>>,
}
