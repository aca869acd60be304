//! A space on the part of a mesh that one of several ranks has.
//!
//! Promises: nodes are those of the space on the whole mesh, in its order, also where a split ends on another rank.

use std::sync::Arc;

use super::{Context, Element, ElementError, Entity, Family, Numbering, Space, Support};
use wfl_mesh::mesh::{CellKind, FaceEdge, FacetRef, Mesh, PlacesInPart, Topology};
use wfl_sparse::index::NONE;

/// A part of a space as it is sent to the rank that works on it.
#[derive(Clone, Debug, PartialEq)]
pub struct SpacePart {
    /// Its cells or facets, those of the part of the mesh.
    pub support: Support,
    /// Polynomial degree.
    pub degree: usize,
    /// Continuous or discontinuous.
    pub family: Family,
    /// By cell or facet, in its local order, the nodes as the whole space numbers them.
    pub nodes: Vec<u32>,
    /// Number of nodes of the whole space.
    pub n_nodes: usize,
    /// The faces along which it is split.
    pub torn: Vec<FacetRef>,
}

/// What a rank that has a part of a space alone knows of the whole one.
#[derive(Clone, Debug)]
pub(super) struct OfWhole {
    /// By node its number in the whole space, increasing.
    numbers: Vec<u32>,
    n_nodes: usize,
}

impl Space {
    /// The part of a whole space that lies in a part of the mesh.
    #[must_use]
    pub fn cut(&self, places: &PlacesInPart) -> SpacePart {
        let mut nodes = Vec::new();
        let mut keep = |position: usize| nodes.extend_from_slice(self.entity_nodes(position));
        let support = match &self.support {
            Support::Cells(cells) => {
                let kept = cells.iter().enumerate().filter_map(|(k, cell)| Some((k, places.cell(*cell)?)));
                Support::Cells(kept.inspect(|(k, _)| keep(*k)).map(|(_, cell)| cell).collect())
            }
            Support::Facets(facets) => {
                let kept = facets.iter().enumerate().filter_map(|(k, facet)| Some((k, places.facet(*facet)?)));
                Support::Facets(kept.inspect(|(k, _)| keep(*k)).map(|(_, facet)| facet).collect())
            }
            Support::Edges(edges) => {
                let cut = |edge: &FaceEdge| Some(FaceEdge { face: places.facet(edge.face)?, ..*edge });
                let kept = edges.iter().enumerate().filter_map(|(k, edge)| Some((k, cut(edge)?)));
                Support::Edges(kept.inspect(|(k, _)| keep(*k)).map(|(_, edge)| edge).collect())
            }
        };
        let torn = self.torn.iter().filter_map(|facet| places.facet(*facet)).collect();
        SpacePart { support, degree: self.degree, family: self.family, nodes, n_nodes: self.n_nodes(), torn }
    }

    /// The space of a rank that has a part alone.
    ///
    /// # Errors
    /// [`ElementError`] when an entity has no element of this degree.
    ///
    /// # Panics
    /// Where the nodes are not those of the entities.
    pub fn of_part(mesh: &Mesh, topology: &Topology, part: SpacePart) -> Result<Space, ElementError> {
        let SpacePart { support, degree, family, nodes, n_nodes, torn } = part;
        let kinds: Vec<CellKind> = match &support {
            Support::Cells(cells) => cells.iter().map(|cell| mesh.kind(*cell)).collect(),
            Support::Facets(facets) => facets.iter().map(|facet| mesh.facet_kind(*facet)).collect(),
            Support::Edges(edges) => edges.iter().map(|edge| mesh.edge_kind(*edge)).collect(),
        };
        let mut space = Space::empty(kinds, support, degree, family)?;
        let mut numbers = nodes.clone();
        numbers.sort_unstable();
        numbers.dedup();
        let place = |node: &u32| numbers.partition_point(|n| n < node) as u32;
        space.nodes = Arc::new(nodes.iter().map(place).collect());
        for position in 0..space.kinds.len() {
            let end = space.starts[position] + space.element_at(position).n_dofs();
            space.starts.push(end);
        }
        assert_eq!(space.starts.last(), Some(&space.nodes.len()), "nodes of the entities");
        space.coordinates = vec![[0.0; 3]; numbers.len()];
        space.index_positions(mesh);
        space.find_entities(mesh, topology);
        space.see_from_behind(mesh, topology);
        space.torn_ids = torn.iter().map(|facet| topology.facet_id(*facet)).collect();
        (space.torn, space.of_whole) = (torn, Some(OfWhole { numbers, n_nodes }));
        Ok(space)
    }

