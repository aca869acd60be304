//! Parameters and other numbers that are known before the run.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, ResolvedScript,
    ast::{Domain, Expr},
};
use wfl_compiler::{Constant, Env, constant};

/// The value of every parameter, in order of declaration; problems go to `diagnostics`.
pub(super) fn parameters(
    script: &ResolvedScript,
    dim: usize,
    diagnostics: &mut Vec<Diagnostic>,
) -> BTreeMap<String, Constant> {
    let mut known: BTreeMap<String, Constant> = BTreeMap::new();
    for param in &script.params {
        let found = {
            let env = bare_env(script, dim, &known);
            constant(&env, &format!("`{}`", param.name.name), &param.value)
        };
        diagnostics.extend(found.diagnostics);
        let Some(mut value) = found.value else { continue };
        value.declared = Some(param.span);
        if let Some(bad) = value.values.iter().find(|v| !v.is_finite()) {
            let d = Diagnostic::new(Code::E702, format!("`{}` is not a finite number: {bad}", param.name.name));
            diagnostics.push(d.at(param.value.span, "must be finite"));
            continue;
        }
        if let Some(domain) = &param.domain {
            // a value that is not allowed is not used: what follows from it says nothing
            let before = diagnostics.len();
            check_domain(script, dim, &known, param, domain, &value, diagnostics);
            if diagnostics.len() > before {
                continue;
            }
        }
        known.insert(param.name.name.clone(), value);
    }
    known
}

/// An environment with parameters only.
pub(super) fn bare_env<'a>(script: &'a ResolvedScript, dim: usize, params: &'a BTreeMap<String, Constant>) -> Env<'a> {
    Env {
        dim,
        fields: &[],
        mappings: &[],
        params,
        expansions: &script.expansions,
        step_variable: None,
        rates: &[],
        tables: &script.tables,
        equal_within: 0.0,
    }
}

fn check_domain(
    script: &ResolvedScript,
    dim: usize,
    known: &BTreeMap<String, Constant>,
    param: &wfl::Param,
    domain: &Domain,
    value: &Constant,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let env = bare_env(script, dim, known);
    let mut number = |e: &Expr| {
        let found = constant(&env, "a bound", e);
        diagnostics.extend(found.diagnostics);
        found.value.map(|c| c.values[0])
    };
    let (good, words) = match domain {
        Domain::Range(low, high) => {
            let (Some(low), Some(high)) = (number(low), number(high)) else { return };
            (
                value.values.iter().all(|v| (low..=high).contains(v)),
                format!("between {} and {}", short(low), short(high)),
            )
        }
        Domain::Set(list) => {
            let allowed: Vec<f64> = list.iter().filter_map(number).collect();
            let words: Vec<String> = allowed.iter().map(|v| short(*v)).collect();
            (value.values.iter().all(|v| allowed.contains(v)), format!("one of {}", words.join(", ")))
        }
    };
    if !good {
        let shown: Vec<String> = value.values.iter().map(|v| short(*v)).collect();
        let d = Diagnostic::new(Code::E701, format!("`{}` must be {words}", param.name.name));
        diagnostics.push(match param.overridden {
            Some(given) => d.at(given, format!("declared: {}, {}", wfl::quote(param.span), wfl::line_of(param.span))),
            None => d.at(param.value.span, format!("this is {}", shown.join(", "))),
        });
    }
}

/// A number as a person would write it: 0.25, 1e24.
fn short(v: f64) -> String {
    if v == 0.0 || (1e-4..1e7).contains(&v.abs()) { v.to_string() } else { format!("{v:e}") }
}

/// A constant expression as numbers.
pub(super) fn numbers(env: &Env<'_>, what: &str, e: &Expr, diagnostics: &mut Vec<Diagnostic>) -> Option<Vec<f64>> {
    let found = constant(env, what, e);
    diagnostics.extend(found.diagnostics);
    let value = found.value?;
    if let Some(bad) = value.values.iter().find(|v| !v.is_finite()) {
        diagnostics.push(Diagnostic::new(Code::E702, format!("{what} is not a finite number: {bad}")).at(e.span, ""));
        return None;
    }
    Some(value.values)
}

/// A constant expression of a scene that was prepared; `None` where it is no constant.
#[must_use]
pub fn numbers_of(
    script: &ResolvedScript,
    params: &BTreeMap<String, Constant>,
    dim: usize,
    e: &Expr,
) -> Option<Vec<f64>> {
    numbers(&bare_env(script, dim, params), "a constant", e, &mut Vec::new())
}

/// A constant expression as one number.
pub(super) fn number(env: &Env<'_>, what: &str, e: &Expr, diagnostics: &mut Vec<Diagnostic>) -> Option<f64> {
    let values = numbers(env, what, e, diagnostics)?;
    if let [one] = values.as_slice() {
        return Some(*one);
    }
    let d = Diagnostic::new(Code::E108, format!("{what} must be one number, found {}", values.len()));
    diagnostics.push(wfl::at_expr(d, e, env.expansions, ""));
    None
}
