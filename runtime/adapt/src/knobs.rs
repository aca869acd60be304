//! Knobs: what is changed in a scene before it is prepared. One mechanism for sweeps and for a demanded accuracy.
//!
//! A knob that is a parameter of the scene replaces its value, as on the command line of `wfl run`. Others change
//! statements: `h`, `refine` and `cells` the mesh, `degree` the unknowns on cells (multipliers stay as they are), `marks` the refinement of the mesh,
//! `quadrature` the rule of the terms with kinks, `tol`, `max_iter`, `search` and `perturb` the iterations, `solver` how systems
//! are solved, `threads` the number of threads, `precision` that of a factor, `no_prune` what is left out. Promises
//! that a text that means nothing is refused before anything is run, that the order of knobs does not matter, and that none
//! of them takes away what another one says; does not judge whether the scene that comes out makes sense.

use thiserror::Error;
use wfl::{
    ResolvedScript, Span,
    ast::{
        Argument, BoxDivision, Expr, ExprKind, Ident, MeshSource, MulOp, OptionItem, OptionValue, Place, QuadratureRule,
    },
};
use wfl_discrete::pruning::Pruning;
use wfl_newton::{LARGEST_PERTURBATION, LARGEST_TOLERANCE};
use wfl_problem::{DEFAULT_STEP_ERROR, ON_ANY_CELLS};
use wfl_sparse::solve::Precision;

/// One setting: knobs with their values, as written.
pub type Setting = [(String, String)];

/// Knobs that are no parameters of a scene.
pub const KNOWN: [&str; 15] = [
    "h",
    "refine",
    "cells",
    "degree",
    MARKS,
    SUBSTEPS,
    "quadrature",
    "tol",
    "max_iter",
    "search",
    "perturb",
    "solver",
    "threads",
    "precision",
    "no_prune",
];

/// Raises the degree of every field on cells or faces that is solved for, and of every rule that is given: what errors are
/// estimated with. Not for the command line; behind `degree`.
pub const RICHER: &str = "richer";

/// Knobs that change the statements of a scene and nothing else: what a run can be given beside parameters.
pub const OF_STATEMENTS: [&str; 8] = ["h", "refine", "cells", "degree", "tol", "perturb", MARKS, SUBSTEPS];

/// The number of parts of each step; of steps that the run chooses the error is divided by its square.
pub const SUBSTEPS: &str = "substeps";

/// The report of a run with a demanded accuracy, whose refinement of the mesh is taken. Who reads the scene reads it, too.
pub const MARKS: &str = "marks";

/// Knobs that say of how many cells the mesh is.
pub const DIVIDING: [&str; 2] = ["h", "cells"];

/// Knobs that change what others say, and are applied behind them.
const BEHIND: [&str; 2] = ["refine", RICHER];

/// A knob that a scene cannot have.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum KnobError {
    /// A text that is no value of the knob.
    #[error("`{value}` is no value of knob `{name}`: {needs}")]
    Value {
        /// The knob.
        name: String,
        /// The text.
        value: String,
        /// What it takes.
        needs: &'static str,
    },
    /// The mesh comes from a file: it cannot be refined.
    #[error("knob `{0}` changes a `mesh box`, and the mesh of this scene comes from a file")]
    MeshFile(String),
    /// A knob with two values.
    #[error("knob `{0}` is given twice\n  = help: one value for each; wfl sweep takes a list: {0}=1,2")]
    Twice(String),
    /// Two knobs that say the same.
    #[error("knobs `{0}` and `{1}` both say how the mesh is divided\n  = help: leave one of them out")]
    Both(String, String),
    /// A knob that takes the place of what a parameter is read by.
    #[error(
        "knob `{knob}` takes the place of the division of the mesh, which reads `{param}`: its value would be without \
         effect there\n  = help: leave one of them out; refine=2 divides what `{param}` gives"
    )]
    Replaced {
        /// The knob.
        knob: String,
        /// The parameter.
        param: String,
    },
    /// Neither a parameter nor a knob.
    #[error("no parameter and no knob `{name}`\n  = help: parameters of the scene: {params}; knobs: {known}")]
    Unknown {
        /// What was written.
        name: String,
        /// The parameters there are.
        params: String,
        /// The knobs there are.
        known: String,
    },
}

/// The knobs that are parameters of the scene, as `NAME=VALUE` of a command line.
#[must_use]
pub fn overrides(setting: &Setting, params: &[String]) -> Vec<String> {
    setting.iter().filter(|(n, _)| params.contains(n)).map(|(n, v)| format!("{n}={v}")).collect()
}

