//! Expressions that are numbers before the run, and what is told when a field stands where none can be.

use wfl::{Checked, Code, Diagnostic, ast::Expr};

use crate::{
    build::{Constant, Env, locate},
    interp::interpret,
    ir::Origin,
    law::run_prologue,
    term::compile_value,
    types::{PlaceKind, PlaceSig},
};

/// The value of an expression that must not change with anything.
#[must_use]
pub fn constant(env: &Env<'_>, what: &str, expr: &Expr) -> Checked<Constant> {
    let nowhere = PlaceSig {
        name: "global".to_owned(),
        kind: PlaceKind::Global,
        here: vec![false; env.fields.len()],
        there: vec![false; env.fields.len()],
        entities: Vec::new(),
        description: "no place".to_owned(),
        here_name: None,
        inside: false,
    };
    let law = compile_value(env, &nowhere, what, expr);
    let known = format!("{what} must be a number known before the run");
    let mut diagnostics: Vec<Diagnostic> =
        law.diagnostics.into_iter().map(|d| without_fields(d, Code::E112, &known)).collect();
    let value = law.value.and_then(|law| {
        if law.inputs.is_empty() && law.prologue.slots.is_empty() {
            let kernel = law.kernel.kernel();
            let uniforms = run_prologue(&law.prologue, &[]);
            let mut out = vec![0.0; kernel.outputs.len()];
            interpret(&law.kernel, &uniforms, &[], &mut Vec::new(), &mut out);
            return Some(Constant { shape: law.shape, values: out, declared: Some(expr.span) });
        }
        let d = Diagnostic::new(Code::E112, known);
        let origin = Origin { span: expr.span, expansion: expr.expansion };
        diagnostics.push(locate(d, origin, env.expansions, "changes with position or time"));
        None
    });
    Checked { value, diagnostics }
}

/// A message about a field where no field can be (E202) in the words of the statement.
#[must_use]
pub fn without_fields(d: Diagnostic, code: Code, message: &str) -> Diagnostic {
    if d.code != Code::E202 {
        return d;
    }
    let field = d.about.clone().unwrap_or_default();
    let told = d.labels.into_iter().enumerate().fold(Diagnostic::new(code, message), |told, (k, label)| {
        let text = if k == 0 { format!("`{field}` is a field: it has values only during the run") } else { label.text };
        told.at(label.span, text)
    });
    told.about(field)
}
