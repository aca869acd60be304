//! What moves where the mesh does: the material derivatives of positions, gradients, normals and measures.
//!
//! Nodes of the mesh move by a velocity V, a field of the degree of the geometry, and with D its gradient (`D_ij` the derivative
//! of `V_i` in direction j): positions move by V, `Grad_u` by -Grad_u D, second derivatives by -H D - (H D)' - Grad_u D2_V,
//! gradients along a face by n (n.(D + D')g) - D'g, the normal by n (n.D'n) - D'n, the conormal c by
//! n (n.(D + D')c) - D'c + c (c.D'c), the gradient K of the geometric map by D K, its transposed inverse B by -D'B, and
//! integrals by Div V on cells, without n.Dn on faces, without c.Dc too along edges (Sokolowski and Zolesio, Introduction to
//! Shape Optimization, 1992, sections 2.16 to 2.20). All are exact for the equations as they are assembled: V has the functions
//! that the nodes of the mesh have. Knows nothing of how V is found.

use crate::{
    graph::{ExprId, Graph, Leaf, Role},
    types::{FieldId, FieldOp, FieldSig, Side},
};

/// What integrals are taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Cells.
    Cells,
    /// Faces.
    Faces,
    /// Edges of faces.
    Edges,
    /// Single points of weight 1, which move with the mesh.
    Points,
    /// A point that does not move with the mesh, but by the field of its own.
    Place,
}

/// The fields that say how the mesh moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Velocity {
    /// The velocity of the nodes, a vector.
    pub field: FieldId,
    /// By cell what its size moves by.
    pub size: FieldId,
    /// What a point of [`Extent::Place`] moves by, a vector that is the same everywhere.
    pub place: FieldId,
    /// Of the law.
    pub extent: Extent,
}

/// A velocity as one of the functions of its field.
#[derive(Clone, Copy)]
pub(crate) struct Motion<'a> {
    pub(crate) of: Velocity,
    /// Test functions, for derivatives in the velocity, or its values.
    pub(crate) role: Role,
    pub(crate) fields: &'a [FieldSig],
    /// Of those the ones that the scene has; behind them are weights and what the motion is made of.
    pub(crate) n_fields: usize,
}

