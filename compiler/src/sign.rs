//! Which expressions cannot be negative, as far as their form shows it, and the warning that rests on it (W502).

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

/// True if the entries are at least 0 whatever the unknowns are, as far as the form shows it.
fn never_negative(g: &Graph, e: ExprId) -> bool {
    let both = |a, b| never_negative(g, a) && never_negative(g, b);
    if let Some(list) = g.constant_value(e) {
        return list.iter().all(|x| *x >= 0.0);
    }
    // what is known before the solution is the author's business: a friction coefficient that varies in space
    if !g.depends(e).unknown {
        return true;
    }
    match g.node(e) {
        Node::Add(a, b) | Node::DivComponents(a, b) | Node::Divide(a, b) => both(*a, *b),
        Node::MulComponents(a, b) | Node::Scale(a, b) | Node::Contract(a, b, _) => a == b || both(*a, *b),
        Node::Reshape(a) | Node::Permute(a, _) | Node::Pick(a, _) | Node::Trace(a, _, _) | Node::Print(a) => {
            never_negative(g, *a)
        }
        Node::Stack(parts) => parts.iter().all(|p| never_negative(g, *p)),
        Node::Norm(_) | Node::BallRatio(..) => true,
        Node::Map(f, _) => {
            matches!(f, Function1::Sqrt | Function1::Math(MathFn1::Exp | MathFn1::Cosh | MathFn1::Acosh))
        }
        Node::Select(mask, a, b) => {
            let bounded = |value: ExprId| match g.node(*mask) {
                // pos_part: the value is taken only where it is at least 0
                Node::Compare(Compare::Less | Compare::LessEqual, low, high) => *high == value && g.is_zero(*low),
                _ => false,
            };
            let otherwise = |value: ExprId| match g.node(*mask) {
                // abs: minus a value that is below 0
                Node::Compare(Compare::Less | Compare::LessEqual, low, high) => {
                    g.is_zero(*low) && matches!(g.node(value), Node::Neg(x) if x == high)
                }
                _ => false,
            };
            (bounded(*a) || never_negative(g, *a)) && (otherwise(*b) || never_negative(g, *b))
        }
        _ => false,
    }
}
