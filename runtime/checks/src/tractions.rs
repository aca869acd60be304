//! Tractions that a scene declares as unknowns: multipliers by another name.
//!
//! A vector that lives on faces alone, of which no gradient is taken, and that an argument of contact reads beside the
//! displacement of a body is a traction. As an unknown it counts as a displacement wherever lengths are looked at.

use wfl_compiler::types::{BasisSlot, FieldKind, FieldOp, InputSlot};
use wfl_contact::Contact;
use wfl_discrete::{field::FieldSpace, system::System};

/// A field that is a traction, and the contact term that reads it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UndeclaredMultiplier {
    /// The field.
    pub field: String,
    /// Number of the term in the scene.
    pub term: usize,
}

/// The unknowns that are multipliers, each once.
#[must_use]
pub fn undeclared_multipliers(system: &System, contact: &Contact) -> Vec<UndeclaredMultiplier> {
    let dim = system.mesh.dim();
    let is_of = |b: &BasisSlot, field: usize| b.field.index() == field;
    // what a cell tests or differentiates belongs to a body, or to a shell on its faces
    let is_of_body = |field: usize| {
        let differentiated = |b: &BasisSlot| is_of(b, field) && b.op != FieldOp::Value;
        system.terms.iter().any(|t| {
            let reads = t.law.inputs.iter().any(|s| matches!(s, InputSlot::Field(b) if differentiated(b)));
            t.on_cells() && t.law.tests.iter().any(|b| is_of(b, field))
                || reads
                || t.law.tests.iter().any(differentiated)
        })
    };
    let candidates = (0..system.fields.len()).filter(|k| {
        let field = &system.fields[*k];
        let is_vector = field.kind == FieldKind::Unknown && field.n_components == dim && dim > 1;
        // one vector for the scene is the motion of a rigid body
        is_vector && !matches!(field.space, FieldSpace::Global) && !field.is_at_points() && system.range(*k).is_some()
    });
    let candidates: Vec<usize> = candidates.filter(|k| !is_of_body(*k)).collect();
    let mut found = Vec::new();
    for field in candidates {
        let reads = |slots: &[InputSlot]| slots.iter().any(|s| matches!(s, InputSlot::Field(b) if is_of(b, field)));
        let presses = |term: &usize| system.terms[*term].law.tests.iter().any(|b| is_of_body(b.field.index()));
        let of_contact = contact.terms().iter().filter(|term| !term.on_cells() && reads(&term.law().0.law.inputs));
        let term = of_contact.map(|term| term.term).find(presses);
        found.extend(term.map(|term| UndeclaredMultiplier { field: system.fields[field].name.clone(), term }));
    }
    found
}
