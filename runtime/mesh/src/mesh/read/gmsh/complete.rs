//! Cells of second order without nodes in the middle of their quadrilaterals: the nodes that are missing.
//!
//! Promises: the geometry is that of the file. A quadrilateral with eight nodes is the one with nine whose last node lies
//! where the eight put the middle, and so is a hexahedron of twenty nodes with its faces and its middle; neighbours share
//! the nodes of their faces. New nodes have the numbers behind the highest of the file.

use std::collections::BTreeMap;

use super::{Block, Contents, ElementType, NodeMap, ReadError};
use crate::{
    cell::CellKind,
    element::{DofEntity, Element, Family},
};

/// A node that a cell has not in the file: of which corners and nodes of edges (places in the list of the file) it is the
/// middle, and whether neighbours have it too.
struct Missing {
    corners: Vec<usize>,
    middles: Vec<usize>,
    shared: bool,
}

/// The nodes that a kind lacks, in Gmsh's order, which has them behind the others.
fn missing(kind: CellKind, places: &[usize], known: usize) -> Vec<Missing> {
    let Ok(element) = Element::lagrange(kind, 2, Family::Continuous) else { return Vec::new() };
    let entities = element.entities();
    let place = |wanted: &DofEntity| entities.iter().position(|e| e == wanted).map(|local| places[local]);
    let corner = |v: &usize| place(&DofEntity::Vertex(*v));
    let edge = |k: usize| place(&DofEntity::Edge { edge: k, index: 0 });
    let mut found: Vec<(usize, Missing)> = Vec::new();
    for (local, entity) in entities.iter().enumerate().filter(|(local, _)| places[*local] >= known) {
        let all: Vec<usize> = (0..kind.n_vertices()).collect();
        let (corners, shared) = match entity {
            DofEntity::Facet { facet, .. } => (kind.facets()[*facet].vertices.to_vec(), true),
            _ => (all, false),
        };
        let inside = |[a, b]: &[usize; 2]| corners.contains(a) && corners.contains(b);
        let edges = kind.edges().iter().enumerate().filter(|(_, ends)| inside(ends));
        let middles = edges.filter_map(|(k, _)| edge(k)).collect();
        let corners = corners.iter().filter_map(corner).collect();
        found.push((places[local], Missing { corners, middles, shared }));
    }
    found.sort_by_key(|(place, _)| *place);
    found.into_iter().map(|(_, missing)| missing).collect()
}

/// Gives the cells of the mesh the nodes that they lack.
pub(super) fn complete(contents: &mut Contents, dim: usize) -> Result<(), ReadError> {
    let bare = |block: &Block| block.element_type.serendipity && block.element_type.dim() == dim;
    if !contents.blocks.iter().any(bare) {
        return Ok(());
    }
    let map = NodeMap::new(&contents.node_numbers)?;
    let highest = contents.node_numbers.iter().copied().max().unwrap_or(0);
    let mut made = Made { next: highest + 1, shared: BTreeMap::new() };
    let mut blocks = std::mem::take(&mut contents.blocks);
    for block in blocks.iter_mut().filter(|block| bare(block)) {
        made.block(block, &map, contents)?;
    }
    contents.blocks = blocks;
    Ok(())
}

/// The nodes made so far, by the corners of their faces.
struct Made {
    next: u64,
    shared: BTreeMap<Vec<u64>, u64>,
}

impl Made {
    fn block(&mut self, block: &mut Block, map: &NodeMap, contents: &mut Contents) -> Result<(), ReadError> {
        let of = block.element_type;
        let n = of.n_nodes();
        let missing = missing(of.kind, of.nodes(), n);
        let mut all = Vec::with_capacity(block.elements.len() * of.nodes().len());
        for (element, nodes) in block.elements.iter().zip(block.nodes.chunks_exact(n)) {
            all.extend_from_slice(nodes);
            for node in &missing {
                let mut key: Vec<u64> = node.corners.iter().map(|k| nodes[*k]).collect();
                key.sort_unstable();
                if let Some(known) = self.shared.get(&key).filter(|_| node.shared) {
                    all.push(*known);
                    continue;
                }
                let place = |k: &usize| -> Result<[f64; 3], ReadError> {
                    let lost = ReadError::MissingNode { element: *element, node: nodes[*k] };
                    map.find(nodes[*k]).map(|at| contents.nodes[at as usize]).ok_or(lost)
                };
                let x = middle(node, place)?;
                contents.nodes.push(x);
                contents.node_numbers.push(self.next);
                if node.shared {
                    self.shared.insert(key, self.next);
                }
                all.push(self.next);
                self.next += 1;
            }
        }
        block.nodes = all;
        block.element_type = ElementType { serendipity: false, ..of };
        Ok(())
    }
}

/// Where the functions of the nodes that are there put the middle: those of corners have -1/4 there, those of the middles of
/// edges 1/2 on a quadrilateral and 1/4 in a hexahedron.
fn middle(node: &Missing, place: impl Fn(&usize) -> Result<[f64; 3], ReadError>) -> Result<[f64; 3], ReadError> {
    let edge = if node.corners.len() == 4 { 0.5 } else { 0.25 };
    let mut x = [0.0; 3];
    for (list, weight) in [(&node.corners, -0.25), (&node.middles, edge)] {
        for k in list {
            let at = place(k)?;
            (0..3).for_each(|d| x[d] += weight * at[d]);
        }
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, cell_volumes};

    /// One cell of this type of Gmsh with nodes where `bend` puts those of the reference cell.
    fn volume(code: i64, bend: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
        let element_type = super::super::find_type(code, 1, || unreachable!()).unwrap();
        let kind = element_type.kind;
        let element = Element::lagrange(kind, 2, Family::Continuous).unwrap();
        let mut nodes = vec![[0.0; 3]; element_type.n_nodes()];
        for (local, place) in element_type.nodes().iter().enumerate().filter(|(_, p)| **p < element_type.n_nodes()) {
            nodes[*place] = bend(element.points()[local]);
        }
        let numbers: Vec<u64> = (1..=nodes.len() as u64).collect();
        let mut contents = Contents::default();
        (contents.nodes, contents.node_numbers) = (nodes, numbers.clone());
        contents.blocks.push(Block { element_type, groups: Vec::new(), elements: vec![1], nodes: numbers });
        let mesh = Mesh::from_raw(contents.into_raw().unwrap()).unwrap();
        cell_volumes(&mesh, &mesh.cells().collect::<Vec<_>>())[0]
    }

    #[test]
    fn bent_cells_have_the_volume_of_their_own_functions() {
        // areas and volumes of the eight, twenty and fifteen functions integrated by SymPy: y + x(1 - x)/2 on one side
        let bulge = |[x, y, z]: [f64; 3]| [x, y * (1.0 + 0.5 * x * (1.0 - x)), z];
        assert!((volume(16, bulge) - (1.0 + 1.0 / 12.0)).abs() < 1e-14);
        assert!((volume(17, bulge) - (1.0 + 1.0 / 12.0)).abs() < 1e-14);
        // a prism whose height grows by z(1 - z) of one quadrilateral
        let prism = |[x, y, z]: [f64; 3]| [x, y * (1.0 + 0.4 * z * (1.0 - z)), z];
        assert!((volume(18, prism) - 0.5 * (1.0 + 0.4 / 6.0)).abs() < 1e-14);
        assert!((volume(19, |x| x) - 1.0 / 3.0).abs() < 1e-14);
    }
}
