//! Directional derivatives of tensor expressions.
//!
//! [`derive`] gives the derivative of an expression when its leaves move along a direction; the direction says for
//! each leaf what it moves by (the trial function for the tangent, the test function for an energy, a column of the
//! gradient for `Grad(e)`). Kinked nodes follow the branch their value takes (rule 1 of the language): selection
//! derives to selection under the same mask, so value and derivative cannot disagree about a branch.
//! Rules: d Norm = v/|v| . dv, 0 at 0; d Ball: stick dv, slip (r/|v|)(dv - e (e.dv)) + e dr, open 0.

mod ends;
mod sides;

use std::collections::HashMap;

pub(crate) use sides::Ties;

use crate::{
    compare::Compare,
    graph::{ExprId, Function1, Graph, Leaf, Node, apply, times},
    lookup::{CurveRef, Reading},
    math::{MathFn1, MathFn2, MatrixFn},
};

/// What a leaf moves by: a tensor of the leaf's shape, or `None` when it stays.
pub(crate) type Direction<'a> = dyn FnMut(&mut Graph, Leaf) -> Option<ExprId> + 'a;

/// A node has no (further) derivative.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NoDerivative {
    /// The node.
    pub(crate) node: ExprId,
    /// What it is, for the message.
    pub(crate) what: &'static str,
}

/// The derivative of `root` along `direction`; the zero tensor if nothing moves.
///
/// # Errors
/// [`NoDerivative`] for the second derivative of `Expm`, `Logm` and of a projection.
pub(crate) fn derive(graph: &mut Graph, root: ExprId, direction: &mut Direction<'_>) -> Result<ExprId, NoDerivative> {
    let mut memo = HashMap::new();
    let found = Rules { memo: &mut memo, direction, ties: None }.of(graph, root)?;
    Ok(found.unwrap_or_else(|| graph.zero(graph.shape(root))))
}

/// The derivative to one side: where a kink lies between two branches, it takes the one that the direction leads to.
///
/// # Errors
/// As [`derive`].
pub(crate) fn derive_to_side(
    graph: &mut Graph,
    root: ExprId,
    direction: &mut Direction<'_>,
    ties: &mut Ties,
) -> Result<ExprId, NoDerivative> {
    let mut memo = HashMap::new();
    let found = Rules { memo: &mut memo, direction, ties: Some(ties) }.of(graph, root)?;
    Ok(found.unwrap_or_else(|| graph.zero(graph.shape(root))))
}

struct Rules<'a, 'd> {
    memo: &'a mut HashMap<ExprId, Option<ExprId>>,
    direction: &'a mut Direction<'d>,
    /// Of a derivative to one side.
    ties: Option<&'a mut Ties>,
}

type Derived = Result<Option<ExprId>, NoDerivative>;

impl Rules<'_, '_> {
    fn of(&mut self, g: &mut Graph, e: ExprId) -> Derived {
        if let Some(known) = self.memo.get(&e) {
            return Ok(*known);
        }
        let before = g.set_origin(g.origin(e));
        let result = self.rule(g, e);
        g.set_origin(before);
        let result = result?.filter(|d| !g.is_zero(*d));
        #[cfg(test)]
        let result = mutants::applied(g, e, result);
        self.memo.insert(e, result);
        Ok(result)
    }

