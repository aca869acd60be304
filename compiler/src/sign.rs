//! Which expressions cannot be negative, as far as their form shows it, and the warning that rests on it (W502).

mod range;

use std::cell::Cell;

use wfl::{Code, Diagnostic};

use crate::{
    build::{Env, locate},
    compare::Compare,
    graph::{ExprId, Function1, Graph, Node},
    law::Listing,
    math::MathFn1,
};

/// W502: a ball whose radius changes sign with the unknowns. W612: one whose radius is a number below 0.
pub(crate) fn radius_warnings(env: &Env<'_>, listing: &Listing) -> Vec<Diagnostic> {
    let g = &listing.graph;
    let Some(residual) = listing.residual else { return Vec::new() };
    let mut out: Vec<Diagnostic> = Vec::new();
    for origin in &g.negative_radii {
        let d = Diagnostic::new(Code::W612, "the radius of this projection is negative at every point");
        let d = locate(d, *origin, env.expansions, "the projection gives 0 whatever its argument is");
        out.push(d.help("a bound is at least 0: look at the signs of its factors"));
    }
    for e in g.reachable(residual) {
        if let Node::Ball(_, radius) = *g.node(e)
            && g.depends(radius).unknown
            && !never_negative(g, radius)
            && let Some(origin) = g.origin(radius)
        {
            let d = Diagnostic::new(Code::W502, "the radius may be negative");
            let d = locate(d, origin, env.expansions, "it changes sign with the unknowns; a negative radius gives 0");
            let d = d.help(format!("pos_part({})", wfl::quote(origin.span)));
            if !out.contains(&d) {
                out.push(d);
            }
        }
    }
    out
}

/// True if the entries are at least 0 whatever the unknowns are, as far as the form shows it, or the ranges of its functions.
fn never_negative(g: &Graph, e: ExprId) -> bool {
    let left = Cell::new(MOST);
    let has = |e: ExprId| Known { g, larger: Vec::new(), left: &left }.has(e, Sign::AtLeastZero);
    has(e) || range::range(g, e, &|inside| inside != e && has(inside), &left)[0] >= 0.0
}

/// Parts of an expression that are looked at: each product asks for both signs of both factors.
const MOST: u32 = 10_000;

/// Functions of the sign of their argument.
const ODD: [MathFn1; 7] =
    [MathFn1::Tanh, MathFn1::Asinh, MathFn1::Atan, MathFn1::Erf, MathFn1::Sinh, MathFn1::Log1p, MathFn1::Expm1];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Sign {
    AtLeastZero,
    AtMostZero,
}

/// Where a condition holds, or does not.
#[derive(Clone, Copy)]
enum Branch {
    Holds,
    Fails,
}

impl Sign {
    fn other(self) -> Self {
        match self {
            Self::AtLeastZero => Self::AtMostZero,
            Self::AtMostZero => Self::AtLeastZero,
        }
    }
}

/// What the branch of a condition says of its sides.
#[derive(Clone)]
struct Known<'g> {
    g: &'g Graph,
    /// The first is at least as large as the second.
    larger: Vec<(ExprId, ExprId)>,
    /// How many more parts are looked at.
    left: &'g Cell<u32>,
}

