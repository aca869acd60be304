//! E613 and E614: loads that nothing balances, and interfaces that drive their sides.

use wfl::{Code, Diagnostic};
use wfl_checks::{DrivenSides, UnbalancedLoad};
use wfl_problem::Scene;

use crate::{Loaded, words::number};

/// E613 and E614 for forces of the wrong sign at the start of a scene. Sides are not judged where the forms of contact,
/// which know more of a law, were `told` of already.
#[must_use]
pub fn forces(loaded: &Loaded, scene: &Scene, told: &[Diagnostic]) -> Vec<Diagnostic> {
    // where a known field has no finite value, the run itself says so with the place
    let Ok((loads, sides)) = scene.signs() else { return Vec::new() };
    let loads = loads.iter().map(|load| unbalanced(loaded, load));
    let sides = sides.iter().filter(|_| told.is_empty());
    loads.chain(sides.map(|sides| driven(loaded, sides))).collect()
}

fn unbalanced(loaded: &Loaded, load: &UnbalancedLoad) -> Diagnostic {
    let UnbalancedLoad { field, load, terms, largest } = load;
    let names: Vec<String> = terms.iter().map(|t| format!("`{t}`")).collect();
    let names = names.join(", ");
    let d = Diagnostic::new(Code::E613, format!("no value of `{field}` balances its load"));
    let declared = loaded.script.fields.iter().find(|f| f.name.name == *field).map(|f| f.name.span);
    let text = format!("its equation has the load {} and from {names} up to {}", number(*load), number(*largest));
    let d = d.at_or_note(declared, text);
    d.note(format!("both have one sign whatever `{field}` is: the load pulls away from what {names} can give")).help(
        format!("the other sign for the load, -P*Test_{field} for P*Test_{field}; or for `Test_{field}` in {names}"),
    )
}

fn driven(loaded: &Loaded, sides: &DrivenSides) -> Diagnostic {
    let DrivenSides { term, field } = sides;
    let d = Diagnostic::new(Code::E614, format!("`{term}` drives its sides instead of holding them"));
    let text = format!("each motion of `{field}` against the other side that it meets releases energy");
    let named = |t: &&wfl::Term| {
        t.name.as_ref().is_some_and(|n| n.name == *term || term.starts_with(&format!("{} on ", n.name)))
    };
    let d = d.at_or_note(loaded.script.terms.iter().find(named).map(|term| term.expr.span), text);
    d.help(
        "a wrong sign: the jump of the test functions has the sides in the order of the jump that the force follows from, \
         jump(Test_uL,Test_uR) with jump(uL,uR)",
    )
}
