//! Scalar node numbering of a field on the cells or facets it lives on.
//!
//! Promises: nodes exist only where the field lives; numbers follow first appearance in the order
//! of the given cells or facets, so neighbours stay near; two cells that share an entity number its
//! dofs alike for any local orientation (dofs along an edge run from its vertex of lower
//! number, those inside a quadrilateral from its lowest vertex, first towards the lower neighbour). Does not know components, values or constraints.

mod mesh_nodes;
mod node_list;
mod part;
mod split;

pub use node_list::NodeList;
use part::OfWhole;
pub use part::SpacePart;

use std::{collections::BTreeSet, sync::Arc};

use wfl_mesh::element::{DofEntity, Element, ElementError, Family};
use wfl_mesh::mesh::{CellId, CellKind, EdgeTable, FaceEdge, FacetId, FacetRef, Mesh, NodeId, Topology};
use wfl_sparse::index::NONE;

/// Where a space lives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Support {
    /// On cells, in this order.
    Cells(Vec<CellId>),
    /// On facets, in this order, each in the parameters of its own side.
    Facets(Vec<FacetRef>),
    /// On edges of facets, in this order; each facet that meets there has the edge.
    Edges(Vec<FaceEdge>),
}

/// A scalar Lagrange space on part of a mesh. Its nodes carry one value a component; a position is
/// a place in the list of cells or facets it was made on.
#[derive(Clone, Debug)]
pub struct Space {
    degree: usize,
    family: Family,
    support: Support,
    kinds: Vec<CellKind>,
    starts: Vec<usize>,
    nodes: Arc<Vec<u32>>,
    coordinates: Vec<[f64; 3]>,
    /// Position of each cell of the mesh; empty for a space on facets.
    position_of_cell: Vec<u32>,
    /// Facets of the support with their positions, sorted; empty for a space on cells.
    position_of_facet: Vec<(FacetRef, u32)>,
    /// Edges of the support with their positions, sorted; empty for other spaces.
    position_of_edge: Vec<((FacetRef, u8), u32)>,
    /// The other sides of those facets that have one, with their nodes as seen from there, sorted.
    behind: Vec<(FacetRef, Vec<u32>)>,
    elements: Vec<Option<Element>>,
    numbering: Numbering,
    /// Nodes at the split and their copies, sorted; empty unless the space is split.
    copies: Vec<(u32, u32)>,
    /// The faces along which it is split.
    torn: Vec<FacetRef>,
    torn_ids: BTreeSet<FacetId>,
    /// Where this rank has a part of the space alone.
    of_whole: Option<OfWhole>,
}

/// First node of each mesh entity, `NONE` where there is none.
#[derive(Clone, Debug, Default)]
struct Numbering {
    vertices: Vec<u32>,
    edges: Vec<u32>,
    facets: Vec<u32>,
    n_nodes: u32,
}

/// A mesh entity that carries dofs.
#[derive(Clone, Copy)]
enum Entity {
    Vertex(usize),
    Edge(usize),
    Facet(usize),
    /// Interior of the position, nobody else's.
    Own,
}

/// One dof of a position: its entity, its place there and the number of dofs there.
#[derive(Clone, Copy)]
struct DofKey {
    entity: Entity,
    index: usize,
    count: usize,
}

/// The mesh with what the numbering looks up.
#[derive(Clone, Copy)]
struct Context<'a> {
    mesh: &'a Mesh,
    topology: &'a Topology,
    /// Only in three dimensions with dofs on edges.
    edges: Option<&'a EdgeTable>,
}

impl Space {
    /// The space of `degree` on `cells` (each at most once): `P_k` on simplices, `Q_k` on tensor
    /// cells. Degree 0 is discontinuous for every `family`.
    ///
    /// # Errors
    /// [`ElementError`] when a cell has no element of this degree.
    pub fn on_cells(
        mesh: &Mesh,
        topology: &Topology,
        cells: &[CellId],
        degree: usize,
        family: Family,
    ) -> Result<Space, ElementError> {
        let kinds: Vec<CellKind> = cells.iter().map(|cell| mesh.kind(*cell)).collect();
        let mut space = Space::empty(kinds, Support::Cells(cells.to_vec()), degree, family)?;
        space.number(mesh, topology);
        Ok(space)
    }

