//! A space that is split along inner faces: nodes there get one copy for each side.
//!
//! The cells around a node form groups that are connected through faces without a split. Each group gets its own node:
//! one at the end of a crack (the field stays continuous), two along it, four where cracks cross.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use super::{Family, Space, Support};
use wfl_mesh::mesh::{FacetId, FacetRef, Topology};

impl Space {
    /// Tears a continuous space on cells along `facets`, each named from one of its sides. Facets that are not between
    /// two cells of the space stay as they are.
    pub fn split(&mut self, topology: &Topology, facets: &[FacetRef]) {
        if self.family == Family::Discontinuous || !matches!(self.support, Support::Cells(_)) {
            return;
        }
        let torn: BTreeSet<FacetId> = facets.iter().map(|f| topology.facet_id(*f)).collect();
        let holders = self.holders(&self.nodes_of_closures(facets));
        let mut nodes = std::mem::take(&mut self.nodes);
        let of_positions = Arc::make_mut(&mut nodes);
        for (node, positions) in holders {
            let groups = self.groups(topology, &torn, &positions);
            for group in &groups[1..] {
                let copy = u32::try_from(self.coordinates.len()).expect("fewer than 2^32 nodes");
                self.coordinates.push(self.coordinates[node as usize]);
                self.copies.push((node, copy));
                for position in group {
                    for slot in &mut of_positions[self.starts[*position]..self.starts[*position + 1]] {
                        if *slot == node {
                            *slot = copy;
                        }
                    }
                }
            }
        }
        self.nodes = nodes;
        self.copies.sort_unstable();
        self.torn.extend_from_slice(facets);
        self.torn_ids.extend(torn);
    }

    /// True if the space is split along this face.
    #[must_use]
    pub fn is_torn_along(&self, facet: FacetId) -> bool {
        self.torn_ids.contains(&facet)
    }

    /// The faces along which the space is split.
    #[must_use]
    pub fn torn(&self) -> &[FacetRef] {
        &self.torn
    }

    /// True if the space is split.
    #[must_use]
    pub fn is_split(&self) -> bool {
        !self.copies.is_empty()
    }

    fn nodes_of_closures(&self, facets: &[FacetRef]) -> BTreeSet<u32> {
        let mut nodes = BTreeSet::new();
        for facet in facets {
            if let Some(position) = self.position_of_cell(facet.cell) {
                let closure = self.element_at(position).facet_closure(usize::from(facet.local));
                nodes.extend(closure.iter().map(|dof| self.entity_nodes(position)[*dof]));
            }
        }
        nodes
    }

    /// By node the positions whose cells hold it.
    fn holders(&self, nodes: &BTreeSet<u32>) -> BTreeMap<u32, Vec<usize>> {
        let mut holders: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for position in 0..self.n_positions() {
            for node in self.entity_nodes(position) {
                if nodes.contains(node) {
                    holders.entry(*node).or_default().push(position);
                }
            }
        }
        holders
    }

    /// The positions in groups that are connected through faces without a split, in the order of their first members.
    fn groups(&self, topology: &Topology, torn: &BTreeSet<FacetId>, positions: &[usize]) -> Vec<Vec<usize>> {
        let Support::Cells(cells) = &self.support else { return Vec::new() };
        let mut open: BTreeSet<usize> = positions.iter().copied().collect();
        let mut groups = Vec::new();
        while let Some(first) = open.pop_first() {
            let mut group = vec![first];
            let mut next = 0;
            while let Some(position) = group.get(next).copied() {
                next += 1;
                for (local, facet) in topology.cell_facets(cells[position]).iter().enumerate() {
                    let here = FacetRef { cell: cells[position], local: u8::try_from(local).expect("few facets") };
                    let beyond = topology.opposite(here).and_then(|there| self.position_of_cell(there.cell));
                    if let Some(beyond) = beyond.filter(|_| !torn.contains(facet))
                        && open.remove(&beyond)
                    {
                        group.push(beyond);
                    }
                }
            }
            groups.push(group);
        }
        groups
    }
}
