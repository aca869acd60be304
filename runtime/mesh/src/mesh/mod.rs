//! The mesh: nodes, cells of mixed kinds, named groups; checked once, then read-only.
//!
//! Promises: a [`Mesh`] was made by [`Mesh::from_raw`], so coordinates are finite, node numbers
//! exist, no cell is inverted, folded or flat. Numbers of cells and nodes are those of the input.
//! Does not know fields or formulations, and never merges, moves or renumbers nodes.

mod cell;
mod check;
mod error;
mod generate;
mod locate;
mod pair;
mod points;
mod quality;
pub mod read;
mod region;
mod topology;

pub use cell::{CellKind, FacetMap, LocalFacet};
pub use error::{CellName, MeshError, NodeName};
pub use generate::{BoxShape, MapError, cells_for_size, generate_box, map_nodes};
pub use locate::{CellFinder, FacetFinder, Image};
pub use pair::{facet_correspondences, orientation};
pub use quality::{QualitySummary, cell_volumes, element_sizes, facet_heights, facet_measures, summary};
pub use region::{
    InterfaceFacet, RegionError, RegionKind, RegionSet, SupportSet, boundary_of, interface, outer_boundary, pick_cells,
    pick_facets, pick_nodes,
};
pub use topology::{EdgeTable, Facet, Topology};

use wfl_host::memory::claim;

use crate::element::{Element, Family, Table};

wfl::define_index! {
    /// A cell of the mesh.
    CellId,
    /// A node of the mesh: a point of its geometry.
    NodeId,
    /// A facet of the mesh, numbered once for both its cells.
    FacetId,
    /// An edge of the mesh, numbered once for all its cells.
    EdgeId,
}

/// A facet seen from one of its cells. The side is part of the identity: the normal of
/// `FacetRef` points out of `cell`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FacetRef {
    /// The cell it is seen from.
    pub cell: CellId,
    /// Local facet of that cell.
    pub local: u8,
}

impl FacetRef {
    /// Local facet `local` of `cell`.
    #[must_use]
    pub fn new(cell: CellId, local: usize) -> Self {
        let local = u8::try_from(local).expect("a cell has at most six facets");
        FacetRef { cell, local }
    }
}

/// A facet of a named group, by its vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GroupFacet {
    /// Shape of the facet.
    pub kind: CellKind,
    /// Vertices; the first `kind.n_vertices()` count.
    pub vertices: [NodeId; 4],
}

impl GroupFacet {
    /// The vertices that count.
    #[must_use]
    pub fn vertices(&self) -> &[NodeId] {
        &self.vertices[..self.kind.n_vertices()]
    }
}

/// What a named group holds.
#[derive(Clone, Debug, PartialEq)]
pub enum GroupEntities {
    /// Cells of the mesh.
    Cells(Vec<CellId>),
    /// Facets.
    Facets(Vec<GroupFacet>),
    /// Nodes: the group was of points, or of curves in three dimensions.
    Nodes(Vec<NodeId>),
}

/// A named set of entities that came with the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name, as written in the file.
    pub name: String,
    /// Dimension of the entities.
    pub dim: usize,
    /// The entities.
    pub entities: GroupEntities,
}

/// A mesh as a reader or generator finds it: nothing is checked yet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Dimension of the space and of the cells, 1 to 3.
    pub dim: usize,
    /// Order of the geometry, 1 or 2.
    pub order: usize,
    /// Coordinates of the nodes; those from `dim` on are ignored and set to zero.
    pub nodes: Vec<[f64; 3]>,
    /// Kind of each cell, all of dimension `dim`.
    pub kinds: Vec<CellKind>,
    /// Nodes of all cells, one cell after the other, each in the local order of the Lagrange
    /// element of degree `order` on its kind.
    pub connectivity: Vec<u32>,
    /// Named groups.
    pub groups: Vec<Group>,
    /// Numbers in the file that the mesh came from.
    pub numbers: FileNumbers,
}

/// What a file calls the cells and nodes of a mesh, in their order; both empty for a mesh that is in no file. Messages
/// use these numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileNumbers {
    /// One number a cell.
    pub cells: Vec<u64>,
    /// One number a node.
    pub nodes: Vec<u64>,
}