/// Whether knobs and parameters that are given together all count: each has one value, and none takes the place of what
/// another one says.
///
/// # Errors
/// [`KnobError`] for two that do not go together.
pub fn together(script: &ResolvedScript, setting: &Setting, params: &[String]) -> Result<(), KnobError> {
    let (given, own): (Vec<&str>, Vec<&str>) =
        setting.iter().map(|(name, _)| name.as_str()).partition(|name| params.iter().any(|p| p == name));
    if let Some(twice) = own.iter().enumerate().find(|(k, name)| own[..*k].contains(name)) {
        return Err(KnobError::Twice((*twice.1).to_owned()));
    }
    let mut dividing = own.iter().filter(|name| DIVIDING.contains(name));
    let Some(knob) = dividing.next() else { return Ok(()) };
    if let Some(other) = dividing.next() {
        return Err(KnobError::Both((*knob).to_owned(), (*other).to_owned()));
    }
    let mut read = mesh_words(script);
    let mut k = 0;
    while let Some(param) = read.get(k).map(|word| script.params.iter().find(|p| p.name.name == *word)) {
        let mut more = Vec::new();
        param.into_iter().for_each(|param| wfl::each_name(&param.value, &mut |word| more.push(word.to_owned())));
        more.retain(|word| !read.contains(word));
        read.extend(more);
        k += 1;
    }
    match given.into_iter().find(|name| read.iter().any(|word| word == name)) {
        Some(param) => Err(KnobError::Replaced { knob: (*knob).to_owned(), param: param.to_owned() }),
        None => Ok(()),
    }
}

/// Changes the statements of a scene for the knobs that are no parameters. `kinked` names the regions of terms with
/// kinks, or of all terms where there are none. In which order knobs are given does not matter.
///
/// # Errors
/// [`KnobError`] for a knob or a value that this scene cannot have, and as [`together`].
pub fn apply(
    script: &mut ResolvedScript,
    setting: &Setting,
    params: &[String],
    kinked: &[String],
) -> Result<(), KnobError> {
    together(script, setting, params)?;
    let mut own: Vec<&(String, String)> = setting.iter().filter(|(n, _)| !params.contains(n)).collect();
    own.sort_by_key(|(name, _)| BEHIND.contains(&name.as_str()));
    for (name, value) in own {
        let wrong = |needs| KnobError::Value { name: name.clone(), value: value.clone(), needs };
        match name.as_str() {
            "h" => mesh(script, name, Some(positive(value).ok_or_else(|| wrong("a length above 0"))?), 1.0)?,
            "cells" => {
                let counts =
                    cells(value).ok_or_else(|| wrong("whole numbers above 0, one for all directions or [4,8]"))?;
                divide(script, name, &counts)?;
            }
            "refine" => mesh(script, name, None, positive(value).ok_or_else(|| wrong("a factor above 0"))?)?,
            RICHER if value == "1" => richer(script).ok_or_else(|| wrong("1"))?,
            RICHER => return Err(wrong("1")),
            "degree" => degree(script, value).ok_or_else(|| wrong("1, 2, 3, …"))?,
            "quadrature" => quadrature(script, value, kinked).ok_or_else(|| wrong("vertex or a degree"))?,
            MARKS => {}
            SUBSTEPS => substeps(script, whole(value).ok_or_else(|| wrong("1, 2, 3, …"))?),
            "tol" if number(value).is_none_or(|t| !(0.0..=LARGEST_TOLERANCE).contains(&t)) => {
                return Err(wrong("a number from 0 to 0.1"));
            }
            "max_iter" if value.parse::<usize>().is_ok_and(|n| n > 0) => solver(script, name, value),
            "max_iter" => return Err(wrong("1, 2, 3, …")),
            "search" if !["auto", "none"].contains(&value.as_str()) => return Err(wrong("auto or none")),
            "perturb" if number(value).is_none_or(|size| !(size > 0.0 && size <= LARGEST_PERTURBATION)) => {
                return Err(wrong("a number above 0, at most 0.1"));
            }
            "tol" | "search" | "perturb" => solver(script, name, value),
            "threads" => drop(threads(setting)?),
            "precision" => drop(precision(setting)?),
            "no_prune" | "solver" => drop(kept(setting)?),
            _ => {
                let params = params.join(", ");
                return Err(KnobError::Unknown { name: name.clone(), params, known: KNOWN.join(", ") });
            }
        }
    }
    Ok(())
}

