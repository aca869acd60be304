//! Unknowns that a law adds to positions: of the distance of `X + u` from an obstacle or an image rounding leaves as much as
//! of the position, however small the displacement is.
//!
//! A sum counts whose summands (nested sums, signs and factors that are numbers are opened) are positions and values of
//! fields, their components and their products with others, such as `(X + u).n` and `y + u(2) - level`. A modulus that
//! depends on the position is a factor, and none of these.

use crate::{
    graph::{ExprId, Graph, Leaf, Node, Role},
    jumps::{summands, sums},
    law::Listing,
    types::{FieldId, FieldOp, InputSlot},
};

impl Listing {
    /// The unknowns whose values are summands beside positions in the residual or energy, sorted.
    #[must_use]
    pub fn added_to_positions(&self, inputs: &[InputSlot]) -> Vec<FieldId> {
        let reads = |slot: &InputSlot| matches!(slot, InputSlot::X(_) | InputSlot::ImageX(_));
        let root = self.energy.or(self.residual).filter(|_| inputs.iter().any(reads));
        let mut found: Vec<FieldId> = root.map_or_else(Vec::new, |root| in_sums(&self.graph, root));
        found.sort_unstable();
        found.dedup();
        found
    }
}

/// What a summand is.
#[derive(Clone, Copy)]
enum Summand {
    Position,
    Value(FieldId),
}

fn in_sums(g: &Graph, root: ExprId) -> Vec<FieldId> {
    let order = g.reachable(root);
    let mut found = Vec::new();
    for sum in sums(g, root, &order) {
        let (mut open, mut fields, mut has_position) = (vec![sum], Vec::new(), false);
        while let Some(e) = open.pop() {
            let parts = summands(g, e);
            open.extend(parts.iter().map(|(_, part)| *part));
            match if parts.is_empty() { kind(g, e) } else { None } {
                Some(Summand::Position) => has_position = true,
                Some(Summand::Value(field)) => fields.push(field),
                None => {}
            }
        }
        if has_position {
            found.extend(fields);
        }
    }
    found
}

/// A position or a value, or a component or a product of one.
fn kind(g: &Graph, e: ExprId) -> Option<Summand> {
    match g.node(e) {
        Node::Leaf(Leaf::X | Leaf::ImageX) => Some(Summand::Position),
        Node::Leaf(Leaf::Field { field, op: FieldOp::Value, role: Role::Current, .. }) => Some(Summand::Value(*field)),
        Node::Pick(a, _) | Node::Reshape(a) | Node::Scale(_, a) | Node::Divide(a, _) => kind(g, *a),
        Node::Contract(a, b, _) | Node::MulComponents(a, b) => kind(g, *a).or_else(|| kind(g, *b)),
        _ => None,
    }
}
