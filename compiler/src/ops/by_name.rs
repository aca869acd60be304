//! `Derivative_f(t)`, `Derivative_1_f(t, u)`, `Derivative_2_f(t, u)`: the derivative of a scalar function by its name.
//!
//! The function is differentiated as a formula of free symbols, so what stands in the call does not matter: numbers,
//! the same expression twice, or a vector (entry by entry). At a kink it is the derivative of the branch taken.

use wfl::{Code, Diagnostic, Span, ast::ExprKind};

use crate::{
    build::{Builder, Call},
    derive::NoDerivative,
    graph::ExprId,
    ops::{
        def::{Entrywise, OpDef},
        formula::Formula,
        scalar::two_arguments,
        table::{all, find},
    },
};

/// The name of the function and the argument (from 0) that a word `Derivative_...` means.
fn parts(word: &str) -> Option<(usize, &str)> {
    let rest = word.strip_prefix("Derivative_")?;
    let numbered = rest.strip_prefix("1_").map(|f| (0, f)).or_else(|| rest.strip_prefix("2_").map(|f| (1, f)));
    Some(numbered.unwrap_or((0, rest)))
}

/// The node of a call `Derivative_...(...)`.
pub(crate) fn derivative_of(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (which, function) = parts(c.name)?;
    let Some((op, formula)) = find(function).and_then(|op| Some((op, op.entrywise?))) else {
        let known = all().filter(|op| op.entrywise.is_some()).map(|op| op.name);
        let near = wfl::nearest(function, known);
        let text = near.map_or_else(String::new, |k| format!("did you mean `{k}`?"));
        let d = Diagnostic::new(Code::E201, format!("`{function}` is no scalar function"));
        let d = d.help("Derivative_sin(t), Derivative_2_pow(t, u)");
        let d = match (near, &c.expr.kind) {
            (Some(near), ExprKind::Call(callee, _)) => {
                let start = callee.span.end - function.len() as u32;
                d.replace(Span { start, ..callee.span }, near)
            }
            _ => d,
        };
        return b.report(d, c.expr, text);
    };
    if which >= op.least || c.args.len() != op.least {
        return wrong_count(b, c, op);
    }
    let values = match formula {
        Entrywise::One(_) => vec![b.plain_argument(c, 0)?.1],
        Entrywise::Two(_) => {
            let (x, y) = two_arguments(b, c)?;
            vec![x, y]
        }
    };
    let shape = b.graph.shape(values[0]);
    let mut symbols = Formula::new(&b.graph, &vec![shape; values.len()]);
    let value = match formula {
        Entrywise::One(f) => f(&mut symbols.graph, symbols.arguments[0]),
        Entrywise::Two(f) => f(&mut symbols.graph, symbols.arguments[0], symbols.arguments[1]),
    };
    match symbols.slope(value, which) {
        Ok(slope) if symbols.graph.is_zero(slope) => {
            let d = Diagnostic::new(Code::E111, format!("`{function}` has no derivative"));
            b.report(d, c.expr, "it is 0 wherever it exists")
        }
        Ok(slope) => Some(symbols.copy(slope, &mut b.graph, &values)),
        Err(NoDerivative { what, .. }) => b.no_derivative(c.expr, what),
    }
}

fn wrong_count(b: &mut Builder<'_>, c: &Call<'_>, op: &OpDef) -> Option<ExprId> {
    let plural = if op.least == 1 { "" } else { "s" };
    let d = Diagnostic::new(
        Code::E105,
        format!("`{}` takes {} argument{plural}, {} given", op.name, op.least, c.args.len()),
    );
    b.report(d, c.expr, op.usage)
}

#[cfg(test)]
mod tests {
    use super::parts;

    #[test]
    fn words_are_split() {
        assert_eq!(parts("Derivative_sin"), Some((0, "sin")));
        assert_eq!(parts("Derivative_1_pow"), Some((0, "pow")));
        assert_eq!(parts("Derivative_2_pow"), Some((1, "pow")));
        assert_eq!(parts("sin"), None);
    }
}