    fn rule(&mut self, g: &mut Graph, e: ExprId) -> Derived {
        match g.node(e).clone() {
            Node::Const(_) | Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) | Node::InBall(..) => {
                Ok(None)
            }
            Node::Leaf(leaf) => Ok((self.direction)(g, leaf)),
            Node::Add(a, b) => {
                let (da, db) = (self.of(g, a)?, self.of(g, b)?);
                Ok(sum(g, da, db))
            }
            Node::Sub(a, b) => Ok(match (self.of(g, a)?, self.of(g, b)?) {
                (Some(x), Some(y)) => Some(g.sub(x, y)),
                (None, Some(y)) => Some(g.neg(y)),
                (x, None) => x,
            }),
            Node::Neg(a) => Ok(self.of(g, a)?.map(|d| g.neg(d))),
            Node::Reshape(a) => Ok(self.of(g, a)?.map(|d| g.reshape(d, g.shape(e)))),
            Node::Trace(a, i, j) => Ok(self.of(g, a)?.map(|d| g.trace(d, usize::from(i), usize::from(j)))),
            Node::Permute(a, perm) => {
                let perm: Vec<usize> = perm.iter().map(|p| usize::from(*p)).collect();
                Ok(self.of(g, a)?.map(|d| g.permute(d, &perm)))
            }
            Node::Pick(a, fixed) => {
                let fixed: Vec<Option<usize>> = fixed.iter().map(|f| f.map(usize::from)).collect();
                Ok(self.of(g, a)?.map(|d| g.pick(d, &fixed)))
            }
            Node::Print(a) => self.of(g, a),
            Node::Stack(parts) => self.stack(g, e, &parts),
            Node::Scale(a, b) => self.product(g, a, b, Graph::scale),
            Node::MulComponents(a, b) => self.product(g, a, b, Graph::mul_components),
            Node::Contract(a, b, axes) => {
                let axes: Vec<(usize, usize)> = axes.iter().map(|(i, j)| (usize::from(*i), usize::from(*j))).collect();
                self.product(g, a, b, |g, x, y| g.contract(x, y, &axes))
            }
            Node::Divide(a, s) => self.quotient(g, e, a, s, Graph::divide, Graph::scale),
            Node::DivComponents(a, b) => self.quotient(g, e, a, b, Graph::div_components, Graph::mul_components),
            Node::Map(f, a) => self.function1(g, e, f, a),
            Node::Lookup(curve, reading, a) => self.lookup(g, &curve, reading, a),
            Node::Map2(f, a, b) => self.function2(g, e, f, a, b),
            Node::Select(mask, a, b) => {
                let (da, db) = (self.of(g, a)?, self.of(g, b)?);
                let mask = self.mask(g, mask)?;
                Ok(select(g, mask, da, db))
            }
            Node::Norm(v) => self.norm(g, e, v),
            Node::Unit(v) => Ok(self.of(g, v)?.map(|dv| unit_derivative(g, v, dv))),
            Node::Ball(v, r) => self.ball(g, v, r),
            Node::BallRatio(v, r) => self.ball_ratio(g, e, v, r),
            Node::Det(a) => Ok(self.of(g, a)?.map(|da| {
                let cofactor = cofactor(g, a);
                g.inner(cofactor, da)
            })),
            Node::Inverse(a) => Ok(self.of(g, a)?.map(|da| inverse_derivative(g, e, da))),
            Node::Matrix(f, a) => self.matrix(g, e, f, a),
        }
    }

    fn product(
        &mut self,
        g: &mut Graph,
        a: ExprId,
        b: ExprId,
        op: impl Fn(&mut Graph, ExprId, ExprId) -> ExprId,
    ) -> Derived {
        let da = self.of(g, a)?.map(|d| op(g, d, b));
        let db = self.of(g, b)?.map(|d| op(g, a, d));
        Ok(sum(g, da, db))
    }

    /// d(a/b) = (da - (a/b) db)/b
    fn quotient(
        &mut self,
        g: &mut Graph,
        e: ExprId,
        a: ExprId,
        b: ExprId,
        over: fn(&mut Graph, ExprId, ExprId) -> ExprId,
        times: fn(&mut Graph, ExprId, ExprId) -> ExprId,
    ) -> Derived {
        let da = self.of(g, a)?;
        let db = self.of(g, b)?.map(|d| {
            let t = times(g, d, e);
            g.neg(t)
        });
        Ok(sum(g, da, db).map(|d| over(g, d, b)))
    }

    fn stack(&mut self, g: &mut Graph, e: ExprId, parts: &[ExprId]) -> Derived {
        let mut moved = Vec::with_capacity(parts.len());
        let mut any = false;
        for p in parts {
            let d = self.of(g, *p)?;
            any |= d.is_some();
            moved.push(d);
        }
        if !any {
            return Ok(None);
        }
        let zero = g.number(0.0);
        let parts: Vec<ExprId> = moved.into_iter().map(|d| d.unwrap_or(zero)).collect();
        Ok(Some(g.stack(g.shape(e), &parts)))
    }

    /// The slope of the piece; a slope has none.
    fn lookup(&mut self, g: &mut Graph, curve: &CurveRef, reading: Reading, a: ExprId) -> Derived {
        if reading == Reading::Slope {
            return Ok(None);
        }
        Ok(self.of(g, a)?.map(|da| {
            let slope = g.lookup(curve, Reading::Slope, a);
            g.scale(slope, da)
        }))
    }

    fn function1(&mut self, g: &mut Graph, e: ExprId, f: Function1, a: ExprId) -> Derived {
        Ok(self.of(g, a)?.map(|da| {
            let slope = function_derivative(g, f, a, e);
            ends::times_slope(g, f, a, slope, da)
        }))
    }

    fn function2(&mut self, g: &mut Graph, e: ExprId, f: MathFn2, a: ExprId, b: ExprId) -> Derived {
        let da = self.of(g, a)?.map(|d| {
            let slope = function2_derivative(g, f, a, b, e, 0);
            ends::times_slope2(g, f, [a, b], slope, d)
        });
        let db = self.of(g, b)?.map(|d| {
            let slope = function2_derivative(g, f, a, b, e, 1);
            g.mul_components(slope, d)
        });
        Ok(sum(g, da, db))
    }

    fn norm(&mut self, g: &mut Graph, e: ExprId, v: ExprId) -> Derived {
        if self.ties.is_some() {
            return self.norm_to_side(g, e, v);
        }
        Ok(self.of(g, v)?.map(|dv| {
            let n = g.unit(v);
            g.inner(n, dv)
        }))
    }

    fn ball(&mut self, g: &mut Graph, v: ExprId, r: ExprId) -> Derived {
        if self.ties.is_some() {
            return self.ball_to_side(g, v, r);
        }
        let (dv, dr) = (self.of(g, v)?, self.of(g, r)?);
        let slip = slipping(g, (v, r), dv, dr);
        let stick = g.in_ball(v, r);
        let closed = select(g, stick, dv, slip);
        let zero = g.number(0.0);
        let pressed = g.compare(Compare::LessEqual, zero, r);
        Ok(select(g, pressed, closed, None))
    }

    /// d(r/|v|) = (dr - (r/|v|) e.dv)/|v| where |v| > r, else 0
    fn ball_ratio(&mut self, g: &mut Graph, e: ExprId, v: ExprId, r: ExprId) -> Derived {
        let (dv, dr) = (self.of(g, v)?, self.of(g, r)?);
        let along = dv.map(|d| {
            let n = g.unit(v);
            let part = g.inner(n, d);
            let scaled = g.scale(e, part);
            g.neg(scaled)
        });
        let norm = g.norm(v);
        let outside = sum(g, dr, along).map(|d| g.divide(d, norm));
        let inside = g.in_ball(v, r);
        let mask = g.not(inside);
        Ok(select(g, mask, outside, None))
    }

    fn matrix(&mut self, g: &mut Graph, e: ExprId, f: MatrixFn, a: ExprId) -> Derived {
        let derivative = match f {
            MatrixFn::Expm => MatrixFn::ExpmDerivative,
            MatrixFn::Logm => MatrixFn::LogmDerivative,
            MatrixFn::ExpmDerivative | MatrixFn::LogmDerivative => {
                let what = if f == MatrixFn::ExpmDerivative { "Expm" } else { "Logm" };
                return match self.of(g, a)? {
                    None => Ok(None),
                    Some(_) => Err(NoDerivative { node: e, what }),
                };
            }
        };
        Ok(self.of(g, a)?.map(|da| {
            let slope = g.matrix(derivative, a);
            g.contract(slope, da, &[(2, 0), (3, 1)])
        }))
    }
}

