//! What is asked of a tangent that is not stored: its diagonal, by dof and by node, and the sums of its rows.

use std::sync::atomic::{AtomicBool, Ordering};

use super::{AssembledTerm, TermError};
use crate::assemble::{
    evaluate::FieldValues,
    shared::{add, shared},
    simd::ZERO,
};
use wfl_mesh::mesh::Mesh;
use wfl_sparse::index::NONE;

/// Room for the entries of a dof with the components of its node.
pub(crate) const MOST_COMPONENTS: usize = 3;

/// What is summed over the cells.
pub(crate) struct NodeBlocks<'a> {
    /// By dof its entries with the components of its node, [`MOST_COMPONENTS`] places each.
    pub(crate) blocks: &'a mut [f64],
    /// By dof the sum of the magnitudes of the entries of each cell: no less than that of the matrix.
    pub(crate) sums: &'a mut [f64],
}

impl AssembledTerm {
    /// Adds the blocks of the nodes and the sums of the rows of the tangent, of fields of no more components than have room.
    ///
    /// # Errors
    /// [`TermError::NonFinite`] with the place.
    pub(crate) fn add_node_blocks(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        to: NodeBlocks<'_>,
    ) -> Result<(), TermError> {
        let finite = AtomicBool::new(true);
        let (blocks, sums) = (shared(to.blocks), shared(to.sums));
        self.share_out(mesh, None, |workspace, duties, owns| {
            for duty in duties {
                if !self.local_tangents(mesh, values, workspace, duty) {
                    finite.store(false, Ordering::Relaxed);
                }
                let binding = &self.assembled.binding.groups[duty.group];
                let (n, sources) = (binding.n_dofs(), &self.plans[duty.group].sources);
                let dofs = &self.dofs[duty.group];
                let rows = binding.bases.iter().flat_map(|basis| {
                    (0..basis.n_nodes).flat_map(move |i| (0..basis.n_components).map(move |c| (basis, i, c)))
                });
                for (basis, i, c) in rows {
                    let row = basis.dof(i, c);
                    let own = &sources[row * n..][..n];
                    let mut sum = ZERO;
                    for source in own.iter().filter(|source| **source != NONE) {
                        let line = &workspace.local[*source as usize];
                        sum.iter_mut().zip(line.iter()).for_each(|(sum, entry)| *sum += entry.abs());
                    }
                    for (lane, entity) in self.entities(duty).enumerate() {
                        let dof = dofs[entity * n + row];
                        if dof == NONE || !owns(dof) {
                            continue;
                        }
                        add(&sums[dof as usize], sum[lane]);
                        for d in 0..basis.n_components.min(MOST_COMPONENTS) {
                            let source = own[basis.dof(i, d)];
                            if source != NONE {
                                let value = workspace.local[source as usize][lane];
                                add(&blocks[dof as usize * MOST_COMPONENTS + d], value);
                            }
                        }
                    }
                }
            }
        });
        self.result(finite.into_inner(), mesh, values, (&self.law.tangent, None))
    }
}
