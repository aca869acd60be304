//! Where the faces of a surface end and meet: `nodes of s`, `rim of s`, `interior of s`, `crossings of s`.
//!
//! In the plane faces are lines and meet at points, in space they meet along edges. Promises: nodes are those of the
//! vertices of the cells; the edges of a rim have one face each, from which they are seen, those of the interior two, and
//! are seen from the first one, those of crossings are seen from each of their faces. A face that a region has from both of its cells is one face. Nodes and edges are picked
//! by one condition: an edge is taken where it holds at its ends and in its middle.

use std::{
    collections::{BTreeMap, BTreeSet},
    convert::Infallible,
};

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{EntityKind, RegionExpr},
};
use wfl_mesh::mesh::{FaceEdge, FacetRef, Mesh, NodeId};

/// Nodes of a surface, and the edges of a rim or between its faces.
pub(super) struct Ends {
    pub(super) nodes: Vec<NodeId>,
    /// `None` for `nodes of`.
    pub(super) edges: Option<Vec<FaceEdge>>,
}

/// The nodes of some faces that are picked: all of them, those of edges with one face, with two, or with three and more.
///
/// # Errors
/// E405 where faces have no edges.
pub(super) fn between(
    mesh: &Mesh,
    entity: EntityKind,
    faces: &[FacetRef],
    span: Span,
) -> Result<Ends, Box<Diagnostic>> {
    let wanted: fn(usize) -> bool = match entity {
        EntityKind::Rim => |n| n == 1,
        EntityKind::Crossings => |n| n > 2,
        EntityKind::Interior => |n| n == 2,
        _ => |_| true,
    };
    let faces_at = faces_at(mesh, faces);
    if faces_at.is_empty() {
        let d = Diagnostic::new(Code::E405, "on a line faces are points: they have no edges");
        return Err(d.at(span, "").help("region ends = nodes where x == 0").into());
    }
    let found = || faces_at.iter().filter(|(_, faces)| wanted(faces.len()));
    let nodes: BTreeSet<NodeId> = found().flat_map(|(ends, _)| ends).copied().collect();
    let of = |faces: &Vec<FaceEdge>| match faces[..] {
        [edge, there] => FaceEdge { across: Some((there.face, there.local)), ..edge },
        _ => faces[0],
    };
    let mut edges: Vec<FaceEdge> = match entity {
        EntityKind::Crossings => found().flat_map(|(_, faces)| faces).copied().collect(),
        _ => found().map(|(_, faces)| of(faces)).collect(),
    };
    edges.sort_unstable();
    let edges = (entity != EntityKind::Nodes).then_some(edges);
    Ok(Ends { nodes: nodes.into_iter().collect(), edges })
}

/// The edges with one face alone of some faces.
pub(super) fn rim(mesh: &Mesh, faces: &[FacetRef]) -> Vec<FaceEdge> {
    faces_at(mesh, faces).into_values().filter(|faces| faces.len() == 1).map(|faces| faces[0]).collect()
}

/// By the ends of an edge, sorted, the faces that have it.
fn faces_at(mesh: &Mesh, faces: &[FacetRef]) -> BTreeMap<Vec<NodeId>, Vec<FaceEdge>> {
    let mut found: BTreeMap<Vec<NodeId>, Vec<FaceEdge>> = BTreeMap::new();
    let mut seen: BTreeSet<Vec<NodeId>> = BTreeSet::new();
    let is_first = |face: &&FacetRef| {
        let mut vertices = mesh.facet_vertices(**face).vertices().to_vec();
        vertices.sort_unstable();
        seen.insert(vertices)
    };
    for edge in faces.iter().filter(is_first).flat_map(|face| mesh.edges_of_face(*face)) {
        let mut ends = mesh.edge_ends(edge);
        ends.sort_unstable();
        found.entry(ends).or_default().push(edge);
    }
    found.values_mut().for_each(|edges| edges.sort_unstable());
    found
}

impl Ends {
    /// Those where a condition holds.
    pub(super) fn pick(
        self,
        mesh: &Mesh,
        holds: &mut dyn FnMut([f64; 3]) -> Result<bool, Infallible>,
    ) -> Result<Self, Infallible> {
        let mut nodes = Vec::new();
        for node in self.nodes {
            if holds(mesh.node(node))? {
                nodes.push(node);
            }
        }
        let mut edges = self.edges.as_ref().map(|_| Vec::new());
        for edge in self.edges.into_iter().flatten() {
            let ends = mesh.edge_ends(edge);
            let are_in = ends.iter().all(|end| nodes.binary_search(end).is_ok());
            if are_in && holds(mesh.edge_middle(edge))? {
                edges.get_or_insert_default().push(edge);
            }
        }
        Ok(Self { nodes, edges })
    }
}

/// True for a region that has edges of faces in it: in space their middles are nodes of degree two, and loads on them are
/// per length.
pub(super) fn are_in(script: &ResolvedScript, region: &str) -> bool {
    has_kind(script, region, &[EntityKind::Rim, EntityKind::Interior, EntityKind::Crossings])
}

/// True for a region made of crossings.
pub(super) fn cross(script: &ResolvedScript, region: &str) -> bool {
    has_kind(script, region, &[EntityKind::Crossings])
}

fn has_kind(script: &ResolvedScript, region: &str, kinds: &[EntityKind]) -> bool {
    let declared = script.regions.iter().find(|r| r.name.name == region);
    declared.is_some_and(|r| has_edges(script, &r.region, (region, kinds)))
}

fn has_edges(script: &ResolvedScript, region: &RegionExpr, wanted: (&str, &[EntityKind])) -> bool {
    let (own, kinds) = wanted;
    match region {
        RegionExpr::Picked { entity, .. } => kinds.contains(entity),
        RegionExpr::Name(name) => name.name != own && has_kind(script, &name.name, kinds),
        RegionExpr::Combine(first, rest) => {
            has_edges(script, first, wanted) || rest.iter().any(|(_, part)| has_edges(script, part, wanted))
        }
        _ => false,
    }
}
