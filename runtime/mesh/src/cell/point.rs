//! The point: the facet of a segment.

use super::shape::{Basis, Polynomials, SIMPLEX, Shape, Subdivision, gmsh, simplex_contains, simplex_hats};

pub(super) static SHAPE: Shape = Shape {
    name: "point",
    dim: 0,
    vertices: SIMPLEX.split_at(1).0,
    axes: &[],
    edges: &[],
    facets: &[],
    facet_edges: &[],
    normals: &[],
    heights: &[],
    volume: 1.0,
    centre: None,
    vertex_weights: None,
    basis: Basis::Simplex,
    polynomials: Polynomials::Total,
    highest_degree: 4,
    straight_is_affine: true,
    subdivision: Some(Subdivision::Bisection),
    hats: simplex_hats::<0>,
    contains: simplex_contains,
    folded: |_| ([0.0; 3], 1.0),
    gmsh: gmsh((15, &[0]), (15, &[0])),
    correspondences: &[[0, 0, 0, 0]],
};
