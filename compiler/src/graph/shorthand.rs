//! Short names for nodes that rules and formulas make often.

use super::{ExprId, Function1, Graph};
use crate::math::{MathFn1, MathFn2};

/// A function of each entry.
pub(crate) fn apply(g: &mut Graph, f: MathFn1, a: ExprId) -> ExprId {
    g.map(Function1::Math(f), a)
}

/// A number as a node.
pub(crate) fn times(g: &mut Graph, factor: f64, a: ExprId) -> ExprId {
    let f = g.number(factor);
    g.scale(f, a)
}

/// t to the u with both scalars, by multiplication for small whole powers.
pub(crate) fn pow_components(g: &mut Graph, a: ExprId, b: ExprId) -> ExprId {
    g.map2(MathFn2::Pow, a, b)
}
