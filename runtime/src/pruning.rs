//! What is left out because a scene does not need it, each with a switch that puts it back.
//!
//! A switch changes how a solution is found and not which: it exists so that the saving can be measured and the result
//! compared ([`savings`]). Does not decide anything: `System`, `Strategy` and the rules of integration ask.

mod savings;

use wfl_compiler::Class;

pub use savings::{Saving, SavingError, savings};

use crate::{scene::Scene, strategy::condenses, system::System};

/// Something that is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pruning {
    /// Loads and other terms without unknowns are summed once per step.
    Constant,
    /// Linear terms are assembled once for all iterations and steps; a scene of nothing else has no Newton iterations.
    Linear,
    /// The linear part is factored once and the dofs of the other terms are condensed.
    Condense,
    /// Symmetric tangents are factored as L L^T in place of L U.
    Symmetric,
    /// Linear terms are integrated with the degree of their own integrands, not with the highest of the scene.
    Quadrature,
}

impl Pruning {
    /// All of them.
    pub const ALL: [Pruning; 5] =
        [Pruning::Constant, Pruning::Linear, Pruning::Condense, Pruning::Symmetric, Pruning::Quadrature];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Pruning::Constant => "constant",
            Pruning::Linear => "linear",
            Pruning::Condense => "condense",
            Pruning::Symmetric => "symmetric",
            Pruning::Quadrature => "quadrature",
        }
    }

    /// The one of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }
}

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
            push(name, "field in no term: it has no dofs".to_owned(), None);
        }
        let system = &self.system;
        let of = |class: Class| system.terms.iter().filter(|t| t.law.class == class).count();
        if of(Class::Constant) > 0 {
            let switch = (!system.is_linear()).then_some(Pruning::Constant);
            push("loads in iterations", format!("{} terms without unknowns: once a step", of(Class::Constant)), switch);
        }
        if system.is_linear() {
            push("Newton", "all terms are linear: one linear system".to_owned(), Some(Pruning::Linear));
        } else if of(Class::Linear) > 0 {
            let why = format!("{} linear terms: assembled once for all iterations and steps", of(Class::Linear));
            push("linear terms in iterations", why, Some(Pruning::Linear));
        }
        if !system.is_linear() && condenses(system) {
            let (touched, free) = (system.n_changing_dofs(), system.numbering.n_free());
            let why = format!("{touched} of {free} dofs have terms that are not linear: the rest is factored once");
            push("factors of the linear part", why, Some(Pruning::Condense));
        }
        if system.is_symmetric() && system.uses(Pruning::Symmetric) {
            push("LU", "every tangent is symmetric: LLT".to_owned(), Some(Pruning::Symmetric));
        }
        let degrees = |known: bool| {
            let of_class = system.terms.iter().filter(move |t| !known || t.law.class <= Class::Linear);
            of_class.map(|t| t.law.degree.rule())
        };
        if let (Some(least), Some(most)) = (degrees(true).min(), degrees(false).max())
            && least < most
            && system.uses(Pruning::Quadrature)
        {
            let why =
                format!("linear terms take the degree of their own integrands, from {least}; the highest is {most}");
            push("quadrature points", why, Some(Pruning::Quadrature));
        }
        for (name, value) in self.params.iter().filter(|p| p.1.values.iter().all(|x| *x == 0.0)) {
            if self.in_terms.contains(name) {
                let zero = if value.shape.rank() == 0 { "0" } else { "zero" };
                push(name, format!("`{name}` is {zero}: nothing that it multiplies is compiled"), None);
            }
        }
        if system.mesh.dim() < 3 {
            push("third component", format!("the mesh has {} dimensions", system.mesh.dim()), None);
        }
        list
    }
}

/// Raises terms of a class to terms of which nothing is known.
pub(crate) fn forget(system: &mut System, class: Class) {
    for term in system.terms.iter_mut().filter(|t| t.law.class == class) {
        term.law.class = Class::Nonlinear;
    }
}
