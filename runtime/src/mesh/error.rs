//! What can be wrong with a mesh, with the numbers that a message needs.
//!
//! Cells and nodes are counted from 0, as everywhere in the program.

use super::{CellId, CellKind, NodeId};

/// A mesh that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The mesh has no cells of its dimension.
    #[error("the mesh has no cells")]
    Empty,
    /// Dimension or order outside what is supported.
    #[error("a mesh of dimension {dim} and order {order} is not supported (1 to 3, 1 or 2)")]
    Unsupported {
        /// Dimension asked for.
        dim: usize,
        /// Order asked for.
        order: usize,
    },
    /// A cell does not have the dimension of the mesh.
    #[error("cell {} is a {kind} in a mesh of dimension {dim}", cell.index())]
    WrongDimension {
        /// The cell.
        cell: CellId,
        /// Its kind.
        kind: CellKind,
        /// Dimension of the mesh.
        dim: usize,
    },
    /// The list of cell nodes has the wrong length.
    #[error("the cells need {expected} node numbers, {found} are given")]
    ConnectivityLength {
        /// Sum over the cells.
        expected: usize,
        /// Length found.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("coordinate {} of node {} is {value}", ["x", "y", "z"][*axis], node.index())]
    NonFinite {
        /// The node.
        node: NodeId,
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// NaN or infinity.
        value: f64,
    },
    /// A cell or group names a node that does not exist.
    #[error("cell {} uses node {node}, but there are only {n_nodes} nodes", cell.index())]
    MissingNode {
        /// The cell.
        cell: CellId,
        /// The number found.
        node: usize,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// A group names an entity that does not exist.
    #[error("group `{group}` names a {what} that the mesh does not have")]
    GroupEntity {
        /// Name of the group.
        group: String,
        /// `cell`, `facet` or `node`.
        what: &'static str,
    },
    /// A cell lists one node twice.
    #[error("cell {} lists node {} twice", cell.index(), node.index())]
    RepeatedNode {
        /// The cell.
        cell: CellId,
        /// The node.
        node: NodeId,
    },
    /// The jacobian determinant is negative in the whole cell: its nodes are listed in the wrong
    /// sense.
    #[error("cell {}{} is inside out: its jacobian determinant is {determinant:e} everywhere checked", cell.index(), in_group(group))]
    Inverted {
        /// The cell.
        cell: CellId,
        /// First group of cells that holds it.
        group: Option<String>,
        /// The largest determinant found.
        determinant: f64,
    },
    /// The jacobian determinant changes sign or vanishes in the cell.
    #[error("cell {}{} is folded: its jacobian determinant is {determinant:e} at ({}, {}, {})", cell.index(), in_group(group), point[0], point[1], point[2])]
    Folded {
        /// The cell.
        cell: CellId,
        /// First group of cells that holds it.
        group: Option<String>,
        /// The smallest determinant found.
        determinant: f64,
        /// Physical point where it was found.
        point: [f64; 3],
    },
    /// The cell has no volume.
    #[error("cell {}{} has no volume (jacobian determinant {determinant:e}, size {size:e})", cell.index(), in_group(group))]
    ZeroVolume {
        /// The cell.
        cell: CellId,
        /// First group of cells that holds it.
        group: Option<String>,
        /// The determinant of largest magnitude.
        determinant: f64,
        /// Largest distance between two vertices.
        size: f64,
    },
    /// More than two cells meet at one facet.
    #[error("{} cells share one facet, among them {}, {} and {}", cells.len(), cells[0].index(), cells[1].index(), cells[2].index())]
    NonManifold {
        /// The cells, at least three.
        cells: Vec<CellId>,
    },
    /// Two cells have the same vertices.
    #[error("cells {} and {} have the same vertices", first.index(), second.index())]
    DuplicateCell {
        /// The lower number.
        first: CellId,
        /// The higher number.
        second: CellId,
    },
    /// Facets of two surfaces lie on each other but their vertices do not coincide.
    #[error(
        "{facets} facets lie against each other without matching, largest distance of vertices {largest_distance:e}"
    )]
    NotMatching {
        /// Number of facets concerned.
        facets: usize,
        /// Largest distance from a vertex of one facet to the nearest vertex of the other.
        largest_distance: f64,
    },
    /// A box or its cell counts make no mesh.
    #[error("the box needs {needed}")]
    BadBox {
        /// What would be right.
        needed: &'static str,
    },
    /// More nodes than 32-bit numbers can count.
    #[error("the mesh would have {nodes} nodes, more than 4294967295")]
    TooLarge {
        /// Number of nodes.
        nodes: u128,
    },
}

fn in_group(group: &Option<String>) -> String {
    group.as_ref().map_or_else(String::new, |name| format!(" of `{name}`"))
}
