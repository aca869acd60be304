//! Derivatives to one side: at a kink between two branches the direction decides.
//!
//! Where both sides of a comparison are one number, `a < b` of values beside it is `da < db` of what they move by. The
//! projection on a ball moves, where the norm of its argument is its radius, as in the ball if `e.dv <= dr`; where both are
//! zero it is the projection of `dv` on the ball of radius `dr`, for both are cones; and a norm of zero moves by the norm of
//! what its argument moves by. What is one number is told by a tolerance for each kink, data of the law. Such a derivative
//! is no linear function of the direction, but positively homogeneous: one of twice a direction is twice as large.

use std::collections::HashMap;

use super::{Derived, NoDerivative, Rules, select, slipping};
use crate::{
    compare::Compare,
    graph::{ExprId, Graph, Node},
};

/// The kinks that a derivative to one side decides on.
#[derive(Debug)]
pub(crate) struct Ties {
    /// A vector with a tolerance for each kink.
    tolerances: ExprId,
    /// Both sides of each, one after the other.
    pub(crate) sides: Vec<ExprId>,
    known: HashMap<ExprId, ExprId>,
}

impl Ties {
    /// Kinks with tolerances from this vector, of [`Self::most`] numbers.
    pub(crate) fn new(tolerances: ExprId) -> Self {
        Self { tolerances, sides: Vec::new(), known: HashMap::new() }
    }

    /// How many there are at most in an expression.
    pub(crate) fn most(graph: &Graph, root: ExprId) -> usize {
        let of = |e: &ExprId| match *graph.node(*e) {
            Node::Compare(_, a, _) => graph.shape(a).len(),
            Node::InBall(..) | Node::Ball(..) | Node::Norm(_) => 1,
            _ => 0,
        };
        graph.reachable(root).iter().map(of).sum()
    }

    /// Adds kinks, entry by entry; gives their tolerances.
    fn add(&mut self, g: &mut Graph, a: ExprId, b: ExprId) -> ExprId {
        let shape = g.shape(a);
        let first = self.sides.len() / 2;
        for k in 0..shape.len() {
            let pair = [g.entry(a, k), g.entry(b, k)];
            self.sides.extend(pair);
        }
        let numbers: Vec<ExprId> = (0..shape.len()).map(|k| g.entry(self.tolerances, first + k)).collect();
        g.stack(shape, &numbers)
    }
}

impl Rules<'_, '_> {
    /// The mask that the derivative of a selection takes.
    pub(super) fn mask(&mut self, g: &mut Graph, mask: ExprId) -> Result<ExprId, NoDerivative> {
        let Some(ties) = self.ties.as_ref() else { return Ok(mask) };
        if let Some(known) = ties.known.get(&mask) {
            return Ok(*known);
        }
        let made = match *g.node(mask) {
            Node::Compare(op @ (Compare::Less | Compare::LessEqual), a, b) => self.comparison(g, mask, (op, a, b))?,
            Node::InBall(v, r) => self.in_ball(g, mask, v, r)?,
            Node::And(a, b) => {
                let (a, b) = (self.mask(g, a)?, self.mask(g, b)?);
                g.and(a, b)
            }
            Node::Or(a, b) => {
                let (a, b) = (self.mask(g, a)?, self.mask(g, b)?);
                g.or(a, b)
            }
            Node::Not(a) => {
                let a = self.mask(g, a)?;
                g.not(a)
            }
            _ => mask,
        };
        if let Some(ties) = &mut self.ties {
            ties.known.insert(mask, made);
        }
        Ok(made)
    }

    fn tolerances(&mut self, g: &mut Graph, a: ExprId, b: ExprId) -> ExprId {
        match &mut self.ties {
            Some(ties) => ties.add(g, a, b),
            None => g.zero(g.shape(a)),
        }
    }

    fn comparison(
        &mut self,
        g: &mut Graph,
        mask: ExprId,
        of: (Compare, ExprId, ExprId),
    ) -> Result<ExprId, NoDerivative> {
        let (op, a, b) = of;
        let (da, db) = (self.of(g, a)?, self.of(g, b)?);
        if da.is_none() && db.is_none() {
            return Ok(mask);
        }
        let tolerance = self.tolerances(g, a, b);
        let zero = g.zero(g.shape(a));
        let moved = g.compare(op, da.unwrap_or(zero), db.unwrap_or(zero));
        let near = near(g, a, b, tolerance);
        Ok(decided(g, near, moved, mask))
    }

