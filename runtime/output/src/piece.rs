//! One piece of a VTU file: the cells of a body, the facets of an interface, or edges of facets, with sampled expressions.
//!
//! Points are the nodes of a Lagrange space on the piece (degree 1, or 2 where a field has degree 2 or more), shared
//! between neighbours; an expression that jumps between cells (a stress) is averaged over the cells at a point.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use wfl_compiler::types::Shape;
use wfl_discrete::{
    assemble::{Domain, FieldValues},
    field::{Field, FieldError, FieldSpace},
    share::owners_of_space,
    space::{Space, Support},
    value::{Sampled, Value},
    window::Window,
};
use wfl_host::halo::Halo;
use wfl_mesh::{
    element::{ElementError, Family},
    mesh::{CellKind, FaceEdge, FacetRef, Mesh, MeshError, Part, SupportSet, Topology},
    quadrature::Rule,
};

use crate::{Array, Cells, Piece, VtkCell};

/// An expression sampled on a piece.
pub struct Item {
    /// The name of its array.
    pub name: String,
    /// The expression.
    pub value: Value,
    sampled: Sampled,
    /// Its mean over each entity is written, in place of its values at the points of the piece.
    means: bool,
}

/// Points and items of a piece; made once, sampled at each step.
pub struct SampledPiece {
    space: Arc<Space>,
    cells: Cells,
    domain: Arc<Domain>,
    items: Vec<Item>,
    support: SupportSet,
    /// An array that is written again under another name: the item, and the name.
    again: Option<(usize, &'static str)>,
    /// By entity whether this rank writes it, where it does not write all.
    is_written: Option<Vec<bool>>,
    /// Where this rank has a part of the mesh alone: nodes whose owners are other ranks, which have all cells around them.
    halo: Option<Halo>,
}

/// By entity whether it is written: by the rank that counts it, an edge once for all its faces. `None` where all are.
fn written(mesh: &Mesh, space: &Space) -> Option<Vec<bool>> {
    let part = mesh.part().filter(|_| !mesh.is_whole());
    let all = 0..space.n_positions();
    match space.support() {
        Support::Cells(cells) => part.map(|_| all.map(|k| mesh.counts_cell(cells[k])).collect()),
        Support::Facets(facets) => part.map(|_| all.map(|k| mesh.counts_facet(facets[k])).collect()),
        Support::Edges(edges) => {
            let mut seen = BTreeSet::new();
            let is_first = |edge: &FaceEdge| {
                let mut ends = mesh.edge_ends(*edge);
                ends.sort_unstable();
                // the owner of an edge has all its faces
                let is_own = part.is_none_or(|part| usize::from(part.owner(&ends)) == part.team().rank());
                seen.insert(ends) && is_own
            };
            Some(edges.iter().map(is_first).collect())
        }
    }
}

/// The nodes of a piece that other ranks own; made by all ranks together.
fn halo(mesh: &Mesh, part: &Part, space: &Space) -> Halo {
    let place = |position: usize| match space.support() {
        Support::Cells(cells) => (cells[position], [u8::MAX; 2]),
        Support::Facets(facets) => (facets[position].cell, [facets[position].local, u8::MAX]),
        Support::Edges(edges) => (edges[position].face.cell, [edges[position].face.local, edges[position].local]),
    };
    let (owners, own) = (owners_of_space(space, mesh, part), part.team().rank());
    // what an owner is asked: which node of which entity
    let mut copies: BTreeMap<u32, (usize, Vec<u64>)> = BTreeMap::new();
    for position in 0..space.n_positions() {
        let (cell, [local, edge]) = place(position);
        let number = u64::from(mesh.cell_number(cell));
        for (dof, node) in space.entity_nodes(position).iter().enumerate() {
            let rank = usize::from(owners[*node as usize]);
            if rank != own {
                copies
                    .entry(*node)
                    .or_insert_with(|| (rank, vec![number, u64::from(local), u64::from(edge), dof as u64]));
            }
        }
    }
    let find = |words: &[u64]| {
        let cell = mesh.numbered_cell(u32::try_from(words[0]).ok()?)?;
        let nodes = match [words[1], words[2]].map(|word| u8::try_from(word).unwrap_or(u8::MAX)) {
            [u8::MAX, _] => space.entity_nodes(space.position_of_cell(cell)?),
            [local, u8::MAX] => space.entity_nodes(space.position_of_facet(FacetRef { cell, local })?),
            [local, edge] => space.on_edge(FacetRef { cell, local }, edge)?.1,
        };
        nodes.get(usize::try_from(words[3]).ok()?).copied()
    };
    let copies = copies.into_iter().map(|(node, (rank, words))| (node, rank, words));
    Halo::found(&**part.team(), 4, copies, find)
}

impl SampledPiece {
    /// A piece on these entities; `degree` 1 or 2 is that of its VTK cells.
    ///
    /// # Errors
    /// [`ElementError`] or [`MeshError`] when the entities have no such element.
    pub fn new(
        mesh: &Mesh,
        topology: &Topology,
        fields: &[Field],
        support: &SupportSet,
        degree: usize,
    ) -> Result<Self, PieceError> {
        let space = match of_a_field(fields, support, degree) {
            Some(space) => space,
            None => {
                let mut space = space_on(mesh, topology, support, degree)?;
                split_as(&mut space, topology, fields);
                Arc::new(space)
            }
        };
        let rule = |kind: CellKind| {
            let points = space.element(kind).map(|e| e.points().to_vec()).unwrap_or_default();
            Rule { kind, degree: 0, weights: vec![1.0; points.len()], points }
        };
        let domain = Arc::new(Domain::new(mesh, &support.region(), &rule)?);
        let mut cells = Cells::default();
        for position in 0..space.n_positions() {
            let kind = vtk_cell(space.element_at(position).kind(), space.degree());
            cells.push_local(kind, space.entity_nodes(position));
        }
        let halo = mesh.part_of_whole().map(|part| halo(mesh, part, &space));
        let is_written = written(mesh, &space);
        let (items, support) = (Vec::new(), support.clone());
        Ok(Self { space, cells, domain, items, support, again: None, is_written, halo })
    }

