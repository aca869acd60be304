//! The cube `[0, 1]^3`, vertices lexicographic, x fastest.

use super::{
    CellKind,
    shape::{Basis, CUBE, CUBE_NORMALS, Polynomials, Shape, Subdivision, facet, gmsh, tensor_contains, tensor_hats},
};

pub(super) static SHAPE: Shape = Shape {
    name: "hexahedron",
    dim: 3,
    vertices: &CUBE,
    axes: &[1, 2, 4],
    edges: &[[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]],
    facets: &[
        facet(CellKind::Quadrilateral, &[0, 2, 4, 6]),
        facet(CellKind::Quadrilateral, &[1, 3, 5, 7]),
        facet(CellKind::Quadrilateral, &[0, 1, 4, 5]),
        facet(CellKind::Quadrilateral, &[2, 3, 6, 7]),
        facet(CellKind::Quadrilateral, &[0, 1, 2, 3]),
        facet(CellKind::Quadrilateral, &[4, 5, 6, 7]),
    ],
    facet_edges: &[&[8, 10, 4, 6], &[9, 11, 5, 7], &[8, 9, 0, 2], &[10, 11, 1, 3], &[4, 5, 0, 1], &[6, 7, 2, 3]],
    normals: &CUBE_NORMALS,
    heights: &[1.0; 6],
    volume: 1.0,
    centre: None,
    vertex_weights: None,
    basis: Basis::Tensor,
    polynomials: Polynomials::Each,
    highest_degree: 4,
    straight_is_affine: false,
    subdivision: Some(Subdivision::Layers),
    hats: tensor_hats::<3>,
    contains: tensor_contains,
    folded: |x| (x, 1.0),
    gmsh: gmsh(
        (5, &[0, 1, 3, 2, 4, 5, 7, 6]),
        (12, &[0, 8, 1, 9, 20, 11, 3, 13, 2, 10, 21, 12, 22, 26, 23, 15, 24, 14, 4, 16, 5, 17, 25, 18, 7, 19, 6]),
    ),
    correspondences: &[],
};