impl Known<'_> {
    /// Whether the entries have this sign, as far as the form shows it.
    fn has(&self, e: ExprId, sign: Sign) -> bool {
        let g = self.g;
        if self.left.replace(self.left.get().saturating_sub(1)) == 0 {
            return false;
        }
        if let Some(list) = g.constant_value(e) {
            return list.iter().all(|x| if sign == Sign::AtLeastZero { *x >= 0.0 } else { *x <= 0.0 });
        }
        // what is known before the solution is the author's business: a friction coefficient that varies in space
        if !g.depends(e).unknown {
            return sign == Sign::AtLeastZero;
        }
        if self.is_said(e, sign) {
            return true;
        }
        let (is_positive, other) = (sign == Sign::AtLeastZero, sign.other());
        match g.node(e) {
            Node::Add(a, b) => self.has(*a, sign) && self.has(*b, sign),
            Node::Sub(a, b) => {
                let sides = if is_positive { (*a, *b) } else { (*b, *a) };
                self.larger.contains(&sides) || self.has(*a, sign) && self.has(*b, other)
            }
            Node::Neg(a) => self.has(*a, other),
            Node::MulComponents(a, b)
            | Node::Scale(a, b)
            | Node::Contract(a, b, _)
            | Node::DivComponents(a, b)
            | Node::Divide(a, b) => {
                let is_square =
                    a == b && is_positive && !matches!(g.node(e), Node::DivComponents(..) | Node::Divide(..));
                let with = |of_b: Sign| {
                    self.has(*b, of_b) && self.has(*a, if of_b == Sign::AtLeastZero { sign } else { other })
                };
                is_square || with(Sign::AtLeastZero) || with(Sign::AtMostZero)
            }
            Node::Reshape(a) | Node::Permute(a, _) | Node::Pick(a, _) | Node::Trace(a, _, _) | Node::Print(a) => {
                self.has(*a, sign)
            }
            Node::Stack(parts) => parts.iter().all(|part| self.has(*part, sign)),
            Node::Norm(_) | Node::BallRatio(..) => is_positive,
            Node::Map(f, a) => {
                let is_odd = matches!(f, Function1::Math(f) if ODD.contains(f));
                is_odd && self.has(*a, sign) || is_positive && self.never_falls_below_zero(e)
            }
            Node::Map2(..) => is_positive && self.never_falls_below_zero(e),
            Node::Select(mask, a, b) => {
                self.beside(*mask, Branch::Holds).has(*a, sign) && self.beside(*mask, Branch::Fails).has(*b, sign)
            }
            _ => false,
        }
    }

    /// Whether the range of a function is that of numbers that are not negative; what is inside may be so for a reason of its own.
    fn never_falls_below_zero(&self, e: ExprId) -> bool {
        range::range(self.g, e, &|inside| inside != e && self.has(inside, Sign::AtLeastZero), self.left)[0] >= 0.0
    }

    /// Whether a condition says it: of the larger side, if the smaller one is at least zero, of a side itself, and of a
    /// multiple of one.
    fn is_said(&self, e: ExprId, sign: Sign) -> bool {
        let (base, sign) = self.base(e, sign);
        // each is asked of what lies beyond once
        self.larger.iter().enumerate().any(|(k, (high, low))| {
            let mut rest = self.clone();
            rest.larger.remove(k);
            let (of_high, high_sign) = self.base(*high, Sign::AtLeastZero);
            let (of_low, low_sign) = self.base(*low, Sign::AtMostZero);
            (of_high == base && high_sign == sign && rest.has(*low, Sign::AtLeastZero))
                || (of_low == base && low_sign == sign && rest.has(*high, Sign::AtMostZero))
        })
    }

    /// An expression without the factors that are known before the solution, and the sign that it has with the one asked for.
    fn base(&self, e: ExprId, sign: Sign) -> (ExprId, Sign) {
        let factor = |known: ExprId, sign: Sign| match self.g.constant_value(known).as_deref() {
            Some([x]) if *x < 0.0 => Some(sign.other()),
            Some([_]) => Some(sign),
            Some(_) => None,
            None => (!self.g.depends(known).unknown).then_some(sign),
        };
        let next = match self.g.node(e) {
            Node::Neg(a) => Some((*a, sign.other())),
            Node::Scale(a, b) | Node::MulComponents(a, b) => {
                factor(*a, sign).map(|s| (*b, s)).or_else(|| factor(*b, sign).map(|s| (*a, s)))
            }
            Node::Divide(a, b) | Node::DivComponents(a, b) => factor(*b, sign).map(|s| (*a, s)),
            _ => None,
        };
        next.map_or((e, sign), |(inside, sign)| self.base(inside, sign))
    }

    /// With what a condition says in a branch.
    fn beside(&self, mask: ExprId, branch: Branch) -> Self {
        let mut known = self.clone();
        known.add(mask, branch);
        known
    }

    fn add(&mut self, mask: ExprId, branch: Branch) {
        match (self.g.node(mask), branch) {
            (Node::Compare(Compare::Less | Compare::LessEqual, low, high), Branch::Holds) => {
                self.larger.push((*high, *low))
            }
            (Node::Compare(Compare::Less | Compare::LessEqual, low, high), Branch::Fails) => {
                self.larger.push((*low, *high))
            }
            (Node::And(a, b), Branch::Holds) | (Node::Or(a, b), Branch::Fails) => {
                self.add(*a, branch);
                self.add(*b, branch);
            }
            (Node::Not(a), Branch::Holds) => self.add(*a, Branch::Fails),
            (Node::Not(a), Branch::Fails) => self.add(*a, Branch::Holds),
            _ => {}
        }
    }
}
