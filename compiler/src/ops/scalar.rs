//! Functions of one or two numbers, applied entry by entry.

use crate::{
    build::{Builder, Call},
    compare::Compare,
    graph::{ExprId, Function1, Graph, times},
    math::MathFn2,
};

/// `reg_pos_part(a, e)`.
pub(super) fn regularised_pos_part(g: &mut Graph, a: ExprId, e: ExprId) -> ExprId {
    let half = times(g, 0.5, e);
    let far = g.sub(a, half);
    let square = g.mul_components(a, a);
    let double = times(g, 2.0, e);
    let near = g.div_components(square, double);
    let zero = g.zero(g.shape(a));
    let positive = g.compare(Compare::Less, zero, a);
    let inner = g.select(positive, near, zero);
    let beyond = g.compare(Compare::LessEqual, e, a);
    g.select(beyond, far, inner)
}

pub(super) fn two_arguments(b: &mut Builder<'_>, c: &Call<'_>) -> Option<(ExprId, ExprId)> {
    let x = b.plain_argument(c, 0);
    let y = b.plain_argument(c, 1);
    let ((_, x), (_, y)) = (x?, y?);
    b.same_shape(c.expr, x, y, &format!("the arguments of `{}`", c.name))
}

/// t >= 0 ? a : b
pub(super) fn by_sign(g: &mut Graph, t: ExprId, a: ExprId, b: ExprId) -> ExprId {
    let zero = g.zero(g.shape(t));
    let mask = g.compare(Compare::LessEqual, zero, t);
    g.select(mask, a, b)
}

/// t for t >= 0, else 0
pub(super) fn pos_part(g: &mut Graph, a: ExprId) -> ExprId {
    let zero = g.zero(g.shape(a));
    by_sign(g, a, a, zero)
}

pub(super) fn square(g: &mut Graph, a: ExprId, factor: f64) -> ExprId {
    let p = pos_part(g, a);
    let square = g.mul_components(p, p);
    times(g, factor, square)
}

pub(super) fn step(g: &mut Graph, a: ExprId, above: f64, below: f64) -> ExprId {
    let shape = g.shape(a);
    let n = shape.len();
    let above = g.constant(shape, &vec![above; n]);
    let below = g.constant(shape, &vec![below; n]);
    by_sign(g, a, above, below)
}

/// a to the b, scalars; whole powers up to 8 by multiplication, so that their derivatives are polynomials.
pub(crate) fn power(g: &mut Graph, a: ExprId, b: ExprId) -> ExprId {
    #[expect(clippy::cast_possible_truncation, reason = "checked to be a small whole number")]
    match g.scalar_constant(b) {
        Some(n) if n.fract() == 0.0 && (1.0..=8.0).contains(&n) => whole_power(g, a, n as u32),
        Some(0.5) => g.map(Function1::Sqrt, a),
        Some(n) if n.fract() == 0.0 && (-8.0..0.0).contains(&n) => {
            let below = whole_power(g, a, (-n) as u32);
            let one = g.number(1.0);
            g.divide(one, below)
        }
        _ => g.map2(MathFn2::Pow, a, b),
    }
}

fn whole_power(g: &mut Graph, a: ExprId, n: u32) -> ExprId {
    if n == 1 {
        return a;
    }
    let half = whole_power(g, a, n / 2);
    let square = g.scale(half, half);
    if n.is_multiple_of(2) { square } else { g.scale(a, square) }
}
