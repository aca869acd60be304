//! Reference cells: vertices, local edges, local facets, outward normals.
//!
//! Promises: simplices are the origin and the unit points of the axes; segment, quadrilateral and
//! hexahedron are `[0, 1]^d` with vertices in lexicographic order, x fastest. Local edges run from
//! the lower to the higher local vertex. In two dimensions edge `i` and facet `i` are the same.
//! Does not know any mesh: positions here are local ones, below 12.

use std::f64::consts::FRAC_1_SQRT_2;

/// `1 / sqrt(3)`, the component of the normal of the oblique facet of a tetrahedron.
const FRAC_1_SQRT_3: f64 = 0.577_350_269_189_625_8;

/// The shape of a cell or of a facet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellKind {
    /// One vertex; the facet of a segment.
    Point,
    /// `[0, 1]`.
    Segment,
    /// Vertices (0,0), (1,0), (0,1).
    Triangle,
    /// `[0, 1]^2`, vertices lexicographic: (0,0), (1,0), (0,1), (1,1).
    Quadrilateral,
    /// Vertices (0,0,0), (1,0,0), (0,1,0), (0,0,1).
    Tetrahedron,
    /// `[0, 1]^3`, vertices lexicographic, x fastest.
    Hexahedron,
}

/// A facet of a reference cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LocalFacet {
    /// Shape of the facet.
    pub kind: CellKind,
    /// Local vertices of the cell, in the vertex order of `kind`: a triangle (a, b, c) is
    /// `a + s (b - a) + r (c - a)`, a quadrilateral is lexicographic, its parameters run along
    /// 0 -> 1 and 0 -> 2.
    pub vertices: &'static [usize],
}

/// The affine map from the parameters of a local facet to the reference cell:
/// `origin + s tangents[0] + r tangents[1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetMap {
    /// Image of the parameter origin.
    pub origin: [f64; 3],
    /// Derivatives with respect to the parameters; unused ones are zero.
    pub tangents: [[f64; 3]; 2],
}

impl FacetMap {
    /// The reference point of the cell at the facet parameters `parameters` (first two used).
    #[must_use]
    #[inline]
    pub fn apply(&self, parameters: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| {
            self.origin[i] + parameters[0] * self.tangents[0][i] + parameters[1] * self.tangents[1][i]
        })
    }
}

const CUBE: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];
const SIMPLEX: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [0, 2]];
const QUADRILATERAL_EDGES: [[usize; 2]; 4] = [[0, 2], [1, 3], [0, 1], [2, 3]];
const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
const HEXAHEDRON_EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

const fn facet(kind: CellKind, vertices: &'static [usize]) -> LocalFacet {
    LocalFacet { kind, vertices }
}

const SEGMENT_FACETS: [LocalFacet; 2] = [facet(CellKind::Point, &[0]), facet(CellKind::Point, &[1])];
const TRIANGLE_FACETS: [LocalFacet; 3] =
    [facet(CellKind::Segment, &[0, 1]), facet(CellKind::Segment, &[1, 2]), facet(CellKind::Segment, &[0, 2])];
const QUADRILATERAL_FACETS: [LocalFacet; 4] = [
    facet(CellKind::Segment, &[0, 2]),
    facet(CellKind::Segment, &[1, 3]),
    facet(CellKind::Segment, &[0, 1]),
    facet(CellKind::Segment, &[2, 3]),
];
const TETRAHEDRON_FACETS: [LocalFacet; 4] = [
    facet(CellKind::Triangle, &[0, 1, 2]),
    facet(CellKind::Triangle, &[0, 1, 3]),
    facet(CellKind::Triangle, &[0, 2, 3]),
    facet(CellKind::Triangle, &[1, 2, 3]),
];
const HEXAHEDRON_FACETS: [LocalFacet; 6] = [
    facet(CellKind::Quadrilateral, &[0, 2, 4, 6]),
    facet(CellKind::Quadrilateral, &[1, 3, 5, 7]),
    facet(CellKind::Quadrilateral, &[0, 1, 4, 5]),
    facet(CellKind::Quadrilateral, &[2, 3, 6, 7]),
    facet(CellKind::Quadrilateral, &[0, 1, 2, 3]),
    facet(CellKind::Quadrilateral, &[4, 5, 6, 7]),
];

/// Edges of the cell on each facet, in the order of the edges of the facet's kind.
const TETRAHEDRON_FACET_EDGES: [[usize; 3]; 4] = [[0, 1, 2], [0, 4, 3], [2, 5, 3], [1, 5, 4]];
const HEXAHEDRON_FACET_EDGES: [[usize; 4]; 6] =
    [[8, 10, 4, 6], [9, 11, 5, 7], [8, 9, 0, 2], [10, 11, 1, 3], [4, 5, 0, 1], [6, 7, 2, 3]];
const SINGLE: [[usize; 1]; 4] = [[0], [1], [2], [3]];

const TRIANGLE_NORMALS: [[f64; 3]; 3] = [[0.0, -1.0, 0.0], [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0], [-1.0, 0.0, 0.0]];
const TETRAHEDRON_NORMALS: [[f64; 3]; 4] =
    [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [FRAC_1_SQRT_3, FRAC_1_SQRT_3, FRAC_1_SQRT_3]];
