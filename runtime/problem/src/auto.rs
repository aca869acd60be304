//! `param gamma = auto`: the parameter of Nitsche's method from the elements at the interface.
//!
//! The scene is made with the value 1, which gives the factor between the param and the parameter of each term; the
//! param then gets what [`wfl_contact::Coercivity::usual`] asks for. That the value does what it should is checked: where
//! a part of the parameter does not come from the param (the hoop stress of a body of revolution changes with the
//! displacement, too), the next value follows from the last one.

use wfl::{Code, Diagnostic, Param, ResolvedScript, ast::ExprKind};
use wfl_contact::coercivity;

use super::{Prepared, Scene, With, prepare_as_written};

/// Relative agreement of the parameter of a term with the requested value.
const AGREEMENT: f64 = 1e-6;
/// Values that are tried: where the parameter is proportional to the param, the second one is right.
const ROUNDS: usize = 8;

/// True if the value of a param is to be found.
pub(super) fn is_auto(param: &Param) -> bool {
    matches!(&param.value.kind, ExprKind::Name(name) if name == "auto")
}

/// Prepares a scene with params whose value is `auto`.
pub(super) fn prepare(script: &ResolvedScript, with: With<'_>) -> Prepared {
    let asked: Vec<usize> = (0..script.params.len()).filter(|k| is_auto(&script.params[*k])).collect();
    let [param] = asked[..] else {
        return refused(&script.params[asked[1]], "only one param can be `auto`");
    };
    let mut given = script.clone();
    let domain = given.params[param].domain.take();
    let mut value = 1.0;
    for round in 0..ROUNDS {
        given.params[param].value.kind = ExprKind::Number(value);
        let mut made = prepare_as_written(&given, with, None);
        let Some(scene) = &mut made.scene else { return made };
        let wanted = gammas(scene).into_iter().map(|(gamma, usual)| usual / gamma).fold(0.0f64, f64::max);
        if !(wanted > 0.0 && wanted.is_finite()) {
            return refused(&script.params[param], "no term has the stress of the bodies in its projections");
        }
        if round > 0 && (wanted - 1.0).abs() < AGREEMENT {
            return made;
        }
        value *= wanted;
        given.params[param].domain.clone_from(&domain);
    }
    refused(&script.params[param], "the parameter of the Nitsche terms does not grow with this param")
}

/// Parameter and usual value of each Nitsche term.
fn gammas(scene: &Scene) -> Vec<(f64, f64)> {
    // a term without a finite value has no parameter; the run reports its place
    let Ok(first) = scene.at_first_step() else { return Vec::new() };
    coercivity(&first.system, &first.contact).iter().map(|c| (c.gamma, c.usual())).collect()
}

fn refused(param: &Param, why: &str) -> Prepared {
    let d = Diagnostic::new(Code::E417, format!("`auto` has no value for `{}`", param.name.name));
    let d = d.at(param.overridden.unwrap_or(param.value.span), why).note("give the value as a number");
    Prepared { scene: None, diagnostics: vec![d] }
}
