//! Nodes of a space at nodes of the mesh.
//!
//! A space has a node at every vertex. Between them it has those of the mesh where its element has one at the same place of the
//! cell: of degree 2 on a mesh of second order all of them, of degree 1 none.

use std::collections::BTreeMap;

use wfl_mesh::{
    element::Family,
    mesh::{Mesh, NodeId},
};

use super::{NONE, Space, Support};

/// Points of the reference cell nearer than this are one point: they are given with all digits.
const SAME_POINT: f64 = 1e-12;

impl Space {
    /// Sorted nodes of the space at these nodes of the mesh, for a continuous space.
    #[must_use]
    pub fn nodes_at_mesh_nodes(&self, mesh: &Mesh, nodes: &[NodeId]) -> Vec<u32> {
        let mut found: Vec<u32> = self.by_mesh_node(mesh, nodes).concat();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// By node of the mesh the nodes of a continuous space there: several where it is torn.
    #[must_use]
    pub fn by_mesh_node(&self, mesh: &Mesh, nodes: &[NodeId]) -> Vec<Vec<u32>> {
        let at = |node: &NodeId| Some(self.numbering.vertices[node.index()]).filter(|n| *n != NONE);
        let mut found: Vec<Vec<u32>> = nodes.iter().map(|node| at(node).into_iter().collect()).collect();
        if mesh.order() > 1 && self.degree > 1 && self.family == Family::Continuous {
            self.between_vertices(mesh, nodes, &mut found);
        }
        for list in found.iter_mut().filter(|_| !self.copies.is_empty()) {
            let torn: Vec<u32> = self.copies.iter().filter(|(n, _)| list.contains(n)).map(|(_, copy)| *copy).collect();
            list.extend(torn);
            list.sort_unstable();
            list.dedup();
        }
        found
    }

    /// Adds nodes at those of the mesh that are no vertices.
    fn between_vertices(&self, mesh: &Mesh, nodes: &[NodeId], found: &mut [Vec<u32>]) {
        let positions: BTreeMap<NodeId, usize> = nodes.iter().copied().zip(0..).collect();
        let mut note = |node: &NodeId, of: u32| {
            if let Some(position) = positions.get(node)
                && !found[*position].contains(&of)
            {
                found[*position].push(of);
            }
        };
        let is_same = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|d| (a[d] - b[d]).abs() < SAME_POINT);
        for position in 0..self.n_positions() {
            let (element, own) = (self.element_at(position), self.entity_nodes(position));
            match &self.support {
                Support::Cells(cells) => {
                    let geometry = mesh.geometry_element(mesh.kind(cells[position]));
                    for (node, x) in mesh.cell_nodes(cells[position]).iter().zip(geometry.points()) {
                        let at = element.points().iter().position(|y| is_same(x, y));
                        at.into_iter().for_each(|at| note(node, own[at]));
                    }
                }
                Support::Facets(facets) => {
                    let facet = facets[position];
                    let (kind, local) = (mesh.kind(facet.cell), usize::from(facet.local));
                    let (geometry, map) = (mesh.geometry_element(kind), kind.facet_map(local));
                    for k in geometry.facet_closure(local) {
                        let x = &geometry.points()[*k];
                        let at = element.points().iter().position(|y| is_same(x, &map.apply(*y)));
                        at.into_iter().for_each(|at| note(&mesh.cell_nodes(facet.cell)[*k], own[at]));
                    }
                }
                Support::Edges(_) => {}
            }
        }
    }
}
