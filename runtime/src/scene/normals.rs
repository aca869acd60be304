//! Outward normals at the nodes of a field on some faces.
//!
//! The normal of a face is taken at the node itself, so that curved faces give the normal of their geometry. Faces
//! that meet at a node at less than [`SMOOTH`] are one smooth surface there, with the mean of their normals weighted by
//! area; at a sharper edge the node has the normals of both sides.

use std::collections::BTreeMap;

use crate::{
    mesh::{FacetRef, Mesh, Topology},
    space::{Space, Support},
};

/// Cosine of the angle between normals below which faces are one smooth surface: 30 degrees.
const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// By node of `space` its normals on `facets`, outward as seen from the named side.
pub(super) fn node_normals(
    mesh: &Mesh,
    topology: &Topology,
    space: &Space,
    facets: &[FacetRef],
) -> BTreeMap<u32, Vec<[f64; 3]>> {
    let mut parts: BTreeMap<u32, Vec<[f64; 3]>> = BTreeMap::new();
    for facet in facets {
        let sides = [(Some(*facet), 1.0), (topology.opposite(*facet), -1.0)];
        let found = sides.into_iter().filter_map(|(side, sign)| Some((side?, sign, nodes_of(mesh, space, side?)?)));
        let mut own: Vec<u32> = Vec::new();
        for (side, sign, mut nodes) in found {
            // of a split field both sides have nodes, of others the first side has all
            nodes.retain(|(node, _)| !own.contains(node));
            if nodes.is_empty() {
                continue;
            }
            own.extend(nodes.iter().map(|(node, _)| *node));
            let points: Vec<[f64; 3]> = nodes.iter().map(|(_, point)| *point).collect();
            let kind = mesh.kind(side.cell);
            let table = mesh.geometry_element(kind).tabulate(&points, 1);
            for (q, (node, _)) in nodes.iter().enumerate() {
                let area = area_vector(mesh, side, mesh.jacobian_at(side.cell, &table, q));
                parts.entry(*node).or_default().push(area.map(|x| sign * x));
            }
        }
    }
    parts.into_iter().map(|(node, list)| (node, grouped(&list))).collect()
}

/// Nodes of a space on a face with their reference points in its cell; `None` where the space is not.
fn nodes_of(mesh: &Mesh, space: &Space, facet: FacetRef) -> Option<Vec<(u32, [f64; 3])>> {
    match space.support() {
        Support::Cells(_) => {
            let position = space.position_of_cell(facet.cell)?;
            let (element, nodes) = (space.element_at(position), space.entity_nodes(position));
            let closure = element.facet_closure(usize::from(facet.local));
            Some(closure.iter().map(|dof| (nodes[*dof], element.points()[*dof])).collect())
        }
        Support::Edges(_) => None,
        Support::Facets(_) => {
            let position = space.position_of_facet(facet)?;
            let element = space.element_at(position);
            let local = mesh.kind(facet.cell).facet_map(usize::from(facet.local));
            let map = |p: &[f64; 3]| local.apply(*p);
            Some(space.entity_nodes(position).iter().copied().zip(element.points().iter().map(map)).collect())
        }
    }
}

/// The part of a face around a point as a vector: along the outward normal, as long as the area that a unit of the
/// reference face covers there, times the area of the reference face.
fn area_vector(mesh: &Mesh, facet: FacetRef, jacobian: [[f64; 3]; 3]) -> [f64; 3] {
    let (kind, dim) = (mesh.kind(facet.cell), mesh.dim());
    let m = nalgebra::Matrix3::from_fn(
        |r, c| {
            if r < dim && c < dim { jacobian[r][c] } else { f64::from(u8::from(r == c)) }
        },
    );
    let local = usize::from(facet.local);
    let map = kind.facet_map(local);
    let images = map.tangents.map(|t| m * nalgebra::Vector3::from(t));
    let covered = match dim {
        1 => 1.0,
        2 => images[0].norm(),
        _ => images[0].cross(&images[1]).norm(),
    };
    // the reference normal goes over by the transposed inverse
    let reference = nalgebra::Vector3::from(kind.facet_normal(local));
    let normal = m.try_inverse().map_or(reference, |inverse| inverse.transpose() * reference).normalize();
    let size = covered * mesh.facet_kind(facet).reference_volume();
    [0, 1, 2].map(|d| normal[d] * size)
}

/// Unit normals of the smooth surfaces among area vectors, in the order of their first faces.
fn grouped(areas: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut sums: Vec<nalgebra::Vector3<f64>> = Vec::new();
    for area in areas {
        let area = nalgebra::Vector3::from(*area);
        let smooth = |sum: &&mut nalgebra::Vector3<f64>| sum.normalize().dot(&area.normalize()) > SMOOTH;
        match sums.iter_mut().find(smooth) {
            Some(sum) => *sum += area,
            None => sums.push(area),
        }
    }
    sums.into_iter().map(|s| s.normalize().into()).collect()
}
