//! The exact solution that a scene defines (`def exact`, `def exact_NAME`), and the errors of runs against it.

use wfl::{
    FieldKind,
    ast::{Expr, ExprKind, MulOp},
};
use wfl_adapt::compare::{EXACT_OUTPUT, Solved, beside_constant, items, name, take, unknowns};
use wfl_compiler::backend::KernelBackend;
use wfl_problem::{SampleAt, Samples};

use crate::bench::Known;

/// Errors are exact to this degree: the exact solution is no polynomial.
const EXACT_DEGREE: usize = 11;

/// Statements put behind a scene so that its exact solution is read with it; `None` if it defines none.
pub(crate) fn statements(known: &Known) -> Option<String> {
    let has = |n: &str| known.loaded.script.macros.iter().any(|m| m.name.name == n);
    let mut items = Vec::new();
    let fields = || known.loaded.script.fields.iter().filter(|f| matches!(f.kind, FieldKind::Unknown));
    for field in fields().map(|f| &f.name.name) {
        let own = format!("exact_{field}");
        let used = if has(&own) { own } else { "exact".to_owned() };
        if has(&used) && (used != "exact" || fields().count() == 1) {
            items.push(format!("{used} as value_{field}, Grad({used}) as slope_{field}"));
        }
    }
    for item in known.loaded.script.outputs.iter().flat_map(|o| &o.items) {
        let own = format!("exact_{}", item.name);
        let listed = format!("{own} as face_{}", item.name);
        if has(&own) && !items.contains(&listed) {
            items.push(listed);
        }
    }
    let of_field = items.iter().any(|i| i.contains(" as value_"));
    of_field.then(|| format!("output vtk \"{EXACT_OUTPUT}\" : {}\n", items.join(", ")))
}

/// The relative errors of a run that was read with [`statements`]: `L2` (of the solution beside its value nearest to zero), `H1`, outputs on
/// contact faces.
pub(crate) fn errors(run: &Solved, backend: &dyn KernelBackend) -> Result<Vec<(String, f64)>, String> {
    let given = run.outputs.iter().find(|o| o.file == EXACT_OUTPUT).ok_or("the scene defines no exact solution")?;
    let exact = |kind: &str, n: &str| given.items.iter().find(|i| i.name == format!("{kind}_{n}")).map(|i| &i.expr);
    let mut list = Vec::new();
    let mut push = |quantity: String, value: Expr, exact: &Expr, norm_of: &Expr| {
        let like = |kind| Expr { kind, span: value.span, expansion: None };
        let sum = |a: Expr, minus, b: Expr| like(ExprKind::Sum(vec![(false, a), (minus, b)]));
        list.push((format!("{quantity} error"), sum(value.clone(), true, exact.clone())));
        // zero times the value: the norm is taken where the value lives
        let factors = vec![(MulOp::Times, value.span, value.clone())];
        let nothing = like(ExprKind::Product(Box::new(like(ExprKind::Number(0.0))), factors));
        list.push((quantity, sum(nothing, false, norm_of.clone())));
    };
    for field in unknowns(run) {
        if let (Some(value), Some(slope)) = (exact("value", field), exact("slope", field)) {
            push("L2".to_owned(), name(run, field), value, &beside_constant(run, field, value)?);
            push("H1".to_owned(), name(run, &format!("Grad_{field}")), slope, slope);
        }
    }
    for item in items(run) {
        if let Some(e) = exact("face", &item.name) {
            push(item.name.clone(), item.expr.clone(), e, e);
        }
    }
    let samples = take(run, backend, &list, SampleAt::Own(EXACT_DEGREE))?;
    let norm = |quantity: &str| {
        let squares = |s: &Samples| -> f64 {
            let one = |(p, w): (usize, &f64)| {
                w * s.values[p * s.components..(p + 1) * s.components].iter().map(|v| v * v).sum::<f64>()
            };
            s.weights.iter().enumerate().map(one).sum()
        };
        samples.iter().filter(|s| s.name == quantity).map(squares).sum::<f64>().sqrt()
    };
    let mut out: Vec<(String, f64)> = Vec::new();
    for quantity in list.iter().map(|l| &l.0).filter(|n| !n.ends_with(" error")) {
        if out.iter().all(|o| o.0 != *quantity) {
            out.push((quantity.clone(), norm(&format!("{quantity} error")) / norm(quantity)));
        }
    }
    Ok(out)
}
