//! W511 for rules of a scene that leave deformations of a cell without stiffness.

use wfl::{Code, Diagnostic, ast::QuadratureRule};
use wfl_checks::Hourglass;
use wfl_problem::Scene;

use crate::Loaded;

/// W511 for each kind of cells on which a rule that the scene gives does not see some deformations.
#[must_use]
pub fn rules(loaded: &Loaded, scene: &Scene) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for statement in loaded.script.quadratures.iter().filter(|q| matches!(q.rule, QuadratureRule::Degree(_))) {
        let on = |place: &str| statement.places.iter().any(|p| p.name == place);
        let given: Vec<usize> = (0..scene.terms.len()).filter(|k| on(&scene.terms[*k].place)).collect();
        // where a known field has no finite value, the run itself says so with the place
        let modes = scene.hourglasses(&given).unwrap_or_default();
        found.extend(modes.iter().map(|mode| told(mode).at(statement.span, "")));
    }
    found
}

fn told(mode: &Hourglass) -> Diagnostic {
    let names: Vec<String> = mode.terms.iter().map(|t| format!("`{t}`")).collect();
    let points = if mode.n_points == 1 { "1 point".to_owned() } else { format!("{} points", mode.n_points) };
    let message =
        format!("the rule leaves {} hourglass modes on a {}: deformations without stiffness", mode.modes, mode.kind);
    Diagnostic::new(Code::W511, message)
        .note(format!("{}: these deformations have no strain at the {points} of the rule", names.join(", ")))
        .help(format!("degree {} or more, or no `quadrature` statement for that region", mode.degree))
}
