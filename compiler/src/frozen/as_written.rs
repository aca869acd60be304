//! Functions whose projections stay as they are written: powers, roots, logarithms, exponentials, what is divided by. On a
//! frozen branch the value of a projection may be any number, also one that the projection never takes (a closed point at
//! an open gap), and there such a function has no value, or one that is huge, or one that pushes the more the further
//! the gap opens (a square).
//!
//! Promises: sums and products of different projections are none of them, nor are norms and kinks.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    graph::{ExprId, Graph, Node},
    math::MathFn2,
    ops::rebuild,
};

/// The nodes of a term that keep the projections inside them as written: functions that are safe between the values of a
/// projection alone.
pub(super) fn nodes(g: &Graph, order: &[ExprId], is_projection: &dyn Fn(ExprId) -> bool) -> BTreeSet<ExprId> {
    // by node: the projections that its value is made of; what one of them projects does not count
    let mut inside: BTreeMap<ExprId, BTreeSet<ExprId>> = BTreeMap::new();
    let mut kept = BTreeSet::new();
    for e in order {
        let mut own = BTreeSet::new();
        g.node(*e).for_each_operand(|o| own.extend(inside.get(&o).into_iter().flatten()));
        let has = |o: &ExprId| inside.contains_key(o);
        let share = |a: &ExprId, b: &ExprId| match (inside.get(a), inside.get(b)) {
            (Some(a), Some(b)) => !a.is_disjoint(b),
            _ => false,
        };
        let is_kept = match g.node(*e) {
            Node::Map(_, a) | Node::Lookup(_, _, a) | Node::Inverse(a) | Node::Matrix(_, a) => has(a),
            Node::Divide(_, by) | Node::DivComponents(_, by) => has(by),
            Node::Map2(MathFn2::Pow, a, b) => has(a) || has(b),
            Node::Scale(a, b) | Node::MulComponents(a, b) | Node::Contract(a, b, _) => share(a, b),
            _ => false,
        };
        if is_kept {
            kept.insert(*e);
        }
        if is_projection(*e) {
            own = BTreeSet::from([*e]);
        }
        if !own.is_empty() {
            inside.insert(*e, own);
        }
    }
    kept
}

/// Copies of these nodes and of all that they are made of into another graph.
pub(super) fn copies(
    from: &Graph,
    order: &[ExprId],
    kept: &BTreeSet<ExprId>,
    g: &mut Graph,
) -> BTreeMap<ExprId, ExprId> {
    let mut copied = BTreeMap::new();
    if kept.is_empty() {
        return copied;
    }
    for e in order {
        let before = g.set_origin(from.origin(*e));
        let made = rebuild(from, *e, g, &[], &|o: ExprId| copied[&o]);
        g.set_origin(before);
        copied.insert(*e, made);
    }
    copied.retain(|e, _| kept.contains(e));
    copied
}
