//! Units checked through the form: every sum, comparison, value and integral of a scene, once some name has a unit.
//!
//! Works on expanded expressions of a resolved scene. Numbers are never converted: a unit that differs by a factor is
//! as wrong as another quantity. Coordinates and time have one unit each for the whole scene, which is found from
//! what they are added to or compared with; until something says it, it fits. Shapes are the compiler's business.

mod eval;
mod explain;
mod functions;
mod infer;
mod places;
mod scene;
mod statements;
mod table;
mod tables;
mod unit;
mod value;

use crate::{diag::Diagnostic, script::ResolvedScript, source::SourceMap};
use scene::Scene;

/// E501, E502, W422 and W505 of a scene; nothing if no param or field of it has a unit.
#[must_use]
pub fn check_units(script: &ResolvedScript, sources: &SourceMap) -> Vec<Diagnostic> {
    if !Scene::has_units(script) {
        return Vec::new();
    }
    let mut found = Vec::new();
    let scene = Scene::new(script, sources, &mut found);
    let pass = infer::checked(&scene);
    let solved = pass.solved;
    if pass.diagnostics.is_empty() {
        found.extend(infer::unnamed(&scene, &solved));
    }
    found.extend(explain::explained(&scene, &solved, pass.diagnostics));
    found
}

/// True for the name of a unit, such as `MPa`.
pub(crate) fn is_unit(name: &str) -> bool {
    table::NamedUnit::find(name).is_some()
}

/// True for a unit of length as it is written: `mm`.
#[must_use]
pub fn is_length(unit: &crate::ast::Unit) -> bool {
    let named = |name: &str| table::NamedUnit::find(name).is_some_and(table::NamedUnit::is_length);
    matches!(unit.factors.as_slice(), [(name, 1)] if named(name))
}

/// The unit of a quantity of a scene, for a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitOf {
    /// The step variable, field, measure or output; `X` for coordinates.
    pub name: String,
    /// `MPa/mm`, `pure number`, or `not known`.
    pub unit: String,
}

/// The units of coordinates, step variable, fields, measures and outputs, in the order of the text; nothing if the
/// scene has no units.
#[must_use]
pub fn unit_report(script: &ResolvedScript, sources: &SourceMap) -> Vec<UnitOf> {
    if !Scene::has_units(script) {
        return Vec::new();
    }
    let scene = Scene::new(script, sources, &mut Vec::new());
    let pass = infer::checked(&scene);
    let shown = |unit: Option<&unit::Unit>| match unit {
        Some(unit) if !unit.is_open() => unit.show(),
        _ => "not known".to_owned(),
    };
    let mut report = vec![UnitOf { name: "X".to_owned(), unit: shown(pass.solved.length.as_ref()) }];
    if let Some(steps) = &script.steps {
        report.push(UnitOf { name: steps.variable.name.clone(), unit: shown(pass.solved.time.as_ref()) });
    }
    let fields = script.fields.iter().map(|f| &f.name.name);
    let quantities = script.outputs.iter().flat_map(|o| &o.items).map(|q| &q.name);
    let computed = script.computed.iter().map(|m| &m.name.name);
    for name in fields.chain(script.measures.iter().map(|m| &m.name.name)).chain(computed).chain(quantities) {
        if report.iter().any(|known| known.name == *name) {
            continue;
        }
        let unit = pass.units.get(name.as_str()).and_then(value::Value::unit);
        report.push(UnitOf { name: name.clone(), unit: shown(unit) });
    }
    report
}

#[cfg(test)]
mod tests;
