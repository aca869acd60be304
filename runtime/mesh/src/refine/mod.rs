//! Local refinement of a mesh that stays conforming.
//!
//! Segments are halved, triangles and tetrahedra bisected (labels.rs), quadrilaterals and hexahedra divided in whole
//! layers: a node in the middle of an edge asks for one on the opposite edge, and so on to the boundary.
//! Wedges and pyramids are not divided yet, and a mark that reaches one is an error. Promises: every
//! inner face has two cells with the same vertices; faces of two bodies that matched do so afterwards; the number of
//! shapes of the parts of a cell is bounded; groups of a file come along; a curved cell of order 2 keeps its shape. The
//! result depends on the mesh and the marks alone. Does not know conditions, scenes or the map of a mesh: the scene moves
//! the nodes of the refined mesh again.

mod carry;
mod closure;
mod curved;
mod descent;
mod labels;
mod marks;
mod pieces;
mod splits;
#[cfg(test)]
mod tests;
mod twins;

pub use descent::Descent;
pub use marks::{Axes, Mark};

use wfl_host::memory::claim;

use crate::{
    cell::{CellKind, Subdivision},
    mesh::{CellId, FacetRef, GroupFacet, Mesh, MeshError, NodeId, RawMesh, cell_bytes, node_bytes},
};
use carry::Middles;
use closure::Closure;
use curved::Curved;
use descent::DescentMaker;
use labels::Label;
use pieces::Piece;
use splits::Splits;
use twins::Twins;

/// A mesh that is refined round by round.
#[derive(Debug)]
pub struct Refiner {
    mesh: Mesh,
    labels: Vec<Label>,
    twins: Twins,
}

/// The cells of the refined mesh.
struct Cells {
    kinds: Vec<CellKind>,
    /// Vertices as the closure numbers them, all cells one after the other.
    vertices: Vec<u32>,
    starts: Vec<usize>,
    connectivity: Vec<u32>,
    labels: Vec<Label>,
    descent: DescentMaker,
}

/// Bytes that a refinement needs for a cell beside those of the mesh: label, parent, vertices and start.
fn refined_bytes(kind: CellKind) -> u64 {
    (size_of::<Label>() + 8 + 8) as u64 + 4 * kind.n_vertices() as u64 + cell_bytes(kind)
}

impl Refiner {
    /// Begins with `mesh`; `shape` is the same mesh where its nodes finally are (moved by a map), whose longest edges are
    /// halved first and whose faces lie on each other.
    ///
    /// # Errors
    /// [`MeshError::NonManifold`] and [`MeshError::DuplicateCell`].
    pub fn new(mesh: Mesh, shape: &Mesh) -> Result<Self, MeshError> {
        let twins = Twins::new(shape)?;
        let labels = labels::first_labels(shape, |node| twins.of(node));
        Ok(Self { mesh, labels, twins })
    }

    /// The mesh as it is now.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The refined mesh.
    #[must_use]
    pub fn into_mesh(self) -> Mesh {
        self.mesh
    }

    /// Halves the size of the marked cells, and divides others as far as a conforming mesh needs it. Old nodes keep their
    /// numbers, parts of a cell take its place.
    ///
    /// # Errors
    /// [`MeshError::TooMuchMemory`] before it is taken, [`MeshError::TooLarge`], [`MeshError::NoRefinement`], and what [`Mesh::from_raw`] finds where
    /// cells become too small for their coordinates.
    ///
    /// # Panics
    /// If a mark is of no cell of the mesh.
    pub fn refine(&mut self, marks: &[Mark]) -> Result<Descent, MeshError> {
        let old = &self.mesh;
        let splits = Splits::new(old.n_nodes(), &self.twins)?;
        let mut closure = Closure::new(old, &self.labels, splits)?;
        closure.close(marks)?;
        let Closure { mut splits, is_touched, .. } = closure;
        self.claim(&splits, &is_touched)?;
        let mut curved = (old.order() > 1).then(|| Curved::new(old));
        let cells = self.divided(&mut splits, &is_touched, curved.as_mut())?;
        let (descent, kinds) = (cells.descent.finish(), cells.kinds);
        let middles = Middles { splits: &splits, curved: curved.as_ref() };
        let node = |vertex: u32| {
            let vertex = curved.as_ref().map_or(vertex, |c| c.vertices[vertex as usize]);
            NodeId::new(vertex as usize)
        };
        let facet = |facet: FacetRef| {
            let local = kinds[facet.cell.index()].facets()[facet.local as usize];
            let mine = &cells.vertices[cells.starts[facet.cell.index()]..];
            let at = |i: usize| node(mine[local.vertices.get(i).copied().unwrap_or(local.vertices[0])]);
            GroupFacet { kind: local.kind, vertices: std::array::from_fn(at) }
        };
        let groups = carry::groups(old, &kinds, &descent, &facet, &middles)?;
        let new: &[[f64; 3]] = curved.as_ref().map_or(splits.positions(), |c| &c.positions);
        let nodes: Vec<[f64; 3]> = old.nodes().iter().chain(new).copied().collect();
        let twins = self.later_twins(&splits, curved.as_ref(), nodes.len());
        let numbers = carry::numbers(old.numbers(), &descent, nodes.len());
        let (dim, order, connectivity) = (old.dim(), old.order(), cells.connectivity);
        let raw = RawMesh { dim, order, nodes, kinds, connectivity, groups, numbers };
        self.mesh = Mesh::from_refined(raw, old.warnings().clone())?;
        (self.labels, self.twins) = (cells.labels, twins);
        Ok(descent)
    }

