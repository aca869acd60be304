//! A cell, and what becomes of it.
//!
//! A simplex is halved at its refinement edge until none of its edges has a node in the middle; a quadrilateral or
//! hexahedron is divided at once along all axes whose edges have one. Promises: pieces are listed in a fixed order, keep
//! the orientation of the cell, and their places in its reference cell are exact binary fractions.

use super::{labels::Label, splits::Splits};
use crate::{
    cell::CellKind,
    mesh::{CellId, Mesh, MeshError},
};

/// A part of a cell: what a new cell is made of.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    /// Its vertices, in the order of the kind.
    pub(super) vertices: [u32; 8],
    /// Their places in the reference cell of the whole.
    pub(super) corners: [[f64; 3]; 8],
    pub(super) label: Label,
}

impl Piece {
    /// A whole cell.
    pub(super) fn whole(mesh: &Mesh, cell: CellId, label: Label) -> Self {
        let mut piece = Self { vertices: [0; 8], corners: [[0.0; 3]; 8], label };
        for (vertex, node) in piece.vertices.iter_mut().zip(mesh.cell_vertices(cell)) {
            *vertex = node.index() as u32;
        }
        let places = mesh.kind(cell).vertices();
        piece.corners[..places.len()].copy_from_slice(places);
        piece
    }

    /// The nodes at the ends of a local edge.
    pub(super) fn edge(&self, edge: [usize; 2]) -> [u32; 2] {
        edge.map(|v| self.vertices[v])
    }

    /// The nodes at the ends of the edge that is halved next.
    pub(super) fn refinement_edge(&self) -> [u32; 2] {
        self.edge(self.label.refinement.map(usize::from))
    }

    /// Both halves of a simplex, with `middle` on its refinement edge.
    pub(super) fn halves(&self, kind: CellKind, middle: u32) -> [Piece; 2] {
        let [a, b] = self.label.refinement.map(usize::from);
        let place = std::array::from_fn(|i| 0.5 * (self.corners[a][i] + self.corners[b][i]));
        [b, a].map(|replaced| {
            let mut half = *self;
            half.vertices[replaced] = middle;
            half.corners[replaced] = place;
            half.label = self.label.half(kind, replaced);
            half
        })
    }

    /// True if an edge has a node in its middle.
    pub(super) fn is_hanging(&self, kind: CellKind, splits: &Splits<'_>) -> bool {
        kind.edges().iter().any(|edge| splits.is_halved(self.edge(*edge)))
    }
}

/// The axis along which a local edge of a quadrilateral or hexahedron runs.
pub(super) fn axis_of([a, b]: [usize; 2]) -> usize {
    (a ^ b).trailing_zeros() as usize
}

/// Calls `each` for all pieces of a simplex.
pub(super) fn simplex(
    whole: Piece,
    kind: CellKind,
    splits: &Splits<'_>,
    each: &mut dyn FnMut(&Piece) -> Result<(), MeshError>,
) -> Result<(), MeshError> {
    match splits.middle(whole.refinement_edge()) {
        None => each(&whole),
        Some(middle) => whole.halves(kind, middle).into_iter().try_for_each(|half| simplex(half, kind, splits, each)),
    }
}

/// Number of pieces of a simplex.
pub(super) fn count(whole: &Piece, kind: CellKind, splits: &Splits<'_>) -> usize {
    match splits.middle(whole.refinement_edge()) {
        None => 1,
        Some(middle) => whole.halves(kind, middle).iter().map(|half| count(half, kind, splits)).sum(),
    }
}

/// The axes along which a quadrilateral or hexahedron is divided, one bit each.
pub(super) fn axes(whole: &Piece, kind: CellKind, splits: &Splits<'_>) -> usize {
    let halved = kind.edges().iter().filter(|edge| splits.is_halved(whole.edge(**edge)));
    halved.fold(0, |bits, edge| bits | 1 << axis_of(*edge))
}

/// Calls `each` for all pieces of a quadrilateral or hexahedron, the first axis fastest.
pub(super) fn tensor(
    whole: &Piece,
    kind: CellKind,
    nodes: &[[f64; 3]],
    splits: &mut Splits<'_>,
    each: &mut dyn FnMut(&Piece) -> Result<(), MeshError>,
) -> Result<(), MeshError> {
    let axes = axes(whole, kind, splits);
    let lattice = Lattice::new(whole, kind, axes, nodes, splits)?;
    for child in (0..kind.n_vertices()).filter(|child| child & !axes == 0) {
        let mut piece = *whole;
        for vertex in 0..kind.n_vertices() {
            // steps of half a cell along the axes
            let steps: [usize; 3] = std::array::from_fn(|d| {
                let [upper, far] = [child, vertex].map(|bits| bits >> d & 1);
                if axes >> d & 1 == 1 { upper + far } else { 2 * far }
            });
            piece.vertices[vertex] = lattice.nodes[steps[0] + 3 * steps[1] + 9 * steps[2]];
            piece.corners[vertex] = std::array::from_fn(|d| 0.5 * steps[d] as f64);
        }
        each(&piece)?;
    }
    Ok(())
}

/// The nodes at the vertices, and in the middle of the edges, faces and the cell that are divided.
struct Lattice {
    nodes: [u32; 27],
}

impl Lattice {
    fn new(
        whole: &Piece,
        kind: CellKind,
        axes: usize,
        nodes: &[[f64; 3]],
        splits: &mut Splits<'_>,
    ) -> Result<Self, MeshError> {
        let mut lattice = Self { nodes: [u32::MAX; 27] };
        let dim = kind.dim();
        for (at, slot) in lattice.nodes.iter_mut().enumerate().take(3usize.pow(dim as u32)) {
            let steps = [at % 3, at / 3 % 3, at / 9];
            let inner = (0..dim).filter(|d| steps[*d] == 1).fold(0, |bits, d| bits | 1 << d);
            if inner & !axes != 0 {
                continue;
            }
            let low = (0..dim).filter(|d| steps[*d] == 2).fold(0, |bits, d| bits | 1 << d);
            // vertices of the entity whose middle it is
            let around: Vec<u32> =
                (0..=inner).filter(|bits| bits & !inner == 0).map(|bits| whole.vertices[low | bits]).collect();
            *slot = match around[..] {
                [vertex] => vertex,
                [_, _] | [_, _, _, _] if around.len() < kind.n_vertices() => middle(&around, nodes, splits)?,
                _ => splits.lone(mean(&around, nodes))?,
            };
        }
        Ok(lattice)
    }
}

/// The node in the middle of an edge or face with these vertices, which other cells share.
fn middle(around: &[u32], nodes: &[[f64; 3]], splits: &mut Splits<'_>) -> Result<u32, MeshError> {
    // of a face: from its lowest vertex to the one opposite, the same from both cells
    let places: Vec<u32> = around.iter().map(|node| splits.place(*node)).collect();
    let low = (0..around.len()).min_by_key(|k| places[*k]).unwrap_or(0);
    let ends = [around[low], around[around.len() - 1 - low]];
    Ok(splits.halve(ends, mean(around, nodes))?.0)
}

fn mean(around: &[u32], nodes: &[[f64; 3]]) -> [f64; 3] {
    let sum = |i: usize| around.iter().map(|node| nodes[*node as usize][i]).sum::<f64>();
    std::array::from_fn(|i| sum(i) / around.len() as f64)
}
