//! Edges of faces: where a surface ends. In the plane faces are lines, and their edges are points.
//!
//! Promises: an edge of a face is a local facet of the kind of that face, so that it has a map and an outward normal there.

use super::{
    Mesh,
    index::{FacetRef, NodeId},
};
use crate::{
    cell::CellKind,
    quadrature::{self, Rule, facet_points},
    vector::norm,
};

/// An edge of a face; in the plane one of its two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FaceEdge {
    /// The face, seen from one of its cells.
    pub face: FacetRef,
    /// Local facet of the kind of the face.
    pub local: u8,
    /// The face on the other side of it and its local facet there, of an edge that is seen together with its neighbour.
    pub across: Option<(FacetRef, u8)>,
}

impl FaceEdge {
    /// The same edge, seen from the face across.
    #[must_use]
    pub fn neighbour(&self) -> Option<Self> {
        let (face, local) = self.across?;
        Some(Self { face, local, across: Some((self.face, self.local)) })
    }
}

impl Mesh {
    /// The edges of a face.
    pub fn edges_of_face(&self, face: FacetRef) -> impl Iterator<Item = FaceEdge> {
        let n = self.facet_kind(face).facets().len();
        let local = |k: usize| u8::try_from(k).expect("a face has at most four edges");
        (0..n).map(move |k| FaceEdge { face, local: local(k), across: None })
    }

    /// The vertices at the ends of an edge, in the order of its map; in the plane one of them.
    #[must_use]
    pub fn edge_ends(&self, edge: FaceEdge) -> Vec<NodeId> {
        let vertices = self.facet_vertices(edge.face);
        let local = self.facet_kind(edge.face).facets()[usize::from(edge.local)];
        local.vertices.iter().map(|k| vertices.vertices()[*k]).collect()
    }

    /// The shape of the edges of a face: segments, points in the plane.
    #[must_use]
    pub fn edge_kind(&self, edge: FaceEdge) -> CellKind {
        self.facet_kind(edge.face).facets()[usize::from(edge.local)].kind
    }

    /// Points of a rule on an edge in the parameters of its face, and as reference points of the cell.
    #[must_use]
    pub fn edge_points(&self, edge: FaceEdge, rule: &Rule) -> [Vec<[f64; 3]>; 2] {
        let (cell, local) = (self.kind(edge.face.cell), usize::from(edge.face.local));
        let parameters = facet_points(self.facet_kind(edge.face), usize::from(edge.local), rule);
        let map = cell.facet_map(local);
        let in_cell = parameters.iter().map(|p| cell.facet_point(local, map.apply(*p))).collect();
        [parameters, in_cell]
    }

    /// True where the face across has the ends of an edge in the other order.
    #[must_use]
    pub fn is_turned_across(&self, edge: FaceEdge) -> bool {
        edge.neighbour().is_some_and(|there| self.edge_ends(edge).first() != self.edge_ends(there).first())
    }

    /// Reference points of the cell of the face across an edge, those of [`Self::edge_points`].
    #[must_use]
    pub fn points_across(&self, edge: FaceEdge, rule: &Rule) -> Option<Vec<[f64; 3]>> {
        let there = edge.neighbour()?;
        let mut rule = rule.clone();
        if self.is_turned_across(edge) {
            rule.points.iter_mut().for_each(|p| p[0] = 1.0 - p[0]);
        }
        let [_, points] = self.edge_points(there, &rule);
        Some(points)
    }

    /// The middle of an edge.
    #[must_use]
    pub fn edge_middle(&self, edge: FaceEdge) -> [f64; 3] {
        let middle = quadrature::rule(self.edge_kind(edge), 1).expect("the midpoint rule");
        let [_, points] = self.edge_points(edge, &middle);
        let table = self.geometry_element(self.kind(edge.face.cell)).tabulate(&points, 0);
        self.point_at(edge.face.cell, &table, 0)
    }
}

/// Length of each of `edges`; 1 for points.
#[must_use]
pub fn edge_lengths(mesh: &Mesh, edges: &[FaceEdge]) -> Vec<f64> {
    let length = |edge: &FaceEdge| {
        let FaceEdge { face, local, .. } = *edge;
        let rule = quadrature::rule(mesh.edge_kind(*edge), 5).expect("rules of low degree exist");
        if rule.kind == CellKind::Point {
            return 1.0;
        }
        let [_, points] = mesh.edge_points(*edge, &rule);
        let table = mesh.geometry_element(mesh.kind(face.cell)).tabulate(&points, 1);
        let direction = direction(mesh.kind(face.cell), usize::from(face.local), usize::from(local));
        let speed = |point: usize| {
            let jacobian = mesh.jacobian_at(face.cell, &table, point);
            norm(jacobian.map(|row| row.iter().zip(direction).map(|(a, b)| a * b).sum()))
        };
        rule.weights.iter().enumerate().map(|(point, weight)| weight * speed(point)).sum()
    };
    edges.iter().map(length).collect()
}

/// The derivative of the reference point of a cell in the parameter of an edge of one of its facets; zero in the plane.
#[must_use]
pub fn direction(cell: CellKind, facet: usize, edge: usize) -> [f64; 3] {
    let [a, b] = cell.facet_map(facet).tangents;
    let [along, _] = cell.facets()[facet].kind.facet_map(edge).tangents;
    std::array::from_fn(|d| along[0] * a[d] + along[1] * b[d])
}
