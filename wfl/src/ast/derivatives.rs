//! `gradient Fn, sum(misfit), slip at t = 4 with E, field k`.

use super::{Expr, Ident};
use crate::source::Span;

/// Results, and what they are differentiated in.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradients {
    /// The results.
    pub results: Vec<Differentiated>,
    /// Parameters.
    pub parameters: Vec<Ident>,
    /// Data fields.
    pub fields: Vec<Ident>,
}

/// A measure at some steps, whose derivatives are wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Differentiated {
    /// The measure.
    pub measure: Ident,
    /// At which steps.
    pub at: AtSteps,
    /// As it is written.
    pub span: Span,
}

/// At which steps a measure is taken.
#[derive(Clone, Debug, PartialEq)]
pub enum AtSteps {
    /// At the last one.
    Last,
    /// The sum over all.
    Sum,
    /// The mean over all.
    Mean,
    /// At the step that ends at a value of the step variable, whose name may stand before it.
    At(Option<Ident>, Expr),
}

impl AtSteps {
    /// The value of the step variable, where there is one.
    #[must_use]
    pub fn value(&self) -> Option<&Expr> {
        match self {
            AtSteps::At(_, value) => Some(value),
            _ => None,
        }
    }
}
