//! W519 for known fields whose formula jumps between the nodes of their elements.

use wfl::{
    Code, DataValue, Diagnostic, FieldKind,
    ast::{Expr, ExprKind},
    children, cond_children, each_name,
};
use wfl_problem::Scene;

use crate::Loaded;

/// The part of the values of a field, in the mean, that interpolation may change without a word: what one sees of most results, and what
/// a kink leaves on a mesh that resolves it.
const SEEN: f64 = 0.01;

/// W519 for each known field that is not what its formula says, where that has cases by position.
#[must_use]
pub(super) fn jumps(loaded: &Loaded, scene: &Scene) -> Vec<Diagnostic> {
    let has_cases = |field: &&wfl::Field| match &field.kind {
        FieldKind::Data { value: DataValue::Formula(formula) } => has_cases(formula),
        _ => false,
    };
    let mut cased = loaded.script.fields.iter().filter(has_cases).peekable();
    if cased.peek().is_none() {
        return Vec::new();
    }
    let lost = scene.data_between_nodes();
    let told = |field: &wfl::Field| {
        let name = &field.name.name;
        let (_, lost) = lost.iter().find(|(known, lost)| known == name && *lost > SEEN)?;
        let text = format!(
            "`{name}` is {lost:.1e} away from its formula in the mean: it jumps between nodes, and the field is continuous"
        );
        let d = Diagnostic::new(Code::W519, text)
            .at(field.name.span, "its values are taken at nodes and are smooth between them");
        Some(d.help(format!("one value for each cell, `data {name} : scalar DP0 = ...` where cells end at the jump; or `def {name} = ...`, which is \
             evaluated at the points of integration")))
    };
    cased.filter_map(told).collect()
}

/// Whether a formula has an `if` that depends on the position.
fn has_cases(e: &Expr) -> bool {
    if let ExprKind::If(condition, ..) = &e.kind {
        let mut is_placed = false;
        cond_children(condition, &mut |side| {
            each_name(side, &mut |word| is_placed |= matches!(word, "x" | "y" | "z" | "X"))
        });
        if is_placed {
            return true;
        }
    }
    let mut found = false;
    children(e, &mut |child| found |= has_cases(child));
    found
}
