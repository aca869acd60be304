//! Knobs: what is changed in a scene before it is prepared.
//!
//! A knob that is a parameter of the scene replaces its value, as on the command line of `wfl run`. Others change
//! statements: `h` and `refine` the mesh, `degree` the unknowns on cells (multipliers stay as they are), `quadrature`
//! the rule of the terms with kinks, `tol`, `max_iter` and `search` the solver, `threads` the number of threads, `no_prune` what is
//! left out.

use thiserror::Error;
use wfl::{
    ResolvedScript, Span,
    ast::{
        BoxDivision, BoxShape, Expr, ExprKind, Ident, MeshSource, MulOp, OptionItem, OptionValue, Place, QuadratureRule,
    },
};
use wfl_runtime::Pruning;

use super::lists::number;

/// One setting: knobs with their values, as written.
pub(super) type Setting = [(String, String)];

/// Knobs that are no parameters of a scene.
pub(super) const KNOWN: [&str; 9] =
    ["h", "refine", "degree", "quadrature", "tol", "max_iter", "search", "threads", "no_prune"];

/// A knob that a scene cannot have.
#[derive(Debug, Error, PartialEq, Eq)]
pub(super) enum KnobError {
    #[error("`{value}` is no value of knob `{name}`: {needs}")]
    Value { name: String, value: String, needs: &'static str },
    #[error("knob `{0}` changes a `mesh box`, and the mesh of this scene comes from a file")]
    MeshFile(String),
    #[error("no parameter and no knob `{name}`\n  = help: parameters of the scene: {params}; knobs: {known}")]
    Unknown { name: String, params: String, known: String },
}

/// The knobs that are parameters of the scene, as `NAME=VALUE` of a command line.
pub(super) fn overrides(setting: &Setting, params: &[String]) -> Vec<String> {
    setting.iter().filter(|(n, _)| params.contains(n)).map(|(n, v)| format!("{n}={v}")).collect()
}

/// Changes the statements of a scene for the knobs that are no parameters. `kinked` names the regions of terms with
/// kinks, or of all terms where there are none.
pub(super) fn apply(
    script: &mut ResolvedScript,
    setting: &Setting,
    params: &[String],
    kinked: &[String],
) -> Result<(), KnobError> {
    for (name, value) in setting.iter().filter(|(n, _)| !params.contains(n)) {
        let wrong = |needs| KnobError::Value { name: name.clone(), value: value.clone(), needs };
        match name.as_str() {
            "h" => mesh(script, name, Some(positive(value).ok_or_else(|| wrong("a length above 0"))?), 1.0)?,
            "refine" => mesh(script, name, None, positive(value).ok_or_else(|| wrong("a factor above 0"))?)?,
            "degree" => degree(script, value).ok_or_else(|| wrong("1, 2, 3, …"))?,
            "quadrature" => quadrature(script, value, kinked).ok_or_else(|| wrong("vertex or a degree"))?,
            "tol" | "max_iter" | "search" => solver(script, name, value),
            "threads" => drop(threads(setting)?),
            "no_prune" => drop(kept(setting)?),
            _ => {
                let params = params.join(", ");
                return Err(KnobError::Unknown { name: name.clone(), params, known: KNOWN.join(", ") });
            }
        }
    }
    Ok(())
}

/// The threads a setting asks for.
pub(super) fn threads(setting: &Setting) -> Result<Option<usize>, KnobError> {
    let Some((name, value)) = setting.iter().find(|(n, _)| n == "threads") else { return Ok(None) };
    match value.parse() {
        Ok(n) if n > 0 => Ok(Some(n)),
        _ => Err(KnobError::Value { name: name.clone(), value: value.clone(), needs: "1, 2, 3, …" }),
    }
}

/// What a setting puts back that is left out otherwise.
pub(super) fn kept(setting: &Setting) -> Result<Option<Pruning>, KnobError> {
    let Some((name, value)) = setting.iter().find(|(n, _)| n == "no_prune") else { return Ok(None) };
    let needs = "nothing, linear, condense or symmetric";
    match (value.as_str(), Pruning::named(value)) {
        ("nothing", _) => Ok(None),
        (_, Some(pruning)) => Ok(Some(pruning)),
        _ => Err(KnobError::Value { name: name.clone(), value: value.clone(), needs }),
    }
}

fn positive(text: &str) -> Option<f64> {
    number(text).filter(|x| *x > 0.0)
}

fn plain(value: f64, span: Span) -> Expr {
    Expr { kind: ExprKind::Number(value), span, expansion: None }
}

fn mesh(script: &mut ResolvedScript, name: &str, size: Option<f64>, refine: f64) -> Result<(), KnobError> {
    let Some(stmt) = &mut script.mesh else { return Ok(()) };
    let span = stmt.span;
    let MeshSource::Box { division, .. } = &mut stmt.source else { return Err(KnobError::MeshFile(name.to_owned())) };
    if let Some(size) = size {
        *division = BoxDivision::Size(plain(size, span));
        return Ok(());
    }
    let times = |e: &Expr, op, factor: f64| Expr {
        kind: ExprKind::Product(Box::new(e.clone()), vec![(op, span, plain(factor, span))]),
        span: e.span,
        expansion: e.expansion,
    };
    *division = match division {
        BoxDivision::Cells(e) => BoxDivision::Cells(times(e, MulOp::Times, refine)),
        BoxDivision::Size(e) => BoxDivision::Size(times(e, MulOp::Divide, refine)),
    };
    Ok(())
}

fn degree(script: &mut ResolvedScript, value: &str) -> Option<()> {
    let degree: usize = value.parse().ok().filter(|d| *d > 0)?;
    let simplices = matches!(
        script.mesh.as_ref().map(|m| &m.source),
        Some(MeshSource::Box { shape: Some((BoxShape::Tri | BoxShape::Tet, _)), .. })
    );
    for field in &mut script.fields {
        if !matches!(field.kind, wfl::FieldKind::Unknown) || matches!(field.space.place, Place::Global(_)) {
            continue;
        }
        let written = field.space.element.as_ref().map(|e| e.name.trim_end_matches(|c: char| c.is_ascii_digit()));
        let family = written.unwrap_or(if simplices { "P" } else { "Q" });
        field.space.element = Some(Ident { name: format!("{family}{degree}"), span: field.space.span });
    }
    Some(())
}

fn quadrature(script: &mut ResolvedScript, value: &str, places: &[String]) -> Option<()> {
    let span = script.mesh.as_ref()?.span;
    let rule = match value {
        "vertex" => QuadratureRule::Vertex,
        _ => QuadratureRule::Degree(plain(value.parse::<u32>().ok().map(f64::from)?, span)),
    };
    for stated in &mut script.quadratures {
        stated.places.retain(|p| !places.contains(&p.name));
    }
    script.quadratures.retain(|q| !q.places.is_empty());
    let places = places.iter().map(|p| Ident { name: p.clone(), span }).collect();
    script.quadratures.push(wfl::Quadrature { places, rule, span });
    Some(())
}

fn solver(script: &mut ResolvedScript, name: &str, value: &str) {
    let Some(span) = script.mesh.as_ref().map(|m| m.span) else { return };
    let ident = |n: &str| Ident { name: n.to_owned(), span };
    let solver = script.solver.get_or_insert_with(|| wfl::Solver { name: ident("newton"), options: Vec::new(), span });
    let kind = number(value).map_or_else(|| ExprKind::Name(value.to_owned()), ExprKind::Number);
    let value = OptionValue::Expr(Expr { kind, span, expansion: None });
    solver.options.retain(|o| o.name.name != name);
    solver.options.push(OptionItem { name: ident(name), value: Some(value) });
}
