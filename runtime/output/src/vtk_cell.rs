//! The cells that VTK knows and we write: numbers of the format and the order of nodes.
//!
//! Promises: [`vtk_order`] turns the local order of our Lagrange elements into the order of VTK.
//! Does not know elements: the local order is the one stated at [`vtk_order`].

/// A cell of the VTK file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum VtkCell {
    /// One node.
    Vertex,
    /// Two nodes.
    Line,
    /// Three nodes: ends, middle.
    QuadraticLine,
    /// Three nodes.
    Triangle,
    /// Six nodes: vertices, then the middles of the edges 01, 12, 20.
    QuadraticTriangle,
    /// Four nodes, around the cell.
    Quad,
    /// Nine nodes: vertices around the cell, middles of the edges 01, 12, 23, 30, centre.
    BiquadraticQuad,
    /// Four nodes.
    Tetra,
    /// Ten nodes: vertices, then the middles of the edges 01, 12, 20, 03, 13, 23.
    QuadraticTetra,
    /// Eight nodes: around z = 0, then around z = 1.
    Hexahedron,
    /// Twenty-seven nodes: vertices as [`VtkCell::Hexahedron`], middles of the edges around
    /// z = 0, around z = 1, of those along z, centres of the facets x = 0, x = 1, y = 0, y = 1,
    /// z = 0, z = 1, centre.
    TriquadraticHexahedron,
    /// Six nodes: a triangle that seen from the other one runs clockwise, then that one.
    Wedge,
    /// Eighteen nodes: vertices as [`VtkCell::Wedge`], middles of the edges of both triangles and between them, centres of
    /// the quadrilaterals.
    QuadraticWedge,
    /// Five nodes: around the base, apex.
    Pyramid,
    /// Thirteen nodes: vertices as [`VtkCell::Pyramid`], middles of the edges around the base and up to the apex. The
    /// centre of the base has no place in this cell.
    QuadraticPyramid,
}

impl VtkCell {
    /// Every cell.
    pub const ALL: [VtkCell; 15] = [
        VtkCell::Vertex,
        VtkCell::Line,
        VtkCell::QuadraticLine,
        VtkCell::Triangle,
        VtkCell::QuadraticTriangle,
        VtkCell::Quad,
        VtkCell::BiquadraticQuad,
        VtkCell::Tetra,
        VtkCell::QuadraticTetra,
        VtkCell::Hexahedron,
        VtkCell::TriquadraticHexahedron,
        VtkCell::Wedge,
        VtkCell::QuadraticWedge,
        VtkCell::Pyramid,
        VtkCell::QuadraticPyramid,
    ];

    /// Number of nodes.
    #[must_use]
    pub fn n_nodes(self) -> usize {
        vtk_order(self).len()
    }

    /// Number of nodes of our element, some of which may have no place in the cell.
    #[must_use]
    pub fn n_local_nodes(self) -> usize {
        vtk_order(self).iter().max().map_or(0, |last| last + 1)
    }

    /// The number of the cell type in the file format (`vtkCellType.h`).
    #[must_use]
    pub fn type_number(self) -> u8 {
        match self {
            VtkCell::Vertex => 1,
            VtkCell::Line => 3,
            VtkCell::Triangle => 5,
            VtkCell::Quad => 9,
            VtkCell::Tetra => 10,
            VtkCell::Hexahedron => 12,
            VtkCell::Wedge => 13,
            VtkCell::Pyramid => 14,
            VtkCell::QuadraticLine => 21,
            VtkCell::QuadraticTriangle => 22,
            VtkCell::QuadraticTetra => 24,
            VtkCell::QuadraticPyramid => 27,
            VtkCell::BiquadraticQuad => 28,
            VtkCell::TriquadraticHexahedron => 29,
            VtkCell::QuadraticWedge => 32,
        }
    }
}