    /// Coordinates of the nodes, and the nodes of each mesh entity.
    fn find_entities(&mut self, mesh: &Mesh, topology: &Topology) {
        let with_edges = mesh.dim() == 3 && self.degree > 1 && self.family == Family::Continuous;
        let context = Context { mesh, topology, edges: with_edges.then(|| topology.edges(mesh)) };
        let mut numbering = Numbering {
            vertices: vec![NONE; mesh.n_nodes()],
            edges: vec![NONE; context.edges.map_or(0, |table| table.edges().len())],
            facets: vec![NONE; if self.degree > 1 { topology.n_facets() } else { 0 }],
            n_nodes: self.coordinates.len() as u32,
        };
        let tabulate = |element: &Element| mesh.geometry_element(element.kind()).tabulate(element.points(), 0);
        let tables: Vec<_> = self.elements.iter().map(|element| element.as_ref().map(tabulate)).collect();
        let mut at_vertices = Vec::new();
        let elements = std::mem::take(&mut self.elements);
        for position in 0..self.kinds.len() {
            let kind = self.kinds[position].index();
            let (Some(element), Some(table)) = (&elements[kind], &tables[kind]) else {
                unreachable!("there is an element for every kind of the support");
            };
            for (dof, entity) in element.entities().iter().enumerate() {
                let node = self.nodes[self.starts[position] + dof];
                let (key, x) = match &self.support {
                    Support::Cells(cells) => {
                        let cell = cells[position];
                        (context.cell_key(cell, element, *entity), mesh.point_at(cell, table, dof))
                    }
                    Support::Facets(facets) => {
                        let facet = facets[position];
                        (context.facet_key(facet, element, *entity), mesh.facet_point_at(facet, table, dof))
                    }
                    Support::Edges(edges) => {
                        let edge = edges[position];
                        (context.edge_key(edge, *entity), mesh.node(mesh.edge_ends(edge)[dof]))
                    }
                };
                self.coordinates[node as usize] = x;
                let slot = match key.entity {
                    Entity::Vertex(vertex) => {
                        at_vertices.push((vertex, node));
                        continue;
                    }
                    Entity::Edge(edge) => &mut numbering.edges[edge],
                    Entity::Facet(facet) => &mut numbering.facets[facet],
                    Entity::Own => continue,
                };
                // nodes of an entity follow each other
                *slot = node.saturating_sub(key.index as u32);
            }
        }
        self.elements = elements;
        // at a split a vertex has a node for each side
        at_vertices.sort_unstable();
        at_vertices.dedup();
        for (vertex, node) in at_vertices {
            match &mut numbering.vertices[vertex] {
                slot if *slot == NONE => *slot = node,
                first => self.copies.push((*first, node)),
            }
        }
        self.numbering = numbering;
    }

    /// The number of a node in the whole space.
    #[must_use]
    #[inline]
    pub fn node_number(&self, node: usize) -> usize {
        self.of_whole.as_ref().map_or(node, |whole| whole.numbers[node] as usize)
    }

    /// The node with this number in the whole space, where this rank has it.
    #[must_use]
    pub fn numbered_node(&self, number: usize) -> Option<usize> {
        match &self.of_whole {
            None => (number < self.n_nodes()).then_some(number),
            Some(whole) => whole.numbers.binary_search(&u32::try_from(number).ok()?).ok(),
        }
    }

    /// Number of nodes of the whole space.
    #[must_use]
    pub fn n_nodes_of_whole(&self) -> usize {
        self.of_whole.as_ref().map_or(self.n_nodes(), |whole| whole.n_nodes)
    }
}