/// Tensor cells list their facets as x = 0, x = 1, y = 0, y = 1, z = 0, z = 1.
const CUBE_NORMALS: [[f64; 3]; 6] =
    [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];

impl CellKind {
    /// Every kind, by dimension.
    pub const ALL: [CellKind; 6] = [
        CellKind::Point,
        CellKind::Segment,
        CellKind::Triangle,
        CellKind::Quadrilateral,
        CellKind::Tetrahedron,
        CellKind::Hexahedron,
    ];

    /// Position in [`CellKind::ALL`], for tables with one entry a kind.
    #[must_use]
    #[inline]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Dimension of the cell, 0 to 3.
    #[must_use]
    #[inline]
    pub fn dim(self) -> usize {
        match self {
            CellKind::Point => 0,
            CellKind::Segment => 1,
            CellKind::Triangle | CellKind::Quadrilateral => 2,
            CellKind::Tetrahedron | CellKind::Hexahedron => 3,
        }
    }

    /// True for point, segment, triangle and tetrahedron: their Lagrange spaces are `P_k`.
    #[must_use]
    #[inline]
    pub fn is_simplex(self) -> bool {
        !matches!(self, CellKind::Quadrilateral | CellKind::Hexahedron)
    }

    /// Number of vertices.
    #[must_use]
    #[inline]
    pub fn n_vertices(self) -> usize {
        self.vertices().len()
    }

    /// Vertices of the reference cell; unused coordinates are zero.
    #[must_use]
    pub fn vertices(self) -> &'static [[f64; 3]] {
        match self {
            CellKind::Point => &SIMPLEX[..1],
            CellKind::Segment => &SIMPLEX[..2],
            CellKind::Triangle => &SIMPLEX[..3],
            CellKind::Tetrahedron => &SIMPLEX,
            CellKind::Quadrilateral => &CUBE[..4],
            CellKind::Hexahedron => &CUBE,
        }
    }

    /// Local edges as pairs of local vertices, lower one first. A segment is its own edge.
    #[must_use]
    pub fn edges(self) -> &'static [[usize; 2]] {
        match self {
            CellKind::Point => &[],
            CellKind::Segment => &TRIANGLE_EDGES[..1],
            CellKind::Triangle => &TRIANGLE_EDGES,
            CellKind::Quadrilateral => &QUADRILATERAL_EDGES,
            CellKind::Tetrahedron => &TETRAHEDRON_EDGES,
            CellKind::Hexahedron => &HEXAHEDRON_EDGES,
        }
    }

    /// Local facets (entities of one dimension less).
    #[must_use]
    #[inline]
    pub fn facets(self) -> &'static [LocalFacet] {
        match self {
            CellKind::Point => &[],
            CellKind::Segment => &SEGMENT_FACETS,
            CellKind::Triangle => &TRIANGLE_FACETS,
            CellKind::Quadrilateral => &QUADRILATERAL_FACETS,
            CellKind::Tetrahedron => &TETRAHEDRON_FACETS,
            CellKind::Hexahedron => &HEXAHEDRON_FACETS,
        }
    }

    /// Local edges of the cell that lie on local facet `local`, in the order of the edges of the
    /// facet's own kind; empty for a segment.
    #[must_use]
    pub fn facet_edges(self, local: usize) -> &'static [usize] {
        match self {
            CellKind::Point | CellKind::Segment => &[],
            CellKind::Triangle | CellKind::Quadrilateral => &SINGLE[local],
            CellKind::Tetrahedron => &TETRAHEDRON_FACET_EDGES[local],
            CellKind::Hexahedron => &HEXAHEDRON_FACET_EDGES[local],
        }
    }

    /// Outward unit normal of local facet `local` on the reference cell.
    #[must_use]
    pub fn facet_normal(self, local: usize) -> [f64; 3] {
        match self {
            CellKind::Point => [0.0; 3],
            CellKind::Triangle => TRIANGLE_NORMALS[local],
            CellKind::Tetrahedron => TETRAHEDRON_NORMALS[local],
            CellKind::Segment | CellKind::Quadrilateral | CellKind::Hexahedron => CUBE_NORMALS[local],
        }
    }

    /// The map from facet parameters to the reference cell (see [`LocalFacet::vertices`]).
    #[must_use]
    pub fn facet_map(self, local: usize) -> FacetMap {
        let facet = self.facets()[local];
        let vertices = self.vertices();
        let origin = vertices[facet.vertices[0]];
        let mut tangents = [[0.0; 3]; 2];
        for (direction, tangent) in tangents.iter_mut().take(facet.kind.dim()).enumerate() {
            let end = vertices[facet.vertices[direction + 1]];
            *tangent = std::array::from_fn(|i| end[i] - origin[i]);
        }
        FacetMap { origin, tangents }
    }

    /// Volume of the reference cell (1 for a point).
    #[must_use]
    pub fn reference_volume(self) -> f64 {
        match self {
            CellKind::Triangle => 0.5,
            CellKind::Tetrahedron => 1.0 / 6.0,
            _ => 1.0,
        }
    }

    /// Barycentre of the reference cell.
    #[must_use]
    pub fn reference_centre(self) -> [f64; 3] {
        let vertices = self.vertices();
        let scale = 1.0 / vertices.len() as f64;
        std::array::from_fn(|i| vertices.iter().map(|v| v[i]).sum::<f64>() * scale)
    }

    /// Values of the vertex hat functions (multilinear or barycentric) at a reference point; the
    /// first `n_vertices` entries are used.
    #[must_use]
    pub fn hat_values(self, x: [f64; 3]) -> [f64; 8] {
        let mut values = [0.0; 8];
        if self.is_simplex() {
            values[0] = 1.0 - x[..self.dim()].iter().sum::<f64>();
            values[1..=self.dim()].copy_from_slice(&x[..self.dim()]);
            return values;
        }
        for (value, vertex) in values.iter_mut().zip(self.vertices()) {
            *value = (0..self.dim()).map(|d| if vertex[d] > 0.5 { x[d] } else { 1.0 - x[d] }).product();
        }
        values
    }
}

