//! Errors and warnings about a mesh, with the numbers that a message needs.
//!
//! Cells and nodes of a file have the numbers of the file; others are counted from 0, as everywhere in the program.

use super::index::{CellId, NodeId};
use crate::cell::CellKind;

/// A cell as a message names it: its number in the file that it came from, else its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellName {
    /// A cell that was generated.
    Cell(CellId),
    /// An element of a file, by its number there.
    Element(u64),
}

impl std::fmt::Display for CellName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            CellName::Cell(cell) => write!(f, "cell {}", cell.index()),
            CellName::Element(number) => write!(f, "element {number}"),
        }
    }
}

/// A node as a message names it: its number in the file that it came from, else its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeName(pub u64);

impl std::fmt::Display for NodeName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "node {}", self.0)
    }
}

/// A mesh that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The mesh has no cells of its dimension.
    #[error("the mesh has no cells")]
    Empty,
    /// Dimension or order outside what is supported.
    #[error("a mesh of dimension {dim} and order {order} is not supported (1 to 3, 1 or 2)")]
    Unsupported {
        /// Requested dimension.
        dim: usize,
        /// Requested order.
        order: usize,
    },
    /// A cell does not have the dimension of the mesh.
    #[error("{cell} is a {kind} in a mesh of dimension {dim}")]
    WrongDimension {
        /// The cell.
        cell: CellName,
        /// Its kind.
        kind: CellKind,
        /// Dimension of the mesh.
        dim: usize,
    },
    /// Meshes of several files that cannot be one.
    #[error("a mesh of dimension {first} and one of dimension {other} cannot stand in one scene")]
    OtherDimension {
        /// That of the first ones.
        first: usize,
        /// That of the next one.
        other: usize,
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
    #[error("coordinate {} of {node} is {value}", ["x", "y", "z"][*axis])]
    NonFinite {
        /// The node.
        node: NodeName,
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// NaN or infinity.
        value: f64,
    },
    /// A cell or group names a node that does not exist.
    #[error("{cell} uses node {node}, but there are only {n_nodes} nodes")]
    MissingNode {
        /// The cell.
        cell: CellName,
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
    #[error("{cell} lists {node} twice")]
    RepeatedNode {
        /// The cell.
        cell: CellName,
        /// The node.
        node: NodeName,
    },
    /// The jacobian determinant is negative in the whole cell: its nodes are listed in the wrong
    /// sense.
    #[error(
        "{}{} is inside out: its jacobian determinant is {determinant:e} everywhere checked",
        cell,
        in_group(group)
    )]
    Inverted {
        /// The cell.
        cell: CellName,
        /// First group of cells that holds it.
        group: Option<String>,
        /// The largest determinant found.
        determinant: f64,
    },
    /// The jacobian determinant changes sign or vanishes in the cell.
    #[error("{}{} is folded: its jacobian determinant is {determinant:e} at ({}, {}, {})", cell, in_group(group), point[0], point[1], point[2])]
    Folded {
        /// The cell.
        cell: CellName,
        /// First group of cells that holds it.
        group: Option<String>,
        /// The smallest determinant found.
        determinant: f64,
        /// Physical point where it was found.
        point: [f64; 3],
    },
    /// The cell has no volume.
    #[error("{}{} has no volume (jacobian determinant {determinant:e}, size {size:e})", cell, in_group(group))]
    ZeroVolume {
        /// The cell.
        cell: CellName,
        /// First group of cells that holds it.
        group: Option<String>,
        /// The determinant of largest magnitude.
        determinant: f64,
        /// Largest distance between two vertices.
        size: f64,
    },
    /// More than two cells meet at one facet.
    #[error("{} cells share one facet, among them {}, {} and {}", cells.len(), cells[0], cells[1], cells[2])]
    NonManifold {
        /// The cells, at least three.
        cells: Vec<CellName>,
    },
    /// Two cells have the same vertices.
    #[error("{first} and {second} have the same vertices")]
    DuplicateCell {
        /// The lower number.
        first: CellName,
        /// The higher number.
        second: CellName,
    },
    /// A triangular face has its vertices on a quadrilateral one of another cell: neighbours do not match.
    #[error(
        "a triangular face of {triangle} lies on a quadrilateral one of {quadrilateral}: cells that share a place must share whole faces, with pyramids between tetrahedra and hexahedra"
    )]
    HalfFace {
        /// The cell with the triangle.
        triangle: CellName,
        /// The cell with the quadrilateral.
        quadrilateral: CellName,
    },
    /// Two cells lie on the same side of the face that they share.
    #[error(
        "{first} and {second} lie on the same side of the face that they share: one of them is folded over the other; mend the place where the mesh is made"
    )]
    FoldedOver {
        /// The lower number.
        first: CellName,
        /// The higher number.
        second: CellName,
    },
    /// Two cells have the vertices of a face in common, but not the nodes between them, which are elsewhere.
    #[error(
        "{first} and {second} share the vertices of a face, but {node} of it belongs to {first} alone, with nothing of {second} at its place: between them is a gap or an overlap; give both cells the same nodes there"
    )]
    MiddleNodes {
        /// The lower number.
        first: CellName,
        /// The higher number.
        second: CellName,
        /// A node of the face in the first cell.
        node: NodeName,
    },
    /// A refinement reaches a cell that cannot be divided.
    #[error(
        "{cell} is a {kind}, and {kind}s are not divided: make the mesh finer where it is made (`Mesh.MeshSizeFactor = 0.5` in Gmsh), or refine only cells that no {kind} shares an edge with"
    )]
    NoRefinement {
        /// The cell.
        cell: CellName,
        /// Its kind.
        kind: CellKind,
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
    /// The need for memory is above the limit.
    #[error(transparent)]
    TooMuchMemory(#[from] wfl_host::memory::TooMuchMemory),
}

fn in_group(group: &Option<String>) -> String {
    group.as_ref().map_or_else(String::new, |name| format!(" of `{name}`"))
}

/// What is odd about a mesh but no error.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshWarnings {
    /// Pairs of distinct nodes of one body (connected by cells) at the same place: nearer than
    /// [`DUPLICATE_TOLERANCE`] of the shortest cell edge at either.
    pub duplicate_nodes: Vec<(NodeId, NodeId)>,
    /// Nodes of no cell; nothing is numbered there.
    pub unused_nodes: Vec<NodeId>,
    /// Plane cells of a file whose nodes ran clockwise, and were put in the other order.
    pub turned_cells: Vec<CellId>,
}

/// Two nodes of one body are duplicates within this part of the shortest edge at them.
pub const DUPLICATE_TOLERANCE: f64 = 1e-6;
