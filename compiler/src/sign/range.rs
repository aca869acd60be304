//! Between which numbers the entries of an expression lie, whatever the unknowns are.
//!
//! Promises: bounds that hold for all values of the unknowns, as far as the functions of an expression have some (interval
//! arithmetic, Moore 1966); rounding of the bounds themselves is not counted.

use std::{
    cell::Cell,
    f64::consts::{FRAC_PI_2, PI},
};

use crate::{
    compare::Compare,
    graph::{ExprId, Function1, Graph, Node},
    math::{MathFn1, MathFn2},
};

/// Smallest and largest value.
pub(super) type Range = [f64; 2];

const ALL: Range = [f64::NEG_INFINITY, f64::INFINITY];
const NONNEGATIVE: Range = [0.0, f64::INFINITY];

/// The range of an expression; `is_known_sign` tells what is at least zero for a reason of its own. Each part is looked at once for each
/// use of it, and no more than are `left`: behind them nothing is known.
pub(super) fn range(g: &Graph, e: ExprId, is_known_sign: &dyn Fn(ExprId) -> bool, left: &Cell<u32>) -> Range {
    if left.replace(left.get().saturating_sub(1)) == 0 {
        return ALL;
    }
    if let Some(list) = g.constant_value(e) {
        return list.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |r, x| [r[0].min(*x), r[1].max(*x)]);
    }
    // what is known before the solution is the author's business, as with signs
    if !g.depends(e).unknown {
        return NONNEGATIVE;
    }
    let of = |e: ExprId| range(g, e, is_known_sign, left);
    let found = match g.node(e) {
        Node::Add(a, b) => sum(of(*a), of(*b)),
        Node::Sub(a, b) => sum(of(*a), minus(of(*b))),
        Node::Neg(a) => minus(of(*a)),
        // a square
        Node::Scale(a, b) | Node::MulComponents(a, b) if a == b => {
            let base = of(*a);
            let [low, high] = product(base, base);
            [low.max(0.0), high]
        }
        Node::Scale(a, b) | Node::MulComponents(a, b) => product(of(*a), of(*b)),
        Node::Divide(a, b) | Node::DivComponents(a, b) => match of(*b) {
            [low, high] if low > 0.0 => product(of(*a), [1.0 / high, 1.0 / low]),
            [0.0, high] => product(of(*a), [1.0 / high, f64::INFINITY]),
            _ => ALL,
        },
        Node::Reshape(a) | Node::Permute(a, _) | Node::Pick(a, _) | Node::Print(a) => of(*a),
        Node::Stack(parts) => parts.iter().map(|p| of(*p)).fold([f64::INFINITY, f64::NEG_INFINITY], joined),
        Node::Select(mask, a, b) => {
            let (first, second) = (of(*a), of(*b));
            match g.node(*mask) {
                // the smaller and the larger one of two numbers
                Node::Compare(Compare::Less | Compare::LessEqual, low, high) if [low, high] == [a, b] => {
                    [first[0].min(second[0]), first[1].min(second[1])]
                }
                Node::Compare(Compare::Less | Compare::LessEqual, low, high) if [high, low] == [a, b] => {
                    [first[0].max(second[0]), first[1].max(second[1])]
                }
                _ => joined(first, second),
            }
        }
        Node::Norm(_) => NONNEGATIVE,
        Node::BallRatio(..) => [0.0, 1.0],
        Node::Map(f, a) => mapped(*f, of(*a)),
        Node::Map2(MathFn2::Pow, a, b) => power(of(*a), g.constant_value(*b).as_deref()),
        Node::Map2(MathFn2::Atan2, ..) => [-PI, PI],
        _ => ALL,
    };
    let least = if is_known_sign(e) { 0.0 } else { f64::NEG_INFINITY };
    [found[0].max(least), found[1]]
}

fn minus([low, high]: Range) -> Range {
    [-high, -low]
}

fn sum(a: Range, b: Range) -> Range {
    [a[0] + b[0], a[1] + b[1]]
}

fn product(a: Range, b: Range) -> Range {
    // zero times infinity is zero here: an end that is not reached
    let times = |x: f64, y: f64| if x == 0.0 || y == 0.0 { 0.0 } else { x * y };
    let all = [times(a[0], b[0]), times(a[0], b[1]), times(a[1], b[0]), times(a[1], b[1])];
    all.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |r, x| [r[0].min(x), r[1].max(x)])
}

fn joined(a: Range, b: Range) -> Range {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Functions that rise, by their ends; of the others what they reach.
fn mapped(f: Function1, a: Range) -> Range {
    let rises = |f: &dyn Fn(f64) -> f64| a.map(f);
    let Function1::Math(f) = f else { return rises(&|x| x.max(0.0).sqrt()) };
    match f {
        MathFn1::Exp => rises(&f64::exp),
        MathFn1::Expm1 => rises(&f64::exp_m1),
        MathFn1::Log => rises(&|x| x.max(0.0).ln()),
        MathFn1::Log1p => rises(&|x| x.max(-1.0).ln_1p()),
        MathFn1::Log10 => rises(&|x| x.max(0.0).log10()),
        MathFn1::Sinh => rises(&f64::sinh),
        MathFn1::Tanh => rises(&f64::tanh),
        MathFn1::Asinh => rises(&f64::asinh),
        MathFn1::Atan => rises(&f64::atan),
        MathFn1::Erf => rises(&libm::erf),
        MathFn1::Softplus => rises(&|x| if x > 30.0 { x } else { x.exp().ln_1p() }),
        MathFn1::Logistic => rises(&|x| 1.0 / (1.0 + (-x).exp())),
        MathFn1::Erfc => minus(rises(&|x| -libm::erfc(x))),
        MathFn1::Sin | MathFn1::Cos => [-1.0, 1.0],
        // its least value, near 4.4934
        MathFn1::Sinc => [-0.217_234, 1.0],
        MathFn1::Asin => [-FRAC_PI_2, FRAC_PI_2],
        MathFn1::Acos => [0.0, PI],
        MathFn1::Cosh => [1.0, f64::INFINITY],
        MathFn1::Acosh => NONNEGATIVE,
        _ => ALL,
    }
}

/// A number to a power that is a constant: of one that is not negative it is not negative, and it falls where the power does.
fn power(base: Range, exponent: Option<&[f64]>) -> Range {
    let Some([p]) = exponent else {
        return if base[0] >= 0.0 { NONNEGATIVE } else { ALL };
    };
    let is_even = p.fract() == 0.0 && (p / 2.0).fract() == 0.0;
    match base {
        [low, high] if low >= 0.0 => {
            let ends = [low.powf(*p), high.powf(*p)];
            [ends[0].min(ends[1]), ends[0].max(ends[1])]
        }
        _ if is_even => NONNEGATIVE,
        _ => ALL,
    }
}
