//! Which half lines of a term press: an aperture `[gap]_+` in a term of contact is a coefficient of what flows or conducts across
//! the gap, and no law of contact.
//!
//! A projection presses if its value stands in the equations of a field whose values its argument reads, or of a multiplier. In
//! which equations it stands is read from the graph: a product counts for the test functions of its factors, and a tensor that
//! is stacked of several for all of theirs. Promises: where none of a term presses, all are left as they were.

use std::collections::{BTreeMap, BTreeSet};

use super::Found;
use crate::{
    branch::ProjectionKind,
    graph::{ExprId, Graph, Leaf, Node, Role},
    types::{FieldId, FieldKind, FieldOp, FieldSig},
};

/// By node the fields whose equations it stands in.
type Tested = BTreeMap<ExprId, BTreeSet<FieldId>>;

/// Half lines that act beside others that press, and do not press themselves, act no more.
pub(super) fn leave_pressing(g: &Graph, root: ExprId, fields: &[FieldSig], found: &mut [Found]) {
    let is_half_line = |f: &Found| f.projection.kind == ProjectionKind::HalfLine && f.projection.acts;
    if found.iter().filter(|f| is_half_line(f)).count() < 2 {
        return;
    }
    let stands_in = equations_of(g, root);
    let presses = |f: &Found| {
        let reads = read_by(g, f.argument);
        let is_own = |field: &FieldId| reads.contains(field) || fields[field.index()].kind == FieldKind::Multiplier;
        stands_in.get(&f.node).is_some_and(|all| all.iter().any(is_own))
    };
    let pressing: Vec<bool> = found.iter().map(|f| is_half_line(f) && presses(f)).collect();
    if pressing.contains(&true) {
        let half_lines = found.iter_mut().zip(pressing).filter(|(f, _)| is_half_line(f));
        half_lines.for_each(|(f, presses)| f.projection.acts = presses);
    }
}

/// The fields whose present values an expression reads.
fn read_by(g: &Graph, e: ExprId) -> BTreeSet<FieldId> {
    let value = |e: ExprId| match *g.node(e) {
        Node::Leaf(Leaf::Field { field, op: FieldOp::Value, role: Role::Current, .. }) => Some(field),
        _ => None,
    };
    g.reachable(e).into_iter().filter_map(value).collect()
}

/// By node the fields whose test functions it is multiplied with.
fn equations_of(g: &Graph, root: ExprId) -> Tested {
    let order = g.reachable(root);
    // what a node has of test functions itself
    let mut own = Tested::new();
    for e in &order {
        let mut fields = BTreeSet::new();
        if let Node::Leaf(Leaf::Field { field, role: Role::Test, .. }) = *g.node(*e) {
            fields.insert(field);
        }
        g.node(*e).for_each_operand(|o| fields.extend(own.get(&o).into_iter().flatten()));
        own.insert(*e, fields);
    }
    let mut all = own.clone();
    for e in order.iter().rev() {
        let around = all[e].clone();
        g.node(*e).for_each_operand(|o| {
            if own[&o].is_empty() {
                all.entry(o).or_default().extend(&around);
            }
        });
    }
    all
}
