//! Which cells are refined next: the fewest that hold a part of the error (Doerfler, SIAM J. Numer. Anal. 33, 1996).
//!
//! Simplices are refined one by one. Quadrilaterals and hexahedra are divided in whole layers, so a layer counts as one:
//! its error for each of its cells decides. Formulas only: knows no scene and no run.

use std::collections::BTreeMap;

use wfl_mesh::{
    mesh::{CellId, Mesh, Subdivision},
    refine::{Axes, Mark},
};

use super::Indicator;

/// What is refined as one: a simplex, or a layer of tensor cells along one axis.
#[derive(Default)]
struct Item {
    members: Vec<(CellId, usize)>,
    error: f64,
}

/// The cells whose refinement takes hold of `part` (0 to 1) of the error.
pub(super) fn marked(mesh: &Mesh, indicator: &Indicator, part: f64) -> Vec<Mark> {
    let mut items = items(mesh, indicator);
    let total: f64 = items.iter().map(|i| i.error).sum();
    let gain = |i: &Item| i.error / i.members.len() as f64;
    items.sort_by(|a, b| gain(b).total_cmp(&gain(a)).then(a.members[0].cmp(&b.members[0])));
    let mut held = 0.0;
    let mut axes: BTreeMap<CellId, Vec<usize>> = BTreeMap::new();
    for item in items {
        if held >= part * total {
            break;
        }
        held += item.error;
        for (cell, axis) in item.members {
            let layered = mesh.kind(cell).subdivision() == Some(Subdivision::Layers);
            axes.entry(cell).or_default().extend(if layered { axis..axis + 1 } else { 0..3 });
        }
    }
    axes.into_iter().map(|(cell, axes)| Mark { cell, axes: Axes::of(&axes) }).collect()
}

/// The cells of two lists, each along the axes of both.
pub(super) fn also(one: Vec<Mark>, other: Vec<Mark>) -> Vec<Mark> {
    let mut axes: BTreeMap<CellId, u8> = BTreeMap::new();
    for mark in one.into_iter().chain(other) {
        *axes.entry(mark.cell).or_default() |= mark.axes.bits();
    }
    axes.into_iter().map(|(cell, bits)| Mark { cell, axes: Axes::from_bits(bits) }).collect()
}

/// Every cell along all its axes.
pub(super) fn everything(mesh: &Mesh) -> Vec<Mark> {
    mesh.cells().map(Mark::all).collect()
}

fn items(mesh: &Mesh, indicator: &Indicator) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    let mut groups = Layers::default();
    for cell in mesh.cells() {
        let (kind, parts) = (mesh.kind(cell), indicator.parts[cell.index()]);
        if kind.subdivision() != Some(Subdivision::Layers) {
            items.push(Item { members: vec![(cell, 0)], error: parts.iter().sum() });
            continue;
        }
        let vertices = mesh.cell_vertices(cell);
        for (axis, part) in parts.iter().enumerate().take(kind.dim()) {
            let along = kind.edges().iter().filter(|[a, b]| a ^ b == 1 << axis);
            let edges = along.map(|[a, b]| {
                let [a, b] = [vertices[*a], vertices[*b]];
                if a < b { [a.index(), b.index()] } else { [b.index(), a.index()] }
            });
            groups.add((cell, axis), *part, edges);
        }
    }
    items.extend(groups.finish());
    items
}

/// Cells that share an edge along an axis are divided together.
#[derive(Default)]
struct Layers {
    by_edge: BTreeMap<[usize; 2], usize>,
    members: Vec<((CellId, usize), f64)>,
    /// The member that stands for the layer, or one on the way to it.
    leader: Vec<usize>,
}

impl Layers {
    fn add(&mut self, member: (CellId, usize), error: f64, edges: impl Iterator<Item = [usize; 2]>) {
        let k = self.members.len();
        self.members.push((member, error));
        self.leader.push(k);
        for edge in edges {
            let other = *self.by_edge.entry(edge).or_insert(k);
            let (a, b) = (self.find(k), self.find(other));
            self.leader[a.max(b)] = a.min(b);
        }
    }

    fn find(&mut self, mut k: usize) -> usize {
        while self.leader[k] != k {
            self.leader[k] = self.leader[self.leader[k]];
            k = self.leader[k];
        }
        k
    }

    fn finish(mut self) -> Vec<Item> {
        let mut layers: BTreeMap<usize, Item> = BTreeMap::new();
        for k in 0..self.members.len() {
            let leader = self.find(k);
            let layer = layers.entry(leader).or_default();
            layer.members.push(self.members[k].0);
            layer.error += self.members[k].1;
        }
        layers.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wfl_mesh::mesh::{BoxShape, generate_box};

    fn square(shape: BoxShape) -> Mesh {
        generate_box([0.0; 3], [1.0; 3], [4, 4, 1], 2, shape).expect("a mesh")
    }

    #[test]
    fn the_fewest_cells_with_the_wanted_part_are_marked() {
        let mesh = square(BoxShape::Triangle);
        let mut parts = vec![[0.0; 3]; mesh.n_cells()];
        (parts[3][0], parts[7][0], parts[9][1]) = (5.0, 4.0, 1.0);
        let indicator = Indicator { parts, size: None };
        let cells = |part| marked(&mesh, &indicator, part).iter().map(|m| m.cell.index()).collect::<Vec<_>>();
        assert_eq!((cells(0.5), cells(0.8), cells(1.0)), (vec![3], vec![3, 7], vec![3, 7, 9]));
    }

    #[test]
    fn layers_of_quadrilaterals_are_marked_along_the_axis_of_the_error() {
        let mesh = square(BoxShape::Quadrilateral);
        let mut parts = vec![[0.0; 3]; mesh.n_cells()];
        (parts[5][0], parts[9][0], parts[2][1]) = (2.0, 2.0, 1.0);
        let marks = marked(&mesh, &Indicator { parts, size: None }, 0.7);
        assert_eq!(marks.len(), 4);
        let column = |m: &Mark| m.cell.index() % 4 == 1 && m.axes == Axes::of(&[0]);
        assert!(marks.iter().all(column), "{marks:?}");
    }
}
