//! Facets at the same position: the correspondence of their vertices, and the search for such pairs.
//!
//! Promises: tolerances are relative to the size of the facets; a pairing is reported as an orientation key, the
//! position of the vertex correspondence in the fixed table [`facet_correspondences`] of the facet kind. Facets that
//! overlap without matching are an error.

use super::{
    Mesh,
    error::MeshError,
    index::{FacetRef, InterfaceFacet, NodeId},
    points::PointGrid,
};
use crate::{
    cell::{CellKind, facet_correspondences},
    quadrature::{self, Rule},
    vector::{cross, difference, distance, dot, norm},
};

/// Vertices of two facets coincide within this part of the facet size.
const COINCIDENT: f64 = 1e-6;

/// ... and within this part of their coordinates: far from the origin numbers are no finer.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Facets whose planes are nearer than this part of their size and of the thickness of their cells, that face each
/// other and overlap, are meant to match.
const FACING: f64 = 0.1;

/// Largest distance between two vertices of a facet; for a point, the size of its cell.
fn facet_size(mesh: &Mesh, facet: FacetRef) -> f64 {
    let vertices = mesh.facet_vertices(facet);
    let vertices = vertices.vertices();
    if vertices.len() == 1 {
        return mesh.cell_diameter(facet.cell);
    }
    let mut size = 0.0;
    for (i, first) in vertices.iter().enumerate() {
        for second in &vertices[..i] {
            size = f64::max(size, distance(mesh.node(*first), mesh.node(*second)));
        }
    }
    size
}

/// The distance below which points of a facet of this size are the same.
fn within(mesh: &Mesh, facet: FacetRef, size: f64) -> f64 {
    let vertices = mesh.facet_vertices(facet);
    let far = vertices.vertices().iter().flat_map(|v| mesh.node(*v)).fold(0.0, |m: f64, c| m.max(c.abs()));
    COINCIDENT * size + ROUNDING * far
}

/// The key of the vertex correspondence between two facets at the same place: below 1, 2, 6 and 8
/// for points, segments, triangles and quadrilaterals. Found from shared nodes, or from coordinates
/// where the nodes are separate (within 1e-6 of the facet size).
///
/// # Errors
/// [`MeshError::NotMatching`] when the vertices do not coincide or the kinds differ.
pub fn orientation(mesh: &Mesh, here: FacetRef, there: FacetRef) -> Result<u8, MeshError> {
    let (ours, theirs) = (mesh.facet_vertices(here), mesh.facet_vertices(there));
    let size = facet_size(mesh, here).max(facet_size(mesh, there));
    let mut largest_distance = 0.0;
    let mut permutation = [0u8; 4];
    for (place, vertex) in permutation.iter_mut().zip(ours.vertices()) {
        let (nearest, gap) = nearest(mesh, *vertex, theirs.vertices());
        *place = nearest;
        largest_distance = f64::max(largest_distance, gap);
    }
    let key = facet_correspondences(ours.kind).iter().position(|p| *p == permutation);
    match key {
        Some(key) if ours.kind == theirs.kind && largest_distance <= within(mesh, here, size) => {
            Ok(u8::try_from(key).expect("at most eight correspondences"))
        }
        _ => Err(MeshError::NotMatching { facets: 1, largest_distance }),
    }
}

fn nearest(mesh: &Mesh, node: NodeId, among: &[NodeId]) -> (u8, f64) {
    let mut best = (0, f64::INFINITY);
    for (position, other) in among.iter().enumerate() {
        if *other == node {
            return (position as u8, 0.0);
        }
        let gap = distance(mesh.node(node), mesh.node(*other));
        if gap < best.1 {
            best = (position as u8, gap);
        }
    }
    best
}

/// The physical points of [`facet_points`](quadrature::facet_points) here as reference points of the cell there,
/// with the orientation key of [`orientation`]. The points depend only on the kinds of the two
/// cells, their local facets and the key, so that equal keys can share tables.
///
/// # Errors
/// [`MeshError::NotMatching`].
pub fn neighbour_points(
    mesh: &Mesh,
    here: FacetRef,
    there: FacetRef,
    rule: &Rule,
) -> Result<(u8, Vec<[f64; 3]>), MeshError> {
    let key = orientation(mesh, here, there)?;
    let points = quadrature::oriented_points(mesh.kind(there.cell), there.local as usize, key, rule);
    Ok((key, points))
}

/// A facet with what the search needs.
struct Candidate {
    facet: FacetRef,
    centre: [f64; 3],
    size: f64,
    /// Outward, of unit length (unless the facet is degenerate).
    normal: [f64; 3],
}

/// Unit normal out of the cell at the facet's vertices (of the plane through the first three).
pub(super) fn outward(mesh: &Mesh, facet: FacetRef, centre: [f64; 3]) -> [f64; 3] {
    let vertices = mesh.facet_vertices(facet);
    let x: Vec<[f64; 3]> = vertices.vertices().iter().map(|v| mesh.node(*v)).collect();
    let across = match x.as_slice() {
        [_] => [1.0, 0.0, 0.0],
        [a, b] => {
            let t = difference(*b, *a);
            [t[1], -t[0], 0.0]
        }
        [a, b, c, ..] => cross(difference(*b, *a), difference(*c, *a)),
        [] => [0.0; 3],
    };
    let inward = dot(across, difference(mesh.centroid(facet.cell), centre));
    let scale = if inward > 0.0 { -1.0 } else { 1.0 } / norm(across);
    across.map(|c| c * scale)
}

