//! What cancels in an equation: the sum of the magnitudes of its summands.
//!
//! A residual alone does not say whether it is small: `tau - f(V)` of 1e-9 is solved where both are 30, and not where
//! both are 1e-9. The flux of a term is a sum; its summands are what must balance.
//!
//! - A factor in front of the whole sum multiplies each summand, and so does a denominator.
//! - A flux of one summand, a product, vanishes with one of its factors: each of these is measured by its own summands.
//! - A function (`log(A/B)`) vanishes where its argument is right to its last digits: one is added to its value.
//! - A product within a sum is one summand: of the rate `(u - Previous_u)/timestep` the slip is told from the load by
//!   its value, not by that of u.
//!
//! A stress is relative to what cancels anywhere inside ([`magnitude`]): of `F (F'F - Id)` the product is one summand, whose
//! value is rounding where the body turns.
//!
//! Promises: at least the magnitude of the flux, but for rounding. Knows no test functions.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    ir::{Inst, Val},
    scalar::Scalars,
};

/// The size of what cancels in `flux`; `moves` says of a scalar whether it changes with the unknowns.
pub(crate) fn size(scalars: &mut Scalars, moves: &impl Fn(Val) -> bool, flux: Val) -> Val {
    match scalars.insts[flux.index()].clone() {
        Inst::Neg(a) => size(scalars, moves, a),
        Inst::Add(..) | Inst::Sub(..) => sum(scalars, flux),
        Inst::Mul(a, b) => {
            let [x, y] = [a, b].map(|v| if moves(v) { size(scalars, moves, v) } else { scalars.abs(v) });
            scalars.mul(x, y)
        }
        Inst::Div(a, b) => {
            let (x, y) = (size(scalars, moves, a), scalars.abs(b));
            scalars.div(x, y)
        }
        Inst::Select(mask, a, b) => {
            let (x, y) = (size(scalars, moves, a), size(scalars, moves, b));
            scalars.select(mask, x, y)
        }
        Inst::Call1(..) | Inst::Call2(..) if moves(flux) => {
            let (value, one) = (scalars.abs(flux), scalars.constant(1.0));
            scalars.add(value, one)
        }
        _ => scalars.abs(flux),
    }
}

/// What rounding of `root` is relative to: its magnitude with every sum inside replaced by that of the magnitudes, in one factor of a
/// product at a time.
/// `known` keeps what was asked before.
pub(crate) fn magnitude(scalars: &mut Scalars, known: &mut BTreeMap<Val, Val>, root: Val) -> Val {
    magnitude_with(scalars, known, root, Functions::BesideOne)
}

/// The same where a function counts with its value alone: what two sides of a comparison are known to, in their unit.
pub(crate) fn magnitude_of_sides(scalars: &mut Scalars, known: &mut BTreeMap<Val, Val>, root: Val) -> Val {
    magnitude_with(scalars, known, root, Functions::ByValue)
}

/// How the values of functions count.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Functions {
    /// One is added: an argument near 1 is known to the last digits of 1.
    BesideOne,
    ByValue,
}

fn magnitude_with(scalars: &mut Scalars, known: &mut BTreeMap<Val, Val>, root: Val, functions: Functions) -> Val {
    // operands stand before what is made of them
    let mut wanted = BTreeSet::from([root]);
    let mut left = vec![root];
    while let Some(v) = left.pop() {
        let operands = match scalars.insts[v.index()] {
            Inst::Neg(a) => [Some(a), None],
            Inst::Add(a, b) | Inst::Sub(a, b) | Inst::Mul(a, b) | Inst::Select(_, a, b) => [Some(a), Some(b)],
            Inst::Div(a, _) => [Some(a), None],
            _ => [None, None],
        };
        left.extend(operands.into_iter().flatten().filter(|o| wanted.insert(*o)));
    }
    for v in wanted {
        if !known.contains_key(&v) {
            let made = one_magnitude(scalars, known, v, functions);
            known.insert(v, made);
        }
    }
    known[&root]
}

/// The same where the operands are known.
fn one_magnitude(scalars: &mut Scalars, known: &BTreeMap<Val, Val>, value: Val, functions: Functions) -> Val {
    match scalars.insts[value.index()].clone() {
        Inst::Neg(a) => known[&a],
        Inst::Add(a, b) | Inst::Sub(a, b) => scalars.add(known[&a], known[&b]),
        // of a square of `T - T0` near 1e8 the rounding is that of 1e8 times the difference, and not of 1e16
        Inst::Mul(a, b) => {
            let [x, y] = [(a, b), (b, a)].map(|(of, times)| {
                let value = scalars.abs(times);
                scalars.mul(known[&of], value)
            });
            scalars.max(x, y)
        }
        Inst::Div(a, b) => {
            let size = scalars.abs(b);
            scalars.div(known[&a], size)
        }
        Inst::Select(mask, a, b) => scalars.select(mask, known[&a], known[&b]),
        // the rounding of an argument near 1 shows in the last digits of 1
        Inst::Call1(..) | Inst::Call2(..) if functions == Functions::BesideOne => {
            let (size, one) = (scalars.abs(value), scalars.constant(1.0));
            scalars.add(size, one)
        }
        _ => scalars.abs(value),
    }
}

