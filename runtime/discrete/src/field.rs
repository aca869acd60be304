//! Fields of a scene: a name, components, and nodes only where the field's region is.

use std::sync::Arc;

use thiserror::Error;
use wfl_compiler::types::{FieldKind, Side};

use crate::{
    domain::{Group, GroupSide, table_of_each},
    point_space::PointSpace,
    space::{NodeList, Space, Support},
};
use wfl_mesh::{
    element::{Element, Table},
    mesh::{CellId, FaceEdge, FacetRef, Mesh, RegionSet, Topology, direction},
};

/// Where a field has its nodes.
#[derive(Clone, Debug)]
pub enum FieldSpace {
    /// Nodes of a space on cells or facets.
    Nodal(Arc<Space>),
    /// One node: one value for the whole scene.
    Global,
    /// One node at each integration point of a region.
    Points(PointSpace),
}

/// A field: nodes with components.
#[derive(Clone, Debug)]
pub struct Field {
    /// Its name in the scene.
    pub name: String,
    /// Unknown, multiplier, data or state.
    pub kind: FieldKind,
    /// Numbers at a node.
    pub n_components: usize,
    /// Where the nodes are.
    pub space: FieldSpace,
}

/// A field is evaluated where it has no nodes.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FieldError {
    /// No cell or facet of the field here.
    #[error("`{field}` has no degrees of freedom on {place}")]
    NotHere {
        /// The field.
        field: String,
        /// Where it was evaluated.
        place: String,
    },
    /// A field of integration points is evaluated at other points.
    #[error("`{field}` lives at integration points, and the points used here are others")]
    OtherPoints {
        /// The field.
        field: String,
    },
}

/// Basis and nodes of a field on a group.
#[derive(Clone, Debug, Default)]
pub struct Tabulated {
    /// Values and reference derivatives at the points of the group: those of a field on facets in the parameters of the
    /// facet, one fewer than space has dimensions.
    pub table: Table,
    /// Of a field on facets: derivatives of the reference point of the cell in those parameters.
    pub tangents: Option<[[f64; 3]; 2]>,
    /// `nodes[entity * n_nodes + i]`
    pub nodes: NodeList,
    /// Where entities are points: by entity its row of the table; else empty.
    pub rows: Arc<[u32]>,
    /// By entity how many of its nodes are its own, the others stand in; empty where all are.
    pub counts: Vec<u16>,
    /// By entity the tangents, where they differ; else empty.
    pub own_tangents: Vec<[[f64; 3]; 2]>,
}

impl Field {
    /// Number of nodes.
    #[must_use]
    #[inline]
    pub fn n_nodes(&self) -> usize {
        match &self.space {
            FieldSpace::Nodal(space) => space.n_nodes(),
            FieldSpace::Global => 1,
            FieldSpace::Points(space) => space.coordinates().len(),
        }
    }

    /// Number of nodes on all ranks.
    #[must_use]
    pub fn n_nodes_of_whole(&self) -> usize {
        match &self.space {
            FieldSpace::Nodal(space) => space.n_nodes_of_whole(),
            FieldSpace::Global | FieldSpace::Points(_) => self.n_nodes(),
        }
    }

    /// What all ranks call a node.
    #[must_use]
    pub fn node_number(&self, node: usize) -> usize {
        match &self.space {
            FieldSpace::Nodal(space) => space.node_number(node),
            FieldSpace::Global | FieldSpace::Points(_) => node,
        }
    }

    /// The node that all ranks call so, where this rank has it.
    #[must_use]
    pub fn numbered_node(&self, number: usize) -> Option<usize> {
        match &self.space {
            FieldSpace::Nodal(space) => space.numbered_node(number),
            FieldSpace::Global | FieldSpace::Points(_) => (number < self.n_nodes()).then_some(number),
        }
    }

    /// Polynomial degree; 0 for a global field and at integration points.
    #[must_use]
    pub fn degree(&self) -> usize {
        match &self.space {
            FieldSpace::Nodal(space) => space.degree(),
            FieldSpace::Global | FieldSpace::Points(_) => 0,
        }
    }

    /// Number of values: nodes times components.
    #[must_use]
    #[inline]
    pub fn n_dofs(&self) -> usize {
        self.n_nodes() * self.n_components
    }

    /// True if it lives at integration points.
    #[must_use]
    pub fn is_at_points(&self) -> bool {
        matches!(self.space, FieldSpace::Points(_))
    }

    /// Position of a node; the origin for a global field.
    #[must_use]
    pub fn node_position(&self, node: usize) -> [f64; 3] {
        match &self.space {
            FieldSpace::Nodal(space) => space.node_coordinates()[node],
            FieldSpace::Global => [0.0; 3],
            FieldSpace::Points(space) => space.coordinates()[node],
        }
    }

