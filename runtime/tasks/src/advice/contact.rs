//! What is said of the formulation of contact: whether it carries the stress of the bodies (`runtime/checks/src/consistency`).

use wfl::{Code, Diagnostic};
use wfl_checks::consistency::{ContactForm, Mistake, Verdict};
use wfl_problem::Scene;

use crate::Loaded;

/// Nearer to a whole number than this, theta is one: the numbers of a tangent are rounded.
const WHOLE: f64 = 1e-9;

/// The region of the terms of a form.
#[must_use]
pub fn place(scene: &Scene, form: &ContactForm) -> String {
    scene.terms.get(form.term).map_or_else(String::new, |t| t.place.clone())
}

/// theta in words.
fn variant(theta: f64) -> String {
    let whole = theta.round();
    let theta = if (theta - whole).abs() < WHOLE { whole + 0.0 } else { theta };
    let name = match theta {
        1.0 => "symmetric variant",
        0.0 => "incomplete variant",
        -1.0 => "skew-symmetric variant",
        _ => "variant",
    };
    format!("{name} (theta = {theta})")
}

/// What a form is, in words: its variant, and whether it is consistent.
#[must_use]
pub fn words(loaded: &Loaded, scene: &Scene, form: &ContactForm) -> String {
    let kind = match (form.theta, form.has_multipliers) {
        (_, true) => "the traction is a multiplier".to_owned(),
        (Some(theta), false) => variant(theta),
        (None, false) => "no stresses".to_owned(),
    };
    match &form.verdict {
        Verdict::Consistent => format!("consistent; {kind}"),
        Verdict::Nearly(left) => format!("consistent up to {left:.0e}; {kind}"),
        Verdict::Penalty(stiffness) => {
            let name = param_of(loaded, scene, *stiffness);
            let name = name.unwrap_or_else(|| format!("{stiffness:.4e}"));
            format!("penalty: an overlap of pressure/{name}, an error of order 1/{name}")
        }
        Verdict::Wrong(mistake) => format!("NOT consistent ({}): {}", code(mistake), title(mistake)),
        Verdict::NotJudged(why) => format!("not judged: {why}"),
    }
}

/// The one param with this value.
fn param_of(loaded: &Loaded, scene: &Scene, value: f64) -> Option<String> {
    let is_it = |v: &[f64]| matches!(v, [x] if (x - value).abs() <= 1e-6 * value.abs());
    let own = |name: &String| loaded.script.params.iter().any(|p| p.name.name == *name);
    let mut same = scene.params.iter().filter(|(name, v)| own(name) && is_it(&v.values)).map(|(name, _)| name);
    let first = same.next()?;
    same.next().is_none().then(|| first.clone())
}

fn code(mistake: &Mistake) -> Code {
    match mistake {
        Mistake::Balance { .. } => Code::W507,
        Mistake::Stress { .. } => Code::W508,
        Mistake::Law { .. } => Code::W509,
        Mistake::Direction(_) => Code::W510,
    }
}

fn title(mistake: &Mistake) -> &'static str {
    match mistake {
        Mistake::Balance { .. } => "the contact terms do not balance the traction of the bodies",
        Mistake::Stress { .. } => "the terms tested with the stress of the test function do not cancel",
        Mistake::Law { .. } => "no multiplier satisfies both its law and equilibrium",
        Mistake::Direction(_) => "contact forces have the wrong sign",
    }
}

/// W507 to W510 for the terms whose formulation is not consistent.
#[must_use]
pub fn warnings(loaded: &Loaded, forms: &[ContactForm]) -> Vec<Diagnostic> {
    let told = |form: &ContactForm| match &form.verdict {
        Verdict::Wrong(mistake) => Some(warning(loaded, form, mistake)),
        _ => None,
    };
    forms.iter().filter_map(told).collect()
}

fn warning(loaded: &Loaded, form: &ContactForm, mistake: &Mistake) -> Diagnostic {
    let d = Diagnostic::new(code(mistake), title(mistake));
    let named = |name: &String| loaded.script.terms.iter().find(|t| t.name.as_ref().is_some_and(|n| n.name == *name));
    let label = match mistake {
        Mistake::Balance { state, carried } => carried_words(state, *carried),
        Mistake::Stress { left } => format!("a residual of {:.0} % remains where contact is closed", 100.0 * left),
        Mistake::Law { left } => {
            format!("a residual of {:.0} % of the law remains where contact is closed", 100.0 * left)
        }
        Mistake::Direction(what) => (*what).to_owned(),
    };
    let d = d.at_or_note(form.terms.iter().filter_map(named).next_back().map(|term| term.span), label);
    let together = match form.terms.as_slice() {
        [_] => String::new(),
        many => format!(" (all terms there together: {})", many.join(", ")),
    };
    let tried = "tested at one point of the faces with bodies of constant stress";
    let d = d.note(format!("{tried}{together}; wfl verify shows the residual of each state"));
    match mistake {
        Mistake::Balance { .. } => d.help(
            "look at the signs of the traction and the jump in the projections, and at the jump of the test functions: in \
             `pos_part(gamma*jump.Normal - traction.Normal)` the jump is that of the side which owns the traction and \
             `Normal` points out of it; a form with a traction of each side needs both",
        ),
        Mistake::Stress { .. } => d.help(
            "a form with theta has `-theta/gamma*trac(u).trac(Test_u)` beside the projections, and these are tested with \
             `gamma*jump(Test_u) - theta*trac(Test_u)`",
        ),
        Mistake::Law { .. } => d.help("the law is `lambda + force = 0` where the force is projected from `-lambda`"),
        Mistake::Direction(_) => d.help("look at the sign of the jump and of the projections"),
    }
}

fn carried_words(state: &str, carried: [Option<f64>; 2]) -> String {
    let part = |x: f64| if x.abs() < 5e-4 { "0".to_owned() } else { format!("{x:.3}") };
    let of = match carried {
        [Some(a), Some(b)] => format!("{} on one side and {} on the other", part(a), part(b)),
        [Some(a), None] => part(a),
        _ => "another part".to_owned(),
    };
    let what = if state == "closed" { "stress" } else { "shear" };
    format!("{state} contact balances {of} of the {what} of the bodies; it should be 1")
}
