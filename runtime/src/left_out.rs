//! The optimisations that a scene allows, with their reasons. Reads only; they are decided elsewhere.

use wfl_compiler::{Class, types::FieldKind};

use crate::{
    newton::{condenses, shares_forces},
    pruning::Pruning,
    scene::Scene,
};

/// Something that a scene does without.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// What.
    pub name: String,
    /// Why the scene does not need it.
    pub why: String,
    /// The switch that puts it back, if there is one.
    pub switch: Option<Pruning>,
}

impl Scene {
    /// What is not done because the scene does not need it.
    #[must_use]
    pub fn left_out(&self) -> Vec<LeftOut> {
        let mut list = Vec::new();
        let mut push = |name: &str, why: String, switch| list.push(LeftOut { name: name.to_owned(), why, switch });
        for name in &self.unused_fields {
            push(name, "a field in no term has no dofs".to_owned(), None);
        }
        for (name, why) in &self.idle {
            push(name, why.clone(), None);
        }
        let system = &self.system;
        let of = |class: Class| system.terms.iter().filter(|t| t.law.class == class).count();
        if of(Class::Constant) > 0 {
            let switch = (!system.is_linear()).then_some(Pruning::Constant);
            push(
                "constant terms once a step",
                format!("{} terms without unknowns are summed once a load step", of(Class::Constant)),
                switch,
            );
        }
        if system.is_linear() {
            let why = "all terms are linear: no Newton iterations".to_owned();
            push("one linear solve", why, Some(Pruning::Linear));
        } else if of(Class::Linear) > 0 {
            let why =
                format!("{} linear terms are assembled once for all iterations and load steps", of(Class::Linear));
            push("linear terms once", why, Some(Pruning::Linear));
        }
        if !system.is_linear() && condenses(system) {
            let (touched, free) = (system.n_changing_dofs(), system.numbering.n_free());
            let why = format!("{touched} of {free} dofs have nonlinear terms: the others are eliminated once");
            push("linear part factored once", why, Some(Pruning::Condense));
            if shares_forces(system) {
                let why = "action equals reaction: each pair of facing dofs shares one unknown of the condensed matrix"
                    .to_owned();
                push("contact forces once a pair", why, Some(Pruning::Forces));
            }
        }
        if system.is_symmetric() && system.uses(Pruning::Symmetric) {
            push(
                "LLT factorisation",
                "every tangent is symmetric: LLT in place of LU".to_owned(),
                Some(Pruning::Symmetric),
            );
        }
        let degrees = |known: bool| {
            let of_class = system.terms.iter().filter(move |t| !known || t.law.class <= Class::Linear);
            of_class.map(|t| t.law.degree.rule())
        };
        if let (Some(least), Some(most)) = (degrees(true).min(), degrees(false).max())
            && least < most
            && system.uses(Pruning::Quadrature)
            && system.fields.iter().all(|f| f.kind != FieldKind::State)
        {
            let why = format!(
                "linear terms are integrated with the degree of their own integrands, from {least}; the highest is {most}"
            );
            push("quadrature degrees by term", why, Some(Pruning::Quadrature));
        }
        for (name, value) in self.params.iter().filter(|p| p.1.values.iter().all(|x| *x == 0.0)) {
            if self.in_terms.contains(name) {
                let zero = if value.shape.rank() == 0 { "0" } else { "zero" };
                push(name, format!("`{name}` is {zero}: terms with this factor are not compiled"), None);
            }
        }
        if system.mesh.dim() < 3 {
            push("third component", format!("the mesh has {} dimensions", system.mesh.dim()), None);
        }
        list
    }
}
