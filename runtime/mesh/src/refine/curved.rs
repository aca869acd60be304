//! The geometry nodes of the pieces of cells of order 2.
//!
//! Promises: a new node lies where the map of its cell has it, so that the geometry stays what it was; a node of the old
//! mesh that lies there is taken. On an edge or face the map depends on its own nodes alone, so both cells agree. Does not
//! move old nodes.

use std::collections::BTreeMap;

use super::{descent::within, pieces::Piece};
use crate::{
    element::{DofEntity, Table},
    mesh::{CellId, Mesh},
};

/// What the pieces of one shape have in common.
struct Shape {
    /// The old geometry node at each point of the piece, by its position in the cell.
    old: Vec<Option<usize>>,
    /// Values of the old basis at these points.
    table: Table,
}

/// Geometry nodes by the vertices of the edge or face in whose middle they lie.
pub(super) struct Curved<'a> {
    mesh: &'a Mesh,
    shapes: BTreeMap<(usize, usize), Shape>,
    /// For each node of the closure the node of the mesh, `u32::MAX` if it has not been met.
    pub(super) vertices: Vec<u32>,
    middles: BTreeMap<[u32; 4], u32>,
    /// Positions of the new nodes.
    pub(super) positions: Vec<[f64; 3]>,
}

impl<'a> Curved<'a> {
    /// Nothing is divided yet: every node is one of the mesh.
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        let vertices: Vec<u32> = (0..mesh.n_nodes() as u32).collect();
        Self { mesh, shapes: BTreeMap::new(), vertices, middles: BTreeMap::new(), positions: Vec::new() }
    }

    /// Appends the geometry nodes of a piece of `parent` that has the shape of this number.
    pub(super) fn nodes(&mut self, parent: CellId, shape: usize, piece: &Piece, connectivity: &mut Vec<u32>) {
        let kind = self.mesh.kind(parent);
        let element = self.mesh.geometry_element(kind);
        let common = self.shapes.entry((kind.index(), shape)).or_insert_with(|| {
            let corners = &piece.corners[..kind.n_vertices()];
            let points: Vec<[f64; 3]> = element.points().iter().map(|x| within(kind, corners, *x)).collect();
            let old = points.iter().map(|x| element.points().iter().position(|y| x == y)).collect();
            Shape { old, table: element.tabulate(&points, 0) }
        });
        let highest = piece.vertices[..kind.n_vertices()].iter().copied().max().unwrap_or(0) as usize;
        if self.vertices.len() <= highest {
            self.vertices.resize(highest + 1, u32::MAX);
        }
        for (k, entity) in element.entities().iter().enumerate() {
            let next = (self.mesh.n_nodes() + self.positions.len()) as u32;
            let mut lone = u32::MAX;
            let slot = match entity {
                DofEntity::Vertex(v) => &mut self.vertices[piece.vertices[*v] as usize],
                DofEntity::Edge { edge, .. } => {
                    self.middles.entry(key(piece, &kind.edges()[*edge])).or_insert(u32::MAX)
                }
                DofEntity::Facet { facet, .. } => {
                    self.middles.entry(key(piece, kind.facets()[*facet].vertices)).or_insert(u32::MAX)
                }
                DofEntity::Interior(_) => &mut lone,
            };
            if *slot == u32::MAX {
                *slot = match common.old[k] {
                    Some(place) => self.mesh.cell_nodes(parent)[place].index() as u32,
                    None => {
                        self.positions.push(self.mesh.point_at(parent, &common.table, k));
                        next
                    }
                };
            }
            connectivity.push(*slot);
        }
    }

    /// The node in the middle of an edge that no cell of the new mesh divides.
    pub(super) fn middle(&self, ends: [u32; 2]) -> Option<u32> {
        let mut key = [u32::MAX; 4];
        key[..2].copy_from_slice(&[ends[0].min(ends[1]), ends[0].max(ends[1])]);
        self.middles.get(&key).copied()
    }
}

fn key(piece: &Piece, vertices: &[usize]) -> [u32; 4] {
    let mut key = [u32::MAX; 4];
    for (part, vertex) in key.iter_mut().zip(vertices) {
        *part = piece.vertices[*vertex];
    }
    key.sort_unstable();
    key
}