    /// The trace space of `degree` on `facets` (each at most once): dofs on the entities of these
    /// facets only. Local order: the Lagrange element of the facet's kind in the facet's own
    /// parameters, seen from the given side.
    ///
    /// # Errors
    /// [`ElementError`] when a facet has no element of this degree.
    pub fn on_facets(
        mesh: &Mesh,
        topology: &Topology,
        facets: &[FacetRef],
        degree: usize,
        family: Family,
    ) -> Result<Space, ElementError> {
        let kinds: Vec<CellKind> = facets.iter().map(|f| mesh.facet_kind(*f)).collect();
        let mut space = Space::empty(kinds, Support::Facets(facets.to_vec()), degree, family)?;
        space.number(mesh, topology);
        space.see_from_behind(mesh, topology);
        Ok(space)
    }

    /// The continuous space of degree one on edges of facets: in space with the ends of the edges for nodes, in the plane
    /// with the points where lines end or meet. Facets that meet at an edge have its nodes in common.
    ///
    /// # Errors
    /// [`ElementError`] when an edge has no element.
    pub fn on_edges(mesh: &Mesh, topology: &Topology, edges: &[FaceEdge]) -> Result<Space, ElementError> {
        let kinds: Vec<CellKind> = edges.iter().map(|edge| mesh.edge_kind(*edge)).collect();
        let mut space = Space::empty(kinds, Support::Edges(edges.to_vec()), 1, Family::Continuous)?;
        space.number(mesh, topology);
        Ok(space)
    }

    fn empty(kinds: Vec<CellKind>, support: Support, degree: usize, family: Family) -> Result<Space, ElementError> {
        let family = if degree == 0 { Family::Discontinuous } else { family };
        let mut elements = vec![None; CellKind::ALL.len()];
        for kind in &kinds {
            if elements[kind.index()].is_none() {
                elements[kind.index()] = Some(Element::lagrange(*kind, degree, family)?);
            }
        }
        Ok(Space {
            degree,
            family,
            support,
            kinds,
            starts: vec![0],
            nodes: Arc::default(),
            coordinates: Vec::new(),
            position_of_cell: Vec::new(),
            position_of_facet: Vec::new(),
            position_of_edge: Vec::new(),
            behind: Vec::new(),
            elements,
            numbering: Numbering::default(),
            copies: Vec::new(),
            torn: Vec::new(),
            torn_ids: BTreeSet::new(),
            of_whole: None,
        })
    }

    fn number(&mut self, mesh: &Mesh, topology: &Topology) {
        let with_edges = mesh.dim() == 3 && self.degree > 1 && self.family == Family::Continuous;
        let edges = with_edges.then(|| topology.edges(mesh));
        let context = Context { mesh, topology, edges };
        self.numbering = Numbering {
            vertices: vec![NONE; mesh.n_nodes()],
            edges: vec![NONE; edges.map_or(0, |table| table.edges().len())],
            facets: vec![NONE; if self.degree > 1 { topology.n_facets() } else { 0 }],
            n_nodes: 0,
        };
        self.index_positions(mesh);
        let tables: Vec<Option<wfl_mesh::element::Table>> = self
            .elements
            .iter()
            .map(|element| {
                let element = element.as_ref()?;
                let geometry = mesh.geometry_element(element.kind());
                Some(geometry.tabulate(element.points(), 0))
            })
            .collect();
        let (elements, mut nodes) = (std::mem::take(&mut self.elements), Vec::new());
        for position in 0..self.kinds.len() {
            let kind = self.kinds[position].index();
            let (Some(element), Some(table)) = (&elements[kind], &tables[kind]) else {
                unreachable!("there is an element for every kind of the support");
            };
            self.number_position(context, position, element, table, &mut nodes);
        }
        nodes.shrink_to_fit();
        self.coordinates.shrink_to_fit();
        (self.elements, self.nodes) = (elements, Arc::new(nodes));
    }

