//! The degree of the geometry map of cells and faces, measured from their nodes.
//!
//! A mesh of hexahedra or of order 2 has affine cells where these are parallelepipeds or have straight edges with nodes
//! in the middle. Promises: the verdict does not change when a mesh is scaled or moved, up to rounding.

use super::{
    Mesh,
    index::{CellId, FacetRef},
};
use crate::{
    cell::CellKind,
    vector::{distance, norm},
};

/// A node this far from where the simpler map has it, in parts of the size of its cell, is rounding of what made the
/// mesh. The error of an integral is of the same order, below the 1e-12 to which constant stresses are to be met.
const SAME: f64 = 1e-13;
/// Rounding of a coordinate, a few operations on it included.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl Mesh {
    /// Degree of the map from the reference cell: 0 if it is affine, 1 if it is multilinear (straight edges with their
    /// nodes in the middle), else the order of the mesh.
    #[must_use]
    pub fn map_order(&self, cell: CellId) -> usize {
        if self.order == 1 && self.kind(cell).straight_is_affine() {
            return 0;
        }
        let orders = self.map_orders.get_or_init(|| self.cells().map(|cell| self.measured_order(cell)).collect());
        usize::from(orders[cell.index()])
    }

    /// The same of the map from the parameters of a facet.
    #[must_use]
    pub fn facet_map_order(&self, facet: FacetRef) -> usize {
        if self.map_order(facet.cell) == 0 {
            return 0;
        }
        let closure = self.geometry_element(self.kind(facet.cell)).facet_closure(facet.local as usize);
        let nodes = self.cell_nodes(facet.cell);
        let x: Vec<[f64; 3]> = closure.iter().map(|dof| self.node(nodes[*dof])).collect();
        usize::from(self.order_of(self.facet_kind(facet), &x))
    }

    /// Whether a facet is curved: nodes that slide along a straight edge or a plane face do not bend it.
    #[must_use]
    pub fn is_bent(&self, facet: FacetRef) -> bool {
        if self.facet_map_order(facet) < 2 {
            return false;
        }
        let closure = self.geometry_element(self.kind(facet.cell)).facet_closure(facet.local as usize);
        let nodes = self.cell_nodes(facet.cell);
        let x: Vec<[f64; 3]> = closure.iter().map(|dof| self.node(nodes[*dof])).collect();
        let kind = self.facet_kind(facet);
        let corners: Vec<[f64; 3]> = self.geometry[kind.index()].vertices.iter().map(|k| x[*k]).collect();
        let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) };
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let along = minus(corners[1], corners[0]);
        let off = |x: &[f64; 3]| {
            let from = minus(*x, corners[0]);
            if kind.dim() == 1 {
                return norm(cross(along, from)) / norm(along);
            }
            let normal = cross(along, minus(corners[2], corners[0]));
            (0..3).map(|i| normal[i] * from[i]).sum::<f64>().abs() / norm(normal)
        };
        let size = corners.iter().fold(0.0f64, |m, x| m.max(distance(*x, corners[0])));
        let magnitude = x.iter().fold(0.0, |m: f64, x| m.max(norm(*x)));
        x.iter().any(|x| off(x) > SAME * size + ROUNDING * magnitude)
    }

    fn measured_order(&self, cell: CellId) -> u8 {
        let nodes = self.cell_nodes(cell);
        // a hexahedron of order 2 has the most
        let mut x = [[0.0; 3]; 27];
        for (x, node) in x.iter_mut().zip(nodes) {
            *x = self.node(*node);
        }
        self.order_of(self.kind(cell), &x[..nodes.len()])
    }

    /// Of an entity with these nodes, in the order of its geometry element.
    fn order_of(&self, kind: CellKind, x: &[[f64; 3]]) -> u8 {
        let geometry = &self.geometry[kind.index()];
        let corner = |k: usize| x[geometry.vertices[k]];
        let magnitude = x.iter().fold(0.0, |m: f64, x| m.max(norm(*x)));
        let size = (1..kind.n_vertices()).fold(0.0, |m: f64, k| m.max(distance(corner(k), corner(0))));
        let tolerance = SAME * size + ROUNDING * magnitude;
        let follows = |place: &dyn Fn([f64; 3]) -> [f64; 3]| {
            geometry.element.points().iter().zip(x).all(|(point, x)| distance(place(*point), *x) <= tolerance)
        };
        let axes = kind.axes();
        let affine = |r: [f64; 3]| {
            let slope = |i: usize| (0..kind.dim()).map(|d| r[d] * (corner(axes[d])[i] - corner(0)[i])).sum::<f64>();
            std::array::from_fn(|i| corner(0)[i] + slope(i))
        };
        let multilinear = |r: [f64; 3]| {
            let hats = kind.hat_values(r);
            std::array::from_fn(|i| (0..kind.n_vertices()).map(|k| hats[k] * corner(k)[i]).sum())
        };
        if follows(&affine) {
            0
        } else if self.order == 1 || follows(&multilinear) {
            1
        } else {
            2
        }
    }
}