impl FileNumbers {
    /// What messages call a cell.
    #[must_use]
    pub fn cell(&self, cell: CellId) -> CellName {
        self.cells.get(cell.index()).map_or(CellName::Cell(cell), |number| CellName::Element(*number))
    }

    /// What messages call a node.
    #[must_use]
    #[inline]
    pub fn node(&self, node: NodeId) -> NodeName {
        NodeName(self.nodes.get(node.index()).copied().unwrap_or(node.index() as u64))
    }
}

/// What is odd about a mesh but no error.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshWarnings {
    /// Pairs of distinct nodes of one body (connected by cells) at the same place: nearer than
    /// [`DUPLICATE_TOLERANCE`] of the shortest cell edge at either.
    pub duplicate_nodes: Vec<(NodeId, NodeId)>,
    /// Nodes of no cell; nothing is numbered there.
    pub unused_nodes: Vec<NodeId>,
}

/// Two nodes of one body are duplicates within this part of the shortest edge at them.
pub const DUPLICATE_TOLERANCE: f64 = 1e-6;

/// Geometry of one cell kind at the order of the mesh.
#[derive(Clone, Debug)]
struct KindGeometry {
    element: Element,
    vertices: Vec<usize>,
    /// Basis values at the centre of the reference cell.
    centre: Vec<f64>,
}

/// A checked mesh.
#[derive(Clone, Debug)]
pub struct Mesh {
    dim: usize,
    order: usize,
    nodes: Vec<[f64; 3]>,
    kinds: Vec<CellKind>,
    starts: Vec<usize>,
    connectivity: Vec<NodeId>,
    /// Vertices of the cells when the order is 2, with their own starts; empty for order 1.
    vertices: Vec<NodeId>,
    vertex_starts: Vec<usize>,
    groups: Vec<Group>,
    numbers: FileNumbers,
    warnings: MeshWarnings,
    geometry: Vec<KindGeometry>,
}

impl Mesh {
    /// Checks a raw mesh and takes it over.
    ///
    /// # Errors
    /// Any defect that [`MeshError`] names; warnings are kept in [`Mesh::warnings`].
    pub fn from_raw(raw: RawMesh) -> Result<Mesh, MeshError> {
        let cells: u64 = raw.kinds.iter().map(|kind| cell_bytes(*kind)).sum();
        claim(node_bytes(raw.nodes.len() as u64) + cells, "the mesh")?;
        let starts = check::structure(&raw)?;
        let mut mesh = Mesh::assemble(raw, starts);
        check::jacobians(&mesh)?;
        mesh.warnings = check::warnings(&mesh);
        Ok(mesh)
    }

    fn assemble(raw: RawMesh, starts: Vec<usize>) -> Mesh {
        let mut nodes = raw.nodes;
        for node in &mut nodes {
            node[raw.dim..].fill(0.0);
        }
        let geometry: Vec<KindGeometry> = CellKind::ALL
            .into_iter()
            .map(|kind| {
                let element = Element::lagrange(kind, raw.order, Family::Continuous)
                    .expect("there are elements of degree 1 and 2 on every cell");
                let vertices = element.vertex_dofs().expect("the degree is not 0");
                let centre = element.tabulate(&[kind.reference_centre()], 0).values;
                KindGeometry { element, vertices, centre }
            })
            .collect();
        let connectivity: Vec<NodeId> = raw.connectivity.into_iter().map(|node| NodeId::new(node as usize)).collect();
        let (mut vertices, mut vertex_starts) = (Vec::new(), Vec::new());
        if raw.order > 1 {
            vertex_starts.push(0);
            for (cell, kind) in raw.kinds.iter().enumerate() {
                let local = &geometry[kind.index()].vertices;
                vertices.extend(local.iter().map(|v| connectivity[starts[cell] + v]));
                vertex_starts.push(vertices.len());
            }
        }
        Mesh {
            dim: raw.dim,
            order: raw.order,
            nodes,
            kinds: raw.kinds,
            starts,
            connectivity,
            vertices,
            vertex_starts,
            groups: raw.groups,
            numbers: raw.numbers,
            warnings: MeshWarnings::default(),
            geometry,
        }
    }

