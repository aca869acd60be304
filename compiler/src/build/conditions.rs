//! Conditions to masks. Coordinates may be compared within a tolerance, everything else exactly.

use wfl::{
    Code, Diagnostic,
    ast::{CmpOp, Cond, CondKind, Expr},
};

use crate::{
    build::{
        Builder,
        gradient::{Reach, along_axis},
        operators::LONGEST_CHAIN,
    },
    compare::Compare,
    derive::derive,
    graph::{ExprId, Function1, Graph, Node},
    math::MathFn1,
    types::Shape,
};

/// Which of several conditions have to hold.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Joint {
    All,
    One,
}

impl Builder<'_> {
    /// The mask of a condition.
    pub fn condition(&mut self, c: &Cond) -> Option<ExprId> {
        match &c.kind {
            CondKind::Compare(first, rest) => {
                let mut left = self.scalar_operand(first);
                let mut all = Vec::with_capacity(rest.len());
                for (op, part) in rest {
                    let right = self.scalar_operand(part);
                    let (a, b) = (left?, right?);
                    all.push(self.comparison(*op, a, b));
                    left = Some(b);
                }
                self.joined(&all, Graph::and)
            }
            CondKind::And(parts) => self.join(parts, Joint::All),
            CondKind::Or(parts) => self.join(parts, Joint::One),
            CondKind::Not(a) => {
                let a = self.condition(a)?;
                Some(self.graph.not(a))
            }
        }
    }

    /// Conditions joined.
    fn join(&mut self, parts: &[Cond], joint: Joint) -> Option<ExprId> {
        // behind a condition with this value the others say nothing
        let decides = joint == Joint::One;
        let before = self.dead;
        let mut built = Vec::with_capacity(parts.len());
        for part in parts {
            let mask = self.condition(part);
            let known = mask.and_then(|mask| self.graph.constant_mask(mask));
            self.dead |= known.is_some_and(|m| m.iter().all(|x| *x == decides));
            built.push(mask);
        }
        self.dead = before;
        let built: Vec<ExprId> = built.into_iter().collect::<Option<_>>()?;
        self.joined(&built, if joint == Joint::All { Graph::and } else { Graph::or })
    }

    /// Masks joined in parts, so that a long list is not deep.
    fn joined(&mut self, masks: &[ExprId], f: fn(&mut Graph, ExprId, ExprId) -> ExprId) -> Option<ExprId> {
        let g = &mut self.graph;
        let mut all: Option<ExprId> = None;
        for part in masks.chunks(LONGEST_CHAIN) {
            let part = part.iter().copied().reduce(|a, b| f(g, a, b))?;
            all = Some(all.map_or(part, |a| f(g, a, part)));
        }
        all
    }

    fn scalar_operand(&mut self, e: &Expr) -> Option<ExprId> {
        let value = self.expr(e)?;
        self.no_tests(e, value, "a comparison")?;
        let shape = self.graph.shape(value);
        if !shape.is_scalar_like() {
            let d = Diagnostic::new(Code::E108, format!("a comparison needs scalars, found a {shape}"));
            return self.report(d, e, shape.to_string());
        }
        Some(self.graph.to_scalar(value))
    }

    fn comparison(&mut self, op: CmpOp, a: ExprId, b: ExprId) -> ExprId {
        let g = &mut self.graph;
        match op {
            CmpOp::Less => g.compare(Compare::Less, a, b),
            CmpOp::LessEqual => g.compare(Compare::LessEqual, a, b),
            CmpOp::Greater => g.compare(Compare::Less, b, a),
            CmpOp::GreaterEqual => g.compare(Compare::LessEqual, b, a),
            CmpOp::Equal | CmpOp::NotEqual if self.loose_equality => {
                let difference = g.sub(a, b);
                let tolerance = self.within(difference);
                let g = &mut self.graph;
                let minus = g.neg(difference);
                let above = g.compare(Compare::LessEqual, difference, tolerance);
                let below = g.compare(Compare::LessEqual, minus, tolerance);
                let equal = g.and(above, below);
                if op == CmpOp::Equal { equal } else { g.not(equal) }
            }
            CmpOp::Equal => g.compare(Compare::Equal, a, b),
            CmpOp::NotEqual => g.compare(Compare::NotEqual, a, b),
        }
    }

    /// How large a difference of two expressions may be where they count as equal: what it changes by over the length
    /// `equal_within`, so that `x*(L - x) == 0` and `x^2 + y^2 == R^2` hold as near as `x == 0` in every unit of length, and
    /// what rounding leaves of its summands: a double root has no slope. The length itself is taken for what does not change
    /// with the position, and for what may have no slope or an infinite one.
    fn within(&mut self, difference: ExprId) -> ExprId {
        let length = self.graph.number(self.env.equal_within);
        if !has_a_slope(&self.graph, difference) {
            return length;
        }
        let fields = self.env.fields;
        let along = |g: &mut Graph, k: usize| {
            derive(g, difference, &mut |g, leaf| along_axis(g, leaf, k, fields, &mut Reach::default())).ok()
        };
        let slopes: Option<Vec<ExprId>> = (0..self.env.dim).map(|k| along(&mut self.graph, k)).collect();
        let g = &mut self.graph;
        match slopes {
            Some(slopes) if slopes.iter().any(|slope| !g.is_zero(*slope)) => {
                let slopes = g.stack(Shape::vector(slopes.len()), &slopes);
                let slope = g.norm(slopes);
                let near = g.scale(length, slope);
                // of a line the length is far above rounding already
                if g.depends(slope).point {
                    let size = summands(g, difference);
                    let roundoff = g.number(ROUNDOFF);
                    let roundoff = g.scale(roundoff, size);
                    g.add(near, roundoff)
                } else {
                    near
                }
            }
            _ => length,
        }
    }
}

/// Roundoff of a formula of some ten operations, in parts of its summands.
const ROUNDOFF: f64 = 16.0 * f64::EPSILON;

/// The sum of the sizes of what an expression adds up.
fn summands(g: &mut Graph, e: ExprId) -> ExprId {
    match *g.node(e) {
        Node::Add(a, b) | Node::Sub(a, b) => {
            let (a, b) = (summands(g, a), summands(g, b));
            g.add(a, b)
        }
        Node::Neg(a) => summands(g, a),
        _ => g.norm(e),
    }
}

/// True for an expression whose derivatives are finite wherever it is: sums, products, entries, and functions without a
/// singular point.
fn has_a_slope(g: &Graph, e: ExprId) -> bool {
    g.reachable(e).into_iter().all(|e| match g.node(e) {
        Node::Const(_)
        | Node::Leaf(_)
        | Node::Add(..)
        | Node::Sub(..)
        | Node::Neg(_)
        | Node::Scale(..)
        | Node::MulComponents(..)
        | Node::Contract(..)
        | Node::Trace(..)
        | Node::Permute(..)
        | Node::Reshape(_)
        | Node::Pick(..)
        | Node::Stack(_)
        | Node::Norm(_) => true,
        Node::Divide(_, by) | Node::DivComponents(_, by) => g.constant_value(*by).is_some(),
        Node::Map(Function1::Math(function), _) => matches!(
            function,
            MathFn1::Sin | MathFn1::Cos | MathFn1::Exp | MathFn1::Sinh | MathFn1::Cosh | MathFn1::Tanh | MathFn1::Atan
        ),
        _ => false,
    })
}