impl std::fmt::Display for CellKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            CellKind::Point => "point",
            CellKind::Segment => "segment",
            CellKind::Triangle => "triangle",
            CellKind::Quadrilateral => "quadrilateral",
            CellKind::Tetrahedron => "tetrahedron",
            CellKind::Hexahedron => "hexahedron",
        })
    }
}

const POINT_SYMMETRIES: [[u8; 4]; 1] = [[0, 0, 0, 0]];
const SEGMENT_SYMMETRIES: [[u8; 4]; 2] = [[0, 1, 0, 0], [1, 0, 0, 0]];
const TRIANGLE_SYMMETRIES: [[u8; 4]; 6] =
    [[0, 1, 2, 0], [0, 2, 1, 0], [1, 0, 2, 0], [1, 2, 0, 0], [2, 0, 1, 0], [2, 1, 0, 0]];
/// The eight symmetries of the square with lexicographic vertices.
const QUADRILATERAL_SYMMETRIES: [[u8; 4]; 8] =
    [[0, 1, 2, 3], [0, 2, 1, 3], [1, 0, 3, 2], [1, 3, 0, 2], [2, 0, 3, 1], [2, 3, 0, 1], [3, 1, 2, 0], [3, 2, 1, 0]];

/// Vertex correspondences of a facet kind: entry `key`, place `i` is the vertex of the facet there
/// that coincides with vertex `i` of the facet here; empty for cells that are nobody's facet.
#[must_use]
pub fn facet_correspondences(kind: CellKind) -> &'static [[u8; 4]] {
    match kind {
        CellKind::Point => &POINT_SYMMETRIES,
        CellKind::Segment => &SEGMENT_SYMMETRIES,
        CellKind::Triangle => &TRIANGLE_SYMMETRIES,
        CellKind::Quadrilateral => &QUADRILATERAL_SYMMETRIES,
        CellKind::Tetrahedron | CellKind::Hexahedron => &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facet_edges_agree_with_the_edges_of_the_facet_kind() {
        for kind in CellKind::ALL {
            for (local, facet) in kind.facets().iter().enumerate() {
                let edges = kind.facet_edges(local);
                if kind.dim() < 2 {
                    continue;
                }
                assert_eq!(edges.len(), facet.kind.edges().len());
                for (edge, ends) in edges.iter().zip(facet.kind.edges()) {
                    let mut expected = ends.map(|v| facet.vertices[v]);
                    expected.sort_unstable();
                    assert_eq!(kind.edges()[*edge], expected, "{kind} facet {local}");
                }
            }
        }
    }

    #[test]
    fn normals_are_unit_orthogonal_to_the_facet_and_point_out() {
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        for kind in CellKind::ALL {
            for local in 0..kind.facets().len() {
                let (normal, map) = (kind.facet_normal(local), kind.facet_map(local));
                assert!((dot(normal, normal) - 1.0).abs() < 1e-15);
                for tangent in map.tangents {
                    assert!(dot(normal, tangent).abs() < 1e-15);
                }
                let centre = kind.reference_centre();
                let inward = std::array::from_fn(|i| centre[i] - map.origin[i]);
                assert!(dot(normal, inward) < -1e-3, "{kind} facet {local}");
            }
        }
    }

    #[test]
    fn the_facet_map_meets_every_facet_vertex() {
        for kind in CellKind::ALL {
            for (local, facet) in kind.facets().iter().enumerate() {
                let map = kind.facet_map(local);
                for (vertex, parameters) in facet.vertices.iter().zip(facet.kind.vertices()) {
                    assert_eq!(map.apply(*parameters), kind.vertices()[*vertex]);
                }
            }
        }
    }

    #[test]
    fn hat_functions_are_one_at_their_vertex() {
        for kind in CellKind::ALL {
            for (i, vertex) in kind.vertices().iter().enumerate() {
                let values = kind.hat_values(*vertex);
                for (j, value) in values.iter().enumerate().take(kind.n_vertices()) {
                    assert_eq!(*value, if i == j { 1.0 } else { 0.0 });
                }
            }
        }
    }
}