/// Pairs of facets of `ours` and `theirs` (boundary facets of two bodies) with coincident vertices.
///
/// # Errors
/// [`MeshError::NotMatching`] when facets face each other and overlap but do not match.
pub(super) fn pair_by_geometry(
    mesh: &Mesh,
    ours: &[FacetRef],
    theirs: &[FacetRef],
) -> Result<Vec<InterfaceFacet>, MeshError> {
    let candidate = |facet: &FacetRef| {
        let centre = mesh.facet_centroid(*facet);
        Candidate { facet: *facet, centre, size: facet_size(mesh, *facet), normal: outward(mesh, *facet, centre) }
    };
    let theirs: Vec<Candidate> = theirs.iter().map(candidate).collect();
    let centres: Vec<[f64; 3]> = theirs.iter().map(|c| c.centre).collect();
    let members: Vec<u32> = (0..theirs.len() as u32).collect();
    let grid = PointGrid::new(&centres, &members, mesh.dim().max(2) - 1);
    let widest = theirs.iter().map(|c| c.size).fold(0.0, f64::max);
    let mut pairs = Vec::new();
    let (mut facets, mut largest_distance) = (0, 0.0);
    for here in ours.iter().map(candidate) {
        let (mut found, mut mismatch) = (None, None::<f64>);
        grid.near(here.centre, here.size.max(widest), |member, gap| {
            let there = &theirs[member as usize];
            if gap <= within(mesh, here.facet, here.size.max(there.size))
                && orientation(mesh, here.facet, there.facet).is_ok()
            {
                found = Some(there.facet);
            } else if facing(mesh, &here, there) {
                let gap = vertex_distance(mesh, here.facet, there.facet);
                mismatch = Some(mismatch.unwrap_or(0.0).max(gap));
            }
        });
        match (found, mismatch) {
            (Some(there), _) => pairs.push(InterfaceFacet { here: here.facet, there }),
            (None, Some(gap)) => {
                facets += 1;
                largest_distance = f64::max(largest_distance, gap);
            }
            (None, None) => {}
        }
    }
    if facets > 0 {
        return Err(MeshError::NotMatching { facets, largest_distance });
    }
    Ok(pairs)
}

/// Vertices of matching `facets` at the same place that are different nodes, as pairs.
pub(crate) fn coincident_nodes(mesh: &Mesh, facets: &[FacetRef]) -> Vec<(NodeId, NodeId)> {
    let centres: Vec<[f64; 3]> = facets.iter().map(|f| mesh.facet_centroid(*f)).collect();
    let members: Vec<u32> = (0..facets.len() as u32).collect();
    let grid = PointGrid::new(&centres, &members, mesh.dim().max(2) - 1);
    let mut pairs = Vec::new();
    for (k, here) in facets.iter().enumerate() {
        let reach = within(mesh, *here, facet_size(mesh, *here));
        grid.near(centres[k], reach, |member, _| {
            let there = facets[member as usize];
            // of two faces that differ a little in size, the larger one finds the other
            if member as usize == k || orientation(mesh, *here, there).is_err() {
                return;
            }
            let (ours, theirs) = (mesh.facet_vertices(*here), mesh.facet_vertices(there));
            for vertex in ours.vertices() {
                let other = theirs.vertices()[nearest(mesh, *vertex, theirs.vertices()).0 as usize];
                if other != *vertex {
                    pairs.push((*vertex.min(&other), *vertex.max(&other)));
                }
            }
        });
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// True when two facets face each other at a small distance and one's centre lies in the
/// other.
fn facing(mesh: &Mesh, here: &Candidate, there: &Candidate) -> bool {
    // flat cells: the outer faces of two bodies are near each other in parts of their width
    let thickness = |c: &Candidate| 2.0 * dot(c.normal, difference(mesh.centroid(c.facet.cell), c.centre)).abs();
    let smaller = here.size.min(there.size).min(thickness(here)).min(thickness(there));
    let offset = dot(here.normal, difference(there.centre, here.centre));
    offset.abs() <= FACING * smaller
        && dot(here.normal, there.normal) < -0.9
        && (inside(mesh, here, there.centre) || inside(mesh, there, here.centre))
}

/// True when the projection of `x` lies inside the facet, away from its border.
fn inside(mesh: &Mesh, facet: &Candidate, x: [f64; 3]) -> bool {
    /// Part of the facet size that counts as its border.
    const BORDER: f64 = 1e-3;
    let vertices = mesh.facet_vertices(facet.facet);
    let loop_order: &[usize] = match vertices.kind {
        CellKind::Quadrilateral => &[0, 1, 3, 2],
        CellKind::Triangle => &[0, 1, 2],
        CellKind::Segment => &[0, 1],
        _ => return distance(x, facet.centre) <= FACING * facet.size,
    };
    let corner = |i: usize| mesh.node(vertices.vertices[loop_order[i % loop_order.len()]]);
    if vertices.kind == CellKind::Segment {
        let along = difference(corner(1), corner(0));
        let place = dot(along, difference(x, corner(0))) / dot(along, along);
        return place > BORDER && place < 1.0 - BORDER;
    }
    (0..loop_order.len()).all(|i| {
        let edge = difference(corner(i + 1), corner(i));
        let towards = cross(facet.normal, edge);
        // The in-plane normal of the edge, pointing to the centre of the facet.
        let scale = dot(towards, difference(facet.centre, corner(i)));
        let depth = dot(towards, difference(x, corner(i)));
        depth * scale.signum() > BORDER * facet.size * norm(towards)
    })
}

/// Largest distance from a vertex of one facet to the nearest vertex of the other.
fn vertex_distance(mesh: &Mesh, here: FacetRef, there: FacetRef) -> f64 {
    let (ours, theirs) = (mesh.facet_vertices(here), mesh.facet_vertices(there));
    let gaps = ours.vertices().iter().map(|v| nearest(mesh, *v, theirs.vertices()).1);
    gaps.fold(0.0, f64::max)
}
