//! An unchecked mesh from a reader or generator, and the memory that it will need.
//!
//! Nothing is checked here: [`Mesh::from_raw`](super::Mesh::from_raw) does that.

use super::{
    error::{CellName, NodeName},
    index::{CellId, NodeId},
};
use crate::cell::CellKind;

/// A facet of a named group, by its vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GroupFacet {
    /// Shape of the facet.
    pub kind: CellKind,
    /// Vertices; the first `kind.n_vertices()` count.
    pub vertices: [NodeId; 4],
}

impl GroupFacet {
    /// The vertices that count.
    #[must_use]
    pub fn vertices(&self) -> &[NodeId] {
        &self.vertices[..self.kind.n_vertices()]
    }
}

/// What a named group holds.
#[derive(Clone, Debug, PartialEq)]
pub enum GroupEntities {
    /// Cells of the mesh.
    Cells(Vec<CellId>),
    /// Facets.
    Facets(Vec<GroupFacet>),
    /// Nodes: the group was of points, or of curves in three dimensions.
    Nodes {
        /// The nodes.
        nodes: Vec<NodeId>,
        /// Vertices of the edges of the curves; empty for points.
        edges: Vec<[NodeId; 2]>,
    },
}

/// A named set of entities that came with the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name, as written in the file.
    pub name: String,
    /// Dimension of the entities.
    pub dim: usize,
    /// The entities.
    pub entities: GroupEntities,
}

/// A mesh as a reader or generator finds it: nothing is checked yet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Dimension of the space and of the cells, 1 to 3.
    pub dim: usize,
    /// Order of the geometry, 1 or 2.
    pub order: usize,
    /// Coordinates of the nodes; those from `dim` on are ignored and set to zero.
    pub nodes: Vec<[f64; 3]>,
    /// Kind of each cell, all of dimension `dim`.
    pub kinds: Vec<CellKind>,
    /// Nodes of all cells, one cell after the other, each in the local order of the Lagrange
    /// element of degree `order` on its kind.
    pub connectivity: Vec<u32>,
    /// Named groups.
    pub groups: Vec<Group>,
    /// Numbers in the file that the mesh came from.
    pub numbers: FileNumbers,
}

/// What a file calls the cells and nodes of a mesh, in their order; both empty for a mesh that is in no file. Messages
/// use these numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileNumbers {
    /// One number a cell.
    pub cells: Vec<u64>,
    /// One number a node.
    pub nodes: Vec<u64>,
}

impl FileNumbers {
    /// What messages call a cell.
    #[must_use]
    pub fn cell(&self, cell: CellId) -> CellName {
        self.cells.get(cell.index()).map_or(CellName::Cell(cell), |number| CellName::Element(*number))
    }

    /// What messages call a node.
    #[must_use]
    #[inline]
    pub fn node(&self, node: NodeId) -> NodeName {
        NodeName(self.nodes.get(node.index()).copied().unwrap_or(node.index() as u64))
    }
}

/// Bytes that nodes take while a mesh is made: positions, and lists by node.
pub(crate) fn node_bytes(nodes: u64) -> u64 {
    (24 + 8) * nodes
}

/// Bytes that a cell takes while a mesh and its facets are made: its nodes; for each of its facets key, entry, slot and
/// partner, whose place the numbered facets take afterwards. Within 6 % of what boxes of 125,000 cubes and of 750,000
/// tetrahedra take.
pub(crate) fn cell_bytes(kind: CellKind) -> u64 {
    let (nodes, facets) = (kind.n_vertices() as u64, kind.facets().len() as u64);
    8 * nodes + 16 + (16 + 16 + 8 + 4) * facets
}
