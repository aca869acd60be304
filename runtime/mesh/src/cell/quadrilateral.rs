//! The square `[0, 1]^2`, vertices lexicographic: (0,0), (1,0), (0,1), (1,1). Edge `i` and facet `i` are the same.

use super::{
    CellKind,
    shape::{Basis, CUBE, CUBE_NORMALS, Polynomials, Shape, Subdivision, facet, gmsh, tensor_contains, tensor_hats},
};

pub(super) static SHAPE: Shape = Shape {
    name: "quadrilateral",
    dim: 2,
    vertices: CUBE.split_at(4).0,
    axes: &[1, 2],
    edges: &[[0, 2], [1, 3], [0, 1], [2, 3]],
    facets: &[
        facet(CellKind::Segment, &[0, 2]),
        facet(CellKind::Segment, &[1, 3]),
        facet(CellKind::Segment, &[0, 1]),
        facet(CellKind::Segment, &[2, 3]),
    ],
    facet_edges: &[&[0], &[1], &[2], &[3]],
    normals: CUBE_NORMALS.split_at(4).0,
    heights: &[1.0; 4],
    volume: 1.0,
    centre: None,
    vertex_weights: None,
    basis: Basis::Tensor,
    polynomials: Polynomials::Each,
    highest_degree: 4,
    straight_is_affine: false,
    subdivision: Some(Subdivision::Layers),
    hats: tensor_hats::<2>,
    contains: tensor_contains,
    folded: |[u, v, _]| ([u, v, 0.0], 1.0),
    // corners counter-clockwise, then the edges around
    gmsh: gmsh((3, &[0, 1, 3, 2]), (10, &[0, 4, 1, 7, 8, 5, 3, 6, 2])),
    // the eight symmetries of the square
    correspondences: &[
        [0, 1, 2, 3],
        [0, 2, 1, 3],
        [1, 0, 3, 2],
        [1, 3, 0, 2],
        [2, 0, 3, 1],
        [2, 3, 0, 1],
        [3, 1, 2, 0],
        [3, 2, 1, 0],
    ],
};
