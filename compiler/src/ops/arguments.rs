//! Arguments of a call, checked: what every operator asks of them is told in the same words.

use wfl::Code;
use wfl::ast::{Argument, Expr};

use crate::{
    build::{Builder, Call},
    graph::ExprId,
    types::Shape,
};

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
                let d = wfl::Diagnostic::new(Code::E105, format!("`:` is no argument of `{}`", call.name));
                self.report(d, call.expr, "")
            }
            Argument::Text(text, _) => {
                let d =
                    wfl::Diagnostic::new(Code::E105, format!("the text \"{text}\" is no argument of `{}`", call.name));
                self.report(d, call.expr, "a number is needed here")
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

    /// Argument `k`, a square matrix without test functions.
    pub(crate) fn square_argument(&mut self, call: &Call<'_>, k: usize) -> Option<ExprId> {
        let argument = self.plain_argument(call, k)?;
        self.square(call, k, argument)
    }

    /// Argument `k` of a linear operator, a square matrix with or without test functions.
    pub(crate) fn linear_square_argument(&mut self, call: &Call<'_>, k: usize) -> Option<ExprId> {
        let argument = self.argument(call, k)?;
        self.square(call, k, argument)
    }

    fn square(&mut self, call: &Call<'_>, k: usize, argument: (&Expr, ExprId)) -> Option<ExprId> {
        let (text, value) = argument;
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
        let value = self.square_argument(call, 0)?;
        let shape = self.graph.shape(value);
        if shape.size(0) <= LARGEST_DETERMINANT {
            return Some(value);
        }
        let text = format!("`{}` of a {shape} is too large: {LARGEST_DETERMINANT} rows at most", call.name);
        self.report(wfl::Diagnostic::new(Code::E110, text), call.expr, shape.to_string())
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
        let d = wfl::Diagnostic::new(Code::E108, format!("`{}` needs {needs}{place}, found a {found}", call.name));
        self.report(d, text, found.to_string())
    }
}
