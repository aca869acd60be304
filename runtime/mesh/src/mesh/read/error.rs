//! Errors in a mesh file, with their place.

use wfl_host::reading::ReadingError;

use crate::mesh::error::MeshError;

/// Where in a file something was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line, counted from 1.
    Line(usize),
    /// Offset in bytes from the start, for binary data.
    Byte(usize),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Place::Line(line) => write!(f, "line {line}"),
            Place::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

impl ReadError {
    /// What is wrong in a line of a deck.
    pub(super) fn deck(line: usize, what: impl Into<String>) -> Self {
        Self::Deck { what: what.into(), place: Place::Line(line) }
    }

    /// Why a file that this one includes cannot be read, if that is what is wrong.
    #[must_use]
    pub fn included(&self) -> Option<&ReadingError> {
        match self {
            ReadError::Include { error, .. } => Some(error),
            ReadError::Within { error, .. } => error.included(),
            _ => None,
        }
    }
}

/// A mesh file that cannot be used. Numbers of nodes and elements are those of the file.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// No reader knows the first bytes.
    #[error(
        "not a mesh file of a known format (Gmsh 2.2 and 4.1, input files of Abaqus and CalculiX, and .vtu are read)"
    )]
    UnknownFormat,
    /// A format that is known, but not read.
    #[error("this is {what}, which is not read; convert it: {cure}")]
    Other {
        /// What the file is.
        what: &'static str,
        /// The command that converts it.
        cure: &'static str,
    },
    /// A Gmsh file of another version or number size.
    #[error(
        "Gmsh file format {found} is not read, save the mesh as 2.2 or 4.1: `gmsh part.msh -save -format msh41 -o new.msh`"
    )]
    Version {
        /// Version found, with the number size when that is the trouble.
        found: String,
    },
    /// Something else was needed here.
    #[error("{place}: found `{found}`, needed {needed}")]
    Syntax {
        /// What was needed.
        needed: &'static str,
        /// What stands there.
        found: String,
        /// Where.
        place: Place,
    },
    /// The file ends too early.
    #[error("{place}: the file ends where {needed} is needed")]
    Truncated {
        /// What was needed.
        needed: &'static str,
        /// End of the file.
        place: Place,
    },
    /// A deck says what is not read, or what makes no sense.
    #[error("{place}: {what}")]
    Deck {
        /// What is wrong, and what to do.
        what: String,
        /// Where.
        place: Place,
    },
    /// A file that a deck includes cannot be read.
    #[error("{place}: `{file}`, which is included there, cannot be read: {error}; it is looked for beside the deck")]
    Include {
        /// Its name in the deck.
        file: String,
        /// Why not.
        error: Box<ReadingError>,
        /// Where it is named.
        place: Place,
    },
    /// Something is wrong in a file that a deck includes.
    #[error("in the included `{file}`, {error}")]
    Within {
        /// Its name in the deck.
        file: String,
        /// What is wrong; the place is that in the included file.
        error: Box<ReadError>,
    },
    /// A section that every mesh needs is not there.
    #[error("the file has no ${section} section")]
    MissingSection {
        /// Name of the section.
        section: &'static str,
    },
    /// An element that is not supported.
    #[error("{place}: element {element} is a {name} (Gmsh type {code}), which is not supported{remedy}")]
    ElementType {
        /// Number of the element.
        element: u64,
        /// Gmsh's type number.
        code: i64,
        /// Its name, as far as known.
        name: &'static str,
        /// How to write the file instead, after a semicolon; empty where nothing helps.
        remedy: &'static str,
        /// Where.
        place: Place,
    },
    /// An element names a node that is not in the file.
    #[error("element {element} uses node {node}, which is not in the file")]
    MissingNode {
        /// Number of the element.
        element: u64,
        /// Number of the node.
        node: u64,
    },
    /// Two nodes have the same number.
    #[error("node {node} is given twice")]
    DuplicateNode {
        /// Number of the node.
        node: u64,
    },
    /// A coordinate is NaN or infinite.
    #[error("{place}: a coordinate of node {node} is {value}")]
    NonFinite {
        /// Number of the node.
        node: u64,
        /// The coordinate.
        value: f64,
        /// Where.
        place: Place,
    },
    /// Elements of first and second order in one mesh.
    #[error("the cells are partly of first and partly of second order (elements {first} and {second})")]
    MixedOrder {
        /// A first-order element.
        first: u64,
        /// A second-order element.
        second: u64,
    },
    /// A mesh of curves or surfaces that does not lie in the x axis or the xy plane.
    #[error(
        "the cells have dimension {dim} but node {node} lies outside {}: a body in space needs cells of its volume, a mesh of dimension {dim} must be flat",
        if *dim == 1 { "the x axis" } else { "the plane of x and y" }
    )]
    NotFlat {
        /// Dimension of the cells.
        dim: usize,
        /// Number of the node.
        node: u64,
    },
    /// The mesh itself is unsound.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