/// Of a sum, differences and opposites included.
fn sum(scalars: &mut Scalars, root: Val) -> Val {
    let (mut left, mut total) = (vec![root], None);
    while let Some(v) = left.pop() {
        match scalars.insts[v.index()] {
            Inst::Add(a, b) | Inst::Sub(a, b) => left.extend([b, a]),
            Inst::Neg(a) => left.push(a),
            _ => {
                let size = scalars.abs(v);
                total = Some(total.map_or(size, |total| scalars.add(total, size)));
            }
        }
    }
    total.expect("a sum has summands")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{emitter::Emitter, interp::interpret, math::MathFn1};

    /// The size at these values of inputs that all are unknowns; the first uniform is a number of the step.
    fn at(make: impl Fn(&mut Scalars, &[Val]) -> Val, inputs: [f64; 3]) -> f64 {
        let mut scalars = Scalars::default();
        let list: Vec<Val> = (0..3).map(|k| scalars.input(k)).collect();
        let flux = make(&mut scalars, &list);
        let moving: Vec<bool> = (0..=flux.index()).map(|k| !scalars.uniform[k]).collect();
        let found = size(&mut scalars, &|v: Val| moving[v.index()], flux);
        let mut emitter = Emitter::new(&scalars, 3);
        let kernel = emitter.kernel("size", &[found]);
        let (kernel, _, _, _) = emitter.finish(kernel.clone(), kernel.clone(), [None, None], Vec::new(), "size");
        let blocked: Vec<f64> = inputs.iter().flat_map(|x| [*x; crate::ir::LANES]).collect();
        let mut out = [0.0; crate::ir::LANES];
        for (lane, slot) in out.iter_mut().enumerate() {
            let one: Vec<f64> = inputs.iter().enumerate().map(|(k, _)| blocked[k * crate::ir::LANES + lane]).collect();
            let mut single = [0.0];
            interpret(&kernel, &[], &one, &mut Vec::new(), &mut single);
            *slot = single[0];
        }
        out[0]
    }

    #[test]
    fn what_cancels_is_the_sum_of_the_magnitudes_of_the_summands() {
        // 3 - 7 + 2, of which 2 is a product
        let plain = |s: &mut Scalars, v: &[Val]| {
            let (two, part) = (s.constant(2.0), s.sub(v[0], v[1]));
            let product = s.mul(two, v[2]);
            s.add(part, product)
        };
        assert_eq!(at(plain, [3.0, 7.0, 1.0]), 12.0);
        // the opposite of a difference, ten times
        let factor = |s: &mut Scalars, v: &[Val]| {
            let (ten, part) = (s.constant(10.0), s.sub(v[0], v[1]));
            let product = s.mul(ten, part);
            s.neg(product)
        };
        assert_eq!(at(factor, [3.0, 7.0, 0.0]), 100.0);
        // a product of two differences
        let product = |s: &mut Scalars, v: &[Val]| {
            let (a, b) = (s.sub(v[0], v[1]), s.sub(v[1], v[2]));
            s.mul(a, b)
        };
        assert_eq!(at(product, [3.0, 3.0, 1.0]), 24.0);
        // a difference within a sum is one number only where a factor stands before it
        let rate = |s: &mut Scalars, v: &[Val]| {
            let (hundred, part) = (s.constant(100.0), s.sub(v[0], v[1]));
            let rate = s.mul(hundred, part);
            s.sub(rate, v[2])
        };
        assert_eq!(at(rate, [1.01, 1.0, 1.0]), 100.0 * (1.01 - 1.0) + 1.0);
        let log = |s: &mut Scalars, v: &[Val]| {
            let ratio = s.div(v[0], v[1]);
            s.call1(MathFn1::Log, ratio)
        };
        assert_eq!(at(log, [5.0, 5.0, 0.0]), 1.0);
    }

    #[test]
    fn of_a_stress_what_cancels_inside_counts() {
        // x (y y - 1) at x = y = 1: the product of 1 and of 2, not of 1 and 0
        let mut s = Scalars::default();
        let [x, y] = [s.input(0), s.input(1)];
        let one = s.constant(1.0);
        let square = s.mul(y, y);
        let strain = s.sub(square, one);
        let stress = s.mul(x, strain);
        assert_eq!(magnitude_at(&mut s, stress, [1.0, 1.0]), 2.0);
    }

    #[test]
    fn of_a_square_of_a_difference_rounds_one_factor() {
        let mut s = Scalars::default();
        let [x, y] = [s.input(0), s.input(1)];
        let difference = s.sub(x, y);
        let square = s.mul(difference, difference);
        assert_eq!(magnitude_at(&mut s, square, [1e8 + 1.0, 1e8]), 2e8 + 1.0, "and not 4e16");
    }

    fn magnitude_at(scalars: &mut Scalars, root: Val, inputs: [f64; 2]) -> f64 {
        let found = magnitude(scalars, &mut BTreeMap::new(), root);
        let mut emitter = Emitter::new(scalars, 2);
        let kernel = emitter.kernel("size", &[found]);
        let (kernel, _, _, _) = emitter.finish(kernel.clone(), kernel.clone(), [None, None], Vec::new(), "size");
        let mut out = [0.0];
        interpret(&kernel, &[], &inputs, &mut Vec::new(), &mut out);
        out[0]
    }
}