/// The threads a setting asks for.
///
/// # Errors
/// [`KnobError::Value`] for anything but a whole number above 0.
pub fn threads(setting: &Setting) -> Result<Option<usize>, KnobError> {
    let Some((name, value)) = setting.iter().find(|(n, _)| n == "threads") else { return Ok(None) };
    match value.parse() {
        Ok(n) if n > 0 => Ok(Some(n)),
        _ => Err(KnobError::Value { name: name.clone(), value: value.clone(), needs: "1, 2, 3, …" }),
    }
}

/// The precision a setting asks for.
///
/// # Errors
/// [`KnobError::Value`] for a name that none has.
pub fn precision(setting: &Setting) -> Result<Option<Precision>, KnobError> {
    let Some((name, value)) = setting.iter().find(|(n, _)| n == "precision") else { return Ok(None) };
    let wrong = || KnobError::Value { name: name.clone(), value: value.clone(), needs: "auto, f64 or f32+f64" };
    Precision::named(value).map(Some).ok_or_else(wrong)
}

/// The tolerance a setting asks for.
#[must_use]
pub fn tolerance(setting: &Setting) -> Option<f64> {
    number(&setting.iter().find(|(n, _)| n == "tol")?.1)
}

/// The optimisations that a setting turns off: `no_prune` by name, `solver` by the requested solver.
///
/// # Errors
/// [`KnobError::Value`] for a name that nothing has.
pub fn kept(setting: &Setting) -> Result<Vec<Pruning>, KnobError> {
    let mut list = Vec::new();
    for (name, value) in setting {
        let wrong = |needs| KnobError::Value { name: name.clone(), value: value.clone(), needs };
        match (name.as_str(), value.as_str()) {
            ("no_prune", "nothing") | ("solver", "auto" | "forces") => {}
            ("no_prune", pruning) => {
                list.push(Pruning::named(pruning).ok_or_else(|| {
                    wrong("nothing, constant, linear, condense, forces, symmetric, quadrature or past")
                })?)
            }
            ("solver", "condensed") => list.push(Pruning::Forces),
            ("solver", "full") => list.push(Pruning::Condense),
            ("solver", _) => {
                return Err(wrong(
                    "auto, forces (one contact force for each pair of facing dofs; what auto uses there), condensed \
                     (Schur complement on the contact dofs) or full (the whole tangent in each iteration)",
                ));
            }
            _ => {}
        }
    }
    Ok(list)
}

/// A number or a quotient of two, as knobs are written: `0.25`, `1/4`.
#[must_use]
pub fn number(text: &str) -> Option<f64> {
    let one = |t: &str| t.trim().parse::<f64>().ok();
    let value = match text.split_once('/') {
        Some((a, b)) => one(a)? / one(b)?,
        None => one(text)?,
    };
    value.is_finite().then_some(value)
}

/// Numbers of cells: `8` or `[8,16]`.
fn cells(text: &str) -> Option<Vec<f64>> {
    let bare = text.trim().trim_start_matches('[').trim_end_matches(']');
    let counts: Option<Vec<f64>> =
        bare.split(',').map(|t| t.trim().parse::<u32>().ok().filter(|n| *n > 0).map(f64::from)).collect();
    counts.filter(|n| n.len() <= 3)
}

