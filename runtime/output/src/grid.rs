//! A grid from the caller: pieces with nodes, cells and arrays.
//!
//! Promises: cells lie flat in memory, in the order of VTK. Contradictions are not checked while a grid is built, but
//! before the first byte is written, with their place.

use super::{VtkCell, vtk_order};

/// A part of a grid with its own nodes, such as one body, or an interface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// Coordinates of the nodes, unused ones zero. Length.
    pub points: Vec<[f64; 3]>,
    /// Cells on these nodes.
    pub cells: Cells,
    /// Arrays with one entry a node.
    pub point_data: Vec<Array>,
    /// Arrays with one entry a cell.
    pub cell_data: Vec<Array>,
}

/// Cells one after the other, each with its own kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cells {
    pub(super) kinds: Vec<VtkCell>,
    /// Node numbers of all cells, in the order of VTK.
    pub(super) nodes: Vec<u32>,
    /// End of each cell in `nodes`.
    pub(super) ends: Vec<usize>,
}

impl Cells {
    /// No cells, with room for `n_cells` cells of `n_nodes` nodes together.
    #[must_use]
    pub fn with_capacity(n_cells: usize, n_nodes: usize) -> Self {
        Cells {
            kinds: Vec::with_capacity(n_cells),
            nodes: Vec::with_capacity(n_nodes),
            ends: Vec::with_capacity(n_cells),
        }
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.kinds.len()
    }

    /// True if there are no cells.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// The first node of a cell.
    #[must_use]
    pub fn first_node(&self, cell: usize) -> Option<u32> {
        let start = if cell == 0 { 0 } else { *self.ends.get(cell - 1)? };
        self.nodes.get(start).copied()
    }

    /// Adds a cell with its nodes in the order of VTK.
    pub fn push(&mut self, kind: VtkCell, nodes: &[u32]) {
        self.push_nodes(kind, nodes.iter().copied());
    }

    /// Adds a cell with its nodes in the local order of our elements, see [`vtk_order`]. A list
    /// of the wrong length is kept as it is and refused when the grid is written.
    pub fn push_local(&mut self, kind: VtkCell, nodes: &[u32]) {
        if nodes.len() == kind.n_local_nodes() {
            self.push_nodes(kind, vtk_order(kind).iter().map(|&local| nodes[local]));
        } else {
            self.push(kind, nodes);
        }
    }

    fn push_nodes(&mut self, kind: VtkCell, nodes: impl Iterator<Item = u32>) {
        self.kinds.push(kind);
        self.nodes.extend(nodes);
        self.ends.push(self.nodes.len());
    }

    /// The cells with their nodes in the order of VTK.
    pub fn iter(&self) -> impl Iterator<Item = (VtkCell, &[u32])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let ranges = starts.zip(&self.ends);
        let nodes = ranges.map(|(start, &end)| &self.nodes[start..end]);
        self.kinds.iter().copied().zip(nodes)
    }
}

impl FromIterator<(VtkCell, Vec<u32>)> for Cells {
    /// Cells with their nodes in the order of VTK.
    fn from_iter<I: IntoIterator<Item = (VtkCell, Vec<u32>)>>(cells: I) -> Self {
        let mut all = Cells::default();
        for (kind, nodes) in cells {
            all.push(kind, &nodes);
        }
        all
    }
}

/// A named array, entry by entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Name shown by the viewer; any text.
    pub name: String,
    /// Numbers of one entry, at least 1. Two are written as three, the third zero; all other
    /// counts are written as they are. Viewers show 1 as scalar, 3 as vector, 9 as matrix.
    pub components: usize,
    /// `components` numbers for each entry; matrices row-major. Unit of the quantity.
    pub values: Vec<f64>,
}

impl Array {
    /// One number an entry.
    #[must_use]
    pub fn scalar(name: impl Into<String>, values: Vec<f64>) -> Self {
        Array { name: name.into(), components: 1, values }
    }

