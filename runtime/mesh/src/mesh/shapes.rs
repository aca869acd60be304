//! How good the cells of a mesh are: angles, lengths of edges, and how much the jacobian varies inside a cell.
//!
//! Promises: numbers without a unit that do not change when a mesh is moved, turned or scaled. Angles and lengths are those
//! of the corners, the jacobian is that of the geometry of the mesh.

use super::{Mesh, index::CellId};
use crate::{
    cell::CellKind,
    quadrature,
    vector::{cross, determinant, distance, dot, norm},
};

/// How good a cell is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellShape {
    /// Smallest and largest angle in degrees: between edges in the plane, between faces in space. NaN of a segment.
    pub angles: [f64; 2],
    /// Longest over shortest edge.
    pub aspect: f64,
    /// Smallest over largest determinant of the jacobian in the cell: 1 of a cell that is an affine image of its reference
    /// cell, near 0 of one that is almost folded.
    pub jacobian: f64,
}

/// The shapes of all cells.
#[must_use]
pub fn cell_shapes(mesh: &Mesh) -> Vec<CellShape> {
    let tables = CellKind::ALL.map(|kind| {
        let element = mesh.geometry_element(kind);
        let mut points = kind.vertices().to_vec();
        // the map of a pyramid has no derivative at its apex
        if kind == CellKind::Pyramid {
            points.truncate(4);
        }
        let rule = quadrature::gauss(kind, 3).map(|rule| rule.points).unwrap_or_default();
        points.extend(rule);
        element.tabulate(&points, 1)
    });
    let jacobian = |cell: CellId| {
        let table = &tables[mesh.kind(cell).index()];
        let values = (0..table.n_points).map(|p| determinant(&mesh.jacobian_at(cell, table, p), mesh.dim()));
        let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(a, b), x| (a.min(x), b.max(x)));
        low / high
    };
    let shape = |cell: CellId| {
        let (angles, aspect) = corners(mesh, cell);
        CellShape { angles, aspect, jacobian: jacobian(cell) }
    };
    mesh.cells().map(shape).collect()
}

/// Angles and aspect of the corners of a cell.
fn corners(mesh: &Mesh, cell: CellId) -> ([f64; 2], f64) {
    let (kind, vertices) = (mesh.kind(cell), mesh.cell_vertices(cell));
    let at = |k: usize| mesh.node(vertices[k]);
    let arm = |a: usize, b: usize| -> [f64; 3] { std::array::from_fn(|d| at(b)[d] - at(a)[d]) };
    let mut shortest = f64::INFINITY;
    let mut longest = 0.0f64;
    for [a, b] in kind.edges() {
        let length = distance(at(*a), at(*b));
        (shortest, longest) = (shortest.min(length), longest.max(length));
    }
    let mut angles = [f64::INFINITY, f64::NEG_INFINITY];
    let mut take = |cosine: f64| {
        let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees();
        angles = [angles[0].min(angle), angles[1].max(angle)];
    };
    match mesh.dim() {
        2 => {
            for k in 0..vertices.len() {
                let mut ends = kind.edges().iter().filter_map(|[a, b]| match () {
                    () if *a == k => Some(arm(k, *b)),
                    () if *b == k => Some(arm(k, *a)),
                    () => None,
                });
                if let (Some(u), Some(v)) = (ends.next(), ends.next()) {
                    take(dot(u, v) / (norm(u) * norm(v)));
                }
            }
        }
        3 => {
            let centre = mesh.centroid(cell);
            let normals: Vec<[f64; 3]> = (0..kind.facets().len()).map(|f| outward(mesh, cell, f, centre)).collect();
            for edge in 0..kind.edges().len() {
                let mut sides = (0..normals.len()).filter(|f| kind.facet_edges(*f).contains(&edge));
                if let (Some(a), Some(b)) = (sides.next(), sides.next()) {
                    take(-dot(normals[a], normals[b]));
                }
            }
        }
        _ => return ([f64::NAN; 2], 1.0),
    }
    (angles, longest / shortest)
}

/// The unit normal of a face of a cell, out of it: of a face that is not plane that of its diagonals.
fn outward(mesh: &Mesh, cell: CellId, facet: usize, centre: [f64; 3]) -> [f64; 3] {
    let kind = mesh.kind(cell);
    let (local, vertices) = (kind.facets()[facet], mesh.cell_vertices(cell));
    let at = |k: usize| mesh.node(vertices[local.vertices[k]]);
    let between = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| b[d] - a[d]) };
    // quadrilaterals are lexicographic: their diagonals are 03 and 12
    let normal = match local.vertices.len() {
        3 => cross(between(at(0), at(1)), between(at(0), at(2))),
        _ => cross(between(at(0), at(3)), between(at(1), at(2))),
    };
    let out = dot(normal, between(centre, at(0))).signum();
    let length = norm(normal);
    normal.map(|x| out * x / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxShape, generate_box};

    #[test]
    fn angles_of_known_cells() {
        let shapes = |dim: usize, shape: BoxShape, to: [f64; 3]| {
            cell_shapes(&generate_box([0.0; 3], to, [2; 3], dim, shape).unwrap())
        };
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
        for shape in shapes(2, BoxShape::Triangle, [1.0, 1.0, 0.0]) {
            near(shape.angles[0], 45.0);
            near(shape.angles[1], 90.0);
            near(shape.aspect, 2f64.sqrt());
            near(shape.jacobian, 1.0);
        }
        for shape in shapes(3, BoxShape::Hexahedron, [1.0, 2.0, 4.0]) {
            near(shape.angles[0], 90.0);
            near(shape.angles[1], 90.0);
            near(shape.aspect, 4.0);
        }
        // Kuhn's tetrahedra of a cube
        for shape in shapes(3, BoxShape::Tetrahedron, [1.0; 3]) {
            near(shape.angles[0], 45.0);
            near(shape.angles[1], 90.0);
        }
        assert!(shapes(1, BoxShape::Segment, [1.0, 0.0, 0.0])[0].angles[0].is_nan());
    }

    #[test]
    fn a_quadrilateral_that_is_almost_a_triangle_has_a_small_jacobian() {
        let mut raw =
            generate_box([0.0; 3], [1.0, 1.0, 0.0], [1, 1, 1], 2, BoxShape::Quadrilateral).unwrap().into_raw();
        let corner = raw.nodes.iter().position(|x| x[0] == 1.0 && x[1] == 1.0).unwrap();
        raw.nodes[corner] = [0.52, 0.52, 0.0];
        let shape = cell_shapes(&Mesh::from_raw(raw).unwrap())[0];
        // determinants at the corners are 1 and 2*0.52 - 1
        assert!((shape.jacobian - 0.04).abs() < 1e-12, "{shape:?}");
        assert!(shape.angles[1] > 175.0);
    }
}
