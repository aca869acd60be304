//! Integrals along the edges of faces: a surface ends there, in the plane at single points.
//!
//! A group of edges is one of their faces with its points on one edge: fields, normals and gradients along the face are
//! those of the face there, and only the measure is that of the edge. Promises: each edge is counted by the rank that
//! counts its face.

use std::collections::BTreeMap;

use super::{Domain, Group, GroupSide, numbers};
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
            let local = group.edge.map(|edge| edge.local);
            let edge = |face: &FacetRef| Some(FaceEdge { face: *face, local: local? });
            group.here.facets.iter().filter_map(edge).collect::<Vec<_>>()
        };
        self.groups.iter().flat_map(of_group)
    }
}

/// The groups of some edges under a rule of their kind.
pub(super) fn groups(mesh: &Mesh, edges: &[FaceEdge], rule: &dyn Fn(CellKind) -> Rule) -> Vec<Group> {
    let mut groups: BTreeMap<[u8; 5], Group> = BTreeMap::new();
    for (k, edge) in edges.iter().enumerate() {
        let (kind, local) = (mesh.kind(edge.face.cell), usize::from(edge.face.local));
        let key = numbers((kind, local, CellKind::Point, 0, usize::from(edge.local) + 1));
        let group = groups.entry(key).or_insert_with(|| {
            let rule = rule(mesh.edge_kind(*edge));
            let [parameters, points] = mesh.edge_points(*edge, &rule);
            let face = mesh.facet_kind(edge.face);
            let two = |x: [f64; 3]| [x[0], x[1]];
            Group {
                key,
                is_own: false,
                entities: Vec::new(),
                weights: rule.weights,
                parameters,
                tangents: Some(kind.facet_map(local).tangents),
                edge: Some(Edge {
                    local: edge.local,
                    along: two(face.facet_map(usize::from(edge.local)).tangents[0]),
                    outward: two(face.facet_normal(usize::from(edge.local))),
                }),
                areas: None,
                reference_normal: kind.facet_normal(local),
                is_global: false,
                here: GroupSide::new(mesh, kind, points),
                there: None,
                there_normal: None,
                motion: None,
            }
        });
        group.entities.push(k);
        group.here.cells.push(edge.face.cell);
        group.here.facets.push(edge.face);
    }
    groups.into_values().collect()
}