    /// True if the field has nodes in this cell.
    #[must_use]
    pub fn lives_in_cell(&self, cell: CellId) -> bool {
        match &self.space {
            FieldSpace::Nodal(space) => space.position_of_cell(cell).is_some(),
            FieldSpace::Global => true,
            FieldSpace::Points(space) => space.has_cell(cell),
        }
    }

    /// True if the field has nodes on this facet, as seen from its cell.
    #[must_use]
    pub fn lives_on_facet(&self, facet: FacetRef) -> bool {
        match &self.space {
            FieldSpace::Nodal(space) => match space.support() {
                Support::Cells(_) => space.position_of_cell(facet.cell).is_some(),
                Support::Facets(_) => space.on_facet(facet).is_some(),
                Support::Edges(_) => false,
            },
            FieldSpace::Global => true,
            FieldSpace::Points(space) => space.has_facet(facet),
        }
    }

    /// True if the field has values on this edge: one of edges has them there, others where they live on its face.
    #[must_use]
    pub fn lives_on_edge(&self, edge: FaceEdge) -> bool {
        match &self.space {
            FieldSpace::Nodal(space) if matches!(space.support(), Support::Edges(_)) => {
                space.on_edge(edge.face, edge.local).is_some()
            }
            _ => self.lives_on_facet(edge.face),
        }
    }

    /// Sorted nodes of the field in a region.
    #[must_use]
    pub fn nodes_in(&self, mesh: &Mesh, topology: &Topology, region: &RegionSet) -> Vec<u32> {
        let space = match &self.space {
            FieldSpace::Nodal(space) => space,
            FieldSpace::Global => return vec![0],
            FieldSpace::Points(_) => return Vec::new(),
        };
        match region {
            RegionSet::Cells(cells) => {
                let mut nodes: Vec<u32> = cells
                    .iter()
                    .filter_map(|c| space.position_of_cell(*c))
                    .flat_map(|p| space.entity_nodes(p).iter().copied())
                    .collect();
                nodes.sort_unstable();
                nodes.dedup();
                nodes
            }
            RegionSet::Facets(facets) => space.nodes_on_facets(mesh, topology, facets),
            RegionSet::Interface(pairs) => {
                let facets: Vec<FacetRef> = pairs.iter().flat_map(|p| [p.here, p.there]).collect();
                space.nodes_on_facets(mesh, topology, &facets)
            }
            RegionSet::Edges(edges) => space.nodes_on_edges(mesh, edges),
            RegionSet::Nodes(nodes) => space.nodes_at_mesh_nodes(mesh, nodes),
        }
    }

    /// Basis tables and nodes of the field on one side of a group of a domain.
    ///
    /// # Errors
    /// [`FieldError`] where the field has no nodes.
    pub fn tabulate(&self, mesh: &Mesh, group: &Group, side: Side, order: usize) -> Result<Tabulated, FieldError> {
        let n = group.entities.len();
        if let FieldSpace::Points(space) = &self.space {
            let found = if side == Side::Here && order == 0 { space.tabulate(mesh.dim(), group) } else { None };
            let (table, nodes) = found.ok_or_else(|| FieldError::OtherPoints { field: self.name.clone() })?;
            return Ok(Tabulated { table, nodes: nodes.into(), rows: group.one_row(), ..Tabulated::default() });
        }
        let FieldSpace::Nodal(space) = &self.space else {
            let points = group.n_points();
            let table =
                Table { n_points: points, n_dofs: 1, dim: mesh.dim(), values: vec![1.0; points], ..Table::default() };
            return Ok(Tabulated { table, nodes: vec![0; n].into(), rows: group.one_row(), ..Tabulated::default() });
        };
        if side == Side::There && group.own.is_some() {
            return self.tabulate_images(mesh, group.side(side), space, order);
        }
        let rows = Arc::clone(&group.side(side).rows);
        let data = group.side(side);
        let edge = if side == Side::Here { group.edge } else { group.edge_there };
        if matches!(space.support(), Support::Cells(_)) {
            return self.tabulate_on_cells(data, space, order);
        }
        let mut all = None;
        for k in 0..n {
            let facet = data.facets.get(k);
            let found = match space.support() {
                Support::Cells(_) => None,
                Support::Facets(_) => facet.and_then(|f| space.on_facet(*f)),
                Support::Edges(_) => facet.zip(edge).and_then(|(f, edge)| space.on_edge(*f, edge.local)),
            };
            let (of_entity, its_nodes) = found.ok_or_else(|| self.not_here(data.cells[k]))?;
            let (_, nodes) = all.get_or_insert_with(|| (of_entity, Vec::with_capacity(n * its_nodes.len())));
            nodes.extend_from_slice(its_nodes);
        }
        let Some((element, nodes)) = all else { return Ok(Tabulated::default()) };
        let nodes = NodeList::from(nodes);
        // the points of the other side are those of this one in the parameters of its own facets
        let map = data.facet_map();
        let parameters = match side {
            Side::Here => group.parameters.clone(),
            Side::There => data.points.iter().map(|x| map.parameters(*x)).collect(),
        };
        let (Support::Edges(_), Some(edge)) = (space.support(), edge) else {
            let (table, tangents) = (element.tabulate(&parameters, order), Some(map.tangents));
            return Ok(Tabulated { table, tangents, nodes, rows, ..Tabulated::default() });
        };
        let facet = data.facets.first().map_or(0, |facet| usize::from(facet.local));
        let of_edge = data.kind.facets()[facet].kind.facet_map(usize::from(edge.local));
        let parameters: Vec<[f64; 3]> = parameters.iter().map(|x| of_edge.parameters(*x)).collect();
        let tangents = [direction(data.kind, facet, usize::from(edge.local)), [0.0; 3]];
        let (table, tangents) = (element.tabulate(&parameters, order), Some(tangents));
        Ok(Tabulated { table, tangents, nodes, rows, ..Tabulated::default() })
    }

