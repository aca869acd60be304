//! What is said of the parameters of Nitsche's method, at the place where they are given.

use wfl::{Code, Diagnostic};
use wfl_contact::{Coercivity, coercivity};
use wfl_problem::{Equations, Scene};

use crate::{
    Loaded,
    words::{number, short},
};

/// A line for the param whose value was found.
#[must_use]
pub fn found_parameters(loaded: &Loaded, scene: &Scene) -> String {
    let auto = |e: &wfl::ast::Expr| matches!(&e.kind, wfl::ast::ExprKind::Name(word) if word == "auto");
    let names = loaded.script.params.iter().filter(|p| auto(&p.value)).map(|p| &p.name.name);
    let value = |name: &String| scene.params.iter().find(|p| p.0 == *name)?.1.values.first().copied();
    names.filter_map(|name| Some(format!("{name} = {} (auto)\n", number(value(name)?)))).collect()
}

/// W503 for each Nitsche parameter below the smallest safe value, W504 for each that is out of proportion.
#[must_use]
pub fn parameters(loaded: &Loaded, scene: &Scene, first: &Equations) -> Vec<Diagnostic> {
    let found = coercivity(&first.system, &first.contact);
    found.iter().filter_map(|c| told(loaded, scene, c)).collect()
}

fn told(loaded: &Loaded, scene: &Scene, c: &Coercivity) -> Option<Diagnostic> {
    let (d, text, note) = if !c.is_safe() {
        (
            Diagnostic::new(Code::W503, format!("theta = {} needs a larger gamma on this mesh", c.theta)),
            format!("smallest safe value here: {}", short(c.smallest())),
            "below it the problem is not coercive, and Newton's method may fail; theta = 0 needs a quarter of the \
             value for theta = 1, theta = -1 has no bound",
        )
    } else if !c.is_usual() {
        (
            Diagnostic::new(Code::W504, "gamma is out of proportion to the stiffness of the cells at the interface"),
            format!("a usual value here: {:.1e}", c.usual()),
            "digits of pressure or jump are lost to rounding",
        )
    } else {
        return None;
    };
    let has_value = |v: &[f64]| matches!(v, [x] if (x - c.gamma).abs() <= 1e-9 * c.gamma);
    let same: Vec<&String> = scene.params.iter().filter(|(_, v)| has_value(&v.values)).map(|(name, _)| name).collect();
    let param = loaded.script.params.iter().find(|p| matches!(same.as_slice(), [name] if **name == p.name.name));
    let d = match param {
        Some(p) => d.at(p.overridden.unwrap_or(p.value.span), text),
        None => d.note(format!("gamma of `{}` is {}; {text}", c.term, short(c.gamma))),
    };
    Some(d.note(note))
}
