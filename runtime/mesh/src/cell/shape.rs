//! What is told of one kind of cell: the row that each file beside this one fills.
//!
//! Positions are local ones of the reference cell. Promises: what other files need to know of a kind stands in its row;
//! they ask [`CellKind`] what it can do and never for its name. Does not know meshes, fields or files.

use super::{CellKind, LocalFacet};

/// The functions that Lagrange elements have on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Basis {
    /// Polynomials of a total degree (`P_k`).
    Simplex,
    /// Products of polynomials in each variable (`Q_k`).
    Tensor,
    /// Products of `P_k` on a triangle and on a line.
    Wedge,
    /// Rational functions: `P_k` on the triangles, `Q_k` on the base.
    Pyramid,
}

/// How polynomials count on a cell: what the letters of the language and the degrees of rules go by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polynomials {
    /// By their total degree: `P_k`.
    Total,
    /// By their degree in each variable: `Q_k`.
    Each,
    /// Both on one cell: `P_k` on its triangles, `Q_k` on its quadrilaterals.
    Both,
}

/// How a cell is divided when a mesh is refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subdivision {
    /// Its longest edge is halved.
    Bisection,
    /// Opposite edges are halved together: whole layers of cells.
    Layers,
}

/// Gmsh's number of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GmshElement {
    /// The number.
    pub(crate) code: i64,
    /// The place in Gmsh's node list of each node of our Lagrange element.
    pub(crate) nodes: &'static [usize],
}

/// The row of one kind.
pub(crate) struct Shape {
    /// What messages call it.
    pub(super) name: &'static str,
    /// Dimension.
    pub(super) dim: usize,
    /// Vertices of the reference cell.
    pub(super) vertices: &'static [[f64; 3]],
    /// The vertices at the ends of the axes, as many as there are dimensions.
    pub(super) axes: &'static [usize],
    /// Pairs of vertices, lower one first.
    pub(super) edges: &'static [[usize; 2]],
    /// Faces of one dimension less.
    pub(super) facets: &'static [LocalFacet],
    /// By facet its edges, in the order of the edges of the facet's kind; empty in one dimension.
    pub(super) facet_edges: &'static [&'static [usize]],
    /// By facet the outward unit normal on the reference cell.
    pub(super) normals: &'static [[f64; 3]],
    /// By facet the factor c of the height c V / A of the cell over it, exact where the map is affine.
    pub(super) heights: &'static [f64],
    /// Volume of the reference cell.
    pub(super) volume: f64,
    /// Barycentre of the reference cell, if that is not the mean of the vertices.
    pub(super) centre: Option<[f64; 3]>,
    /// Integrals of the vertex functions over the reference cell, if they are not all the same.
    pub(super) vertex_weights: Option<&'static [f64]>,
    /// Functions of its Lagrange elements.
    pub(super) basis: Basis,
    /// How polynomials count.
    pub(super) polynomials: Polynomials,
    /// Highest degree of a Lagrange element.
    pub(super) highest_degree: usize,
    /// The vertex functions alone make an affine map.
    pub(super) straight_is_affine: bool,
    /// How it is divided; `None` if there is no way yet.
    pub(super) subdivision: Option<Subdivision>,
    /// The vertex functions at a point; the first entries count.
    pub(super) hats: fn([f64; 3]) -> [f64; 8],
    /// Whether a point lies in the cell, or out of it by at most a margin.
    pub(super) contains: fn(&[f64], f64) -> bool,
    /// The image of a point of the unit cube that is folded onto the cell, and the determinant of that map over the largest.
    pub(super) folded: fn([f64; 3]) -> ([f64; 3], f64),
    /// Gmsh's elements of first and second order.
    pub(super) gmsh: [GmshElement; 2],
    /// Vertex correspondences of two such cells as facets; empty for cells that are nobody's facet.
    pub(super) correspondences: &'static [[u8; 4]],
}

pub(super) const fn facet(kind: CellKind, vertices: &'static [usize]) -> LocalFacet {
    LocalFacet { kind, vertices }
}

/// A point of first and second order has one node.
pub(super) const fn gmsh(first: (i64, &'static [usize]), second: (i64, &'static [usize])) -> [GmshElement; 2] {
    [GmshElement { code: first.0, nodes: first.1 }, GmshElement { code: second.0, nodes: second.1 }]
}

/// The unit points of the axes and the origin.
pub(super) static SIMPLEX: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The unit cube, x fastest.
pub(super) static CUBE: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];

/// Tensor cells list their facets as x = 0, x = 1, y = 0, y = 1, z = 0, z = 1.
pub(super) static CUBE_NORMALS: [[f64; 3]; 6] =
    [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];

/// Barycentric coordinates.
pub(super) fn simplex_hats<const DIM: usize>(x: [f64; 3]) -> [f64; 8] {
    let mut values = [0.0; 8];
    values[0] = 1.0 - x[..DIM].iter().sum::<f64>();
    values[1..=DIM].copy_from_slice(&x[..DIM]);
    values
}

/// Multilinear functions.
pub(super) fn tensor_hats<const DIM: usize>(x: [f64; 3]) -> [f64; 8] {
    let mut values = [0.0; 8];
    for (value, vertex) in values.iter_mut().zip(&CUBE[..1 << DIM]) {
        *value = (0..DIM).map(|d| if vertex[d] > 0.5 { x[d] } else { 1.0 - x[d] }).product();
    }
    values
}

pub(super) fn simplex_contains(r: &[f64], margin: f64) -> bool {
    r.iter().all(|c| *c >= -margin) && r.iter().sum::<f64>() <= 1.0 + margin
}

pub(super) fn tensor_contains(r: &[f64], margin: f64) -> bool {
    r.iter().all(|c| (-margin..=1.0 + margin).contains(c))
}
