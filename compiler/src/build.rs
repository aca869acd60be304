//! Syntax to typed graph: names are looked up, shapes and test functions checked, every problem reported.
//!
//! A [`Builder`] works on one term (or one other expression) on one place. It returns `None` after an error and
//! goes on with the neighbours, so one run reports all of them. Formulas of functions are in `ops/`.

mod conditions;
mod gradient;
mod names;
mod operators;
mod parts;

use std::{collections::BTreeMap, sync::Arc};

use wfl::{
    Code, Diagnostic, Span, Table,
    ast::{Argument, Expansions, Expr, ExprKind},
    quote,
};

use crate::{
    graph::{Arity, ExprId, Graph},
    ir::Origin,
    types::{FieldSig, MappingSig, PlaceSig, RateForm, Shape},
};

/// Operations that may follow on each other's results (E441): walks over the graph and its derivatives call themselves so
/// often, on a stack that the command makes large enough. Sums and products of scalars are cut into parts, so that their
/// length does not count.
pub const DEPTH_LIMIT: usize = 10_000;

/// Messages about one expression: further ones say nothing new.
const MOST_MESSAGES: usize = 1000;

/// A named constant tensor.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Its shape.
    pub shape: Shape,
    /// Its entries, first index fastest.
    pub values: Vec<f64>,
    /// Where it is declared, for messages.
    pub declared: Option<Span>,
}

/// What every expression of a scene can see.
#[derive(Clone, Debug)]
pub struct Env<'a> {
    /// Space dimension.
    pub dim: usize,
    /// Fields, by [`crate::types::FieldId`].
    pub fields: &'a [FieldSig],
    /// Mappings to other points.
    pub mappings: &'a [MappingSig],
    /// Parameters by name.
    pub params: &'a BTreeMap<String, Constant>,
    /// Macro uses, so that messages can show them.
    pub expansions: &'a Expansions,
    /// The variable of `steps`, if written.
    pub step_variable: Option<&'a str>,
    /// By field, what its rates are compiled to; [`RateForm::Difference`] for fields behind its end.
    pub rates: &'a [RateForm],
    /// The files of `table`.
    pub tables: &'a [Arc<Table>],
    /// Two coordinates are equal in a condition when they differ by at most this (a length).
    pub equal_within: f64,
}

/// Builds the graph of one expression on one place.
pub struct Builder<'a> {
    pub(crate) env: &'a Env<'a>,
    pub(crate) place: &'a PlaceSig,
    /// The graph so far.
    pub graph: Graph,
    /// What was found.
    pub diagnostics: Vec<Diagnostic>,
    /// Conditions compare coordinates within `equal_within`.
    pub(crate) loose_equality: bool,
    /// The other place that `Interpolate` has reached: the neighbour (`None`) or a mapping.
    pub(crate) reached: Option<Option<usize>>,
    /// Role of plain field names: `Current`, except below `Previous`.
    pub(crate) order2: bool,
    /// Names stand for what they were at the end of the previous step: below `Rate`.
    pub(crate) in_the_past: bool,
    /// Below a product that is zero for the present parameters.
    pub(crate) without_effect: bool,
    /// In a branch that the present parameters never take: what a number there is says nothing.
    pub(crate) dead: bool,
}

/// A call of a function, ready for `ops/`.
pub(crate) struct Call<'c> {
    pub(crate) name: &'c str,
    pub(crate) expr: &'c Expr,
    pub(crate) args: &'c [Argument],
}

impl<'a> Builder<'a> {
    /// A builder on `place`.
    #[must_use]
    pub fn new(env: &'a Env<'a>, place: &'a PlaceSig) -> Self {
        Self {
            env,
            place,
            graph: Graph::new(env.dim, env.fields),
            diagnostics: Vec::new(),
            loose_equality: false,
            reached: None,
            order2: false,
            in_the_past: false,
            without_effect: false,
            dead: false,
        }
    }

    /// In conditions on positions `==` means "within `equal_within`".
    #[must_use]
    pub fn with_loose_equality(mut self) -> Self {
        self.loose_equality = true;
        self
    }

    /// A diagnostic at an expression: inside a macro the use is the primary place and the body the second.
    #[must_use]
    pub fn at(&self, diagnostic: Diagnostic, e: &Expr, text: impl Into<String>) -> Diagnostic {
        locate(diagnostic, Origin { span: e.span, expansion: e.expansion }, self.env.expansions, text)
    }

    /// The place of an operand of `parent`: one that is a use of a macro is the use, not the body.
    pub(crate) fn operand(&self, parent: &Expr, e: &Expr) -> Origin {
        let mut origin = Origin { span: e.span, expansion: e.expansion };
        while origin.expansion != parent.expansion {
            let Some(id) = origin.expansion else { return Origin { span: e.span, expansion: e.expansion } };
            let use_ = &self.env.expansions.list[id.index()];
            origin = Origin { span: use_.call, expansion: use_.parent };
        }
        origin
    }

    /// A diagnostic at an operand of `parent`.
    pub(crate) fn at_operand(&self, d: Diagnostic, parent: &Expr, e: &Expr, text: impl Into<String>) -> Diagnostic {
        locate(d, self.operand(parent, e), self.env.expansions, text)
    }

    /// The text of an operand of `parent` as it is written.
    pub(crate) fn text_of(&self, parent: &Expr, e: &Expr) -> String {
        quote(self.operand(parent, e).span)
    }

    pub(crate) fn report<T>(&mut self, diagnostic: Diagnostic, e: &Expr, text: impl Into<String>) -> Option<T> {
        let diagnostic = self.at(diagnostic, e, text);
        if self.diagnostics.len() < MOST_MESSAGES && !self.diagnostics.contains(&diagnostic) {
            self.diagnostics.push(diagnostic);
        }
        None
    }

