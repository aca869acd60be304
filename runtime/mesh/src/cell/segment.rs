//! The segment `[0, 1]`.

use super::{
    CellKind,
    shape::{
        Basis, CUBE_NORMALS, Polynomials, SIMPLEX, Shape, Subdivision, facet, gmsh, simplex_contains, simplex_hats,
    },
};

pub(super) static SHAPE: Shape = Shape {
    name: "segment",
    dim: 1,
    vertices: SIMPLEX.split_at(2).0,
    axes: &[1],
    edges: &[[0, 1]],
    facets: &[facet(CellKind::Point, &[0]), facet(CellKind::Point, &[1])],
    facet_edges: &[&[], &[]],
    normals: CUBE_NORMALS.split_at(2).0,
    heights: &[1.0, 1.0],
    volume: 1.0,
    centre: None,
    vertex_weights: None,
    basis: Basis::Simplex,
    polynomials: Polynomials::Total,
    highest_degree: 4,
    straight_is_affine: true,
    subdivision: Some(Subdivision::Bisection),
    hats: simplex_hats::<1>,
    contains: simplex_contains,
    folded: |[u, _, _]| ([u, 0.0, 0.0], 1.0),
    gmsh: gmsh((1, &[0, 1]), (8, &[0, 1, 2])),
    correspondences: &[[0, 1, 0, 0], [1, 0, 0, 0]],
};