impl Motion<'_> {
    fn read(self, g: &mut Graph, field: FieldId, side: Side, op: FieldOp) -> ExprId {
        g.leaf(Leaf::Field { field, side, op, role: self.role })
    }

    /// D
    fn gradient(self, g: &mut Graph, side: Side) -> ExprId {
        self.read(g, self.of.field, side, FieldOp::Grad)
    }

    /// What a leaf moves by where the mesh moves and all else keeps its values at the nodes.
    pub(crate) fn of_leaf(self, g: &mut Graph, leaf: Leaf) -> Option<ExprId> {
        match leaf {
            Leaf::X if self.of.extent == Extent::Place => Some(self.read(g, self.of.place, Side::Here, FieldOp::Value)),
            Leaf::X => Some(self.read(g, self.of.field, Side::Here, FieldOp::Value)),
            Leaf::Field { field, side, op, role } => {
                let moved = match op {
                    FieldOp::Value => None,
                    FieldOp::Grad => Some(self.of_gradient(g, leaf, side, field)),
                    FieldOp::Hess => Some(self.of_second(g, leaf, side)),
                };
                let further = match op {
                    FieldOp::Value => Some(FieldOp::Grad),
                    FieldOp::Grad => Some(FieldOp::Hess),
                    FieldOp::Hess => None,
                };
                let is_own = field.index() < self.n_fields && !self.fields[field.index()].global;
                let is_still = self.of.extent != Extent::Place || !is_own;
                let Some(further) = further.filter(|_| !is_still) else { return moved };
                let slope = g.leaf(Leaf::Field { field, side, op: further, role });
                let beside = self.beside_the_mesh(g);
                let by_place = along_last(g, slope, beside);
                Some(moved.map_or(by_place, |moved| g.add(moved, by_place)))
            }
            Leaf::Normal(side) => {
                let (n, d) = (g.leaf(leaf), self.gradient(g, side));
                let turned = g.contract(n, d, &[(0, 0)]);
                let size = g.inner(n, turned);
                let along = g.scale(size, n);
                Some(g.sub(along, turned))
            }
            Leaf::Conormal(side) => Some(self.of_conormal(g, side)),
            Leaf::ElementSize(side) => Some(self.read(g, self.of.size, side, FieldOp::Value)),
            Leaf::ElementK(side) => {
                let (k, d) = (g.leaf(leaf), self.gradient(g, side));
                Some(g.contract(d, k, &[(1, 0)]))
            }
            Leaf::ElementB(side) => {
                let (b, d) = (g.leaf(leaf), self.gradient(g, side));
                let moved = g.contract(d, b, &[(0, 0)]);
                Some(g.neg(moved))
            }
            _ => None,
        }
    }

    /// By how much more than the mesh a point of its own moves.
    fn beside_the_mesh(self, g: &mut Graph) -> ExprId {
        let place = self.read(g, self.of.place, Side::Here, FieldOp::Value);
        let mesh = self.read(g, self.of.field, Side::Here, FieldOp::Value);
        g.sub(place, mesh)
    }

    fn of_gradient(self, g: &mut Graph, leaf: Leaf, side: Side, field: FieldId) -> ExprId {
        let (gradient, d) = (g.leaf(leaf), self.gradient(g, side));
        let last = g.shape(gradient).rank() - 1;
        let turned = g.contract(gradient, d, &[(last, 0)]);
        if !self.fields[field.index()].on_faces {
            return g.neg(turned);
        }
        let n = g.leaf(Leaf::Normal(side));
        let stretched = g.contract(gradient, d, &[(last, 1)]);
        let both = g.add(stretched, turned);
        let size = along_last(g, both, n);
        let along = g.contract(size, n, &[]);
        g.sub(along, turned)
    }

    fn of_second(self, g: &mut Graph, leaf: Leaf, side: Side) -> ExprId {
        let Leaf::Field { field, role, .. } = leaf else { return g.number(0.0) };
        let (second, d) = (g.leaf(leaf), self.gradient(g, side));
        let rank = g.shape(second).rank();
        let once = g.contract(second, d, &[(rank - 1, 0)]);
        let mut order: Vec<usize> = (0..rank).collect();
        order.swap(rank - 1, rank - 2);
        let other = g.permute(once, &order);
        let gradient = g.leaf(Leaf::Field { field, side, op: FieldOp::Grad, role });
        let bent = self.read(g, self.of.field, side, FieldOp::Hess);
        let last = g.shape(gradient).rank() - 1;
        let by_bending = g.contract(gradient, bent, &[(last, 0)]);
        let both = g.add(once, other);
        let all = g.add(both, by_bending);
        g.neg(all)
    }

    fn of_conormal(self, g: &mut Graph, side: Side) -> ExprId {
        let (c, n, d) = (g.leaf(Leaf::Conormal(side)), g.leaf(Leaf::Normal(side)), self.gradient(g, side));
        let turned = g.contract(c, d, &[(0, 0)]);
        let stretched = g.contract(d, c, &[(1, 0)]);
        let both = g.add(turned, stretched);
        let size = g.inner(n, both);
        let out = g.scale(size, n);
        let size = g.inner(c, turned);
        let along = g.scale(size, c);
        let sum = g.add(out, along);
        g.sub(sum, turned)
    }

    /// By how much of itself what is integrated over grows; `None` for points.
    pub(crate) fn growth(self, g: &mut Graph) -> Option<ExprId> {
        if matches!(self.of.extent, Extent::Points | Extent::Place) {
            return None;
        }
        let d = self.gradient(g, Side::Here);
        let mut sum = g.trace(d, 0, 1);
        let across: &[Leaf] = match self.of.extent {
            Extent::Faces => &[Leaf::Normal(Side::Here)],
            Extent::Edges => &[Leaf::Normal(Side::Here), Leaf::Conormal(Side::Here)],
            _ => &[],
        };
        for leaf in across {
            let direction = g.leaf(*leaf);
            let stretched = g.contract(d, direction, &[(1, 0)]);
            let part = g.inner(direction, stretched);
            sum = g.sub(sum, part);
        }
        Some(sum)
    }
}

/// The last index of a tensor with a vector.
fn along_last(g: &mut Graph, tensor: ExprId, vector: ExprId) -> ExprId {
    let last = g.shape(tensor).rank() - 1;
    g.contract(tensor, vector, &[(last, 0)])
}
