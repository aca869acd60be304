//! W512 for loads that their quadrature rules do not resolve.

use wfl::{Code, Diagnostic};
use wfl_checks::CoarseLoad;
use wfl_discrete::finite;
use wfl_problem::Scene;

/// W512 for each load whose nodal forces a rule with more points moves.
pub(super) fn loads(scene: &Scene) -> Vec<Diagnostic> {
    // where a known field has no finite value, the run itself says so with the place
    let found = scene.coarse_loads().unwrap_or_default();
    found.iter().map(|load| told(scene, load)).collect()
}

fn told(scene: &Scene, load: &CoarseLoad) -> Diagnostic {
    let term = &scene.terms[load.term];
    let own = term.rule.words();
    let step = if scene.steps.values.len() > 1 { format!(" at t = {}", load.time) } else { String::new() };
    let text = format!(
        "degree {} moves its nodal forces by {:.0} %{step}, most at {}",
        load.degree,
        100.0 * load.share,
        finite::position(load.position)
    );
    Diagnostic::new(Code::W512, format!("the rule on `{}` ({own}) does not resolve this load", term.place))
        .at(term.span, text)
        .help(format!(
            "smaller cells there, or quadrature on {} with a higher degree; a pole such as 1/x has no integral, and no \
             rule helps",
            term.place
        ))
}
