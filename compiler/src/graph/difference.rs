//! The difference of two values of one expression, such as now and at the end of the previous step.
//!
//! Promises: the value of `a - b`. What both have in common is left out before anything is rounded: of an aperture
//! `w0 + o` the change is that of `o`, however small it is beside `w0`.

use super::{ExprId, Graph, Node};

/// Expressions that are nested more deeply are subtracted as they are.
const DEEP: usize = 500;

impl Graph {
    /// `now - before`, summand by summand where both are built alike.
    pub fn difference(&mut self, now: ExprId, before: ExprId) -> ExprId {
        assert_eq!(self.shape(now), self.shape(before));
        if now == before {
            return self.zero(self.shape(now));
        }
        if self.depth(now).max(self.depth(before)) > DEEP {
            return self.sub(now, before);
        }
        match (self.node(now).clone(), self.node(before).clone()) {
            (Node::Add(a, b), Node::Add(c, d)) if self.are_alike([a, b], [c, d]) => {
                let (first, second) = (self.difference(a, c), self.difference(b, d));
                self.add(first, second)
            }
            (Node::Sub(a, b), Node::Sub(c, d)) if self.are_alike([a, b], [c, d]) => {
                let (first, second) = (self.difference(a, c), self.difference(b, d));
                self.sub(first, second)
            }
            (Node::Neg(a), Node::Neg(c)) => {
                let change = self.difference(a, c);
                self.neg(change)
            }
            (Node::Scale(s, a), Node::Scale(r, c)) if s == r && self.shape(a) == self.shape(c) => {
                let change = self.difference(a, c);
                self.scale(s, change)
            }
            (Node::Scale(s, a), Node::Scale(r, c)) if a == c => {
                let change = self.difference(s, r);
                self.scale(change, a)
            }
            (Node::Divide(a, s), Node::Divide(c, r)) if s == r && self.shape(a) == self.shape(c) => {
                let change = self.difference(a, c);
                self.divide(change, s)
            }
            (Node::Contract(a, b, over), Node::Contract(c, d, also))
                if over == also && self.are_alike([a, b], [c, d]) =>
            {
                let axes: Vec<(usize, usize)> = over.iter().map(|(i, j)| (usize::from(*i), usize::from(*j))).collect();
                if b == d {
                    let change = self.difference(a, c);
                    return self.contract(change, b, &axes);
                }
                if a == c {
                    let change = self.difference(b, d);
                    return self.contract(a, change, &axes);
                }
                self.sub(now, before)
            }
            _ => self.sub(now, before),
        }
    }

    /// Whether the operands of two nodes have the same shapes.
    fn are_alike(&self, now: [ExprId; 2], before: [ExprId; 2]) -> bool {
        now.iter().zip(&before).all(|(a, b)| self.shape(*a) == self.shape(*b))
    }
}