    /// Adds an expression under a name.
    ///
    /// # Errors
    /// [`FieldError`] where a field it reads has no dofs.
    pub fn add(&mut self, mesh: &Mesh, fields: &[Field], name: String, value: Value) -> Result<(), FieldError> {
        let sampled = value.bind(mesh, self.domain.clone(), fields)?;
        self.items.push(Item { name, value, sampled, means: false });
        Ok(())
    }

    /// Adds an expression that is known at the points of `domain` only: its mean over each entity of the piece, in
    /// the order of the piece.
    ///
    /// # Errors
    /// [`FieldError`] where a field it reads has no values.
    pub fn add_means(
        &mut self,
        mesh: &Mesh,
        fields: &[Field],
        name: String,
        value: Value,
        domain: Arc<Domain>,
    ) -> Result<(), FieldError> {
        let sampled = value.bind(mesh, domain, fields)?;
        self.items.push(Item { name, value, sampled, means: true });
        Ok(())
    }

    /// Writes the values of an expression at points once more under another name; false if it is not on this piece.
    pub fn write_again(&mut self, name: &str, other: &'static str) -> bool {
        let found = self.items.iter().position(|i| i.name == name && !i.means);
        self.again = found.map(|k| (k, other));
        found.is_some()
    }

    /// The cells, facets or edges it covers.
    #[must_use]
    pub fn support(&self) -> &SupportSet {
        &self.support
    }

    /// True if an expression on it reads the end of the previous step.
    #[must_use]
    pub fn reads_past(&self) -> bool {
        self.items.iter().any(|i| i.value.reads_past())
    }