    fn index_positions(&mut self, mesh: &Mesh) {
        match &self.support {
            Support::Cells(cells) => {
                self.position_of_cell = vec![NONE; mesh.n_cells()];
                for (position, cell) in cells.iter().enumerate() {
                    self.position_of_cell[cell.index()] = position as u32;
                }
            }
            Support::Facets(facets) => {
                self.position_of_facet = facets.iter().copied().zip(0..).collect();
                self.position_of_facet.sort_unstable();
            }
            Support::Edges(edges) => {
                self.position_of_edge = edges.iter().map(|edge| (edge.face, edge.local)).zip(0..).collect();
                self.position_of_edge.sort_unstable();
            }
        }
    }

    fn number_position(
        &mut self,
        context: Context<'_>,
        position: usize,
        element: &Element,
        table: &wfl_mesh::element::Table,
        nodes: &mut Vec<u32>,
    ) {
        let mut own = NONE;
        for (dof, entity) in element.entities().iter().enumerate() {
            let key = match &self.support {
                Support::Cells(cells) => context.cell_key(cells[position], element, *entity),
                Support::Facets(facets) => context.facet_key(facets[position], element, *entity),
                Support::Edges(edges) => context.edge_key(edges[position], *entity),
            };
            let node = self.numbering.node(key, &mut own);
            nodes.push(node);
            if node as usize >= self.coordinates.len() {
                self.coordinates.resize(node as usize + 1, [f64::NAN; 3]);
            }
            if self.coordinates[node as usize][0].is_nan() {
                self.coordinates[node as usize] = match &self.support {
                    Support::Cells(cells) => context.mesh.point_at(cells[position], table, dof),
                    Support::Facets(facets) => context.mesh.facet_point_at(facets[position], table, dof),
                    Support::Edges(edges) => context.mesh.node(context.mesh.edge_ends(edges[position])[dof]),
                };
            }
        }
        self.starts.push(nodes.len());
    }

    /// Polynomial degree.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Continuous or discontinuous.
    #[must_use]
    pub fn family(&self) -> Family {
        self.family
    }

    /// The cells or facets the space was made on.
    #[must_use]
    #[inline]
    pub fn support(&self) -> &Support {
        &self.support
    }

    /// Number of nodes.
    #[must_use]
    #[inline]
    pub fn n_nodes(&self) -> usize {
        self.coordinates.len()
    }

    /// Number of cells or facets of the support.
    #[must_use]
    #[inline]
    pub fn n_positions(&self) -> usize {
        self.kinds.len()
    }

    /// Nodes of the cell or facet at `position`, in the local order of [`Space::element_at`].
    #[must_use]
    #[inline]
    pub fn entity_nodes(&self, position: usize) -> &[u32] {
        &self.nodes[self.starts[position]..self.starts[position + 1]]
    }

    /// Element of the cell or facet at `position`.
    #[must_use]
    #[inline]
    pub fn element_at(&self, position: usize) -> &Element {
        self.elements[self.kinds[position].index()].as_ref().expect("there is an element for every kind of the support")
    }

    /// Element of `kind`, when the support has such cells or facets.
    #[must_use]
    pub fn element(&self, kind: CellKind) -> Option<&Element> {
        self.elements[kind.index()].as_ref()
    }

    /// Position of a cell in the support; `None` also for spaces on facets.
    #[must_use]
    pub fn position_of_cell(&self, cell: CellId) -> Option<usize> {
        let position = *self.position_of_cell.get(cell.index())?;
        (position != NONE).then_some(position as usize)
    }

    /// Position of a facet (as given, the side counts) in the support; `None` also for spaces on
    /// cells.
    #[must_use]
    pub fn position_of_facet(&self, facet: FacetRef) -> Option<usize> {
        let find = |entry: &(FacetRef, u32)| entry.0;
        let place = self.position_of_facet.binary_search_by_key(&facet, find).ok()?;
        Some(self.position_of_facet[place].1 as usize)
    }