    /// The graph node of an expression; `None` after errors.
    pub fn expr(&mut self, e: &Expr) -> Option<ExprId> {
        let origin = Some(Origin { span: e.span, expansion: e.expansion });
        let before = self.graph.set_origin(origin);
        let built = self.kind(e);
        self.graph.set_origin(before);
        let built = built?;
        if self.graph.depth(built) > DEPTH_LIMIT {
            let d = Diagnostic::new(
                Code::E441,
                format!("more than {DEPTH_LIMIT} operations, each on the result of the last"),
            );
            return self.report(d, e, "");
        }
        Some(built)
    }

    fn kind(&mut self, e: &Expr) -> Option<ExprId> {
        match &e.kind {
            ExprKind::Number(x) => Some(self.graph.number(*x)),
            ExprKind::Name(name) => self.name(e, name),
            ExprKind::Sum(parts) => self.sum(e, parts),
            ExprKind::Product(first, rest) => self.product(e, first, rest),
            ExprKind::Negate(a) => {
                let a = self.expr(a)?;
                Some(self.graph.neg(a))
            }
            ExprKind::Power(a, b) => self.power(a, b),
            ExprKind::Transpose(a) => {
                let x = self.expr(a)?;
                Some(self.transpose(x))
            }
            ExprKind::Call(callee, args) => self.call(e, callee, args),
            ExprKind::Tensor(rows) => self.tensor(e, rows),
            ExprKind::If(cond, a, b) => {
                let mask = self.condition(cond);
                let taken = mask.and_then(|mask| self.graph.constant_mask(mask));
                let [a_dead, b_dead] = [false, true].map(|v| taken.as_ref().is_some_and(|m| m.iter().all(|x| *x == v)));
                let (a_built, b_built) = (self.branch(a, a_dead), self.branch(b, b_dead));
                let (mask, x, y) = (mask?, a_built?, b_built?);
                let (x, y) = self.same_shape(e, x, y, "the two branches of `if`")?;
                for (part, x) in [(a, x), (b, y)] {
                    self.no_tests(part, x, "if")?;
                }
                Some(self.graph.select(mask, x, y))
            }
        }
    }

    /// An operand that, where it is dead, the present parameters never ask for.
    fn branch(&mut self, e: &Expr, dead: bool) -> Option<ExprId> {
        let before = self.dead;
        self.dead |= dead;
        let built = self.expr(e);
        self.dead = before;
        built
    }

    /// Refuses test functions inside a nonlinear function.
    pub(crate) fn no_tests(&mut self, e: &Expr, value: ExprId, function: &str) -> Option<()> {
        if self.graph.arity(value) == Arity::NONE {
            return Some(());
        }
        let d = Diagnostic::new(Code::E303, "test function inside a nonlinear function");
        match first_test(e) {
            Some((at, name)) => self.report(d, at, format!("`{function}` makes this term nonlinear in {name}")),
            None => self.report(d, e, format!("`{function}` makes this term nonlinear in the test function")),
        }
    }

    /// Gives two values one shape: a scalar is repeated to fit the other.
    pub(crate) fn same_shape(&mut self, e: &Expr, a: ExprId, b: ExprId, what: &str) -> Option<(ExprId, ExprId)> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        if sa == sb {
            return Some((a, b));
        }
        if sa.is_scalar_like() {
            let scalar = self.graph.to_scalar(a);
            return Some((self.graph.fill(scalar, sb), b));
        }
        if sb.is_scalar_like() {
            let scalar = self.graph.to_scalar(b);
            return Some((a, self.graph.fill(scalar, sa)));
        }
        let d = Diagnostic::new(Code::E108, format!("{what} must be of one shape, found {sa} and {sb}"));
        self.report(d, e, "")
    }
}

/// A diagnostic at a place: inside a macro the outermost use is the primary place and the body the second.
#[must_use]
pub fn locate(diagnostic: Diagnostic, origin: Origin, expansions: &Expansions, text: impl Into<String>) -> Diagnostic {
    let Some(id) = origin.expansion else {
        return diagnostic.at(origin.span, text);
    };
    let inner = &expansions.list[id.index()];
    let mut outer = inner;
    while let Some(parent) = outer.parent {
        outer = &expansions.list[parent.index()];
    }
    let first = diagnostic.labels.is_empty();
    let d = if first { diagnostic.at(outer.call, format!("in this use of `{}`", outer.name)) } else { diagnostic };
    d.at(origin.span, text)
}

/// The first test function in an expression, with its name.
pub(crate) fn first_test(e: &Expr) -> Option<(&Expr, &str)> {
    match &e.kind {
        ExprKind::Name(n) => n.find("Test_").map(|at| (e, &n[at..])),
        ExprKind::Number(_) => None,
        ExprKind::Sum(parts) => parts.iter().find_map(|(_, p)| first_test(p)),
        ExprKind::Product(first, rest) => first_test(first).or_else(|| rest.iter().find_map(|(_, _, p)| first_test(p))),
        ExprKind::Negate(a) | ExprKind::Transpose(a) => first_test(a),
        ExprKind::Power(a, b) | ExprKind::If(_, a, b) => first_test(a).or_else(|| first_test(b)),
        ExprKind::Call(callee, args) => args
            .iter()
            .find_map(|a| if let Argument::Expr(e) = a { first_test(e) } else { None })
            .or_else(|| first_test(callee)),
        ExprKind::Tensor(rows) => rows.iter().flatten().find_map(first_test),
    }
}
