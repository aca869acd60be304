//! Images that move: what a value at the image of a point moves by.
//!
//! A mapping `raytrace from r onto s moving with u1, u2` finds the image `Y` where the ray from `x = X + u1` along the current
//! normal `n` of `r` meets the current faces `s`: `x + g n = y = Y + u2(Y)`. With `d1`, `d2` the variations of the two
//! displacements at fixed points of their bodies, `F = I + Grad u`, `n_y` the current normal of `s` and `B` the tangents of
//! the face in the reference placement,
//!
//! ```text
//! dn = -(I - n n') F1^-T (Grad d1)' n
//! dY = C F2' (I - n n_y'/(n.n_y)) (d1 - d2 + g dn),    C = B (B' F2' F2 B)^-1 B'
//! ```
//!
//! The image of `project` is the closest point `y`: with `B` the tangents of what it lies on, a face, an edge (one column) or a
//! corner (none), and `y_ab` the second derivatives of the current face along them,
//!
//! ```text
//! dY = C (F2' (d1 - d2) + (Grad d2)' (x - y)),    C = B A^-1 B',    A_ab = (B' F2' F2 B)_ab - (x - y).y_ab
//! ```
//!
//! Whatever is read at the image moves by its own variation and by its gradient along `dY`; a test function there moves,
//! too. `C` and the derivative of the reference normal along the face are leaves that the runtime fills in. Promises: exact
//! for images inside a face; where an image crosses an edge the derivative is that of the face found. There is no second
//! variation: the derivative of `C` is refused.

use crate::{
    compare::Compare,
    derive::NoDerivative,
    graph::{ExprId, Graph, Leaf, Role},
    ops::carried_normal,
    types::{FieldOp, ImageBy, Moves, Side},
};

/// What a second variation of an image is called in messages.
pub(crate) const SECOND: &str = "the image under a moving mapping";

/// Derivatives along test or trial functions in a graph that may read through a moving mapping.
pub(crate) struct Variation {
    role: Role,
    /// What has no derivative, once that was asked for.
    refused: Option<&'static str>,
}

impl Variation {
    /// Along the functions of this role.
    pub(crate) fn new(role: Role) -> Self {
        Self { role, refused: None }
    }

    /// What a leaf moves by where `own` is its variation at a fixed point of its body.
    pub(crate) fn of(&mut self, g: &mut Graph, leaf: Leaf, own: Option<ExprId>) -> Option<ExprId> {
        let Some(moves) = g.moves.filter(|_| g.is_at_image(leaf)) else { return own };
        let along = match leaf {
            Leaf::Field { op: FieldOp::Hess, .. } => {
                return self.refuse("a second derivative at the image of a mapping");
            }
            Leaf::Field { field, side, op, role } => {
                let next = if op == FieldOp::Value { FieldOp::Grad } else { FieldOp::Hess };
                let gradient = g.leaf(Leaf::Field { field, side, op: next, role });
                self.shifted(g, moves, gradient)
            }
            Leaf::Normal(_) => {
                let slope = g.leaf(Leaf::ImageSlope);
                self.shifted(g, moves, slope)
            }
            Leaf::ImageX => shift(g, moves, self.role),
            _ => return self.refuse(SECOND),
        };
        #[cfg(test)]
        let along = mutants::part(g, mutants::name(leaf), along);
        Some(match own {
            Some(own) => g.add(own, along),
            None => along,
        })
    }

    /// The last index of a gradient along the shift of the image.
    fn shifted(&self, g: &mut Graph, moves: Moves, gradient: ExprId) -> ExprId {
        let shift = shift(g, moves, self.role);
        let last = g.shape(gradient).rank() - 1;
        g.contract(gradient, shift, &[(last, 0)])
    }

    fn refuse(&mut self, what: &'static str) -> Option<ExprId> {
        self.refused.get_or_insert(what);
        None
    }

    /// The derivative of `root`, unless something in it has none.
    pub(crate) fn finish(self, root: ExprId, derived: ExprId) -> Result<ExprId, NoDerivative> {
        match self.refused {
            Some(what) => Err(NoDerivative { node: root, what }),
            None => Ok(derived),
        }
    }
}

/// `dY`: one node however often it is asked for.
fn shift(g: &mut Graph, moves: Moves, role: Role) -> ExprId {
    let [d1, d2] = values(g, moves, role);
    #[cfg(test)]
    let [d1, d2] = [("d1", d1), ("d2", d2)].map(|(name, part)| mutants::part(g, name, part));
    let apart = g.sub(d1, d2);
    let [_, grad2] = gradients(g, moves, Role::Current);
    #[cfg(test)]
    let grad2 = mutants::part(g, "F2 - I", grad2);
    let id = g.identity(g.dim);
    let f2 = g.add(id, grad2);
    let back = match moves.by {
        ImageBy::Ray => {
            let in_plane = along_ray(g, moves, role, apart);
            g.contract(f2, in_plane, &[(0, 0)])
        }
        ImageBy::Closest => {
            let straight = g.contract(f2, apart, &[(0, 0)]);
            let turned = turned(g, moves, role);
            g.add(straight, turned)
        }
    };
    let c = g.leaf(Leaf::ImageShift);
    g.contract(c, back, &[(1, 0)])
}