    /// Element and nodes of a facet of the support, in the parameters of the side that is named: a field on facets has one
    /// value, from whichever cell it is seen. `None` also for spaces on cells.
    #[must_use]
    pub fn on_facet(&self, facet: FacetRef) -> Option<(&Element, &[u32])> {
        if let Some(position) = self.position_of_facet(facet) {
            return Some((self.element_at(position), self.entity_nodes(position)));
        }
        let place = self.behind.binary_search_by_key(&facet, |entry| entry.0).ok()?;
        let nodes = &self.behind[place].1;
        self.elements.iter().flatten().find(|e| e.n_dofs() == nodes.len()).map(|e| (e, nodes.as_slice()))
    }

    /// Element and nodes of an edge of a facet of the support, in the parameter of the edge; `None` for other spaces.
    #[must_use]
    pub fn on_edge(&self, facet: FacetRef, local: u8) -> Option<(&Element, &[u32])> {
        let place = self.position_of_edge.binary_search_by_key(&(facet, local), |entry| entry.0).ok()?;
        let position = self.position_of_edge[place].1 as usize;
        Some((self.element_at(position), self.entity_nodes(position)))
    }

    /// Finds the nodes of the other sides of the facets, which are where those of the facets are.
    fn see_from_behind(&mut self, mesh: &Mesh, topology: &Topology) {
        let Support::Facets(facets) = &self.support else { return };
        let mut behind = Vec::new();
        for (position, facet) in facets.iter().enumerate() {
            let Some(opposite) = topology.opposite(*facet).filter(|o| self.position_of_facet(*o).is_none()) else {
                continue;
            };
            let (element, own) = (self.element_at(position), self.entity_nodes(position));
            let table = mesh.geometry_element(element.kind()).tabulate(element.points(), 0);
            let nearest = |dof: usize| {
                let x = mesh.facet_point_at(opposite, &table, dof);
                let gap = |node: &u32| {
                    let y = self.coordinates[*node as usize];
                    (0..3).map(|d| (x[d] - y[d]) * (x[d] - y[d])).sum::<f64>()
                };
                own.iter().copied().min_by(|a, b| gap(a).total_cmp(&gap(b)))
            };
            behind.push((opposite, (0..own.len()).filter_map(nearest).collect()));
        }
        behind.sort_unstable();
        self.behind = behind;
    }

    /// Physical coordinates of the nodes.
    #[must_use]
    #[inline]
    pub fn node_coordinates(&self) -> &[[f64; 3]] {
        &self.coordinates
    }

