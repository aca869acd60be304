//! Plane cells whose nodes run clockwise: mesh generators number the cells of a surface along its curve loop.
//!
//! Promises: a cell is turned only where its neighbours say that it is its numbering and not its place: two cells with one
//! orientation run through their common edge in opposite directions. A cell that was folded over its neighbour stays as
//! it is, and so does every other one of that mesh. Geometry and groups do not change.

use std::collections::BTreeMap;

use super::{index::CellId, raw::RawMesh};
use crate::{
    cell::CellKind,
    element::{Element, Family},
};

/// What a kind of plane cell needs: the corners around it, and where each node goes when its two directions are exchanged.
struct Turn {
    around: Vec<usize>,
    exchanged: Vec<usize>,
}

impl Turn {
    fn new(kind: CellKind, order: usize) -> Option<Self> {
        let element = Element::lagrange(kind, order, Family::Continuous).ok()?;
        let points = element.points();
        let place = |x: [f64; 3]| points.iter().position(|p| p.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-9));
        let exchanged: Option<Vec<usize>> = points.iter().map(|p| place([p[1], p[0], p[2]])).collect();
        let corners = element.vertex_dofs()?;
        let order = if kind == CellKind::Quadrilateral { vec![0, 1, 3, 2] } else { vec![0, 1, 2] };
        Some(Self { around: order.into_iter().map(|k| corners[k]).collect(), exchanged: exchanged? })
    }
}

/// Turns the cells that run clockwise; which ones. Cells of a mesh that is not plane, or not well formed, stay.
pub(super) fn turn(raw: &mut RawMesh) -> Vec<CellId> {
    let turns = [CellKind::Triangle, CellKind::Quadrilateral].map(|kind| Turn::new(kind, raw.order));
    let [Some(triangle), Some(quadrilateral)] = &turns else { return Vec::new() };
    let of = |kind: CellKind| match kind {
        CellKind::Triangle => Some(triangle),
        CellKind::Quadrilateral => Some(quadrilateral),
        _ => None,
    };
    let mut starts = Vec::with_capacity(raw.kinds.len());
    let mut end = 0;
    for kind in &raw.kinds {
        let Some(turn) = of(*kind).filter(|_| raw.dim == 2) else { return Vec::new() };
        starts.push(end);
        end += turn.exchanged.len();
    }
    if raw.connectivity.len() != end || raw.connectivity.iter().any(|n| *n as usize >= raw.nodes.len()) {
        return Vec::new();
    }
    let corners = |cell: usize| -> Vec<u32> {
        let around = of(raw.kinds[cell]).map_or(&[][..], |t| &t.around);
        around.iter().map(|k| raw.connectivity[starts[cell] + k]).collect()
    };
    let area = |corners: &[u32]| -> f64 {
        let at = |k: usize| raw.nodes[corners[k % corners.len()] as usize];
        let origin = at(0);
        let arm = |k: usize| [at(k)[0] - origin[0], at(k)[1] - origin[1]];
        (1..corners.len()).map(|k| (arm(k), arm(k + 1))).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
    };
    let clockwise: Vec<bool> = (0..raw.kinds.len()).map(|cell| area(&corners(cell)) < 0.0).collect();
    if !clockwise.contains(&true) || is_folded(&clockwise, corners) {
        return Vec::new();
    }
    let found: Vec<usize> = (0..clockwise.len()).filter(|cell| clockwise[*cell]).collect();
    let turned: Vec<Vec<u32>> = found
        .iter()
        .map(|cell| {
            let exchanged = of(raw.kinds[*cell]).map_or(&[][..], |t| &t.exchanged);
            exchanged.iter().map(|k| raw.connectivity[starts[*cell] + k]).collect()
        })
        .collect();
    for (cell, nodes) in found.iter().zip(turned) {
        raw.connectivity[starts[*cell]..][..nodes.len()].copy_from_slice(&nodes);
    }
    found.into_iter().map(CellId::new).collect()
}

/// Whether two neighbours lie on one side of their common edge.
fn is_folded(clockwise: &[bool], corners: impl Fn(usize) -> Vec<u32>) -> bool {
    let mut edges: BTreeMap<[u32; 2], (usize, bool)> = BTreeMap::new();
    for cell in 0..clockwise.len() {
        let around = corners(cell);
        for k in 0..around.len() {
            let (a, b) = (around[k], around[(k + 1) % around.len()]);
            let forward = a < b;
            let Some((other, other_forward)) = edges.insert([a.min(b), a.max(b)], (cell, forward)) else { continue };
            let opposite = forward != other_forward;
            if opposite != (clockwise[cell] == clockwise[other]) {
                return true;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxShape, Mesh, cell_volumes, generate_box};

    /// A unit square of so many cells, some of them turned.
    fn square(shape: BoxShape, turned: &[usize]) -> RawMesh {
        let mesh = generate_box([0.0; 3], [1.0, 1.0, 0.0], [2, 2, 1], 2, shape).unwrap();
        let mut raw = mesh.into_raw();
        let n = raw.connectivity.len() / raw.kinds.len();
        for cell in turned {
            raw.connectivity.swap(n * cell + 1, n * cell + 2);
        }
        raw
    }

    #[test]
    fn cells_are_turned_whichever_of_them_run_clockwise() {
        for shape in [BoxShape::Quadrilateral, BoxShape::Triangle] {
            for which in [vec![], vec![1], vec![0, 1, 2, 3]] {
                let mut raw = square(shape, &which);
                assert_eq!(turn(&mut raw).iter().map(|c| c.index()).collect::<Vec<_>>(), which);
                let mesh = Mesh::from_raw(raw).unwrap();
                let area: f64 = cell_volumes(&mesh, &mesh.cells().collect::<Vec<_>>()).iter().sum();
                assert!((area - 1.0).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_cell_that_is_folded_over_its_neighbour_stays() {
        let mut raw = square(BoxShape::Triangle, &[]);
        // the node in the middle, far outside
        let middle = raw.nodes.iter().position(|x| x[0] == 0.5 && x[1] == 0.5).unwrap();
        raw.nodes[middle] = [3.0, 0.5, 0.0];
        assert!(turn(&mut raw).is_empty());
        assert!(Mesh::from_raw(raw).is_err());
    }
}