/// The two displacements, or their variations.
fn values(g: &mut Graph, moves: Moves, role: Role) -> [ExprId; 2] {
    let sides = [(moves.here, Side::Here), (moves.there, Side::There)];
    sides.map(|(field, side)| g.leaf(Leaf::Field { field, side, op: FieldOp::Value, role }))
}

/// The gradients of the two displacements, or of their variations.
fn gradients(g: &mut Graph, moves: Moves, role: Role) -> [ExprId; 2] {
    let sides = [(moves.here, Side::Here), (moves.there, Side::There)];
    sides.map(|(field, side)| g.leaf(Leaf::Field { field, side, op: FieldOp::Grad, role }))
}

/// `(I - n n_y'/(n.n_y)) (d1 - d2 + g dn)`: along the ray onto the tangent plane of the image.
fn along_ray(g: &mut Graph, moves: Moves, role: Role, apart: ExprId) -> ExprId {
    let [grad1, grad2] = gradients(g, moves, Role::Current);
    let normal = g.leaf(Leaf::Normal(Side::Here));
    let n = carried_normal(g, grad1, normal);
    let normal = g.leaf(Leaf::Normal(Side::There));
    let n_y = carried_normal(g, grad2, normal);
    let way = way(g, moves);
    let gap = g.inner(way, n);
    let dn = normal_variation(g, moves, grad1, n, role);
    #[cfg(test)]
    let dn = mutants::part(g, "dn", dn);
    let turned = g.scale(gap, dn);
    let w = g.add(apart, turned);
    let (steep, across) = (g.inner(n, n_y), g.inner(n_y, w));
    let part = g.divide(across, steep);
    // a point without an image has a stand-in, which may lie across its ray; nothing shifts there
    let (zero, nothing) = (g.number(0.0), g.zero(g.shape(part)));
    let is_met = g.compare(Compare::NotEqual, steep, zero);
    let part = g.select(is_met, part, nothing);
    let part = g.scale(part, n);
    #[cfg(test)]
    let part = mutants::part(g, "n n_y'/(n.n_y)", part);
    g.sub(w, part)
}

/// `(Grad d2)' (x - y)`: a face that turns takes the foot of the perpendicular with it.
fn turned(g: &mut Graph, moves: Moves, role: Role) -> ExprId {
    let [_, d] = gradients(g, moves, role);
    let way = way(g, moves);
    let back = g.neg(way);
    let turned = g.contract(d, back, &[(0, 0)]);
    #[cfg(test)]
    let turned = mutants::part(g, "(Grad d2)' (x - y)", turned);
    turned
}

/// `y - x`
fn way(g: &mut Graph, moves: Moves) -> ExprId {
    let [u1, u2] = values(g, moves, Role::Current);
    let (image, x) = (g.leaf(Leaf::ImageX), g.leaf(Leaf::X));
    let y = g.add(image, u2);
    let from = g.sub(y, x);
    g.sub(from, u1)
}

/// `-F1^-T (Grad d1)' n`: `dn` but for a part along `n`, which the projection along the ray takes out.
fn normal_variation(g: &mut Graph, moves: Moves, grad1: ExprId, n: ExprId, role: Role) -> ExprId {
    let d = g.leaf(Leaf::Field { field: moves.here, side: Side::Here, op: FieldOp::Grad, role });
    let id = g.identity(g.dim);
    let f1 = g.add(id, grad1);
    let inverse = g.inverse(f1);
    let along = g.contract(d, n, &[(0, 0)]);
    let carried = g.contract(inverse, along, &[(0, 0)]);
    g.neg(carried)
}

/// Parts of the formulas left out on purpose, for the test that each of them is missed.
#[cfg(test)]
pub(crate) mod mutants {
    use std::cell::Cell;

    use super::{ExprId, FieldOp, Graph, Leaf, Role};

    thread_local! {
        static LEFT_OUT: Cell<Option<&'static str>> = const { Cell::new(None) };
    }

    /// Parts of the shift along a ray alone.
    pub(crate) const OF_RAYS: [&str; 2] = ["dn", "n n_y'/(n.n_y)"];
    /// Those of the shift of a closest point alone.
    pub(crate) const OF_CLOSEST: [&str; 1] = ["(Grad d2)' (x - y)"];
    /// Parts of both, then what takes part in a shift.
    pub(crate) const PARTS: [&str; 10] = [
        "d1",
        "d2",
        "F2 - I",
        "value",
        "gradient",
        "test function",
        "gradient of a test function",
        "past",
        "position",
        "normal",
    ];

    pub(super) fn name(leaf: Leaf) -> &'static str {
        match leaf {
            Leaf::ImageX => "position",
            Leaf::Normal(_) => "normal",
            Leaf::Field { op: FieldOp::Value, role: Role::Test, .. } => "test function",
            Leaf::Field { role: Role::Test, .. } => "gradient of a test function",
            Leaf::Field { role: Role::Previous, .. } => "past",
            Leaf::Field { op: FieldOp::Value, .. } => "value",
            _ => "gradient",
        }
    }

    pub(super) fn part(g: &mut Graph, name: &str, e: ExprId) -> ExprId {
        if LEFT_OUT.get() == Some(name) { g.zero(g.shape(e)) } else { e }
    }

    /// What `make` gives without a part.
    pub(crate) fn without<T>(name: Option<&'static str>, make: impl FnOnce() -> T) -> T {
        LEFT_OUT.set(name);
        let made = make();
        LEFT_OUT.set(None);
        made
    }
}
