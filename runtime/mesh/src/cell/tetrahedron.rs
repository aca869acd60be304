//! The tetrahedron (0,0,0), (1,0,0), (0,1,0), (0,0,1).

use super::{
    CellKind,
    shape::{Basis, Polynomials, SIMPLEX, Shape, Subdivision, facet, gmsh, simplex_contains, simplex_hats},
};

/// `1 / sqrt(3)`, the component of the normal of the oblique facet.
const FRAC_1_SQRT_3: f64 = 0.577_350_269_189_625_8;

pub(super) static SHAPE: Shape = Shape {
    name: "tetrahedron",
    dim: 3,
    vertices: &SIMPLEX,
    axes: &[1, 2, 3],
    edges: &[[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]],
    facets: &[
        facet(CellKind::Triangle, &[0, 1, 2]),
        facet(CellKind::Triangle, &[0, 1, 3]),
        facet(CellKind::Triangle, &[0, 2, 3]),
        facet(CellKind::Triangle, &[1, 2, 3]),
    ],
    facet_edges: &[&[0, 1, 2], &[0, 4, 3], &[2, 5, 3], &[1, 5, 4]],
    normals: &[[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [FRAC_1_SQRT_3, FRAC_1_SQRT_3, FRAC_1_SQRT_3]],
    heights: &[3.0; 4],
    volume: 1.0 / 6.0,
    centre: None,
    vertex_weights: None,
    basis: Basis::Simplex,
    polynomials: Polynomials::Total,
    highest_degree: 4,
    straight_is_affine: true,
    subdivision: Some(Subdivision::Bisection),
    hats: simplex_hats::<3>,
    contains: simplex_contains,
    folded: |[u, v, w]| ([u, v * (1.0 - u), w * (1.0 - u) * (1.0 - v)], (1.0 - u) * (1.0 - u) * (1.0 - v)),
    // edges (1,3) and (2,3) change places
    gmsh: gmsh((4, &[0, 1, 2, 3]), (11, &[0, 1, 2, 3, 4, 5, 6, 7, 9, 8])),
    correspondences: &[],
};
