//! Reference cells: vertices, local edges, local facets, outward normals, and what each kind can do.
//!
//! Each kind has a file here with its row (`shape.rs`); a new one is a file, a name in [`CellKind`] and a row in the
//! table. Other files ask what a kind can do (is its map affine, how do its polynomials count, is there a way to divide
//! it) and never for a list of kinds. Promises: simplices are the origin and the unit points of the axes; segment,
//! quadrilateral and hexahedron are `[0, 1]^d` with vertices in lexicographic order, x fastest. Local edges run from
//! the lower to the higher local vertex. In two dimensions edge `i` and facet `i` are the same.
//! Does not know any mesh: positions here are local ones, below 12.

mod hexahedron;
mod point;
pub(crate) mod pyramid;
mod quadrilateral;
mod segment;
mod shape;
mod tetrahedron;
mod triangle;
mod wedge;

use shape::Shape;
pub(crate) use shape::{Basis, GmshElement};
pub use shape::{Polynomials, Subdivision};

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
    /// A triangle times `[0, 1]`: vertices (0,0,0), (1,0,0), (0,1,0), then the same at z = 1.
    Wedge,
    /// The unit square, vertices lexicographic, and the apex (0,0,1).
    Pyramid,
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

    /// The parameters of a reference point on the facet, by T (T'T)^-1 of the tangents.
    #[must_use]
    pub fn parameters(&self, point: [f64; 3]) -> [f64; 3] {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let [a, b] = self.tangents;
        let from = std::array::from_fn(|i| point[i] - self.origin[i]);
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let (of_a, of_b) = (dot(a, from), dot(b, from));
        let determinant = aa * bb - ab * ab;
        if determinant > 0.0 {
            return [(bb * of_a - ab * of_b) / determinant, (aa * of_b - ab * of_a) / determinant, 0.0];
        }
        // a line has one tangent, a point none
        if aa > 0.0 { [of_a / aa, 0.0, 0.0] } else { [0.0; 3] }
    }
}

static SHAPES: [&Shape; 8] = [
    &point::SHAPE,
    &segment::SHAPE,
    &triangle::SHAPE,
    &quadrilateral::SHAPE,
    &tetrahedron::SHAPE,
    &hexahedron::SHAPE,
    &wedge::SHAPE,
    &pyramid::SHAPE,
];

impl CellKind {
    /// Every kind, by dimension.
    pub const ALL: [CellKind; 8] = [
        CellKind::Point,
        CellKind::Segment,
        CellKind::Triangle,
        CellKind::Quadrilateral,
        CellKind::Tetrahedron,
        CellKind::Hexahedron,
        CellKind::Wedge,
        CellKind::Pyramid,
    ];

