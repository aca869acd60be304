//! Half lines in other words than `pos_part`: `max(0, x)`, `if x > 0 then c*x else 0`, `min(-x, 0)` are c times the positive part
//! of x.
//!
//! Promises: the values of the graph, and at zero its derivatives. What is known before the solution is a factor, whatever its
//! sign is.

use std::collections::BTreeMap;

use crate::{
    compare::Compare,
    graph::{ExprId, Graph, Node},
    ops::rebuild,
    types::FieldSig,
};

/// The graph and its root with such selections as factors times `0 <= x ? x : 0`, or `0 < x`; `None` where there are none.
pub(super) fn rewritten(from: &Graph, root: ExprId, fields: &[FieldSig]) -> Option<(Graph, ExprId)> {
    let order = from.reachable(root);
    if order.iter().all(|e| Multiple::of(from, *e).is_none()) {
        return None;
    }
    let mut g = Graph::new(from.dim, fields);
    g.moves = from.moves;
    let mut copied: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    for e in &order {
        let before = g.set_origin(from.origin(*e));
        let made = match Multiple::of(from, *e) {
            Some(multiple) => multiple.build(&mut g, &copied),
            None => rebuild(from, *e, &mut g, &[], &|o: ExprId| copied[&o]),
        };
        g.set_origin(before);
        copied.insert(*e, made);
    }
    Some((g, *copied.get(order.last()?)?))
}

/// The code of the mask of a selection on which it is a multiple of the positive part of its argument that is not zero; `None` for other
/// selections.
pub(crate) fn active_code(g: &Graph, e: ExprId) -> Option<u8> {
    let Node::Select(mask, a, b) = *g.node(e) else { return None };
    let Node::Compare(_, zero, x) = *g.node(mask) else { return None };
    let is_written = a == x && g.is_zero(b) && g.is_zero(zero);
    (is_written || Multiple::of(g, e).is_some()).then(|| u8::from(g.is_zero(b)))
}

/// A factor of a value.
#[derive(Clone, Copy)]
enum Factor {
    Times(ExprId),
    Over(ExprId),
    Minus,
}

/// A multiple of the positive part of an argument.
struct Multiple {
    /// The argument, or with `is_negated` what it is minus of.
    of: ExprId,
    is_negated: bool,
    /// `<` or `<=`: whether the branch of zero is the constant one.
    op: Compare,
    factors: Vec<Factor>,
}

impl Multiple {
    /// What a selection is a multiple of; `None` for one that is written as a half line, or is none.
    fn of(g: &Graph, e: ExprId) -> Option<Self> {
        let Node::Select(mask, a, b) = *g.node(e) else { return None };
        let Node::Compare(op @ (Compare::Less | Compare::LessEqual), low, high) = *g.node(mask) else { return None };
        // where a condition does not hold the other one does, with the other side of zero
        let other = if op == Compare::Less { Compare::LessEqual } else { Compare::Less };
        let (of, is_negated, op, value) = match [a, b, low, high].map(|part| g.is_zero(part)) {
            [false, true, true, false] => (high, false, op, a),
            [false, true, false, true] => (low, true, op, a),
            [true, false, false, true] => (low, false, other, b),
            [true, false, true, false] => (high, true, other, b),
            _ => return None,
        };
        if !g.depends(of).unknown || g.shape(of) != g.shape(value) {
            return None;
        }
        let is_written = !is_negated && a == high && g.is_zero(low);
        let mut factors = factors_between(g, value, of)?;
        if is_negated {
            factors.push(Factor::Minus);
        }
        (!is_written).then_some(Self { of, is_negated, op, factors })
    }

    fn build(&self, g: &mut Graph, copied: &BTreeMap<ExprId, ExprId>) -> ExprId {
        let x = copied[&self.of];
        let x = if self.is_negated { g.neg(x) } else { x };
        let zero = g.zero(g.shape(x));
        let mask = g.compare(self.op, zero, x);
        let half_line = g.select(mask, x, zero);
        self.factors.iter().fold(half_line, |value, factor| match factor {
            Factor::Times(by) => times(g, copied[by], value),
            Factor::Over(by) => g.divide(value, copied[by]),
            Factor::Minus => g.neg(value),
        })
    }
}

fn times(g: &mut Graph, by: ExprId, value: ExprId) -> ExprId {
    if g.shape(by) == g.shape(value) { g.mul_components(by, value) } else { g.scale(by, value) }
}

/// What a value is of an argument, if that is a product with what is known before the solution.
fn factors_between(g: &Graph, value: ExprId, argument: ExprId) -> Option<Vec<Factor>> {
    let is_known = |e: ExprId| !g.depends(e).unknown;
    let (mut at, mut factors) = (value, Vec::new());
    while at != argument {
        let (factor, inside) = match *g.node(at) {
            Node::Neg(a) => (Factor::Minus, a),
            Node::Scale(a, b) | Node::MulComponents(a, b) if is_known(a) => (Factor::Times(a), b),
            Node::Scale(a, b) | Node::MulComponents(a, b) if is_known(b) && g.shape(a) == g.shape(b) => {
                (Factor::Times(b), a)
            }
            Node::Divide(a, b) if is_known(b) => (Factor::Over(b), a),
            // the argument may be a minus, too
            _ => match *g.node(argument) {
                Node::Neg(a) if a == at => {
                    factors.push(Factor::Minus);
                    return Some(factors);
                }
                _ => return None,
            },
        };
        factors.push(factor);
        at = inside;
    }
    Some(factors)
}
