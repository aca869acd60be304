//! The mesh: nodes, cells of mixed kinds, named groups; checked once, then read-only.
//!
//! Promises: a [`Mesh`] was made by [`Mesh::from_raw`], so coordinates are finite, node numbers
//! exist, no cell is inverted, folded or flat. Numbers of cells and nodes are those of the input.
//! Does not know fields or formulations, and never merges, moves or renumbers nodes.

mod against;
mod check;
mod edge;
mod error;
mod generate;
mod index;
mod locate;
mod map_order;
mod pair;
mod part;
mod points;
mod quality;
mod raw;
pub mod read;
mod region;
mod second_order;
mod shapes;
mod sheet;
mod sides;
mod together;
mod topology;
mod turn;

pub use crate::cell::{CellKind, FacetMap, LocalFacet, Polynomials, Subdivision, facet_correspondences};
pub use crate::vector::determinant;
pub use against::{Against, Divided, divided_facets, facets_against};
pub use edge::{FaceEdge, direction, edge_lengths};
pub use error::{CellName, DUPLICATE_TOLERANCE, MeshError, MeshWarnings, NodeName};
pub use generate::{BoxShape, MapError, cells_for_size, generate_box, map_nodes, map_refined};
pub use index::{CellId, EdgeId, FacetId, FacetRef, InterfaceFacet, NodeId};
pub use locate::{CellFinder, FacetFinder, Image};
pub(crate) use pair::coincident_nodes;
pub use pair::{neighbour_points, orientation};
pub use part::{MeshPart, Part, PlacesInPart};
pub use quality::{QualitySummary, cell_volumes, element_sizes, facet_heights, facet_measures, summary};
pub use raw::{FileNumbers, Group, GroupEntities, GroupFacet, RawMesh};
pub(crate) use raw::{cell_bytes, node_bytes};
pub use region::{
    RegionError, RegionKind, RegionSet, SupportSet, boundary_of, interface, outer_boundary, pick_cells, pick_facets,
    pick_nodes,
};
pub use second_order::{Curves, along_curves, curved_in_space, curves, faces_of, second_order};
pub use shapes::{CellShape, cell_shapes};
pub use sheet::{Sheet, SheetError, both_sides, front_nodes, oriented_sheets, sheets_of};
pub use together::{Placement, Together, together};
pub use topology::{EdgeTable, Facet, Topology};

use std::sync::{Arc, OnceLock};

use crate::{
    element::{Element, Family, Table},
    vector::distance,
};

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
    /// Degree of the map of every cell, once somebody has asked.
    map_orders: OnceLock<Vec<u8>>,
    /// Who owns its nodes; `None` where one rank has all.
    part: Option<Arc<Part>>,
}

impl Mesh {
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
            map_orders: OnceLock::new(),
            part: None,
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

    /// Largest distance between two vertices of a cell.
    #[must_use]
    pub fn cell_diameter(&self, cell: CellId) -> f64 {
        let vertices = self.cell_vertices(cell);
        let mut largest = 0.0;
        for (i, first) in vertices.iter().enumerate() {
            for second in &vertices[..i] {
                let length = distance(self.node(*first), self.node(*second));
                largest = f64::max(largest, length);
            }
        }
        largest
    }

    /// Bounds of the used nodes: lowest and highest coordinates; of the whole mesh where this rank has a part of it.
    #[must_use]
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        if let Some([low, high]) = self.bounds_of_whole() {
            return (low, high);
        }
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

#[cfg(test)]
mod solids_tests;
#[cfg(test)]
mod tests;
