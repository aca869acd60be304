//! GetFEM's derivatives at ties, written in the language.
//!
//! At a tie of a kinked function two programs may choose different derivatives, both right. An expression in which
//! `max`, `min` and `Ball_projection` are replaced as [`like_getfem`] does has the same value everywhere and GetFEM's
//! derivative where its arguments are equal, so that a tangent can be compared there too. The compiler knows nothing of
//! this: `Heaviside` has the derivative 0, and a frozen copy of a field is a data field with the same values.

use wfl::ast::{Argument, Expr, ExprKind, MulOp};

/// The name of the copy of a field whose derivative is 0.
pub(super) fn frozen_name(field: &str) -> String {
    format!("{field}_frozen")
}

/// The expression with GetFEM's derivatives at ties; `unknowns` are the names of the fields that have frozen copies.
///
/// - `max(a, b)`: both derivatives count where a = b, as in `max(a0, b0) + Heaviside(a-b)*(a-a0) + Heaviside(b-a)*(b-b0)`
///   with the frozen values a0 and b0; `min` likewise.
/// - `Ball_projection(v, r)`: no derivative at r = 0, as in `(1-Heaviside(-r))*Ball_projection(v, r)`.
pub(super) fn like_getfem(e: &Expr, unknowns: &[&str]) -> Expr {
    let e = with_parts(e, &|part| like_getfem(part, unknowns));
    let ExprKind::Call(name, arguments) = &e.kind else { return e };
    let (ExprKind::Name(name), [Argument::Expr(a), Argument::Expr(b)]) = (&name.kind, arguments.as_slice()) else {
        return e;
    };
    match name.as_str() {
        "max" => both_at_a_tie(&e, [a, b], [not_below(a, b), not_below(b, a)], unknowns),
        "min" => both_at_a_tie(&e, [a, b], [not_below(b, a), not_below(a, b)], unknowns),
        "Ball_projection" => {
            let one = Expr { kind: ExprKind::Number(1.0), ..b.clone() };
            let minus = Expr { kind: ExprKind::Negate(Box::new(b.clone())), ..b.clone() };
            product(&difference(&one, &heaviside(&minus)), &e)
        }
        _ => e,
    }
}

/// The frozen value of `chosen`, a `max` or `min` of two arguments, and what moves each of them where its weight is 1.
fn both_at_a_tie(chosen: &Expr, arguments: [&Expr; 2], weights: [Expr; 2], unknowns: &[&str]) -> Expr {
    let mut parts = vec![(false, frozen(chosen, unknowns))];
    for (argument, weight) in arguments.into_iter().zip(&weights) {
        parts.push((false, product(weight, &difference(argument, &frozen(argument, unknowns)))));
    }
    Expr { kind: ExprKind::Sum(parts), ..chosen.clone() }
}

/// The expression at the frozen copies of its fields.
fn frozen(e: &Expr, unknowns: &[&str]) -> Expr {
    if let ExprKind::Name(name) = &e.kind {
        // `p`, `Grad_p`
        let field =
            unknowns.iter().find(|f| name.strip_suffix(**f).is_some_and(|op| op.is_empty() || op.ends_with('_')));
        return field.map_or_else(|| e.clone(), |_| Expr { kind: ExprKind::Name(frozen_name(name)), ..e.clone() });
    }
    with_parts(e, &|part| frozen(part, unknowns))
}

/// 1 where a >= b, else 0.
fn not_below(a: &Expr, b: &Expr) -> Expr {
    heaviside(&difference(a, b))
}

fn heaviside(t: &Expr) -> Expr {
    let name = Expr { kind: ExprKind::Name("Heaviside".to_owned()), ..t.clone() };
    Expr { kind: ExprKind::Call(Box::new(name), vec![Argument::Expr(t.clone())]), ..t.clone() }
}

fn difference(a: &Expr, b: &Expr) -> Expr {
    Expr { kind: ExprKind::Sum(vec![(false, a.clone()), (true, b.clone())]), ..a.clone() }
}

fn product(a: &Expr, b: &Expr) -> Expr {
    Expr { kind: ExprKind::Product(Box::new(a.clone()), vec![(MulOp::Times, a.span, b.clone())]), ..a.clone() }
}

/// The expression with each of its parts replaced; conditions, which have no derivative, stay.
fn with_parts(e: &Expr, f: &dyn Fn(&Expr) -> Expr) -> Expr {
    let boxed = |part: &Expr| Box::new(f(part));
    let kind = match &e.kind {
        ExprKind::Number(_) | ExprKind::Name(_) => e.kind.clone(),
        ExprKind::Sum(parts) => ExprKind::Sum(parts.iter().map(|(minus, part)| (*minus, f(part))).collect()),
        ExprKind::Product(first, rest) => {
            ExprKind::Product(boxed(first), rest.iter().map(|(op, at, part)| (*op, *at, f(part))).collect())
        }
        ExprKind::Negate(a) => ExprKind::Negate(boxed(a)),
        ExprKind::Power(a, b) => ExprKind::Power(boxed(a), boxed(b)),
        ExprKind::Transpose(a) => ExprKind::Transpose(boxed(a)),
        ExprKind::Call(name, arguments) => {
            let argument = |a: &Argument| match a {
                Argument::Expr(part) => Argument::Expr(f(part)),
                Argument::Slice(_) | Argument::Text(..) => a.clone(),
            };
            ExprKind::Call(name.clone(), arguments.iter().map(argument).collect())
        }
        ExprKind::Tensor(rows) => ExprKind::Tensor(rows.iter().map(|row| row.iter().map(f).collect()).collect()),
        ExprKind::If(c, a, b) => ExprKind::If(c.clone(), boxed(a), boxed(b)),
    };
    Expr { kind, ..e.clone() }
}
