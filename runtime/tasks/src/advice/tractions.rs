//! W518 for tractions that are declared as unknowns.

use wfl::{Code, Diagnostic};
use wfl_checks::undeclared_multipliers;
use wfl_problem::{Equations, Scene};

use crate::Loaded;

/// W518 for each unknown on faces that is a multiplier.
pub(super) fn unknowns(loaded: &Loaded, scene: &Scene, first: &Equations) -> Vec<Diagnostic> {
    let told = |of: wfl_checks::UndeclaredMultiplier| {
        let (field, term) = (&of.field, &scene.terms[of.term].name);
        let d = Diagnostic::new(Code::W518, format!("`{field}` is a traction, declared as an unknown"));
        let declared = loaded.script.fields.iter().find(|f| f.name.name == *field).map(|f| f.name.span);
        d.at_or_note(declared, format!("lives on faces alone, and `{term}` takes it for a force of contact"))
            .note("as an unknown it counts as a displacement: in checks of slip, of overlap and of equilibrium")
            .help(format!("multiplier {field} : vector on ..."))
    };
    undeclared_multipliers(&first.system, &first.contact).into_iter().map(told).collect()
}
