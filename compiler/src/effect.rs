//! Parts of a text that have no effect, because a factor of theirs is zero: `inertia*rho*Dot2_u.Test_u` with
//! `param inertia = 0`. What stands in them is checked like all other text, but asks for nothing: neither for a second rate,
//! nor for a scheme. Knows numbers and parameters; what follows from fields or places is never zero here.

use std::collections::BTreeMap;

use wfl::ast::{Expr, ExprKind, MulOp};

use crate::build::Constant;

/// The parameters of a scene by name.
type Params = BTreeMap<String, Constant>;

/// True for an expression that is zero for the present values of parameters.
#[must_use]
pub(crate) fn vanishes(params: &Params, e: &Expr) -> bool {
    match &e.kind {
        ExprKind::Name(name) => params.get(name).is_some_and(|c| c.values.iter().all(|v| *v == 0.0)),
        ExprKind::Product(first, rest) => {
            vanishes(params, first) || rest.iter().any(|(op, _, factor)| !is_quotient(*op) && vanishes(params, factor))
        }
        ExprKind::Negate(a) | ExprKind::Transpose(a) => vanishes(params, a),
        _ => number(params, e) == Some(0.0),
    }
}

/// Calls `f` for every word of an expression, but for those in products that are zero for the present values of parameters.
pub fn each_name_in_effect<'e>(params: &Params, e: &'e Expr, f: &mut dyn FnMut(&'e str)) {
    if matches!(&e.kind, ExprKind::Product(..)) && vanishes(params, e) {
        return;
    }
    if let ExprKind::Name(word) = &e.kind {
        f(word);
    }
    wfl::children(e, &mut |part| each_name_in_effect(params, part, f));
}

fn is_quotient(op: MulOp) -> bool {
    matches!(op, MulOp::Divide | MulOp::DivideByComponent)
}

/// The value of an expression of numbers and scalar parameters.
fn number(params: &Params, e: &Expr) -> Option<f64> {
    match &e.kind {
        ExprKind::Number(x) => Some(*x),
        ExprKind::Name(name) => match params.get(name)?.values.as_slice() {
            [x] => Some(*x),
            _ => None,
        },
        ExprKind::Sum(parts) => parts.iter().try_fold(0.0, |sum, (minus, part)| {
            let x = number(params, part)?;
            Some(if *minus { sum - x } else { sum + x })
        }),
        ExprKind::Product(first, rest) => rest.iter().try_fold(number(params, first)?, |product, (op, _, factor)| {
            let x = number(params, factor)?;
            Some(if is_quotient(*op) { product / x } else { product * x })
        }),
        ExprKind::Negate(a) => number(params, a).map(|x| -x),
        ExprKind::Power(a, b) => Some(number(params, a)?.powf(number(params, b)?)),
        _ => None,
    }
}