    fn in_ball(&mut self, g: &mut Graph, mask: ExprId, v: ExprId, r: ExprId) -> Result<ExprId, NoDerivative> {
        let (dv, dr) = (self.of(g, v)?, self.of(g, r)?);
        if dv.is_none() && dr.is_none() {
            return Ok(mask);
        }
        let (norm, radius) = (g.norm(v), g.to_scalar(r));
        let tolerance = self.tolerances(g, norm, radius);
        Ok(stays_inside(g, (v, radius, mask), tolerance, (dv, dr)))
    }

    pub(super) fn norm_to_side(&mut self, g: &mut Graph, norm: ExprId, v: ExprId) -> Derived {
        let Some(dv) = self.of(g, v)? else { return Ok(None) };
        let zero = g.number(0.0);
        let tolerance = self.tolerances(g, norm, zero);
        let is_zero = g.compare(Compare::LessEqual, norm, tolerance);
        let (n, grown) = (g.unit(v), g.norm(dv));
        let along = g.inner(n, dv);
        Ok(Some(g.select(is_zero, grown, along)))
    }

    pub(super) fn ball_to_side(&mut self, g: &mut Graph, v: ExprId, r: ExprId) -> Derived {
        let (dv, dr) = (self.of(g, v)?, self.of(g, r)?);
        if dv.is_none() && dr.is_none() {
            return Ok(None);
        }
        let (norm, radius, zero) = (g.norm(v), g.to_scalar(r), g.number(0.0));
        let tolerance = self.tolerances(g, norm, radius);
        let inside = g.in_ball(v, r);
        let stick = stays_inside(g, (v, radius, inside), tolerance, (dv, dr));
        let slip = slipping(g, (v, r), dv, dr);
        let closed = select(g, stick, dv, slip);
        let grows = dr.map_or(zero, |dr| g.to_scalar(dr));
        let vanishes = near(g, radius, zero, tolerance);
        let [opens, pressed] = [grows, radius].map(|x| g.compare(Compare::LessEqual, zero, x));
        let pressed = decided(g, vanishes, opens, pressed);
        let ordinary = select(g, pressed, closed, None);
        let still = g.zero(g.shape(v));
        let cone = g.ball(dv.unwrap_or(still), grows);
        let is_short = g.compare(Compare::LessEqual, norm, tolerance);
        let apex = g.and(vanishes, is_short);
        Ok(select(g, apex, Some(cone), ordinary))
    }
}

/// Mask: both within the tolerance.
fn near(g: &mut Graph, a: ExprId, b: ExprId, tolerance: ExprId) -> ExprId {
    let apart = [g.sub(a, b), g.sub(b, a)];
    let [above, below] = apart.map(|d| g.compare(Compare::LessEqual, d, tolerance));
    g.and(above, below)
}

/// Mask: `near ? moved : written`.
fn decided(g: &mut Graph, near: ExprId, moved: ExprId, written: ExprId) -> ExprId {
    let far = g.not(near);
    let (there, elsewhere) = (g.and(near, moved), g.and(far, written));
    g.or(there, elsewhere)
}

/// Mask: `v` stays in the ball of radius `r`; `inside` says whether it is there.
fn stays_inside(
    g: &mut Graph,
    of: (ExprId, ExprId, ExprId),
    tolerance: ExprId,
    moved: (Option<ExprId>, Option<ExprId>),
) -> ExprId {
    let ((v, radius, inside), zero) = (of, g.number(0.0));
    let (norm, n) = (g.norm(v), g.unit(v));
    let along = moved.0.map_or(zero, |dv| g.inner(n, dv));
    let grows = moved.1.map_or(zero, |dr| g.to_scalar(dr));
    let stays = g.compare(Compare::LessEqual, along, grows);
    let meets = near(g, norm, radius, tolerance);
    decided(g, meets, stays, inside)
}
