//! What comes with a mesh: groups of a file and its numbers, on the refined mesh.
//!
//! Promises: a group has the parts of its cells and faces, and of a curve the nodes in the middle of its edges; a part of
//! an element has the number of that element in messages. Does not know conditions: regions given by them are picked on
//! the refined mesh.

use super::{curved::Curved, descent::Descent, splits::Splits};
use crate::mesh::{
    CellId, FacetId, FacetRef, FileNumbers, Group, GroupEntities, GroupFacet, Mesh, MeshError, NodeId, Topology,
};

/// New nodes in the middle of edges.
pub(super) struct Middles<'a, 's> {
    pub(super) splits: &'a Splits<'s>,
    pub(super) curved: Option<&'a Curved<'a>>,
}

impl Middles<'_, '_> {
    /// The number in the mesh of a node of the closure.
    fn node(&self, node: u32) -> NodeId {
        let node = self.curved.map_or(node, |c| c.vertices[node as usize]);
        NodeId::new(node as usize)
    }

    /// Adds the parts of an edge and the nodes on it.
    fn divide(&self, ends: [u32; 2], edges: &mut Vec<[NodeId; 2]>, nodes: &mut Vec<NodeId>) {
        if let Some(middle) = self.splits.middle(ends) {
            nodes.push(self.node(middle));
            self.divide([ends[0], middle], edges, nodes);
            self.divide([middle, ends[1]], edges, nodes);
            return;
        }
        nodes.extend(self.curved.and_then(|c| c.middle(ends)).map(|node| NodeId::new(node as usize)));
        edges.push(ends.map(|node| self.node(node)));
    }
}

/// The groups on a refined mesh; `vertices` gives the vertices of a facet of it.
pub(super) fn groups(
    old: &Mesh,
    kinds: &[crate::cell::CellKind],
    descent: &Descent,
    vertices: &dyn Fn(FacetRef) -> GroupFacet,
    middles: &Middles<'_, '_>,
) -> Result<Vec<Group>, MeshError> {
    let mut groups: Vec<Group> = old.groups().to_vec();
    let mut parts: Vec<Vec<GroupFacet>> = vec![Vec::new(); groups.len()];
    if groups.iter().any(|g| matches!(g.entities, GroupEntities::Facets(_))) {
        let topology = Topology::new(old)?;
        let members = Members::new(old, &topology);
        for (cell, kind) in kinds.iter().enumerate() {
            for local in 0..kind.facets().len() {
                let facet = FacetRef::new(CellId::new(cell), local);
                let Some(parent) = descent.parent_facet(facet, *kind) else { continue };
                let id = topology.facet_id(parent);
                // once, from the cell of lower number
                if topology.facet(id).here == parent {
                    members.of(id).for_each(|group| parts[group].push(vertices(facet)));
                }
            }
        }
        members.loose.iter().for_each(|(group, facet)| parts[*group].push(*facet));
    }
    let mut children = vec![Vec::new(); if groups.is_empty() { 0 } else { old.n_cells() }];
    if groups.iter().any(|g| matches!(g.entities, GroupEntities::Cells(_))) {
        (0..kinds.len()).map(CellId::new).for_each(|cell| children[descent.parent(cell).index()].push(cell));
    }
    for (group, mut facets) in groups.iter_mut().zip(parts) {
        match &mut group.entities {
            GroupEntities::Cells(cells) => {
                *cells = cells.iter().flat_map(|cell| children[cell.index()].iter().copied()).collect();
            }
            GroupEntities::Facets(members) => {
                facets.sort_unstable();
                *members = facets;
            }
            GroupEntities::Nodes { nodes, edges } => {
                for ends in std::mem::take(edges) {
                    middles.divide(ends.map(|n| n.index() as u32), edges, nodes);
                }
                nodes.sort_unstable();
                nodes.dedup();
            }
        }
    }
    Ok(groups)
}

/// The groups of each facet.
struct Members {
    /// Facet and group, sorted.
    pairs: Vec<(FacetId, usize)>,
    /// Facets that no cell has: they stay as they are.
    loose: Vec<(usize, GroupFacet)>,
}

impl Members {
    fn new(mesh: &Mesh, topology: &Topology) -> Self {
        let (mut pairs, mut loose) = (Vec::new(), Vec::new());
        for (k, group) in mesh.groups().iter().enumerate() {
            let GroupEntities::Facets(facets) = &group.entities else { continue };
            for facet in facets {
                match topology.find_facet(mesh, facet.vertices()) {
                    Some(id) => pairs.push((id, k)),
                    None => loose.push((k, *facet)),
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        Self { pairs, loose }
    }

    fn of(&self, facet: FacetId) -> impl Iterator<Item = usize> {
        let from = self.pairs.partition_point(|(id, _)| *id < facet);
        self.pairs[from..].iter().take_while(move |(id, _)| *id == facet).map(|(_, group)| *group)
    }
}

/// Numbers for messages: parts have the number of their element, new nodes follow the highest number of the file.
pub(super) fn numbers(old: &FileNumbers, descent: &Descent, n_nodes: usize) -> FileNumbers {
    let mut numbers = FileNumbers::default();
    if !old.cells.is_empty() {
        let parents = (0..descent.n_cells()).map(|cell| descent.parent(CellId::new(cell)).index());
        numbers.cells = parents.map(|parent| old.cells[parent]).collect();
    }
    if !old.nodes.is_empty() {
        let highest = old.nodes.iter().copied().max().unwrap_or(0);
        let new = (1..=n_nodes.saturating_sub(old.nodes.len()) as u64).map(|k| highest + k);
        numbers.nodes = old.nodes.iter().copied().chain(new).collect();
    }
    numbers
}