fn divide(script: &mut ResolvedScript, name: &str, counts: &[f64]) -> Result<(), KnobError> {
    let Some(stmt) = &mut script.mesh else { return Ok(()) };
    let span = stmt.span;
    let MeshSource::Box { division, .. } = &mut stmt.source else { return Err(KnobError::MeshFile(name.to_owned())) };
    *division = BoxDivision::Cells(match counts {
        [one] => plain(*one, span),
        all => {
            Expr { kind: ExprKind::Tensor(vec![all.iter().map(|n| plain(*n, span)).collect()]), span, expansion: None }
        }
    });
    Ok(())
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

fn richer(script: &mut ResolvedScript) -> Option<()> {
    let mut most = 0;
    for field in &mut script.fields {
        let solved = matches!(field.kind, wfl::FieldKind::Unknown | wfl::FieldKind::Multiplier { .. });
        if !solved || matches!(field.space.place, Place::Global(_)) {
            continue;
        }
        let written = field.space.element.as_ref().map_or("degree 1", |e| e.name.as_str());
        let family = written.trim_end_matches(|c: char| c.is_ascii_digit());
        let degree: usize = written.strip_prefix(family)?.parse().ok()?;
        field.space.element = Some(Ident { name: format!("{family}{}", degree + 1), span: field.space.span });
        most = most.max(degree + 1);
    }
    for given in &mut script.quadratures {
        if given.rule == QuadratureRule::Vertex && most > NODAL_DEGREES {
            given.rule = QuadratureRule::Degree(plain(2.0 * most as f64 + 1.0, given.span));
            continue;
        }
        if let QuadratureRule::Degree(e) = &mut given.rule {
            let kind = ExprKind::Sum(vec![(false, e.clone()), (false, plain(MORE_DEGREES, e.span))]);
            *e = Expr { kind, span: e.span, expansion: e.expansion };
        }
    }
    Some(())
}

/// Degree of the elements up to which there are nodal rules with positive weights of every kind of cell.
const NODAL_DEGREES: usize = 2;

/// By how much the degree of a given rule is raised: its points are others, and two more in each direction. With one more
/// the errors of the rule at contact are too much alike: an estimate for the manufactured contact was 0.44 of the error.
const MORE_DEGREES: f64 = 4.0;

fn degree(script: &mut ResolvedScript, value: &str) -> Option<()> {
    let degree: usize = value.parse().ok().filter(|d| *d > 0)?;
    for field in &mut script.fields {
        if !matches!(field.kind, wfl::FieldKind::Unknown) || matches!(field.space.place, Place::Global(_)) {
            continue;
        }
        let written = field.space.element.as_ref().map(|e| e.name.trim_end_matches(|c: char| c.is_ascii_digit()));
        let family = written.unwrap_or(ON_ANY_CELLS);
        field.space.element = Some(Ident { name: format!("{family}{degree}"), span: field.space.span });
    }
    Some(())
}

/// A whole number from 1.
fn whole(text: &str) -> Option<f64> {
    text.parse::<u32>().ok().filter(|n| *n > 0).map(f64::from)
}

fn substeps(script: &mut ResolvedScript, parts: f64) {
    let Some(steps) = &mut script.steps else { return };
    let span = steps.span;
    let over = |e: &Expr, by: f64| Expr {
        kind: ExprKind::Product(Box::new(e.clone()), vec![(MulOp::Divide, span, plain(by, span))]),
        span: e.span,
        expansion: e.expansion,
    };
    if !steps.is_auto() {
        steps.by = over(&steps.by, parts);
        return;
    }
    let error = |o: &&mut OptionItem| o.name.name == "error";
    match steps.options.iter_mut().find(error).map(|o| &mut o.value) {
        Some(Some(OptionValue::Expr(e))) => *e = over(e, parts * parts),
        _ => {
            let value = plain(DEFAULT_STEP_ERROR / (parts * parts), span);
            let name = Ident { name: "error".to_owned(), span };
            steps.options.push(OptionItem { name, value: Some(OptionValue::Expr(value)), places: Vec::new() });
        }
    }
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
    script.quadratures.push(wfl::Quadrature { places, segments: None, rule, span });
    Some(())
}

fn solver(script: &mut ResolvedScript, name: &str, value: &str) {
    let Some(span) = script.mesh.as_ref().map(|m| m.span) else { return };
    let ident = |n: &str| Ident { name: n.to_owned(), span };
    let solver = script.solver.get_or_insert_with(|| wfl::Solver { name: ident("newton"), options: Vec::new(), span });
    let kind = number(value).map_or_else(|| ExprKind::Name(value.to_owned()), ExprKind::Number);
    let value = OptionValue::Expr(Expr { kind, span, expansion: None });
    solver.options.retain(|o| o.name.name != name);
    solver.options.push(OptionItem { name: ident(name), value: Some(value), places: Vec::new() });
}

/// Words that a size of the mesh is computed from.
#[must_use]
pub fn mesh_words(script: &ResolvedScript) -> Vec<String> {
    fn walk(e: &Expr, out: &mut Vec<String>) {
        match &e.kind {
            ExprKind::Name(n) => out.push(n.clone()),
            ExprKind::Tensor(rows) => rows.iter().flatten().for_each(|e| walk(e, out)),
            ExprKind::Sum(parts) => parts.iter().for_each(|p| walk(&p.1, out)),
            ExprKind::Product(a, rest) => {
                walk(a, out);
                rest.iter().for_each(|p| walk(&p.2, out));
            }
            ExprKind::Call(f, args) => {
                walk(f, out);
                for a in args {
                    if let Argument::Expr(e) = a {
                        walk(e, out);
                    }
                }
            }
            _ => {}
        }
    }
    let mut out = Vec::new();
    if let Some(MeshSource::Box { division, .. }) = script.mesh.as_ref().map(|m| &m.source) {
        let (BoxDivision::Cells(e) | BoxDivision::Size(e)) = division;
        walk(e, &mut out);
    }
    out
}
