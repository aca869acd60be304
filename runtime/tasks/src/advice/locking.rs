//! W513 for nearly incompressible bodies on elements of degree 1.

use wfl::{Code, Diagnostic};
use wfl_checks::{LockedBody, locked_bodies};
use wfl_discrete::finite;
use wfl_problem::{Equations, Scene};

/// W513 for each displacement of degree 1 whose body is nearly incompressible at the first step.
pub(super) fn bodies(scene: &Scene, first: &Equations) -> Vec<Diagnostic> {
    let found = locked_bodies(&first.system);
    found.iter().map(|body| told(scene, body)).collect()
}

fn told(scene: &Scene, body: &LockedBody) -> Diagnostic {
    let message = format!("`{}` is nearly incompressible, on elements of degree 1", body.field);
    let text = format!(
        "as stiff against changes of volume as a body with lambda/mu = {:.3e} at {}",
        body.ratio,
        finite::position(body.position)
    );
    let d = Diagnostic::new(Code::W513, message);
    let d = match scene.terms.iter().find(|t| body.terms.contains(&t.name)) {
        Some(term) => d.at(term.span, text),
        None => d.note(text),
    };
    d.note("such elements lock: displacements are too small, and pressures alternate from cell to cell").help(format!(
        "unknown {} : vector P2 or Q2, or a pressure as an unknown of its own with Div(u) - p/lambda = 0",
        body.field
    ))
}
