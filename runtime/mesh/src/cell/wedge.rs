//! The wedge (triangular prism): the reference triangle times `[0, 1]`, vertices of z = 0 first.

use std::f64::consts::FRAC_1_SQRT_2;

use super::{
    CellKind,
    shape::{Basis, Polynomials, Shape, facet, gmsh, simplex_contains},
};

/// Two triangles, then the quadrilaterals over the edges 01, 02 and 12 of the first.
pub(super) static SHAPE: Shape = Shape {
    name: "wedge",
    dim: 3,
    vertices: &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]],
    axes: &[1, 2, 3],
    edges: &[[0, 1], [1, 2], [0, 2], [3, 4], [4, 5], [3, 5], [0, 3], [1, 4], [2, 5]],
    facets: &[
        facet(CellKind::Triangle, &[0, 1, 2]),
        facet(CellKind::Triangle, &[3, 4, 5]),
        facet(CellKind::Quadrilateral, &[0, 1, 3, 4]),
        facet(CellKind::Quadrilateral, &[0, 2, 3, 5]),
        facet(CellKind::Quadrilateral, &[1, 2, 4, 5]),
    ],
    facet_edges: &[&[0, 1, 2], &[3, 4, 5], &[6, 7, 0, 3], &[6, 8, 2, 5], &[7, 8, 1, 4]],
    normals: &[
        [0.0, 0.0, -1.0],
        [0.0, 0.0, 1.0],
        [0.0, -1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0],
    ],
    // over a triangle the length of the prism, over a quadrilateral the height of the triangle
    heights: &[1.0, 1.0, 2.0, 2.0, 2.0],
    volume: 0.5,
    centre: None,
    vertex_weights: None,
    basis: Basis::Wedge,
    polynomials: Polynomials::Both,
    highest_degree: 4,
    straight_is_affine: false,
    subdivision: None,
    hats: |[x, y, z]| {
        let [a, b] = [1.0 - z, z];
        let o = 1.0 - x - y;
        [o * a, x * a, y * a, o * b, x * b, y * b, 0.0, 0.0]
    },
    contains: |r, margin| simplex_contains(&r[..2], margin) && (-margin..=1.0 + margin).contains(&r[2]),
    folded: |[u, v, w]| ([u, v * (1.0 - u), w], 1.0 - u),
    // the nodes of z = 0, z = 1/2 and z = 1, each in the order of a triangle of second order
    gmsh: gmsh((6, &[0, 1, 2, 3, 4, 5]), (13, &[0, 1, 2, 6, 9, 7, 8, 10, 11, 15, 17, 16, 3, 4, 5, 12, 14, 13])),
    correspondences: &[],
};
