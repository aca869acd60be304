//! Cells at a common facet: on its two sides, and with the same nodes on it.
//!
//! Promises: the side is told by the order of vertices alone, which is exact, since every determinant was checked before.
//! Does not find cells that overlap without a common facet.

use super::{
    CellKind, Mesh,
    error::MeshError,
    index::{FacetRef, NodeId},
};
use crate::{
    cell::facet_correspondences,
    vector::{cross, difference, distance, dot},
};

/// Middle nodes of a common facet are at one place within this part of the facet: rounding of what wrote the file.
const SAME_PLACE: f64 = 1e-6;

/// ... and within this part of their coordinates: far from the origin numbers are no finer.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Refuses the first facet, given as both of its cells see it, whose cells lie on one side of it, or have other middle nodes
/// on it at other places.
///
/// # Errors
/// [`MeshError::FoldedOver`] and [`MeshError::MiddleNodes`].
pub(super) fn refuse_one_sided(
    mesh: &Mesh,
    facets: impl Iterator<Item = (FacetRef, FacetRef)>,
) -> Result<(), MeshError> {
    for (here, there) in facets {
        let name = |facet: FacetRef| mesh.numbers().cell(facet.cell);
        let (first, second) = (name(here), name(there));
        if !on_two_sides(mesh, here, there) {
            return Err(MeshError::FoldedOver { first, second });
        }
        if mesh.order() > 1
            && let Some(node) = middle_of_one(mesh, here, there)
        {
            let node = mesh.numbers().node(node);
            return Err(MeshError::MiddleNodes { first, second, node });
        }
    }
    Ok(())
}

/// The sense of a facet's parameters: 1 where they make the outward normal of its cell, else -1.
fn sense(kind: CellKind, local: usize) -> f64 {
    let (normal, [a, b]) = (kind.facet_normal(local), kind.facet_map(local).tangents);
    let made = match kind.dim() {
        1 => [1.0, 0.0, 0.0],
        2 => [a[1], -a[0], 0.0],
        _ => cross(a, b),
    };
    dot(made, normal).signum()
}

/// Cells of positive determinant lie on two sides where their outward normals are opposite.
fn on_two_sides(mesh: &Mesh, here: FacetRef, there: FacetRef) -> bool {
    let (ours, theirs) = (mesh.facet_vertices(here), mesh.facet_vertices(there));
    let place = |vertex: &NodeId| theirs.vertices().iter().position(|other| other == vertex).unwrap_or(0);
    let mut places = [0u8; 4];
    for (to, vertex) in places.iter_mut().zip(ours.vertices()) {
        *to = place(vertex) as u8;
    }
    // a quadrilateral whose corners stand in another order is crossed
    if !facet_correspondences(ours.kind).contains(&places) {
        return false;
    }
    let corner = |k: usize| ours.kind.vertices()[usize::from(places[k])];
    let along = |axis: usize| difference(corner(ours.kind.axes()[axis]), corner(0));
    let same = match ours.kind.dim() {
        0 => 1.0,
        1 => along(0)[0],
        _ => cross(along(0), along(1))[2],
    };
    let of = |facet: FacetRef| sense(mesh.kind(facet.cell), facet.local as usize);
    of(here) * same.signum() * of(there) < 0.0
}

/// A node of the facet here that is no node of the facet there, and at no place of one.
fn middle_of_one(mesh: &Mesh, here: FacetRef, there: FacetRef) -> Option<NodeId> {
    let nodes = |facet: FacetRef| {
        let closure = mesh.geometry_element(mesh.kind(facet.cell)).facet_closure(facet.local as usize);
        let of_cell = mesh.cell_nodes(facet.cell);
        closure.iter().map(move |dof| of_cell[*dof])
    };
    let alone = |node: &NodeId| {
        if nodes(there).any(|other| other == *node) {
            return false;
        }
        let x = mesh.node(*node);
        let size = nodes(here).map(|other| distance(x, mesh.node(other))).fold(0.0, f64::max);
        let far = x.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        !nodes(there).any(|other| distance(x, mesh.node(other)) <= SAME_PLACE * size + ROUNDING * far)
    };
    nodes(here).find(alone)
}