    /// Asks for the memory of the refined mesh.
    fn claim(&self, splits: &Splits<'_>, is_touched: &[bool]) -> Result<(), MeshError> {
        let mut bytes = 0;
        let mut nodes = (self.mesh.n_nodes() + splits.positions().len()) as u64;
        for cell in self.mesh.cells() {
            let kind = self.mesh.kind(cell);
            let parts = match kind.subdivision().filter(|_| is_touched[cell.index()]) {
                None => 1,
                Some(Subdivision::Bisection) => pieces::count(&self.whole(cell), kind, splits) as u64,
                Some(Subdivision::Layers) => {
                    let parts = 1 << pieces::axes(&self.whole(cell), kind, splits).count_ones();
                    // one in the middle, and three of its faces
                    nodes += if parts > 2 { 4 } else { 0 };
                    parts
                }
            };
            bytes += parts * refined_bytes(kind);
        }
        if nodes > u64::from(u32::MAX) {
            return Err(MeshError::TooLarge { nodes: nodes.into() });
        }
        let nodes = if self.mesh.order() > 1 { 4 * nodes } else { nodes };
        Ok(claim(bytes + node_bytes(nodes), "the refined mesh")?)
    }

    fn whole(&self, cell: CellId) -> Piece {
        Piece::whole(&self.mesh, cell, self.labels[cell.index()])
    }

    /// Makes the cells of the refined mesh.
    fn divided(
        &self,
        splits: &mut Splits<'_>,
        is_touched: &[bool],
        mut curved: Option<&mut Curved<'_>>,
    ) -> Result<Cells, MeshError> {
        let old = &self.mesh;
        let mut cells = Cells {
            kinds: Vec::new(),
            vertices: Vec::new(),
            starts: Vec::new(),
            connectivity: Vec::new(),
            labels: Vec::new(),
            descent: DescentMaker::new(old.n_cells()),
        };
        for cell in old.cells() {
            let (kind, whole) = (old.kind(cell), self.whole(cell));
            if !is_touched[cell.index()] {
                cells.add(kind, &whole);
                cells.connectivity.extend(old.cell_nodes(cell).iter().map(|node| node.index() as u32));
                cells.descent.whole(cell, kind);
                continue;
            }
            let mut each = |piece: &Piece| -> Result<(), MeshError> {
                cells.add(kind, piece);
                let shape = cells.descent.part(cell, kind, &piece.corners[..kind.n_vertices()]);
                match curved.as_mut() {
                    Some(curved) => curved.nodes(cell, shape, piece, &mut cells.connectivity),
                    None => cells.connectivity.extend_from_slice(&piece.vertices[..kind.n_vertices()]),
                }
                Ok(())
            };
            if kind.subdivision() == Some(Subdivision::Bisection) {
                pieces::simplex(whole, kind, splits, &mut each)?;
            } else {
                pieces::tensor(&whole, kind, old.nodes(), splits, &mut each)?;
            }
        }
        Ok(cells)
    }

    /// The nodes at one place in the refined mesh.
    fn later_twins(&self, splits: &Splits<'_>, curved: Option<&Curved<'_>>, n_nodes: usize) -> Twins {
        if self.twins.none() {
            return Twins::from_list(Vec::new());
        }
        let mut same: Vec<u32> = (0..n_nodes as u32).collect();
        let node = |vertex: u32| curved.map_or(vertex, |c| c.vertices[vertex as usize]);
        for vertex in 0..(self.mesh.n_nodes() + splits.positions().len()) as u32 {
            same[node(vertex) as usize] = node(splits.place(vertex));
        }
        Twins::from_list(same)
    }
}

impl Cells {
    fn add(&mut self, kind: CellKind, piece: &Piece) {
        self.kinds.push(kind);
        self.starts.push(self.vertices.len());
        self.vertices.extend_from_slice(&piece.vertices[..kind.n_vertices()]);
        self.labels.push(piece.label);
    }
}
