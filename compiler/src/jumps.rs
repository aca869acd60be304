//! Differences of the values of fields on the two sides of a face: where a field has the same unknowns on both sides
//! they are zero for every state.
//!
//! A sum of summands `c s` (nested sums, signs and factors that are numbers are opened) has such a difference where
//! summands become equal when the values from the other side are replaced by those of this side, and their factors `c`
//! add up to zero: `u - Interpolate(u, neighbor_element)` in any order, with further summands or below products. Means
//! of both sides have factors that add up to 1. Gradients differ on the two sides of a face of a continuous field; they
//! are not replaced.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    graph::{ExprId, Graph, Leaf, Node},
    law::{Listing, ValueJump},
    ops::rebuild,
    types::{FieldId, FieldOp, Side},
};

impl Listing {
    /// The differences of values of the same field on both sides of a face, in its energy or residual.
    #[must_use]
    pub fn value_jumps(&self) -> Vec<ValueJump> {
        self.energy.or(self.residual).map_or_else(Vec::new, |root| value_jumps(&self.graph, root))
    }
}

/// The differences of values of the same field on both sides of a face.
pub(crate) fn value_jumps(from: &Graph, root: ExprId) -> Vec<ValueJump> {
    let order = from.reachable(root);
    // what a mapping reaches is another point, not the other side
    if from.mapping.is_some() || !order.iter().any(|e| value_there(from, *e).is_some()) {
        return Vec::new();
    }
    let same = Replaced::new(from, &order);
    let mut found: Vec<ValueJump> = Vec::new();
    for sum in sums(from, root, &order) {
        for (fields, node) in same.differences(from, sum) {
            if !fields.is_empty() && found.iter().all(|f| f.fields != fields) {
                found.push(ValueJump { fields, origin: from.origin(node) });
            }
        }
    }
    found
}

/// The field whose value on the other side a node is.
fn value_there(g: &Graph, e: ExprId) -> Option<FieldId> {
    match *g.node(e) {
        Node::Leaf(Leaf::Field { field, side: Side::There, op: FieldOp::Value, .. }) if !g.is_global(field) => {
            Some(field)
        }
        _ => None,
    }
}

/// The operands of a node that is linear in them, with their factors; none for other nodes.
pub(crate) fn summands(g: &Graph, e: ExprId) -> Vec<(f64, ExprId)> {
    match *g.node(e) {
        Node::Add(a, b) => vec![(1.0, a), (1.0, b)],
        Node::Sub(a, b) => vec![(1.0, a), (-1.0, b)],
        Node::Neg(a) => vec![(-1.0, a)],
        Node::Scale(factor, a) => g.scalar_constant(factor).map_or_else(Vec::new, |c| vec![(c, a)]),
        Node::Divide(a, by) => g.scalar_constant(by).map_or_else(Vec::new, |c| vec![(1.0 / c, a)]),
        _ => Vec::new(),
    }
}

/// The sums that are no summands of a larger one only.
pub(crate) fn sums(g: &Graph, root: ExprId, order: &[ExprId]) -> Vec<ExprId> {
    let mut outermost = BTreeSet::from([root]);
    for e in order {
        if summands(g, *e).is_empty() {
            g.node(*e).for_each_operand(|o| {
                outermost.insert(o);
            });
        }
    }
    outermost.retain(|e| !summands(g, *e).is_empty());
    outermost.into_iter().collect()
}

/// Each node with the values of the other side replaced by those of this side.
struct Replaced {
    node: BTreeMap<ExprId, ExprId>,
    /// The fields that were replaced in it.
    fields: BTreeMap<ExprId, BTreeSet<FieldId>>,
}

impl Replaced {
    fn new(from: &Graph, order: &[ExprId]) -> Self {
        let mut g = from.clone();
        let mut node: BTreeMap<ExprId, ExprId> = BTreeMap::new();
        let mut fields: BTreeMap<ExprId, BTreeSet<FieldId>> = BTreeMap::new();
        for e in order {
            let mut own: BTreeSet<FieldId> = value_there(from, *e).into_iter().collect();
            from.node(*e).for_each_operand(|o| own.extend(fields.get(&o).into_iter().flatten()));
            let made = match *from.node(*e) {
                _ if own.is_empty() => *e,
                Node::Leaf(Leaf::Field { field, op, role, .. }) => {
                    g.leaf(Leaf::Field { field, side: Side::Here, op, role })
                }
                _ => rebuild(from, *e, &mut g, &[], &|o: ExprId| node[&o]),
            };
            node.insert(*e, made);
            if !own.is_empty() {
                fields.insert(*e, own);
            }
        }
        Self { node, fields }
    }

    /// The groups of summands that cancel: the fields that were replaced in them, and the innermost sum that has all of
    /// the group.
    fn differences(&self, g: &Graph, sum: ExprId) -> Vec<(Vec<FieldId>, ExprId)> {
        let mut open = BTreeMap::from([(sum, 1.0)]);
        let (mut nodes, mut leaves) = (Vec::new(), BTreeMap::<ExprId, Vec<(f64, ExprId)>>::new());
        // operands have smaller numbers than what is made of them
        while let Some((e, factor)) = open.pop_last() {
            let parts = summands(g, e);
            if parts.is_empty() {
                leaves.entry(self.node[&e]).or_default().push((factor, e));
            } else {
                nodes.push(e);
                parts.into_iter().for_each(|(c, part)| *open.entry(part).or_insert(0.0) += c * factor);
            }
        }
        let cancels = |group: &&Vec<(f64, ExprId)>| {
            let (sum, size) = group.iter().fold((0.0, 0.0), |(s, n), (c, _)| (s + c, n + f64::abs(*c)));
            // factors are products and sums of few numbers
            size > 0.0 && f64::abs(sum) <= 8.0 * f64::EPSILON * size
        };
        let several = leaves.values().filter(|group| group.iter().filter(|(c, _)| *c != 0.0).count() > 1);
        let groups = several.filter(cancels);
        let replaced = |e: &ExprId| self.fields.get(e).into_iter().flatten().copied();
        groups
            .map(|group| {
                let fields: BTreeSet<FieldId> = group.iter().flat_map(|(_, e)| replaced(e)).collect();
                let holds = |n: &&ExprId| {
                    let below = g.reachable(**n);
                    group.iter().all(|(_, e)| below.binary_search(e).is_ok())
                };
                let innermost = nodes.iter().rev().find(holds).copied().unwrap_or(sum);
                (fields.into_iter().collect(), innermost)
            })
            .collect()
    }
}
