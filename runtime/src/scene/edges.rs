//! Where the faces of a surface end and meet: `nodes of s`, `rim of s`, `crossings of s`.
//!
//! In the plane faces are lines and meet at points, in space they meet along edges. Promises: edges are those of the
//! vertices of the cells; nodes in the middle of edges of second order are in no region.

use std::{
    collections::{BTreeMap, BTreeSet},
    convert::Infallible,
};

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{EntityKind, RegionExpr},
};

use crate::mesh::{FacetRef, Mesh, NodeId, RegionSet};

/// The nodes of some faces that are picked: all of them, those of edges with one face, or with three and more.
///
/// # Errors
/// E405 for what a region of edges would be needed for, or where faces have no edges.
pub(super) fn between(
    mesh: &Mesh,
    entity: EntityKind,
    faces: &[FacetRef],
    span: Span,
) -> Result<BTreeSet<NodeId>, Box<Diagnostic>> {
    let wanted: fn(usize) -> bool = match entity {
        EntityKind::Rim => |n| n == 1,
        EntityKind::Crossings => |n| n > 2,
        EntityKind::Interior => {
            let d = Diagnostic::new(
                Code::E405,
                "`interior` is that of the mesh: jumps between faces of a surface are not available",
            );
            let text = "a region of edges, of which only `rim` and `crossings` have nodes to be fixed";
            return Err(d.at(span, text).help("`interior` alone: the inner faces of all cells").into());
        }
        _ => |_| true,
    };
    let mut faces_at: BTreeMap<Vec<NodeId>, usize> = BTreeMap::new();
    for face in faces {
        edges(mesh, *face).for_each(|edge| *faces_at.entry(edge).or_default() += 1);
    }
    if faces_at.is_empty() {
        let d = Diagnostic::new(Code::E405, "on a line faces are points: they have no edges");
        return Err(d.at(span, "").help("region ends = nodes where x == 0").into());
    }
    Ok(faces_at.into_iter().filter(|(_, n)| wanted(*n)).flat_map(|(edge, _)| edge).collect())
}

/// The edges of a face by their nodes, sorted; in the plane its two ends.
fn edges(mesh: &Mesh, face: FacetRef) -> impl Iterator<Item = Vec<NodeId>> {
    let vertices = mesh.facet_vertices(face);
    let nodes = vertices.vertices().to_vec();
    let of_edges: Vec<Vec<usize>> = match mesh.dim() {
        1 => Vec::new(),
        2 => vec![vec![0], vec![1]],
        _ => mesh.facet_kind(face).edges().iter().map(|ends| ends.to_vec()).collect(),
    };
    of_edges.into_iter().map(move |ends| {
        let mut edge: Vec<NodeId> = ends.into_iter().map(|k| nodes[k]).collect();
        edge.sort_unstable();
        edge
    })
}

/// Those of the nodes where a condition holds.
pub(super) fn pick(
    mesh: &Mesh,
    nodes: BTreeSet<NodeId>,
    holds: &mut dyn FnMut([f64; 3]) -> Result<bool, Infallible>,
) -> Result<RegionSet, Infallible> {
    let mut picked = Vec::new();
    for node in nodes {
        if holds(mesh.node(node))? {
            picked.push(node);
        }
    }
    Ok(RegionSet::Nodes(picked))
}

/// True for a region that has edges of faces in it: in space their middles are nodes of degree two, and loads on them are
/// per length.
pub(super) fn are_in(script: &ResolvedScript, region: &str) -> bool {
    let declared = script.regions.iter().find(|r| r.name.name == region);
    declared.is_some_and(|r| has_edges(script, &r.region, region))
}

fn has_edges(script: &ResolvedScript, region: &RegionExpr, own: &str) -> bool {
    match region {
        RegionExpr::Picked { entity, .. } => matches!(entity, EntityKind::Rim | EntityKind::Crossings),
        RegionExpr::Name(name) => name.name != own && are_in(script, &name.name),
        RegionExpr::Combine(first, rest) => {
            has_edges(script, first, own) || rest.iter().any(|(_, part)| has_edges(script, part, own))
        }
        _ => false,
    }
}
