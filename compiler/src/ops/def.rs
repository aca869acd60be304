//! What an operator is to the compiler: a row of `table.rs`.

use crate::{
    build::{Builder, Call},
    graph::{ExprId, Graph},
};

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
    /// Why it has no samples; empty if it has.
    pub untested: &'static str,
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