/// What a projection on a ball moves by where its argument is outside.
fn slipping(g: &mut Graph, of: (ExprId, ExprId), dv: Option<ExprId>, dr: Option<ExprId>) -> Option<ExprId> {
    let (v, r) = of;
    let ratio = g.ball_ratio(v, r);
    sum_with(
        g,
        dv.map(|d| (d, ())),
        |g, (d, ())| {
            let turned = turn(g, v, d);
            g.scale(ratio, turned)
        },
        dr,
        |g, d| {
            let n = g.unit(v);
            g.scale(d, n)
        },
    )
}

fn sum(g: &mut Graph, a: Option<ExprId>, b: Option<ExprId>) -> Option<ExprId> {
    match (a, b) {
        (Some(a), Some(b)) => Some(g.add(a, b)),
        (a, b) => a.or(b),
    }
}

fn sum_with<T>(
    g: &mut Graph,
    a: Option<T>,
    fa: impl FnOnce(&mut Graph, T) -> ExprId,
    b: Option<ExprId>,
    fb: impl FnOnce(&mut Graph, ExprId) -> ExprId,
) -> Option<ExprId> {
    let a = a.map(|x| fa(g, x));
    let b = b.map(|x| fb(g, x));
    sum(g, a, b)
}

/// mask ? a : b with `None` for zero; a zero branch keeps the test functions of the other.
fn select(g: &mut Graph, mask: ExprId, a: Option<ExprId>, b: Option<ExprId>) -> Option<ExprId> {
    let shape = g.shape(a.or(b)?);
    let a = a.unwrap_or_else(|| g.zero(shape));
    let b = b.unwrap_or_else(|| g.zero(shape));
    Some(g.select(mask, a, b))
}

