//! The triangle (0,0), (1,0), (0,1). Edge `i` and facet `i` are the same.

use std::f64::consts::FRAC_1_SQRT_2;

use super::{
    CellKind,
    shape::{Basis, Polynomials, SIMPLEX, Shape, Subdivision, facet, gmsh, simplex_contains, simplex_hats},
};

pub(super) static SHAPE: Shape = Shape {
    name: "triangle",
    dim: 2,
    vertices: SIMPLEX.split_at(3).0,
    axes: &[1, 2],
    edges: &[[0, 1], [1, 2], [0, 2]],
    facets: &[facet(CellKind::Segment, &[0, 1]), facet(CellKind::Segment, &[1, 2]), facet(CellKind::Segment, &[0, 2])],
    facet_edges: &[&[0], &[1], &[2]],
    normals: &[[0.0, -1.0, 0.0], [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0], [-1.0, 0.0, 0.0]],
    heights: &[2.0; 3],
    volume: 0.5,
    centre: None,
    vertex_weights: None,
    basis: Basis::Simplex,
    polynomials: Polynomials::Total,
    highest_degree: 4,
    straight_is_affine: true,
    subdivision: Some(Subdivision::Bisection),
    hats: simplex_hats::<2>,
    contains: simplex_contains,
    folded: |[u, v, _]| ([u, v * (1.0 - u), 0.0], 1.0 - u),
    gmsh: gmsh((2, &[0, 1, 2]), (9, &[0, 1, 2, 3, 4, 5])),
    correspondences: &[[0, 1, 2, 0], [0, 2, 1, 0], [1, 0, 2, 0], [1, 2, 0, 0], [2, 0, 1, 0], [2, 1, 0, 0]],
};
