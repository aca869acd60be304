//! The pyramid over the unit square of z = 0, vertices of the base lexicographic, then the apex (0,0,1): the points with
//! `0 <= z <= 1` and `0 <= x, y <= 1 - z`.
//!
//! With `w = 1 - z`, `a = x/w`, `b = y/w` it is the unit cube of (a, b, z), collapsed at z = 1. Its vertex functions are `w`
//! times the bilinear ones of (a, b), and `z`: rational, with a value at the apex but no derivative there. Derivatives at
//! the apex are those along the line from the middle of the base; seen from a face, those along the middle of the face
//! ([`CellKind::facet_point`]).

use std::f64::consts::FRAC_1_SQRT_2;

use super::{
    CellKind,
    shape::{Basis, Polynomials, Shape, facet, gmsh},
};

/// `w`, `a` and `b` of a point; at the apex those of the middle of the base.
pub(crate) fn collapsed([x, y, z]: [f64; 3]) -> [f64; 3] {
    let w = 1.0 - z;
    if w == 0.0 { [0.0, 0.5, 0.5] } else { [w, x / w, y / w] }
}

pub(super) static SHAPE: Shape = Shape {
    name: "pyramid",
    dim: 3,
    vertices: &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    axes: &[1, 2, 4],
    edges: &[[0, 2], [1, 3], [0, 1], [2, 3], [0, 4], [1, 4], [2, 4], [3, 4]],
    // x = 0, x = 1 - z, y = 0, y = 1 - z, z = 0
    facets: &[
        facet(CellKind::Triangle, &[0, 2, 4]),
        facet(CellKind::Triangle, &[1, 3, 4]),
        facet(CellKind::Triangle, &[0, 1, 4]),
        facet(CellKind::Triangle, &[2, 3, 4]),
        facet(CellKind::Quadrilateral, &[0, 1, 2, 3]),
    ],
    facet_edges: &[&[0, 6, 4], &[1, 7, 5], &[2, 5, 4], &[3, 7, 6], &[0, 1, 2, 3]],
    normals: &[
        [-1.0, 0.0, 0.0],
        [FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2],
        [0.0, -1.0, 0.0],
        [0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2],
        [0.0, 0.0, -1.0],
    ],
    // over a triangle the distance of the opposite edge of the base
    heights: &[1.5, 1.5, 1.5, 1.5, 3.0],
    volume: 1.0 / 3.0,
    // the centroid of the body: a quarter of its height, over the middle of the section there
    centre: Some([0.375, 0.375, 0.25]),
    vertex_weights: Some(&[1.0 / 16.0, 1.0 / 16.0, 1.0 / 16.0, 1.0 / 16.0, 1.0 / 12.0]),
    basis: Basis::Pyramid,
    polynomials: Polynomials::Both,
    highest_degree: 2,
    straight_is_affine: false,
    subdivision: None,
    hats: |x| {
        let [w, a, b] = collapsed(x);
        let (c, d) = (1.0 - a, 1.0 - b);
        [w * c * d, w * a * d, w * c * b, w * a * b, x[2], 0.0, 0.0, 0.0]
    },
    contains: |r, margin| r.iter().all(|c| *c >= -margin) && r[0].max(r[1]) + r[2] <= 1.0 + margin,
    folded: |[u, v, z]| ([u * (1.0 - z), v * (1.0 - z), z], (1.0 - z) * (1.0 - z)),
    // lexicographic layers: nine nodes of z = 0, four of z = 1/2, the apex
    gmsh: gmsh((7, &[0, 1, 3, 2, 4]), (14, &[0, 5, 1, 6, 13, 8, 3, 10, 2, 7, 9, 12, 11, 4])),
    correspondences: &[],
};
