//! W611 for bodies that are not positive definite.

use wfl::{Code, Diagnostic};
use wfl_checks::{NegativeBody, negative_bodies};
use wfl_discrete::finite;
use wfl_problem::Equations;

use crate::Loaded;

/// W611 for each field whose terms on cells are not positive definite at the first step.
pub(super) fn bodies(loaded: &Loaded, first: &Equations) -> Vec<Diagnostic> {
    negative_bodies(&first.system).iter().map(|body| told(loaded, body)).collect()
}

fn told(loaded: &Loaded, body: &NegativeBody) -> Diagnostic {
    let d = Diagnostic::new(Code::W611, format!("the terms of `{}` on cells are not positive definite", body.field));
    let text = format!(
        "its stiffness against gradients lies between {:.3e} and {:.3e} at {}",
        body.smallest,
        body.largest,
        finite::position(body.position)
    );
    let named = |t: &&wfl::Term| t.name.as_ref().is_some_and(|n| body.terms.contains(&n.name));
    let d = match loaded.script.terms.iter().find(named) {
        Some(term) => d.at(term.expr.span, text),
        None => d.note(format!("{text} ({})", body.terms.join(", "))),
    };
    d.note("such a deformation releases energy: the solution is no stable equilibrium")
        .help("check the signs of terms and parameters; an elastic body has E > 0 and -1 < nu < 0.5, a conductor k > 0")
}
