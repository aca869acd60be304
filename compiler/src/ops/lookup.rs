//! `table("history.csv", t, "q")`: a column of a file that was read before the scene is compiled.

use wfl::{Code, Diagnostic, ast::Argument};

use crate::{
    build::{Builder, Call},
    graph::ExprId,
    lookup::{CurveRef, Reading},
};

/// The node of a call. What the file says was checked where it was read (`wfl/src/resolve/tables.rs`).
pub(super) fn lookup(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (file, column) = match (&c.args[0], c.args.get(2)) {
        (Argument::Text(file, _), None) => (file, None),
        (Argument::Text(file, _), Some(Argument::Text(column, _))) => (file, Some(column.as_str())),
        _ => {
            let d = Diagnostic::new(
                Code::E105,
                "`table` takes a file in quotes and a number; a column in quotes may follow",
            );
            return b.report(d, c.expr, "");
        }
    };
    let found = b.env.tables.iter().find(|t| t.name == *file).map(|t| t.curve(column));
    let curve = match found {
        Some(Ok(curve)) => CurveRef::from(curve),
        Some(Err((why, help))) => return b.report(Diagnostic::new(Code::E446, why).help(help), c.expr, ""),
        None => {
            let d = Diagnostic::new(Code::E446, format!("no file can be read here, \"{file}\" neither"));
            return b.report(d, c.expr, "");
        }
    };
    let argument = b.scalar_argument(c, 1)?;
    let value = b.graph.lookup(&curve, Reading::Value, argument);
    if let (Some(x), None) = (b.graph.scalar_constant(argument), b.graph.scalar_constant(value)) {
        let (first, last) = curve.range();
        let d = Diagnostic::new(Code::E447, format!("{x} is outside the rows of {}", curve.name));
        return b.report(d, c.expr, format!("the rows go from {first} to {last}"));
    }
    Some(value)
}
