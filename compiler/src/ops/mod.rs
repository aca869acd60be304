//! The registry of functions: one row each, with its usage, its doc and samples that the tests differentiate.
//!
//! A function is written in operations of the graph; its derivative then follows from `derive.rs`. A function whose
//! derivative cannot follow that way gets a node of its own there. Names in samples: `p`, `q` scalar fields, `u`, `w`
//! vector fields, `A`, `B` square matrix expressions near the identity (the tests put `Grad_u` in them).

/// A row of a function that has no formula entry by entry.
macro_rules! row {
    ($name:literal, $least:literal, $most:literal, $usage:literal, $doc:literal, $samples:expr, $build:expr) => {
        OpDef {
            name: $name,
            least: $least,
            most: $most,
            usage: $usage,
            doc: $doc,
            samples: $samples,
            build: $build,
            entrywise: None,
        }
    };
}

mod by_name;
mod field;
mod formula;
pub(crate) use formula::rebuild;
mod hyperelastic;
mod project;
mod scalar;
mod tensor;

use wfl::ast::{Argument, Expr};

use crate::{
    build::{Builder, Call},
    graph::{ExprId, Function1, Graph},
    math::{MathFn1, MathFn2},
    types::Shape,
};

pub(crate) use by_name::derivative_of;
pub(crate) use scalar::power;

/// What builds the graph of a call.
pub(crate) type BuildFn = fn(&mut Builder<'_>, &Call<'_>) -> Option<ExprId>;

/// A function of the language.
pub struct OpDef {
    /// Its name.
    pub name: &'static str,
    /// Fewest arguments.
    pub(crate) least: usize,
    /// Most arguments.
    pub(crate) most: usize,
    /// How it is called.
    pub usage: &'static str,
    /// What it is, and its rule at a kink.
    pub doc: &'static str,
    /// Expressions that the tests evaluate and differentiate.
    pub samples: &'static [&'static str],
    pub(crate) build: BuildFn,
    /// The formula of a function that acts entry by entry: `Derivative_f` differentiates it.
    pub(crate) entrywise: Option<Entrywise>,
}

/// A function of one or two tensors of one shape, entry by entry.
#[derive(Clone, Copy)]
pub(crate) enum Entrywise {
    /// f(t)
    One(fn(&mut Graph, ExprId) -> ExprId),
    /// f(t, u)
    Two(fn(&mut Graph, ExprId, ExprId) -> ExprId),
}

/// GWFL words that are known but not supported.
pub(crate) const NOT_SUPPORTED: &[&str] = &[
    "Xfem_plus",
    "Xfem_minus",
    "Elementary_transformation",
    "Secondary_domain",
    "Secondary_Domain",
    "Interpolate_derivative",
];

/// All functions, table by table.
pub fn all() -> impl Iterator<Item = &'static OpDef> {
    [scalar::SMOOTH, scalar::TABLE, tensor::TABLE, project::TABLE, hyperelastic::TABLE, field::TABLE]
        .into_iter()
        .flatten()
}

/// The function of that name.
pub(crate) fn find(name: &str) -> Option<&'static OpDef> {
    all().find(|op| op.name == name)
}

/// All names.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    all().map(|op| op.name)
}

/// Rows of a matrix whose determinant or inverse is written out.
const LARGEST_DETERMINANT: usize = 6;

impl Builder<'_> {
    /// Argument `k` as an expression (not `:`), with its text.
    pub(crate) fn argument<'c>(&mut self, call: &Call<'c>, k: usize) -> Option<(&'c Expr, ExprId)> {
        let text = self.argument_text(call, k)?;
        Some((text, self.expr(text)?))
    }

    /// The text of argument `k`.
    pub(crate) fn argument_text<'c>(&mut self, call: &Call<'c>, k: usize) -> Option<&'c Expr> {
        match &call.args[k] {
            Argument::Expr(e) => Some(e),
            Argument::Slice(_) => {
                let d = wfl::Diagnostic::new("E105", format!("`:` is no argument of `{}`", call.name));
                self.report(d, call.expr, "")
            }
        }
    }

    /// Argument `k` without test functions.
    pub(crate) fn plain_argument<'c>(&mut self, call: &Call<'c>, k: usize) -> Option<(&'c Expr, ExprId)> {
        let (text, value) = self.argument(call, k)?;
        self.no_tests(text, value, call.name)?;
        Some((text, value))
    }

    /// Argument `k`, a scalar without test functions.
    pub(crate) fn scalar_argument(&mut self, call: &Call<'_>, k: usize) -> Option<ExprId> {
        let (text, value) = self.plain_argument(call, k)?;
        let shape = self.graph.shape(value);
        if shape.is_scalar_like() {
            return Some(self.graph.to_scalar(value));
        }
        self.bad_argument(call, k, text, "a scalar", shape)
    }

    /// Argument `k`, a square matrix; test functions are allowed when `linear`.
    pub(crate) fn square_argument(&mut self, call: &Call<'_>, k: usize, linear: bool) -> Option<ExprId> {
        let (text, value) = if linear { self.argument(call, k)? } else { self.plain_argument(call, k)? };
        let shape = self.graph.shape(value);
        if shape.rank() == 2 && shape.size(0) == shape.size(1) {
            return Some(value);
        }
        if shape.is_scalar_like() {
            return Some(self.graph.reshape(value, Shape::matrix(1, 1)));
        }
        self.bad_argument(call, k, text, "a square matrix", shape)
    }

    /// A square matrix whose determinant is written out: its cost grows with the factorial of the size.
    pub(crate) fn small_matrix(&mut self, call: &Call<'_>) -> Option<ExprId> {
        let value = self.square_argument(call, 0, false)?;
        let shape = self.graph.shape(value);
        if shape.size(0) <= LARGEST_DETERMINANT {
            return Some(value);
        }
        let text = format!("`{}` of a {shape} is too large: {LARGEST_DETERMINANT} rows at most", call.name);
        self.report(wfl::Diagnostic::new("E110", text), call.expr, shape.to_string())
    }

    pub(crate) fn bad_argument<T>(
        &mut self,
        call: &Call<'_>,
        k: usize,
        text: &Expr,
        needs: &str,
        found: Shape,
    ) -> Option<T> {
        let place = if call.args.len() > 1 { format!(" as argument {}", k + 1) } else { String::new() };
        let d = wfl::Diagnostic::new("E108", format!("`{}` needs {needs}{place}, found a {found}", call.name));
        self.report(d, text, found.to_string())
    }
}

/// A scalar function row.
pub(crate) fn apply(g: &mut Graph, f: MathFn1, a: ExprId) -> ExprId {
    g.map(Function1::Math(f), a)
}

/// A number as a node.
pub(crate) fn times(g: &mut Graph, factor: f64, a: ExprId) -> ExprId {
    let f = g.number(factor);
    g.scale(f, a)
}

/// t to the u with both scalars, by multiplication for small whole powers.
pub(crate) fn pow_components(g: &mut Graph, a: ExprId, b: ExprId) -> ExprId {
    g.map2(MathFn2::Pow, a, b)
}
