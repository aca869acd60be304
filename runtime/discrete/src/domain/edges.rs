//! Integrals along the edges of faces: a surface ends there, in the plane at single points.
//!
//! A group of edges is one of their faces with its points on one edge: fields, normals and gradients along the face are
//! those of the face there, and only the measure is that of the edge. Between two faces it has two sides: of the other one
//! its own face. Promises: each edge is counted by the rank that counts its face.

use std::collections::BTreeMap;

use super::{Domain, Group, GroupSide, Key, numbers};
use wfl_mesh::{
    mesh::{CellKind, FaceEdge, FacetRef, Mesh},
    quadrature::Rule,
};

/// Where the edges of a group lie in their faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Local facet of the kind of the face.
    pub local: u8,
    /// Derivatives of the parameters of the face in that of the edge; zero for the end of a line.
    pub along: [f64; 2],
    /// Outward normal of the edge in the parameters of the face.
    pub outward: [f64; 2],
}

impl Domain {
    /// The edges of a domain over edges; none of others.
    pub fn edges(&self) -> impl Iterator<Item = FaceEdge> {
        let of_group = |group: &Group| {
            let locals = [group.edge, group.edge_there].map(|edge| edge.map(|edge| edge.local));
            let edge = |(k, face): (usize, &FacetRef)| {
                let across = group.there.as_ref().and_then(|there| Some((*there.facets.get(k)?, locals[1]?)));
                Some(FaceEdge { face: *face, local: locals[0]?, across })
            };
            group.here.facets.iter().enumerate().filter_map(edge).collect::<Vec<_>>()
        };
        self.groups.iter().flat_map(of_group)
    }
}

/// The groups of some edges under a rule of their kind.
pub(super) fn groups(mesh: &Mesh, edges: &[FaceEdge], rule: &dyn Fn(CellKind) -> Rule) -> Vec<Group> {
    let mut groups: BTreeMap<[u8; 5], Group> = BTreeMap::new();
    for (k, edge) in edges.iter().enumerate() {
        let (kind, local) = (mesh.kind(edge.face.cell), usize::from(edge.face.local));
        let key = numbers(key(mesh, edge));
        let group = groups.entry(key).or_insert_with(|| {
            let rule = rule(mesh.edge_kind(*edge));
            let [parameters, points] = mesh.edge_points(*edge, &rule);
            let there = mesh.points_across(*edge, &rule).zip(edge.neighbour());
            Group {
                key,
                is_own: false,
                entities: Vec::new(),
                own: None,
                weights: rule.weights,
                parameters,
                tangents: Some(kind.facet_map(local).tangents),
                edge: Some(Edge::new(mesh, *edge)),
                edge_there: edge.neighbour().map(|there| Edge::new(mesh, there)),
                areas: None,
                reference_normal: kind.facet_normal(local),
                is_global: false,
                here: side(mesh, *edge, points),
                there_normal: edge.neighbour().map(|e| mesh.kind(e.face.cell).facet_normal(usize::from(e.face.local))),
                there: there.map(|(points, there)| side(mesh, there, points)),
            }
        });
        group.entities.push(k);
        group.here.cells.push(edge.face.cell);
        group.here.facets.push(edge.face);
        if let (Some(there), Some(edge)) = (&mut group.there, edge.neighbour()) {
            there.cells.push(edge.face.cell);
            there.facets.push(edge.face);
        }
    }
    groups.into_values().collect()
}

impl Edge {
    pub(super) fn new(mesh: &Mesh, edge: FaceEdge) -> Self {
        let (face, local) = (mesh.facet_kind(edge.face), usize::from(edge.local));
        let two = |x: [f64; 3]| [x[0], x[1]];
        let along = two(face.facet_map(local).tangents[0]);
        Self { local: edge.local, along, outward: two(face.facet_normal(local)) }
    }
}

/// What edges with the same reference points have in common.
fn key(mesh: &Mesh, edge: &FaceEdge) -> Key {
    let (kind, local) = (mesh.kind(edge.face.cell), usize::from(edge.face.local));
    // a face has four edges at most
    let own = 1 + usize::from(edge.local);
    match edge.neighbour() {
        None => (kind, local, CellKind::Point, 0, own),
        Some(there) => {
            let turned = usize::from(mesh.is_turned_across(*edge));
            let both = own + 4 * (1 + usize::from(there.local) + 4 * turned);
            (kind, local, mesh.kind(there.face.cell), usize::from(there.face.local), both)
        }
    }
}

/// One side of a group of edges: sizes are those of its face, taken at the nodes of the face.
fn side(mesh: &Mesh, edge: FaceEdge, points: Vec<[f64; 3]>) -> GroupSide {
    let kind = mesh.kind(edge.face.cell);
    let element = mesh.geometry_element(kind);
    let nodes = element.facet_closure(usize::from(edge.face.local));
    let of_face: Vec<[f64; 3]> = nodes.iter().map(|k| element.points()[*k]).collect();
    let corners = element.tabulate(&of_face, 1);
    GroupSide { corners, ..GroupSide::new(mesh, kind, points) }
}
