//! W517 for contact laws whose distance has the wrong sign.

use wfl::{Code, Diagnostic};
use wfl_checks::{ReversedGap, reversed_gaps};
use wfl_discrete::finite;
use wfl_problem::{Equations, Scene};

/// W517 for each contact law through a mapping whose distance is the opposite of that of the mesh.
pub(super) fn signs(scene: &Scene, first: &Equations) -> Vec<Diagnostic> {
    let found = reversed_gaps(&first.system, &first.contact);
    found.iter().map(|gap| told(scene, gap)).collect()
}

fn told(scene: &Scene, gap: &ReversedGap) -> Diagnostic {
    let term = &scene.terms[gap.term];
    let d = Diagnostic::new(Code::W517, format!("the distance in `{}` has the wrong sign", term.name));
    let words = |x: f64| if x < 0.0 { format!("an overlap of {:.3e}", -x) } else { format!("a distance of {x:.3e}") };
    let text = format!(
        "without displacement it takes {} for {} at {}",
        words(gap.distance),
        words(gap.written),
        finite::position(gap.position)
    );
    d.at(term.span, text)
        .note("bodies that are apart are pressed together by it, or bodies that overlap are let go")
        .help("from a point X to its image Y under the mapping m the distance is (Interpolate(X, m) - X).Normal")
}