    /// Sorted nodes in the closure of `facets`. A space on cells gives the nodes of the cell whose facet is named, or,
    /// where that is not its own, of the cell beyond: a facet that only touches its cells at an edge has none. A
    /// continuous space on facets is matched by mesh entities (vertices, edges, facets), also where only the rim
    /// touches; a discontinuous one gives all nodes of the facet, whichever side is named.
    #[must_use]
    pub fn nodes_on_facets(&self, mesh: &Mesh, topology: &Topology, facets: &[FacetRef]) -> Vec<u32> {
        let mut found = Vec::new();
        for facet in facets {
            match (&self.support, self.family) {
                (Support::Facets(_), Family::Continuous) => self.shared_nodes(mesh, topology, *facet, &mut found),
                _ => self.own_nodes(topology, *facet, &mut found),
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The same of edges of faces: of spaces on faces also the nodes between their ends.
    #[must_use]
    pub fn nodes_on_edges(&self, mesh: &Mesh, edges: &[FaceEdge]) -> Vec<u32> {
        let ends: BTreeSet<NodeId> = edges.iter().flat_map(|edge| mesh.edge_ends(*edge)).collect();
        let mut found = self.nodes_at_mesh_nodes(mesh, &ends.into_iter().collect::<Vec<_>>());
        for edge in edges {
            if let Some((element, nodes)) = self.on_facet(edge.face) {
                let closure = element.facet_closure(usize::from(edge.local));
                found.extend(closure.iter().map(|dof| nodes[*dof]));
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    fn own_nodes(&self, topology: &Topology, facet: FacetRef, found: &mut Vec<u32>) {
        let sides = [Some(facet), topology.opposite(facet)];
        for side in sides.into_iter().flatten() {
            if let Some(position) = self.position_of_cell(side.cell) {
                let closure = self.element_at(position).facet_closure(usize::from(side.local));
                let nodes = self.entity_nodes(position);
                found.extend(closure.iter().map(|dof| nodes[*dof]));
                return;
            }
        }
        for position in sides.into_iter().flatten().filter_map(|f| self.position_of_facet(f)) {
            found.extend_from_slice(self.entity_nodes(position));
        }
    }

    fn shared_nodes(&self, mesh: &Mesh, topology: &Topology, facet: FacetRef, found: &mut Vec<u32>) {
        let kind = mesh.kind(facet.cell);
        let numbering = &self.numbering;
        let mut take = |first: u32, count: usize| {
            if first != NONE {
                found.extend(first..first + count as u32);
            }
        };
        for vertex in mesh.facet_vertices(facet).vertices() {
            take(numbering.vertices[vertex.index()], 1);
        }
        if !numbering.edges.is_empty() {
            let edges = topology.edges(mesh).cell_edges(facet.cell);
            for edge in kind.facet_edges(facet.local as usize) {
                take(numbering.edges[edges[*edge].index()], self.degree - 1);
            }
        }
        if self.degree > 1 && mesh.dim() > 1 {
            let facet_kind = mesh.facet_kind(facet);
            let count = inner_dofs(facet_kind, self.degree);
            take(numbering.facets[topology.facet_id(facet).index()], count);
        }
    }
}

/// Number of dofs inside a facet of `kind`.
fn inner_dofs(kind: CellKind, degree: usize) -> usize {
    match kind {
        CellKind::Segment => degree - 1,
        CellKind::Triangle => (degree - 1) * degree.saturating_sub(2) / 2,
        CellKind::Quadrilateral => (degree - 1) * (degree - 1),
        _ => 0,
    }
}

impl Numbering {
    /// The node of a dof; `own` is the first interior node of the position, set when needed.
    fn node(&mut self, key: DofKey, own: &mut u32) -> u32 {
        let slot = match key.entity {
            Entity::Vertex(vertex) => &mut self.vertices[vertex],
            Entity::Edge(edge) => &mut self.edges[edge],
            Entity::Facet(facet) => &mut self.facets[facet],
            Entity::Own => own,
        };
        if *slot == NONE {
            *slot = self.n_nodes;
            let count = u32::try_from(key.count).expect("an entity carries a few dofs");
            self.n_nodes = self.n_nodes.checked_add(count).expect("fewer than 2^32 nodes");
        }
        *slot + key.index as u32
    }
}

impl Context<'_> {
    fn cell_key(&self, cell: CellId, element: &Element, entity: DofEntity) -> DofKey {
        let kind = element.kind();
        let vertices = self.mesh.cell_vertices(cell);
        let along = element.degree().saturating_sub(1);
        match entity {
            DofEntity::Vertex(vertex) => single(Entity::Vertex(vertices[vertex].index())),
            DofEntity::Interior(index) => DofKey { entity: Entity::Own, index, count: inside(element) },
            DofEntity::Facet { facet, index } => {
                let local = kind.facets()[facet];
                let corners: Vec<NodeId> = local.vertices.iter().map(|v| vertices[*v]).collect();
                DofKey {
                    entity: Entity::Facet(self.topology.cell_facets(cell)[facet].index()),
                    index: inside_facet(local.kind, &corners, index, along),
                    count: inner_dofs(local.kind, element.degree()),
                }
            }
            DofEntity::Edge { edge, index } => {
                let ends = kind.edges()[edge].map(|v| vertices[v]);
                // In two dimensions an edge is a facet and carries its number.
                let entity = match self.edges {
                    Some(table) => Entity::Edge(table.cell_edges(cell)[edge].index()),
                    None => Entity::Facet(self.topology.cell_facets(cell)[edge].index()),
                };
                DofKey { entity, index: oriented(ends, index, along), count: along }
            }
        }
    }

    /// The key of a dof of an element of degree one.
    fn edge_key(&self, edge: FaceEdge, entity: DofEntity) -> DofKey {
        let DofEntity::Vertex(vertex) = entity else { unreachable!("all dofs are at the ends") };
        single(Entity::Vertex(self.mesh.edge_ends(edge)[vertex].index()))
    }

    fn facet_key(&self, facet: FacetRef, element: &Element, entity: DofEntity) -> DofKey {
        let vertices = self.mesh.facet_vertices(facet).vertices;
        let along = element.degree().saturating_sub(1);
        if element.family() == Family::Discontinuous {
            let DofEntity::Interior(index) = entity else {
                unreachable!("all dofs of a discontinuous element are interior");
            };
            return DofKey { entity: Entity::Own, index, count: element.n_dofs() };
        }
        match entity {
            DofEntity::Vertex(vertex) => single(Entity::Vertex(vertices[vertex].index())),
            DofEntity::Edge { edge, index } => {
                let on_cell = self.mesh.kind(facet.cell).facet_edges(facet.local as usize)[edge];
                let table = self.edges.expect("facets with edges are those of 3D cells");
                let ends = element.kind().edges()[edge].map(|v| vertices[v]);
                DofKey {
                    entity: Entity::Edge(table.cell_edges(facet.cell)[on_cell].index()),
                    index: oriented(ends, index, along),
                    count: along,
                }
            }
            DofEntity::Interior(index) | DofEntity::Facet { index, .. } => DofKey {
                entity: Entity::Facet(self.topology.facet_id(facet).index()),
                index: inside_facet(element.kind(), &vertices[..element.kind().n_vertices()], index, along),
                count: inner_dofs(element.kind(), element.degree()),
            },
        }
    }
}

fn single(entity: Entity) -> DofKey {
    DofKey { entity, index: 0, count: 1 }
}

/// Place along an edge counted from its vertex of lower number.
fn oriented(ends: [NodeId; 2], index: usize, count: usize) -> usize {
    if ends[0] < ends[1] { index } else { count - 1 - index }
}

/// Place inside a facet, the same from the cells on both sides: `index` is that in the facet's own parameters, `along` the
/// number of dofs inside an edge.
fn inside_facet(kind: CellKind, corners: &[NodeId], index: usize, along: usize) -> usize {
    match kind {
        CellKind::Segment => oriented([corners[0], corners[1]], index, along),
        CellKind::Quadrilateral => {
            let first = (0..4).min_by_key(|k| corners[*k]).unwrap_or(0);
            let from = |far: bool, place: usize| if far { along - 1 - place } else { place };
            let [x, y] = [from(first & 1 == 1, index % along), from(first & 2 == 2, index / along)];
            if corners[first ^ 1] < corners[first ^ 2] { x + y * along } else { y + x * along }
        }
        CellKind::Triangle => {
            // barycentric places in units of 1/degree, by corners in the order of their numbers
            let degree = along + 1;
            let places = || (1..degree).flat_map(|r| (1..degree.saturating_sub(r)).map(move |s| [s, r]));
            let Some([s, r]) = places().nth(index) else { return index };
            let mut parts = [(corners[0], degree - s - r), (corners[1], s), (corners[2], r)];
            parts.sort_unstable_by_key(|(corner, _)| *corner);
            places().position(|place| place == [parts[1].1, parts[2].1]).unwrap_or(index)
        }
        _ => index,
    }
}

fn inside(element: &Element) -> usize {
    let inner = |entity: &&DofEntity| matches!(entity, DofEntity::Interior(_));
    element.entities().iter().filter(inner).count()
}

#[cfg(test)]
mod tests;