/// dv - e (e . dv), the part of dv that turns v
fn turn(g: &mut Graph, v: ExprId, dv: ExprId) -> ExprId {
    let n = g.unit(v);
    let along = g.inner(n, dv);
    let part = g.scale(along, n);
    g.sub(dv, part)
}

/// d(A^-1) = -A^-1 dA A^-1
fn inverse_derivative(g: &mut Graph, inverse: ExprId, da: ExprId) -> ExprId {
    let first = g.contract(inverse, da, &[(1, 0)]);
    let both = g.contract(first, inverse, &[(1, 0)]);
    g.neg(both)
}

/// (dv - e (e . dv))/|v|, 0 at 0
fn unit_derivative(g: &mut Graph, v: ExprId, dv: ExprId) -> ExprId {
    let norm = g.norm(v);
    let turned = turn(g, v, dv);
    let over = g.divide(turned, norm);
    let zero = g.number(0.0);
    let nonzero = g.compare(Compare::NotEqual, norm, zero);
    let nothing = g.zero(g.shape(v));
    g.select(nonzero, over, nothing)
}

/// The matrix of cofactors, d det(A)/dA: polynomial in the entries, right for singular matrices too.
pub(crate) fn cofactor(g: &mut Graph, a: ExprId) -> ExprId {
    let shape = g.shape(a);
    let n = shape.size(0);
    let mut parts = Vec::with_capacity(n * n);
    for j in 0..n {
        for i in 0..n {
            let rows: Vec<usize> = (0..n).filter(|k| *k != i).collect();
            let columns: Vec<usize> = (0..n).filter(|k| *k != j).collect();
            let minor = minor(g, a, &rows, &columns);
            parts.push(if (i + j) % 2 == 0 { minor } else { g.neg(minor) });
        }
    }
    g.stack(shape, &parts)
}

/// Determinant of the rows and columns given, by expansion along the first row.
fn minor(g: &mut Graph, a: ExprId, rows: &[usize], columns: &[usize]) -> ExprId {
    let Some((first, rest)) = rows.split_first() else {
        return g.number(1.0);
    };
    let mut total: Option<ExprId> = None;
    for (k, column) in columns.iter().enumerate() {
        let others: Vec<usize> = columns.iter().copied().filter(|c| c != column).collect();
        let entry = g.pick(a, &[Some(*first), Some(*column)]);
        let below = minor(g, a, rest, &others);
        let product = g.scale(entry, below);
        total = Some(match total {
            None => product,
            Some(t) if k % 2 == 0 => g.add(t, product),
            Some(t) => g.sub(t, product),
        });
    }
    total.expect("as many columns as rows")
}

/// f'(a) entry by entry; `value` is f(a).
pub(crate) fn function_derivative(g: &mut Graph, f: Function1, a: ExprId, value: ExprId) -> ExprId {
    match f {
        Function1::Sqrt => {
            let double = times(g, 2.0, value);
            reciprocal(g, double)
        }
        Function1::Math(f) => math_derivative(g, f, a, value),
    }
}

/// The derivative that a row names.
macro_rules! derivative_of {
    ($g:ident $a:ident $y:ident native($f:path, $extended:expr, $slope:expr, $derivative:expr)) => {{
        let derivative: fn(&mut Graph, ExprId, ExprId) -> ExprId = $derivative;
        derivative($g, $a, $y)
    }};
    ($g:ident $a:ident $y:ident formula(|$t:ident| $value:expr, $derivative:expr)) => {{
        let derivative: fn(&mut Graph, ExprId, ExprId) -> ExprId = $derivative;
        derivative($g, $a, $y)
    }};
}

