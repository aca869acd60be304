//! Points that belong to no rule: the one of what is global, and those at nodes, each of weight 1.

use std::collections::BTreeMap;

use wfl_mesh::mesh::{CellId, CellKind, FaceEdge, Mesh};

use super::{Domain, Edge, Group, GroupSide, Over};
use crate::space::{Space, Support};

/// What holds a node: the kind of the cell, its local facet, the edge of that, and the local node.
type Held = (CellKind, Option<u8>, Option<u8>, usize);

impl Domain {
    /// One point of weight 1 that belongs to no entity, for terms on `global`.
    #[must_use]
    pub fn global(mesh: &Mesh) -> Self {
        let cell = CellId::new(0);
        if mesh.n_cells() == 0 {
            // a part of a mesh without cells: the first rank has the equation
            return Self { over: Over::Points, dim: mesh.dim(), n_entities: 0, groups: Vec::new(), moving: None };
        }
        let kind = mesh.kind(cell);
        let mut here = GroupSide::new(mesh, kind, vec![kind.reference_centre()]);
        here.cells.push(cell);
        let group = Group { entities: vec![0], ..one_point(here) };
        Self { over: Over::Points, dim: mesh.dim(), n_entities: 1, groups: vec![group], moving: None }
    }
}

impl Domain {
    /// A point of weight 1 at each of these nodes of a space, in the first cell or on the first facet that holds it.
    #[must_use]
    pub fn at_nodes(mesh: &Mesh, space: &Space, nodes: &[u32]) -> Self {
        let mut wanted: BTreeMap<u32, usize> = nodes.iter().enumerate().map(|(k, node)| (*node, k)).collect();
        let mut groups: BTreeMap<Held, Group> = BTreeMap::new();
        for position in 0..space.n_positions() {
            let (cell, facet, edge) = match space.support() {
                Support::Cells(cells) => (cells[position], None, None),
                Support::Facets(facets) => (facets[position].cell, Some(facets[position]), None),
                Support::Edges(edges) => {
                    let edge = edges[position];
                    (edge.face.cell, Some(edge.face), Some(edge))
                }
            };
            let kind = mesh.kind(cell);
            for (local, node) in space.entity_nodes(position).iter().enumerate() {
                let Some(entity) = wanted.remove(node) else { continue };
                let [on_face, on_line] = [facet.map(|f| f.local), edge.map(|e| e.local)];
                let group = groups.entry((kind, on_face, on_line, local)).or_insert_with(|| {
                    let point = space.element_at(position).points()[local];
                    let on_edge = |e: FaceEdge| {
                        let (face, local) = (mesh.facet_kind(e.face), usize::from(e.local));
                        face.facet_point(local, face.facet_map(local).apply(point))
                    };
                    let point = edge.map_or(point, on_edge);
                    let in_cell = facet.map_or(point, |f| {
                        kind.facet_point(usize::from(f.local), kind.facet_map(usize::from(f.local)).apply(point))
                    });
                    let here = GroupSide::new(mesh, kind, vec![in_cell]);
                    Group { parameters: vec![point], edge: edge.map(|e| Edge::new(mesh, e)), ..one_point(here) }
                });
                group.entities.push(entity);
                group.here.cells.push(cell);
                group.here.facets.extend(facet);
            }
            if wanted.is_empty() {
                break;
            }
        }
        let groups = groups.into_values().collect();
        Self { over: Over::Points, dim: mesh.dim(), groups, n_entities: nodes.len(), moving: None }
    }
}

/// A group without entities whose only point has weight 1, independent of the cell.
fn one_point(here: GroupSide) -> Group {
    Group {
        key: [0; 5],
        is_own: false,
        entities: Vec::new(),
        own: None,
        weights: vec![1.0],
        parameters: vec![[0.0; 3]],
        tangents: None,
        edge: None,
        edge_there: None,
        areas: None,
        reference_normal: [0.0; 3],
        is_global: true,
        here,
        there: None,
        there_normal: None,
    }
}