    #[inline]
    fn shape(self) -> &'static Shape {
        SHAPES[self as usize]
    }

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
        self.shape().dim
    }

    /// True if vertices alone make an affine map: cells with straight edges have one Jacobian.
    #[must_use]
    #[inline]
    pub fn straight_is_affine(self) -> bool {
        self.shape().straight_is_affine
    }

    /// How polynomials count on the cell.
    #[must_use]
    #[inline]
    pub fn polynomials(self) -> Polynomials {
        self.shape().polynomials
    }

    /// True for segment, quadrilateral and hexahedron, where rules of lines multiply and nodes stand in lines.
    #[must_use]
    pub fn is_product_of_segments(self) -> bool {
        self == CellKind::Segment || self.basis() == Basis::Tensor
    }

    /// How the cell is divided by a refinement; `None` if there is no way.
    #[must_use]
    #[inline]
    pub fn subdivision(self) -> Option<Subdivision> {
        self.shape().subdivision
    }

    /// Highest degree of a Lagrange element.
    #[must_use]
    #[inline]
    pub fn highest_degree(self) -> usize {
        self.shape().highest_degree
    }

    /// Functions of the Lagrange elements.
    #[inline]
    pub(crate) fn basis(self) -> Basis {
        self.shape().basis
    }

    /// Gmsh's element of an order, 1 or 2.
    pub(crate) fn gmsh(self, order: usize) -> &'static GmshElement {
        &self.shape().gmsh[order - 1]
    }

    /// Degree of the determinant of the map of an order, as [`CellKind::polynomials`] count; with
    /// [`Polynomials::Both`] an upper bound in each variable.
    #[must_use]
    pub fn determinant_degree(self, order: usize) -> usize {
        match self.polynomials() {
            Polynomials::Total => self.dim() * (order - 1),
            Polynomials::Each | Polynomials::Both => self.dim() * order - 1,
        }
    }

    /// Number of vertices.
    #[must_use]
    #[inline]
    pub fn n_vertices(self) -> usize {
        self.vertices().len()
    }

    /// Vertices of the reference cell; unused coordinates are zero.
    #[must_use]
    #[inline]
    pub fn vertices(self) -> &'static [[f64; 3]] {
        self.shape().vertices
    }

    /// The vertex at the end of each axis of the reference cell; vertex 0 is the origin.
    #[must_use]
    pub fn axes(self) -> &'static [usize] {
        self.shape().axes
    }

    /// Local edges as pairs of local vertices, lower one first. A segment is its own edge.
    #[must_use]
    #[inline]
    pub fn edges(self) -> &'static [[usize; 2]] {
        self.shape().edges
    }

    /// Local facets (entities of one dimension less).
    #[must_use]
    #[inline]
    pub fn facets(self) -> &'static [LocalFacet] {
        self.shape().facets
    }

    /// Local edges of the cell that lie on local facet `local`, in the order of the edges of the
    /// facet's own kind; empty for a segment.
    #[must_use]
    pub fn facet_edges(self, local: usize) -> &'static [usize] {
        self.shape().facet_edges.get(local).copied().unwrap_or_default()
    }

    /// Outward unit normal of local facet `local` on the reference cell.
    #[must_use]
    pub fn facet_normal(self, local: usize) -> [f64; 3] {
        self.shape().normals.get(local).copied().unwrap_or_default()
    }

    /// The factor c of the height c V / A of a cell of volume V over its facet of area A: exact where the map is affine.
    #[must_use]
    pub fn height_factor(self, local: usize) -> f64 {
        self.shape().heights[local]
    }

    /// The map from facet parameters to the reference cell (see [`LocalFacet::vertices`]).
    #[must_use]
    pub fn facet_map(self, local: usize) -> FacetMap {
        let facet = self.facets()[local];
        let vertices = self.vertices();
        let origin = vertices[facet.vertices[0]];
        let mut tangents = [[0.0; 3]; 2];
        for (tangent, axis) in tangents.iter_mut().zip(facet.kind.axes()) {
            let end = vertices[facet.vertices[*axis]];
            *tangent = std::array::from_fn(|i| end[i] - origin[i]);
        }
        FacetMap { origin, tangents }
    }

    /// A point of local facet `local` where tables of the cell have its values and derivatives as seen from that facet:
    /// the point itself, but at the apex of a pyramid, where each facet has derivatives of its own, a neighbour of it on
    /// the facet by one rounding.
    #[must_use]
    pub fn facet_point(self, local: usize, point: [f64; 3]) -> [f64; 3] {
        let below = 0.5 * f64::EPSILON;
        if self.basis() != Basis::Pyramid || 1.0 - point[2] >= below {
            return point;
        }
        let vertices = self.vertices();
        let ends = self.facets()[local].vertices;
        let middle = |d: usize| 0.5 * (vertices[ends[0]][d] + vertices[ends[1]][d]);
        [below * middle(0), below * middle(1), 1.0 - below]
    }

    /// Volume of the reference cell (1 for a point).
    #[must_use]
    pub fn reference_volume(self) -> f64 {
        self.shape().volume
    }

    /// Integral of each vertex function over the reference cell.
    #[must_use]
    pub fn vertex_weights(self) -> Vec<f64> {
        let n = self.n_vertices();
        self.shape().vertex_weights.map_or_else(|| vec![self.reference_volume() / n as f64; n], <[f64]>::to_vec)
    }

    /// Barycentre of the reference cell.
    #[must_use]
    pub fn reference_centre(self) -> [f64; 3] {
        if let Some(centre) = self.shape().centre {
            return centre;
        }
        let vertices = self.vertices();
        let scale = 1.0 / vertices.len() as f64;
        std::array::from_fn(|i| vertices.iter().map(|v| v[i]).sum::<f64>() * scale)
    }

    /// Values of the vertex hat functions (multilinear, barycentric or products of both; rational on a pyramid) at a
    /// reference point; the first `n_vertices` entries are used.
    #[must_use]
    #[inline]
    pub fn hat_values(self, x: [f64; 3]) -> [f64; 8] {
        (self.shape().hats)(x)
    }

    /// True if a point, by as many coordinates as the cell has dimensions, lies in the reference cell, or out of it by at
    /// most `margin`.
    #[must_use]
    pub fn contains(self, point: &[f64], margin: f64) -> bool {
        (self.shape().contains)(point, margin)
    }

    /// The image of a point of the unit cube that is folded onto the reference cell, and the part of the volume there in
    /// that of the cube, up to a factor.
    #[must_use]
    pub fn folded(self, point: [f64; 3]) -> ([f64; 3], f64) {
        (self.shape().folded)(point)
    }
}

impl std::fmt::Display for CellKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.shape().name)
    }
}

/// Vertex correspondences of a facet kind: entry `key`, place `i` is the vertex of the facet there
/// that coincides with vertex `i` of the facet here; empty for cells that are nobody's facet.
#[must_use]
pub fn facet_correspondences(kind: CellKind) -> &'static [[u8; 4]] {
    kind.shape().correspondences
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
                    assert_eq!(map.parameters(kind.vertices()[*vertex]), *parameters, "{kind} facet {local}");
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
