//! Outward normals at the nodes of a field on some faces.
//!
//! The normal of a face is taken at the node itself, so that curved faces give the normal of their geometry. Faces
//! that meet at a node at less than [`SMOOTH`] are one smooth surface there, with the mean of their normals weighted by
//! area; at a sharper edge the node has the normals of both sides. A surface that is held in pieces, by a list of regions or
//! by several statements, is the same surface: at a seam its nodes have one normal.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{ResolvedScript, ast::TargetPart};
use wfl_discrete::space::{Space, Support};
use wfl_mesh::mesh::{FacetRef, Mesh, RegionSet, Topology};

use super::regions::Regions;

/// Cosine of the angle between normals below which faces are one smooth surface: 30 degrees.
const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// The faces of a region, seen from the named side; `None` for a region of others.
pub(super) fn faces_of(set: &RegionSet) -> Option<Vec<FacetRef>> {
    match set {
        RegionSet::Facets(facets) => Some(facets.clone()),
        RegionSet::Interface(pairs) => Some(pairs.iter().map(|p| p.here).collect()),
        RegionSet::Cells(_) | RegionSet::Edges(_) | RegionSet::Nodes(_) => None,
    }
}

/// All faces on which a field is held along normals, in an order of their own.
pub(super) fn held_faces(script: &ResolvedScript, regions: &Regions, field: &str) -> Vec<FacetRef> {
    let is_normal = |target: &&wfl::ast::Target| target.field.name == field && target.part == TargetPart::Normal;
    let statements = script.fixes.iter().filter(|fix| fix.targets.iter().any(|target| is_normal(&target)));
    let sets = statements.flat_map(|fix| &fix.places).filter_map(|place| regions.get(&place.name));
    let all: BTreeSet<FacetRef> = sets.filter_map(|region| faces_of(&region.set)).flatten().collect();
    all.into_iter().collect()
}

/// By node of `space` its normals on `facets`, outward as seen from the named side; `beside` are all faces of the surfaces
/// that these may be a part of.
pub(super) fn node_normals(
    mesh: &Mesh,
    topology: &Topology,
    space: &Space,
    facets: &[FacetRef],
    beside: &[FacetRef],
) -> BTreeMap<u32, Vec<[f64; 3]>> {
    let own_faces: BTreeSet<FacetRef> = facets.iter().copied().collect();
    let others = facets.iter().filter(|facet| beside.binary_search(facet).is_err());
    let mut parts: BTreeMap<u32, Vec<([f64; 3], bool)>> = BTreeMap::new();
    for facet in beside.iter().chain(others) {
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
                parts.entry(*node).or_default().push((area.map(|x| sign * x), own_faces.contains(facet)));
            }
        }
    }
    let normals = parts.into_iter().map(|(node, list)| (node, grouped(&list)));
    normals.filter(|(_, list)| !list.is_empty()).collect()
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

/// Unit normals of the smooth surfaces among area vectors, in the order of their first faces, of those that have a face that
/// is asked for.
fn grouped(areas: &[([f64; 3], bool)]) -> Vec<[f64; 3]> {
    let mut sums: Vec<(nalgebra::Vector3<f64>, bool)> = Vec::new();
    for (area, is_own) in areas {
        let area = nalgebra::Vector3::from(*area);
        let smooth = |(sum, _): &&mut (nalgebra::Vector3<f64>, bool)| sum.normalize().dot(&area.normalize()) > SMOOTH;
        match sums.iter_mut().find(smooth) {
            Some((sum, own)) => (*sum, *own) = (*sum + area, *own || *is_own),
            None => sums.push((area, *is_own)),
        }
    }
    sums.into_iter().filter(|(_, own)| *own).map(|(sum, _)| sum.normalize().into()).collect()
}