/// The local order of our elements in the order of VTK: node `i` of the VTK cell is local node
/// `vtk_order(cell)[i]`.
///
/// Local order. Quadrilateral and hexahedron: lexicographic, x fastest, node
/// `i + (k + 1) j + (k + 1)^2 l` at `(i, j, l) / k` for degree `k`. Line, triangle and
/// tetrahedron of degree 2: vertices, then the middles of the edges in the order 01, 12, 02, 03,
/// 13, 23, which is VTK's own. Wedge: the nodes of a triangle at each z in turn. Pyramid: lexicographic layers. The nodes
/// that are not listed have no place in the VTK cell.
#[must_use]
pub fn vtk_order(cell: VtkCell) -> &'static [usize] {
    match cell {
        VtkCell::Vertex => &[0],
        VtkCell::Line => &[0, 1],
        VtkCell::QuadraticLine | VtkCell::Triangle => &[0, 1, 2],
        VtkCell::QuadraticTriangle => &[0, 1, 2, 3, 4, 5],
        VtkCell::Tetra => &[0, 1, 2, 3],
        VtkCell::QuadraticTetra => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
        VtkCell::Quad => &[0, 1, 3, 2],
        VtkCell::BiquadraticQuad => &[0, 2, 8, 6, 1, 5, 7, 3, 4],
        VtkCell::Hexahedron => &[0, 1, 3, 2, 4, 5, 7, 6],
        VtkCell::TriquadraticHexahedron => &[
            0, 2, 8, 6, 18, 20, 26, 24, // vertices
            1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15, // edges
            12, 14, 10, 16, 4, 22, 13, // facets, centre
        ],
        VtkCell::Wedge => &[0, 2, 1, 3, 5, 4],
        VtkCell::QuadraticWedge => &[
            0, 2, 1, 12, 14, 13, // vertices
            5, 4, 3, 17, 16, 15, 6, 8, 7, // edges of the triangles, edges between them
            11, 10, 9, // quadrilaterals
        ],
        VtkCell::Pyramid => &[0, 1, 3, 2, 4],
        VtkCell::QuadraticPyramid => &[0, 2, 8, 6, 13, 1, 5, 7, 3, 9, 10, 12, 11],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the parametric coordinates of the VTK nodes, as VTK 9.7 prints them
    /// (`GetParametricCoords` of vtkBiQuadraticQuad and vtkTriQuadraticHexahedron; the first 4
    /// and 8 are those of vtkQuad and vtkHexahedron).
    const QUAD: [[usize; 3]; 9] =
        [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0, 0], [2, 1, 0], [1, 2, 0], [0, 1, 0], [1, 1, 0]];
    const HEXAHEDRON: [[usize; 3]; 27] = [
        [0, 0, 0],
        [2, 0, 0],
        [2, 2, 0],
        [0, 2, 0],
        [0, 0, 2],
        [2, 0, 2],
        [2, 2, 2],
        [0, 2, 2],
        [1, 0, 0],
        [2, 1, 0],
        [1, 2, 0],
        [0, 1, 0],
        [1, 0, 2],
        [2, 1, 2],
        [1, 2, 2],
        [0, 1, 2],
        [0, 0, 1],
        [2, 0, 1],
        [2, 2, 1],
        [0, 2, 1],
        [0, 1, 1],
        [2, 1, 1],
        [1, 0, 1],
        [1, 2, 1],
        [1, 1, 0],
        [1, 1, 2],
        [1, 1, 1],
    ];

    fn check_lexicographic(cell: VtkCell, degree: usize, twice_coordinates: &[[usize; 3]]) {
        let n = degree + 1;
        let local = twice_coordinates.iter().map(|place| {
            let [i, j, l] = place.map(|twice| twice * degree / 2);
            i + n * j + n * n * l
        });
        assert!(local.eq(vtk_order(cell).iter().copied()), "{cell:?}");
    }

    #[test]
    fn tensor_cells_have_their_nodes_where_vtk_has_them() {
        check_lexicographic(VtkCell::Quad, 1, &QUAD[..4]);
        check_lexicographic(VtkCell::BiquadraticQuad, 2, &QUAD);
        check_lexicographic(VtkCell::Hexahedron, 1, &HEXAHEDRON[..8]);
        check_lexicographic(VtkCell::TriquadraticHexahedron, 2, &HEXAHEDRON);
    }

    /// The same of vtkBiQuadraticQuadraticWedge and vtkQuadraticPyramid (the first 6 and 5 are those of vtkWedge and
    /// vtkPyramid). Seen from the triangle 345 the triangle 012 of a wedge runs clockwise: its normal by the right hand
    /// points out of the cell.
    const WEDGE: [[usize; 3]; 18] = [
        [0, 0, 0],
        [0, 2, 0],
        [2, 0, 0],
        [0, 0, 2],
        [0, 2, 2],
        [2, 0, 2],
        [0, 1, 0],
        [1, 1, 0],
        [1, 0, 0],
        [0, 1, 2],
        [1, 1, 2],
        [1, 0, 2],
        [0, 0, 1],
        [0, 2, 1],
        [2, 0, 1],
        [0, 1, 1],
        [1, 1, 1],
        [1, 0, 1],
    ];
    const PYRAMID: [[usize; 3]; 13] = [
        [0, 0, 0],
        [2, 0, 0],
        [2, 2, 0],
        [0, 2, 0],
        [0, 0, 2],
        [1, 0, 0],
        [2, 1, 0],
        [1, 2, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
        [0, 1, 1],
    ];

    #[test]
    fn wedges_and_pyramids_have_their_nodes_where_vtk_has_them() {
        use wfl_mesh::{
            element::{Element, Family},
            mesh::CellKind,
        };
        let cells: [(VtkCell, CellKind, usize, &[[usize; 3]]); 4] = [
            (VtkCell::Wedge, CellKind::Wedge, 1, &WEDGE[..6]),
            (VtkCell::QuadraticWedge, CellKind::Wedge, 2, &WEDGE),
            (VtkCell::Pyramid, CellKind::Pyramid, 1, &PYRAMID[..5]),
            (VtkCell::QuadraticPyramid, CellKind::Pyramid, 2, &PYRAMID),
        ];
        for (cell, kind, degree, twice) in cells {
            let element = Element::lagrange(kind, degree, Family::Continuous).expect("an element");
            assert_eq!(cell.n_nodes(), twice.len());
            for (local, place) in vtk_order(cell).iter().zip(twice) {
                assert_eq!(element.points()[*local].map(|x| 2.0 * x), place.map(|x| x as f64), "{cell:?}");
            }
        }
    }

    #[test]
    fn every_order_is_a_permutation_and_every_type_number_differs() {
        let mut numbers = Vec::new();
        for cell in VtkCell::ALL {
            let mut order = vtk_order(cell).to_vec();
            order.sort_unstable();
            // the centre of the base of a pyramid has no place
            let missing = if cell == VtkCell::QuadraticPyramid { Some(4) } else { None };
            assert!(order.into_iter().eq((0..cell.n_local_nodes()).filter(|k| Some(*k) != missing)), "{cell:?}");
            numbers.push(cell.type_number());
        }
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), VtkCell::ALL.len());
    }
}
