//! Common parts of the element families: positions of the dofs, and tables of basis functions.

use crate::cell::CellKind;

/// The entity of the cell that carries a dof.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DofEntity {
    /// Local vertex.
    Vertex(usize),
    /// Local edge of a cell of dimension 2 or 3, and the place along the edge counted from its
    /// first local vertex.
    Edge {
        /// Local edge.
        edge: usize,
        /// Place along the edge.
        index: usize,
    },
    /// Local facet of a cell of dimension 3.
    Facet {
        /// Local facet.
        facet: usize,
        /// Place on the facet.
        index: usize,
    },
    /// Inside the cell; also every dof of a discontinuous or constant element.
    Interior(usize),
}

/// Places of the dofs of a nodal element.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lattice {
    /// The cell.
    pub(super) kind: CellKind,
    /// Steps along an edge.
    pub(super) degree: usize,
    /// For each dof the integer coordinates of its point, in units of `1 / degree`: barycentric (dim + 1 of them) on
    /// simplices, Cartesian (dim of them) on tensor cells and pyramids, barycentric of the triangle and z on wedges.
    pub(super) places: Vec<[u8; 4]>,
    /// Of functions that are no products of their places: those of each dof in a list of simpler ones; else empty.
    pub(super) coefficients: Vec<f64>,
}

/// Basis functions tabulated at points. Arrays that were not requested are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Number of points.
    pub n_points: usize,
    /// Number of local dofs.
    pub n_dofs: usize,
    /// Dimension of the cell.
    pub dim: usize,
    /// `values[point * n_dofs + dof]`.
    pub values: Vec<f64>,
    /// `gradients[(point * n_dofs + dof) * dim + d]`, reference derivatives.
    pub gradients: Vec<f64>,
    /// `hessians[((point * n_dofs + dof) * dim + d) * dim + e]`, reference derivatives.
    pub hessians: Vec<f64>,
}

/// One factor of a basis function with its first and second derivative.
pub(super) type Jet = [f64; 3];

/// Product of the factors `n` with derivatives taken of factor `d` and factor `e`.
pub(super) fn product(factors: &[Jet], d: Option<usize>, e: Option<usize>) -> f64 {
    let order = |i| usize::from(d == Some(i)) + usize::from(e == Some(i));
    factors.iter().enumerate().map(|(i, jet)| jet[order(i)]).product()
}