    /// The mesh as raw data, for another round of [`Mesh::from_raw`] after a change.
    #[must_use]
    pub fn into_raw(self) -> RawMesh {
        RawMesh {
            dim: self.dim,
            order: self.order,
            nodes: self.nodes,
            kinds: self.kinds,
            connectivity: self.connectivity.iter().map(|n| n.index() as u32).collect(),
            groups: self.groups,
            numbers: self.numbers,
        }
    }

    /// Dimension of the space and of the cells.
    #[must_use]
    #[inline]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Order of the geometry, 1 or 2.
    #[must_use]
    #[inline]
    pub fn order(&self) -> usize {
        self.order
    }

    /// Coordinates of all nodes; unused ones are zero.
    #[must_use]
    #[inline]
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// Coordinates of one node.
    #[must_use]
    #[inline]
    pub fn node(&self, node: NodeId) -> [f64; 3] {
        self.nodes[node.index()]
    }

    /// Number of nodes, used or not.
    #[must_use]
    #[inline]
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of cells.
    #[must_use]
    #[inline]
    pub fn n_cells(&self) -> usize {
        self.kinds.len()
    }

    /// All cells, ascending.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = CellId> + use<> {
        (0..self.n_cells()).map(CellId::new)
    }

    /// Kind of a cell.
    #[must_use]
    #[inline]
    pub fn kind(&self, cell: CellId) -> CellKind {
        self.kinds[cell.index()]
    }

    /// Kind of every cell.
    #[must_use]
    #[inline]
    pub fn kinds(&self) -> &[CellKind] {
        &self.kinds
    }

    /// Geometry nodes of a cell, in the local order of [`Mesh::geometry_element`].
    #[must_use]
    #[inline]
    pub fn cell_nodes(&self, cell: CellId) -> &[NodeId] {
        &self.connectivity[self.starts[cell.index()]..self.starts[cell.index() + 1]]
    }

    /// Vertices of a cell, in the order of [`CellKind::vertices`].
    #[must_use]
    #[inline]
    pub fn cell_vertices(&self, cell: CellId) -> &[NodeId] {
        if self.order == 1 {
            return self.cell_nodes(cell);
        }
        &self.vertices[self.vertex_starts[cell.index()]..self.vertex_starts[cell.index() + 1]]
    }

    /// Shape of a facet.
    #[must_use]
    #[inline]
    pub fn facet_kind(&self, facet: FacetRef) -> CellKind {
        self.kind(facet.cell).facets()[facet.local as usize].kind
    }

    /// Vertices of a facet in the order of its kind; the first `facet_kind().n_vertices()` count,
    /// the others repeat the first.
    #[must_use]
    pub fn facet_vertices(&self, facet: FacetRef) -> GroupFacet {
        let local = self.kind(facet.cell).facets()[facet.local as usize];
        let cell = self.cell_vertices(facet.cell);
        let vertices = std::array::from_fn(|i| cell[local.vertices.get(i).copied().unwrap_or(local.vertices[0])]);
        GroupFacet { kind: local.kind, vertices }
    }

    /// The Lagrange element of the geometry map of cells (and facets) of `kind`.
    #[must_use]
    #[inline]
    pub fn geometry_element(&self, kind: CellKind) -> &Element {
        &self.geometry[kind.index()].element
    }

    /// Named groups of the mesh.
    #[must_use]
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// What messages call the cells and nodes.
    #[must_use]
    pub fn numbers(&self) -> &FileNumbers {
        &self.numbers
    }

    /// What is odd about the mesh but no error.
    #[must_use]
    pub fn warnings(&self) -> &MeshWarnings {
        &self.warnings
    }

    /// Image of the reference centre of a cell.
    #[must_use]
    pub fn centroid(&self, cell: CellId) -> [f64; 3] {
        let values = &self.geometry[self.kind(cell).index()].centre;
        self.combine(self.cell_nodes(cell).iter().copied(), values)
    }

    /// Image of the reference centre of a facet.
    #[must_use]
    pub fn facet_centroid(&self, facet: FacetRef) -> [f64; 3] {
        let kind = self.kind(facet.cell);
        let closure = self.geometry[kind.index()].element.facet_closure(facet.local as usize);
        let values = &self.geometry[self.facet_kind(facet).index()].centre;
        let nodes = self.cell_nodes(facet.cell);
        self.combine(closure.iter().map(|dof| nodes[*dof]), values)
    }

    /// The physical point of row `point` of a table of [`Mesh::geometry_element`] of the cell's
    /// kind.
    #[must_use]
    #[inline]
    pub fn point_at(&self, cell: CellId, table: &Table, point: usize) -> [f64; 3] {
        let values = &table.values[point * table.n_dofs..][..table.n_dofs];
        self.combine(self.cell_nodes(cell).iter().copied(), values)
    }

    /// The physical point of row `point` of a table of [`Mesh::geometry_element`] of the facet's
    /// kind, tabulated at facet parameters.
    #[must_use]
    #[inline]
    pub fn facet_point_at(&self, facet: FacetRef, table: &Table, point: usize) -> [f64; 3] {
        let values = &table.values[point * table.n_dofs..][..table.n_dofs];
        let element = self.geometry_element(self.kind(facet.cell));
        let closure = element.facet_closure(facet.local as usize);
        let nodes = self.cell_nodes(facet.cell);
        self.combine(closure.iter().map(|dof| nodes[*dof]), values)
    }

    /// `jacobian[i][j] = d x_i / d xi_j` at row `point` of a table (with gradients) of
    /// [`Mesh::geometry_element`] of the cell's kind. Entries outside `dim x dim` are zero.
    #[must_use]
    #[inline]
    pub fn jacobian_at(&self, cell: CellId, table: &Table, point: usize) -> [[f64; 3]; 3] {
        let mut jacobian = [[0.0; 3]; 3];
        let row = &table.gradients[point * table.n_dofs * table.dim..];
        for (node, gradient) in self.cell_nodes(cell).iter().zip(row.chunks_exact(table.dim)) {
            let x = self.node(*node);
            for i in 0..self.dim {
                for (j, slope) in gradient.iter().enumerate() {
                    jacobian[i][j] += x[i] * slope;
                }
            }
        }
        jacobian
    }

    #[inline]
    fn combine(&self, nodes: impl Iterator<Item = NodeId>, values: &[f64]) -> [f64; 3] {
        let mut point = [0.0; 3];
        for (node, value) in nodes.zip(values) {
            let x = self.node(node);
            for i in 0..3 {
                point[i] += value * x[i];
            }
        }
        point
    }

    /// Bounds of the used nodes: lowest and highest coordinates.
    #[must_use]
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for node in &self.connectivity {
            let x = self.node(*node);
            for i in 0..3 {
                low[i] = low[i].min(x[i]);
                high[i] = high[i].max(x[i]);
            }
        }
        (low, high)
    }
}

/// Bytes that nodes take while a mesh is made: positions, and lists by node.
fn node_bytes(nodes: u64) -> u64 {
    (24 + 8) * nodes
}

/// Bytes that a cell takes while a mesh and its facets are made: its nodes; for each of its facets key, entry, slot and
/// partner, whose place the numbered facets take afterwards. Within 6 % of what boxes of 125,000 cubes and of 750,000
/// tetrahedra take.
fn cell_bytes(kind: CellKind) -> u64 {
    let (nodes, facets) = (kind.n_vertices() as u64, kind.facets().len() as u64);
    8 * nodes + 16 + (16 + 16 + 8 + 4) * facets
}

/// Determinant of the leading `dim x dim` block.
#[must_use]
pub fn determinant(m: &[[f64; 3]; 3], dim: usize) -> f64 {
    match dim {
        0 => 1.0,
        1 => m[0][0],
        2 => m[0][0] * m[1][1] - m[0][1] * m[1][0],
        _ => {
            m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
                + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
        }
    }
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(difference(a, b))
}

#[cfg(test)]
mod tests;