    /// Matrices of `shape` rows and columns, at most 3 by 3, row-major in `values`; put into the
    /// upper corner of 3 by 3 matrices, the rest zero. A larger shape is kept as it is.
    #[must_use]
    pub fn matrix(name: impl Into<String>, shape: [usize; 2], values: Vec<f64>) -> Self {
        let [rows, columns] = shape;
        let name = name.into();
        let fits = (1..=3).contains(&rows) && (1..=3).contains(&columns);
        if !fits || shape == [3, 3] || !values.len().is_multiple_of(rows * columns) {
            return Array { name, components: rows * columns, values };
        }
        let mut padded = vec![0.0; values.len() / (rows * columns) * 9];
        let entries = values.chunks_exact(rows * columns);
        for (full, entry) in padded.chunks_exact_mut(9).zip(entries) {
            for (full_row, row) in full.chunks_exact_mut(3).zip(entry.chunks_exact(columns)) {
                full_row[..columns].copy_from_slice(row);
            }
        }
        Array { name, components: 9, values: padded }
    }
}

/// What a grid can contradict itself in. Pieces, cells and nodes are counted from 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VtuError {
    /// There is nothing to write.
    #[error("the grid has no piece")]
    NoPiece,
    /// A cell has the wrong number of nodes.
    #[error("cell {cell} of piece {piece} is a {kind:?} with {found} nodes, it has {}", kind.n_nodes())]
    CellNodes {
        /// The piece.
        piece: usize,
        /// The cell in the piece.
        cell: usize,
        /// Its kind.
        kind: VtkCell,
        /// Number of nodes given.
        found: usize,
    },
    /// A cell names a node that the piece does not have.
    #[error("cell {cell} of piece {piece} names node {node}, the piece has {n_points} nodes")]
    NoSuchNode {
        /// The piece.
        piece: usize,
        /// The cell in the piece.
        cell: usize,
        /// The node.
        node: u32,
        /// Number of nodes of the piece.
        n_points: usize,
    },
    /// The length of an array is not entries times components.
    #[error("array `{name}` of piece {piece} has {found} values, {expected} are needed")]
    ArrayLength {
        /// The piece.
        piece: usize,
        /// The array.
        name: String,
        /// Entries times components.
        expected: usize,
        /// Number of values given.
        found: usize,
    },
    /// An array has no components, or not the same number in all pieces.
    #[error("array `{name}` has {found} components in piece {piece}, {expected} are needed")]
    ArrayComponents {
        /// The piece.
        piece: usize,
        /// The array.
        name: String,
        /// Components of the first piece that has the array, or 1.
        expected: usize,
        /// Components given.
        found: usize,
    },
    /// A piece has two arrays of one name, both on nodes or both on cells.
    #[error("piece {piece} has two arrays named `{name}`")]
    DuplicateArray {
        /// The piece.
        piece: usize,
        /// The name.
        name: String,
    },
    /// The parts of a grid that ranks hold have not the same number of pieces.
    #[error("part {part} of the grid has {found} pieces, the first part has {expected}")]
    PartPieces {
        /// The part, counted from 0.
        part: usize,
        /// Pieces of the first part.
        expected: usize,
        /// Pieces of this part.
        found: usize,
    },
    /// The parts of a grid that ranks hold have not the same arrays in the same order.
    #[error("array `{name}` is in one of the first part and part {part} of the grid only, or is another one there")]
    PartArrays {
        /// The part, counted from 0.
        part: usize,
        /// The first array that differs.
        name: String,
    },
}

/// Every cell has the nodes that its kind needs, and they exist.
pub(super) fn check_cells(idx: usize, piece: &Piece) -> Result<(), VtuError> {
    let n_points = piece.points.len();
    for (cell, (kind, nodes)) in piece.cells.iter().enumerate() {
        if nodes.len() != kind.n_nodes() {
            return Err(VtuError::CellNodes { piece: idx, cell, kind, found: nodes.len() });
        }
        if let Some(&node) = nodes.iter().find(|&&node| node as usize >= n_points) {
            return Err(VtuError::NoSuchNode { piece: idx, cell, node, n_points });
        }
    }
    Ok(())
}
