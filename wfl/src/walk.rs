//! Walks over expressions. Nesting is bounded, so they recurse.

use crate::ast::{Argument, Cond, CondKind, Expr, ExprKind};

/// Calls `f` for each part directly below `e`, conditions included.
pub fn children<'e>(e: &'e Expr, f: &mut dyn FnMut(&'e Expr)) {
    match &e.kind {
        ExprKind::Number(_) | ExprKind::Name(_) => {}
        ExprKind::Sum(parts) => parts.iter().for_each(|(_, p)| f(p)),
        ExprKind::Product(first, rest) => {
            f(first);
            rest.iter().for_each(|(_, _, p)| f(p));
        }
        ExprKind::Negate(a) | ExprKind::Transpose(a) => f(a),
        ExprKind::Power(a, b) => {
            f(a);
            f(b);
        }
        ExprKind::Call(callee, arguments) => {
            f(callee);
            for a in arguments {
                if let Argument::Expr(a) = a {
                    f(a);
                }
            }
        }
        ExprKind::Tensor(rows) => rows.iter().flatten().for_each(f),
        ExprKind::If(c, a, b) => {
            cond_children(c, f);
            f(a);
            f(b);
        }
    }
}

/// Calls `f` for each expression of a condition.
pub fn cond_children<'e>(c: &'e Cond, f: &mut dyn FnMut(&'e Expr)) {
    match &c.kind {
        CondKind::Compare(first, rest) => {
            f(first);
            rest.iter().for_each(|(_, e)| f(e));
        }
        CondKind::And(parts) | CondKind::Or(parts) => parts.iter().for_each(|p| cond_children(p, f)),
        CondKind::Not(a) => cond_children(a, f),
    }
}

/// Calls `f` for every word of an expression.
pub fn each_name<'e>(e: &'e Expr, f: &mut dyn FnMut(&'e str)) {
    if let ExprKind::Name(word) = &e.kind {
        f(word);
    }
    children(e, &mut |c| each_name(c, f));
}

/// Calls `f` for every node that is a word, with the word.
pub fn each_word<'e>(e: &'e Expr, f: &mut dyn FnMut(&'e Expr, &'e str)) {
    if let ExprKind::Name(word) = &e.kind {
        f(e, word);
    }
    children(e, &mut |c| each_word(c, f));
}

/// The number of nodes.
pub(crate) fn size(e: &Expr) -> usize {
    let mut n = 1;
    children(e, &mut |c| n += size(c));
    n
}

/// How many nodes stand below the top one on the longest way down.
pub(crate) fn height(e: &Expr) -> usize {
    let mut deepest = 0;
    children(e, &mut |c| deepest = deepest.max(1 + height(c)));
    deepest
}