    fn not_here(&self, cell: CellId) -> FieldError {
        FieldError::NotHere { field: self.name.clone(), place: format!("cell {}", cell.index()) }
    }

    /// The same for a field on cells.
    fn tabulate_on_cells(&self, data: &GroupSide, space: &Space, order: usize) -> Result<Tabulated, FieldError> {
        let Some(first) = data.cells.first() else { return Ok(Tabulated::default()) };
        let (Some(element), Some(nodes)) = (space.element(data.kind), space.nodes_of_cells(&data.cells)) else {
            let lacks = |cell: &&CellId| space.position_of_cell(**cell).is_none();
            return Err(self.not_here(*data.cells.iter().find(lacks).unwrap_or(first)));
        };
        let (table, rows) = (element.tabulate(&data.points, order), Arc::clone(&data.rows));
        Ok(Tabulated { table, nodes, rows, ..Tabulated::default() })
    }

    /// The same for the images of points, each in a cell of its own.
    fn tabulate_images(
        &self,
        mesh: &Mesh,
        images: &GroupSide,
        space: &Space,
        order: usize,
    ) -> Result<Tabulated, FieldError> {
        let n = images.cells.len();
        let place = |k: usize| match space.support() {
            Support::Cells(_) => {
                let position = space.position_of_cell(images.cells[k]);
                position.map(|p| (space.element_at(p), space.entity_nodes(p)))
            }
            Support::Facets(_) => images.facets.get(k).and_then(|facet| space.on_facet(*facet)),
            Support::Edges(_) => None,
        };
        let found: Vec<(&Element, &[u32])> =
            (0..n).map(|k| place(k).ok_or_else(|| self.not_here(images.cells[k]))).collect::<Result<_, _>>()?;
        let width = found.iter().map(|(_, nodes)| nodes.len()).max().unwrap_or(0);
        let mut nodes = Vec::with_capacity(n * width);
        for (_, own) in &found {
            nodes.extend_from_slice(own);
            nodes.extend(std::iter::repeat_n(own[0], width - own.len()));
        }
        let counts: Vec<u16> = found.iter().map(|f| u16::try_from(f.1.len()).expect("few functions")).collect();
        let are_all = counts.iter().all(|count| usize::from(*count) == width);
        let counts = if are_all { Vec::new() } else { counts };
        let (rows, nodes) = (Arc::clone(&images.rows), NodeList::from(nodes));
        let element = |k: usize| found[k].0;
        if matches!(space.support(), Support::Cells(_)) {
            let table = table_of_each(n, element, |k| images.points[k], order);
            return Ok(Tabulated { table, nodes, rows, counts, ..Tabulated::default() });
        }
        let map = |k: usize| mesh.kind(images.cells[k]).facet_map(usize::from(images.facets[k].local));
        let table = table_of_each(n, element, |k| map(k).parameters(images.points[k]), order);
        let own_tangents: Vec<[[f64; 3]; 2]> = (0..n).map(|k| map(k).tangents).collect();
        let tangents = own_tangents.first().copied();
        Ok(Tabulated { table, tangents, nodes, rows, counts, own_tangents })
    }
}
