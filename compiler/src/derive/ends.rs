//! Slopes that are infinite at zero, of what is zero on one branch of a kink: `pos_part(g)^0.5`, `sqrt(max(0, g))`.
//!
//! Where the argument has come to rest at zero its derivative is zero, and so is the one of the function; as a product of an
//! infinite slope with zero it would be no number. Promises: other arguments keep their rule, also those that pass
//! through zero, whose slope there is infinite indeed.

use crate::{
    compare::Compare,
    graph::{ExprId, Function1, Graph, Node},
    math::{MathFn1, MathFn2},
};

/// A slope of a function of one number times the derivative of its argument.
pub(super) fn times_slope(g: &mut Graph, f: Function1, a: ExprId, slope: ExprId, da: ExprId) -> ExprId {
    let is_steep = matches!(f, Function1::Sqrt | Function1::Math(MathFn1::Log | MathFn1::Log10));
    product(g, is_steep.then_some(a), slope, da)
}

/// The same in the first argument of a function of two numbers.
pub(super) fn times_slope2(g: &mut Graph, f: MathFn2, [a, b]: [ExprId; 2], slope: ExprId, da: ExprId) -> ExprId {
    let is_steep = f == MathFn2::Pow && g.constant_value(b).is_none_or(|list| list.iter().any(|b| *b < 1.0));
    product(g, is_steep.then_some(a), slope, da)
}

/// The product, zero where an argument of which that is asked rests at zero.
fn product(g: &mut Graph, steep_in: Option<ExprId>, slope: ExprId, da: ExprId) -> ExprId {
    let product = g.mul_components(slope, da);
    let Some(a) = steep_in.filter(|a| rests_at_zero(g, *a)) else { return product };
    let zero = g.zero(g.shape(a));
    let beyond = g.compare(Compare::Less, zero, a);
    let none = g.zero(g.shape(product));
    g.select(beyond, product, none)
}

/// Whether a number is zero on one branch of a kink: a positive part, its products and sums.
fn rests_at_zero(g: &Graph, a: ExprId) -> bool {
    let is_moving = |e: ExprId| g.depends(e).unknown;
    is_moving(a)
        && match *g.node(a) {
            Node::Select(mask, x, y) => is_moving(mask) && (g.is_zero(x) || g.is_zero(y)),
            Node::Scale(x, y) | Node::MulComponents(x, y) => rests_at_zero(g, x) || rests_at_zero(g, y),
            Node::Divide(x, _) | Node::DivComponents(x, _) | Node::Reshape(x) => rests_at_zero(g, x),
            Node::Add(x, y) => rests_at_zero(g, x) && rests_at_zero(g, y),
            _ => false,
        }
}
