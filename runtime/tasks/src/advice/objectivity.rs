//! W514 for bodies whose law does not know a rotation, W515 for shears that are counted twice or half.

use wfl::{Code, Diagnostic};
use wfl_checks::{CubicBody, Turning, TurningBody, cubic_bodies, turning_bodies};
use wfl_discrete::finite;
use wfl_problem::{Equations, Scene};

use crate::Loaded;

/// What rounding may leave of a ratio of moduli.
const ROUNDING: f64 = 1e-6;

/// W514 for each displacement whose law is not objective.
pub(super) fn bodies(loaded: &Loaded, scene: &Scene, first: &Equations) -> Vec<Diagnostic> {
    let found = turning_bodies(&first.system);
    let presses = |field: &str| {
        let number = scene.system.fields.iter().position(|f| f.name == field);
        number.is_some_and(|number| scene.contact.presses(number))
    };
    let meant = |body: &&TurningBody| !body.may_be_no_body || is_length(loaded, &body.field) || presses(&body.field);
    found.iter().filter(meant).map(|body| told(scene, body)).collect()
}

/// True for a field whose unit is a length.
fn is_length(loaded: &Loaded, field: &str) -> bool {
    let declared = loaded.script.fields.iter().find(|f| f.name.name == field);
    declared.and_then(|f| f.space.unit.as_ref()).is_some_and(wfl::is_length)
}

fn told(scene: &Scene, body: &TurningBody) -> Diagnostic {
    let (field, at) = (&body.field, finite::position(body.position));
    let percent = format!("{:.3} %", 100.0 * body.share);
    let (message, text) = match body.what {
        Turning::Resists => (
            format!("the body of `{field}` resists being turned"),
            format!("a small rotation gives a stress at {at}: {percent} of that of a shear of the same size"),
        ),
        Turning::Moments => (
            format!("the stress of `{field}` is not symmetric"),
            format!("its antisymmetric part is {percent} of it at {at}: the moments of the forces do not balance"),
        ),
        Turning::Finite => (
            format!("the law of `{field}` is neither one of small strains nor one of finite strains"),
            format!("after a rotation of the body the stress is another one, by {percent} of it at {at}"),
        ),
    };
    let help = match body.what {
        Turning::Finite => format!(
            "with F = Id + Grad_{field} and S a symmetric function of F'*F: (F*S):Grad_Test_{field}; transposes are the \
             usual slip: F'*F, not F*F' or F*F; Inv(F)', not Inv(F); a law of small strains reads Sym(Grad_{field}) alone"
        ),
        _ => format!(
            "an elastic stress is a symmetric function of the strain Sym(Grad_{field}): 2*mu*Sym(Grad_{field}), not \
             2*mu*Grad_{field}"
        ),
    };
    let d = Diagnostic::new(Code::W514, message);
    let d = d.at_or_note(scene.terms.iter().find(|t| body.terms.contains(&t.name)).map(|term| term.span), text);
    d.note("a rotation strains no body: it gives no stress, and turns the stress that is there").help(help)
}

/// W515 for each displacement whose shear is isotropic but for a factor.
pub(super) fn shears(scene: &Scene, first: &Equations) -> Vec<Diagnostic> {
    let found = cubic_bodies(&first.system);
    found.iter().filter_map(|body| uneven(scene, body)).collect()
}

fn uneven(scene: &Scene, body: &CubicBody) -> Option<Diagnostic> {
    let isotropic = 0.5 * (body.c11 - body.c12);
    let factor = [0.25, 0.5, 2.0, 4.0].into_iter().find(|f| (body.c44 / isotropic - f).abs() <= ROUNDING * f)?;
    let d =
        Diagnostic::new(Code::W515, format!("`{}` is isotropic but for a factor {factor} on its shear", body.field));
    let text = format!(
        "C11 = {:.4e}, C12 = {:.4e}, shear modulus {:.4e} for (C11 - C12)/2 = {isotropic:.4e} at {}",
        body.c11,
        body.c12,
        body.c44,
        finite::position(body.position)
    );
    let d = d.at_or_note(scene.terms.iter().find(|t| body.terms.contains(&t.name)).map(|term| term.span), text);
    let (first, second) = ("(g(1,2) + g(2,1))/2", "g(1,2) + g(2,1)");
    Some(
        d.note("an engineering shear strain is twice the component of the strain tensor")
            .help(format!("the shear stress is 2*mu*{first}, or mu*({second}); its work is that on {second}")),
    )
}
