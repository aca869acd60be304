//! Functions of one or two numbers, applied entry by entry.

use crate::{
    build::{Builder, Call},
    graph::{ExprId, Function1, Graph},
    ir::Compare,
    math::{MathFn1, MathFn2},
    ops::{Entrywise, OpDef, apply, pow_components, times},
};

macro_rules! one {
    ($name:literal, $doc:literal, $samples:expr, $f:expr) => {
        OpDef {
            name: $name,
            least: 1,
            most: 1,
            usage: concat!($name, "(t)"),
            doc: $doc,
            samples: $samples,
            build: |b, c| {
                let (_, a) = b.plain_argument(c, 0)?;
                let f: fn(&mut Graph, ExprId) -> ExprId = $f;
                Some(f(&mut b.graph, a))
            },
            entrywise: Some(Entrywise::One($f)),
        }
    };
}

macro_rules! two {
    ($name:literal, $doc:literal, $samples:expr, $f:expr) => {
        OpDef {
            name: $name,
            least: 2,
            most: 2,
            usage: concat!($name, "(t, u)"),
            doc: $doc,
            samples: $samples,
            build: |b, c| {
                let (x, y) = two_arguments(b, c)?;
                let f: fn(&mut Graph, ExprId, ExprId) -> ExprId = $f;
                Some(f(&mut b.graph, x, y))
            },
            entrywise: Some(Entrywise::Two($f)),
        }
    };
}

/// Rows of `wfl/src/scalar_functions.rs` that the language has.
macro_rules! table {
    (@rows [$($rows:expr,)*]) => {
        &[$($rows),*]
    };
    (@rows [$($rows:expr,)*] word $variant:ident $name:literal $doc:literal [$($sample:literal),*]
        $form:ident($($value:tt)*); $($more:tt)*) => {
        table!(@rows [
            $($rows,)*
            one!($name, $doc, &[$($sample),*], |g, a| apply(g, MathFn1::$variant, a)),
        ] $($more)*)
    };
    (@rows [$($rows:expr,)*] inner $variant:ident $name:literal $doc:literal []
        $form:ident($($value:tt)*); $($more:tt)*) => {
        table!(@rows [$($rows,)*] $($more)*)
    };
    (word $($rows:tt)*) => {
        table!(@rows [] word $($rows)*)
    };
}

/// The smooth functions.
pub(super) const SMOOTH: &[OpDef] = wfl::scalar_functions!(table);

/// The others.
pub(super) const TABLE: &[OpDef] = &[
    one!("sqr", "t times t", &["sqr(p)", "sqr(u).w"], |g, a| g.mul_components(a, a)),
    one!("sqrt", "square root; its derivative is infinite at 0", &["sqrt(4+p)"], |g, a| g.map(Function1::Sqrt, a)),
    one!("Heaviside", "1 for t >= 0, else 0; derivative 0", &[], |g, a| step(g, a, 1.0, 0.0)),
    one!("sign", "1 for t >= 0, else -1; derivative 0", &[], |g, a| step(g, a, 1.0, -1.0)),
    one!("abs", "absolute value; derivative 1 at 0", &["abs(p)"], |g, a| {
        let minus = g.neg(a);
        by_sign(g, a, a, minus)
    }),
    one!("pos_part", "t for t >= 0, else 0; derivative 1 at 0", &["pos_part(p)", "pos_part(u).w"], pos_part),
    one!("neg_part", "pos_part(-t), also at 0", &["neg_part(p)"], |g, a| {
        let minus = g.neg(a);
        pos_part(g, minus)
    }),
    one!("sqr_pos_part", "pos_part squared", &["sqr_pos_part(p)"], |g, a| square(g, a, 1.0)),
    one!("half_sqr_pos_part", "half of pos_part squared: a potential", &["half_sqr_pos_part(p)"], |g, a| square(
        g, a, 0.5
    )),
    one!("sqr_neg_part", "neg_part squared", &["sqr_neg_part(p)"], |g, a| {
        let minus = g.neg(a);
        square(g, minus, 1.0)
    }),
    one!("half_sqr_neg_part", "half of neg_part squared", &["half_sqr_neg_part(p)"], |g, a| {
        let minus = g.neg(a);
        square(g, minus, 0.5)
    }),
    two!("pow", "t to the u", &["pow(4+p, 1.7)", "pow(4+p, q)"], |g, a, b| {
        if g.shape(a).rank() == 0 { power(g, a, b) } else { pow_components(g, a, b) }
    }),
    two!("atan2", "angle of the point (u, t)", &["atan2(p, 4+q)"], |g, a, b| g.map2(MathFn2::Atan2, a, b)),
    two!("max", "the larger; of a tie the first", &["max(p, q)", "max(u, 0.1).w"], |g, a, b| {
        let mask = g.compare(Compare::LessEqual, b, a);
        g.select(mask, a, b)
    }),
    two!("min", "the smaller; of a tie the first", &["min(p, q)"], |g, a, b| {
        let mask = g.compare(Compare::LessEqual, a, b);
        g.select(mask, a, b)
    }),
    two!(
        "reg_pos_part",
        "pos_part with a parabola on [0, eps]",
        &["reg_pos_part(p, 0.3)", "reg_pos_part(p, 2+q)"],
        |g, a, e| {
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
    ),
];

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

fn square(g: &mut Graph, a: ExprId, factor: f64) -> ExprId {
    let p = pos_part(g, a);
    let square = g.mul_components(p, p);
    times(g, factor, square)
}

fn step(g: &mut Graph, a: ExprId, above: f64, below: f64) -> ExprId {
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