    /// True if nothing is sampled on it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// About as many bytes as it takes in a file.
    #[must_use]
    pub fn bytes(&self) -> usize {
        const NUMBER: usize = size_of::<f64>();
        let (nodes, entities) = (self.space.n_nodes(), self.space.n_positions());
        let corners: usize = (0..entities).map(|k| self.space.entity_nodes(k).len()).sum();
        // three coordinates; of each cell its nodes, where they end, and a byte for its kind
        let grid = NUMBER * (3 * nodes + corners + entities) + entities;
        let item = |i: &Item| {
            let width = if i.value.n_components() == 2 { 3 } else { i.value.n_components() };
            NUMBER * width * if i.means { entities } else { nodes }
        };
        let again = self.again.iter().map(|(k, _)| item(&self.items[*k]));
        grid + self.items.iter().map(item).chain(again).sum::<usize>()
    }

    /// The entities of a sampled piece that this rank writes: all of them, or those that it counts, and of edges each once.
    #[must_use]
    pub fn written(&self, piece: Piece) -> Piece {
        match &self.is_written {
            Some(is_written) => piece.kept(is_written),
            None => piece,
        }
    }

    /// The piece at a state, with all entities that this rank has; sampled by all ranks together.
    pub fn sample(&self, mesh: &Mesh, window: Window, values: FieldValues<'_>) -> Piece {
        let n = self.space.n_nodes();
        let (mut point_data, mut cell_data) = (Vec::with_capacity(self.items.len()), Vec::new());
        for item in &self.items {
            let value = item.value.at_step(values.with_present_rates(window));
            if item.means {
                cell_data.push(array(&item.name, value.law.shape, item.means(&value, mesh, values)));
                continue;
            }
            let nc = item.value.n_components();
            let (mut sums, mut counts) = (vec![0.0; n * nc], vec![0.0; n]);
            let (domain, space) = (&self.domain, &self.space);
            value.for_each_point(mesh, &item.sampled, values, |g, entity, q, _, value| {
                let position = domain.groups[g].entities[entity];
                let node = space.entity_nodes(position)[q] as usize;
                counts[node] += 1.0;
                for (slot, v) in sums[node * nc..][..nc].iter_mut().zip(value) {
                    *slot += v;
                }
            });
            for (node, count) in counts.iter().enumerate() {
                sums[node * nc..][..nc].iter_mut().for_each(|s| *s /= count);
            }
            if let Some(halo) = &self.halo {
                halo.of_entries(nc).update(mesh.team(), &mut sums);
            }
            point_data.push(array(&item.name, item.value.law.shape, sums));
        }
        let again = self.again.and_then(|(k, other)| {
            let array: &Array = point_data.iter().find(|a: &&Array| a.name == self.items[k].name)?;
            Some(Array { name: other.to_owned(), ..array.clone() })
        });
        point_data.extend(again);
        Piece { points: self.space.node_coordinates().to_vec(), cells: self.cells.clone(), point_data, cell_data }
    }
}

impl Item {
    /// Means over the entities: `out[entity * n_components + component]`.
    fn means(&self, value: &Value, mesh: &Mesh, values: FieldValues<'_>) -> Vec<f64> {
        // images may follow the bodies
        let sampled = self.sampled.at(mesh, values.current);
        let (domain, nc) = (&sampled.domain, value.n_components());
        let (mut sums, mut sizes) = (vec![0.0; domain.n_entities * nc], vec![0.0; domain.n_entities]);
        value.for_each_point(mesh, &sampled, values, |g, k, _, weight, value| {
            let entity = domain.groups[g].entities[k];
            sizes[entity] += weight;
            for (slot, v) in sums[entity * nc..][..nc].iter_mut().zip(value) {
                *slot += weight * v;
            }
        });
        for (sum, size) in sums.chunks_exact_mut(nc.max(1)).zip(&sizes) {
            sum.iter_mut().for_each(|s| *s /= size);
        }
        sums
    }
}

/// The space of a field that has the nodes of a piece: on the same cells, of its degree, and split where any field is.
fn of_a_field(fields: &[Field], support: &SupportSet, degree: usize) -> Option<Arc<Space>> {
    let SupportSet::Cells(cells) = support else { return None };
    let nodal = || {
        fields.iter().filter_map(|field| match &field.space {
            FieldSpace::Nodal(space) => Some(space),
            FieldSpace::Global | FieldSpace::Points(_) => None,
        })
    };
    let is_same = |space: &&Arc<Space>| {
        (space.degree(), space.family()) == (degree, Family::Continuous)
            && matches!(space.support(), Support::Cells(own) if own == cells)
            && nodal().filter(|other| other.is_split()).all(|other| other.torn() == space.torn())
    };
    nodal().find(is_same).cloned()
}

fn space_on(mesh: &Mesh, topology: &Topology, support: &SupportSet, degree: usize) -> Result<Space, ElementError> {
    match support {
        SupportSet::Cells(cells) => Space::on_cells(mesh, topology, cells, degree, Family::Continuous),
        SupportSet::Facets(facets) => Space::on_facets(mesh, topology, facets, degree, Family::Continuous),
        SupportSet::Interface(pairs) => {
            let facets: Vec<FacetRef> = pairs.iter().map(|p| p.here).collect();
            Space::on_facets(mesh, topology, &facets, degree, Family::Continuous)
        }
        SupportSet::Edges(edges) => Space::on_edges(mesh, topology, edges),
    }
}

/// A split field shows its two sides.
pub fn split_as(space: &mut Space, topology: &Topology, fields: &[Field]) {
    for field in fields {
        if let FieldSpace::Nodal(torn) = &field.space
            && torn.is_split()
        {
            space.split(topology, torn.torn());
        }
    }
}

/// Why a piece cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PieceError {
    /// No element of that degree.
    #[error(transparent)]
    Element(#[from] ElementError),
    /// The two sides do not match.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Entries with the first index fastest to an array; matrices become row-major.
pub fn array(name: &str, shape: Shape, values: Vec<f64>) -> Array {
    if shape.rank() != 2 {
        return Array { name: name.to_owned(), components: shape.len(), values };
    }
    let (m, n) = (shape.size(0), shape.size(1));
    let mut rows = Vec::with_capacity(values.len());
    for entry in values.chunks_exact(m * n) {
        rows.extend((0..m).flat_map(|i| (0..n).map(move |j| entry[i + m * j])));
    }
    Array::matrix(name, [m, n], rows)
}

/// The cell of VTK with the nodes of a Lagrange element of degree 1 or 2.
pub fn vtk_cell(kind: CellKind, degree: usize) -> VtkCell {
    match (kind, degree) {
        (CellKind::Point, _) => VtkCell::Vertex,
        (CellKind::Segment, 1) => VtkCell::Line,
        (CellKind::Segment, _) => VtkCell::QuadraticLine,
        (CellKind::Triangle, 1) => VtkCell::Triangle,
        (CellKind::Triangle, _) => VtkCell::QuadraticTriangle,
        (CellKind::Quadrilateral, 1) => VtkCell::Quad,
        (CellKind::Quadrilateral, _) => VtkCell::BiquadraticQuad,
        (CellKind::Tetrahedron, 1) => VtkCell::Tetra,
        (CellKind::Tetrahedron, _) => VtkCell::QuadraticTetra,
        (CellKind::Hexahedron, 1) => VtkCell::Hexahedron,
        (CellKind::Hexahedron, _) => VtkCell::TriquadraticHexahedron,
        (CellKind::Wedge, 1) => VtkCell::Wedge,
        (CellKind::Wedge, _) => VtkCell::QuadraticWedge,
        (CellKind::Pyramid, 1) => VtkCell::Pyramid,
        (CellKind::Pyramid, _) => VtkCell::QuadraticPyramid,
    }
}
