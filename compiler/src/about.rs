//! What an expression is, found from its graph alone: shape, test functions, class. No point law is made, so it is fast
//! enough for every keystroke of an editor.
//!
//! Messages are those of `term.rs`; only those that need the scalars of a law are missing there and here.

use wfl::{Checked, Diagnostic, ast::Cond, ast::Expr};

use crate::{
    build::{Builder, Env},
    graph::{Arity, ExprId, Graph, Node},
    law::Class,
    term::{TermSource, kink_warnings, listing_of, tangent_of},
    types::{PlaceSig, Shape},
};

/// An expression on a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct About {
    /// Its shape.
    pub shape: Shape,
    /// It is linear in a test function.
    pub tests: bool,
    /// How it depends on the unknowns.
    pub class: Class,
    /// It changes from point to point.
    pub point: bool,
    /// It changes with the step variable.
    pub step: bool,
}

/// What an expression is; `None` where it has an error.
#[must_use]
pub fn about(env: &Env<'_>, place: &PlaceSig, expr: &Expr) -> Option<About> {
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr)?;
    let mut graph = builder.graph;
    let depends = graph.depends(root);
    Some(About {
        shape: graph.shape(root),
        tests: graph.arity(root).test,
        class: class(&mut graph, env, root),
        point: depends.point,
        step: depends.step,
    })
}

/// The class by the derivative: constant without unknowns, linear if the derivative has none.
fn class(graph: &mut Graph, env: &Env<'_>, root: ExprId) -> Class {
    if !graph.depends(root).unknown {
        return Class::Constant;
    }
    let derivative = if graph.arity(root) == Arity::NONE || !graph.arity(root).trial {
        tangent_of(graph, env.fields, root).ok()
    } else {
        None
    };
    let moves = |e: &ExprId| match *graph.node(*e) {
        Node::Select(mask, ..) => graph.depends(mask).unknown,
        Node::Ball(v, r) => graph.depends(v).unknown || graph.depends(r).unknown,
        _ => false,
    };
    // also where the derivative has no unknown: a law that jumps from one affine form to another is not affine
    if graph.reachable(root).iter().any(moves) {
        Class::Kinked
    } else if derivative.is_some_and(|d| !graph.depends(d).unknown) {
        Class::Linear
    } else {
        Class::Nonlinear
    }
}

/// The messages of [`crate::compile_term`] that need no point law.
#[must_use]
pub fn check_term(env: &Env<'_>, place: &PlaceSig, source: TermSource<'_>) -> Vec<Diagnostic> {
    let Checked { value, mut diagnostics } = listing_of(env, place, source);
    if let Some(listing) = value {
        diagnostics.extend(kink_warnings(env, &listing));
    }
    diagnostics
}

/// The shape of an expression without test functions, and the messages of [`crate::compile_value`].
#[must_use]
pub fn check_value(env: &Env<'_>, place: &PlaceSig, name: &str, expr: &Expr) -> Checked<Shape> {
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr).filter(|root| builder.no_tests(expr, *root, name).is_some());
    Checked { value: root.map(|r| builder.graph.shape(r)), diagnostics: builder.diagnostics }
}

/// The messages of [`crate::compile_condition`].
#[must_use]
pub fn check_condition(env: &Env<'_>, place: &PlaceSig, condition: &Cond) -> Vec<Diagnostic> {
    let mut builder = Builder::new(env, place).with_loose_equality();
    // what is built is not kept: a condition has no shape
    let _ = builder.condition(condition);
    builder.diagnostics
}
