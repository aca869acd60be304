//! Nodes of cells, stored once for all who ask for them.
//!
//! Promises: the nodes of cells one after the other, in the order that was asked for. Does not know elements.

use std::{ops::Deref, sync::Arc};

use super::Space;
use wfl_mesh::mesh::CellId;

/// Nodes of entities one after the other, a part of a list that others may share: a mesh has many cells, and many ask for the
/// same nodes of the same cells.
#[derive(Clone, Debug, Default)]
pub struct NodeList {
    all: Arc<Vec<u32>>,
    first: usize,
    n: usize,
}

impl From<Vec<u32>> for NodeList {
    fn from(nodes: Vec<u32>) -> Self {
        Self { n: nodes.len(), all: Arc::new(nodes), first: 0 }
    }
}

impl FromIterator<u32> for NodeList {
    fn from_iter<I: IntoIterator<Item = u32>>(nodes: I) -> Self {
        nodes.into_iter().collect::<Vec<u32>>().into()
    }
}

impl Deref for NodeList {
    type Target = [u32];

    #[inline]
    fn deref(&self) -> &[u32] {
        &self.all[self.first..][..self.n]
    }
}

impl Space {
    /// Nodes of the cells of a support on cells, all of them of one kind, in the local order of [`Space::element_at`]; shared
    /// with the space where they follow each other in it. `None` where the space does not live in one of them.
    #[must_use]
    pub fn nodes_of_cells(&self, cells: &[CellId]) -> Option<NodeList> {
        let positions = || cells.iter().map(|cell| self.position_of_cell(*cell));
        let first = self.position_of_cell(*cells.first()?)?;
        if (first..).zip(positions()).all(|(expected, position)| position == Some(expected)) {
            let range = self.starts[first]..self.starts[first + cells.len()];
            return Some(NodeList { all: Arc::clone(&self.nodes), first: range.start, n: range.len() });
        }
        let mut nodes = Vec::with_capacity(cells.len() * self.entity_nodes(first).len());
        for position in positions() {
            nodes.extend_from_slice(self.entity_nodes(position?));
        }
        Some(NodeList::from(nodes))
    }
}