macro_rules! derivatives {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        /// f'(a) entry by entry; `y` is f(a).
        fn math_derivative(g: &mut Graph, f: MathFn1, a: ExprId, y: ExprId) -> ExprId {
            match f {
                $(MathFn1::$variant => derivative_of!(g a y $form($($value)*))),*
            }
        }
    };
}

wfl::scalar_functions!(derivatives);

/// A tensor of the shape of `like` with one number in every entry.
fn filled(g: &mut Graph, like: ExprId, x: f64) -> ExprId {
    let shape = g.shape(like);
    g.constant(shape, &vec![x; shape.len()])
}

/// `x + a` entry by entry.
fn plus(g: &mut Graph, x: f64, a: ExprId) -> ExprId {
    let number = filled(g, a, x);
    g.add(number, a)
}

/// `1/a` entry by entry.
fn reciprocal(g: &mut Graph, a: ExprId) -> ExprId {
    let one = filled(g, a, 1.0);
    g.div_components(one, a)
}

/// `1/sqrt(a)` entry by entry.
fn reciprocal_root(g: &mut Graph, a: ExprId) -> ExprId {
    let root = g.map(Function1::Sqrt, a);
    reciprocal(g, root)
}

/// `(1 - a)(1 + a)` entry by entry.
fn one_minus_square(g: &mut Graph, a: ExprId) -> ExprId {
    let one = filled(g, a, 1.0);
    let low = g.sub(one, a);
    let high = g.add(one, a);
    g.mul_components(low, high)
}

/// `sign 2/sqrt(pi) exp(-a^2)` entry by entry.
fn bell_node(g: &mut Graph, sign: f64, a: ExprId) -> ExprId {
    let square = g.mul_components(a, a);
    let minus = g.neg(square);
    let bell = apply(g, MathFn1::Exp, minus);
    times(g, sign * std::f64::consts::FRAC_2_SQRT_PI, bell)
}

/// sinc'' = -sinc - 2 sinc'/t, so sinc''' = -sinc' - 2 (sinc'' - sinc'/t)/t, 0 at 0; `second` is sinc''(a).
fn third_of_sinc(g: &mut Graph, a: ExprId, second: ExprId) -> ExprId {
    let first = apply(g, MathFn1::SincFirst, a);
    let ratio = g.div_components(first, a);
    let inner = g.sub(second, ratio);
    let double = times(g, 2.0, inner);
    let part = g.div_components(double, a);
    let total = g.add(first, part);
    let third = g.neg(total);
    let zero = g.zero(g.shape(a));
    let nonzero = g.compare(Compare::NotEqual, a, zero);
    g.select(nonzero, third, zero)
}

/// Partial derivative in argument `which` of a function of two numbers; `value` is f(a, b).
pub(crate) fn function2_derivative(
    g: &mut Graph,
    f: MathFn2,
    a: ExprId,
    b: ExprId,
    value: ExprId,
    which: usize,
) -> ExprId {
    let shape = g.shape(a);
    match (f, which) {
        (MathFn2::Pow, 0) => {
            let one = g.constant(shape, &vec![1.0; shape.len()]);
            let less = g.sub(b, one);
            let power = g.map2(MathFn2::Pow, a, less);
            g.mul_components(b, power)
        }
        // t^u log t, whose limit at t = 0 is 0 for u > 0
        (MathFn2::Pow, _) => {
            let log = g.map(Function1::Math(MathFn1::Log), a);
            let product = g.mul_components(value, log);
            let zero = g.zero(shape);
            let nonzero = g.compare(Compare::NotEqual, value, zero);
            g.select(nonzero, product, zero)
        }
        (MathFn2::Atan2, _) => {
            let (aa, bb) = (g.mul_components(a, a), g.mul_components(b, b));
            let square = g.add(aa, bb);
            let top = if which == 0 { b } else { g.neg(a) };
            g.div_components(top, square)
        }
        (MathFn2::AsinhExp, _) => {
            let slope = g.map2(MathFn2::AsinhExpSlope, a, b);
            if which == 0 { slope } else { g.mul_components(a, slope) }
        }
        // with s the slope and w = a s at most 1 in size: -w s s and s (1 - w)(1 + w)
        (MathFn2::AsinhExpSlope, _) => {
            let part = g.mul_components(a, value);
            if which == 0 {
                let once = g.mul_components(part, value);
                let twice = g.mul_components(once, value);
                g.neg(twice)
            } else {
                let rest = one_minus_square(g, part);
                g.mul_components(value, rest)
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod mutants;
