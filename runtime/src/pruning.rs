//! What is left out because a scene does not need it, each with a switch that puts it back.
//!
//! A switch changes how a solution is found and not which: it exists so that the saving can be measured and the result
//! compared. Does not decide anything: `System` and `Strategy` ask.

use wfl_compiler::Class;

use crate::{scene::Scene, strategy::condenses, system::System};

/// Something that is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pruning {
    /// Linear terms are assembled once for all iterations and steps; a scene of nothing else has no Newton iterations.
    Linear,
    /// The linear part is factored once and the dofs of the other terms are condensed.
    Condense,
    /// Symmetric tangents are factored as L L^T in place of L U.
    Symmetric,
}

impl Pruning {
    /// All of them.
    pub const ALL: [Pruning; 3] = [Pruning::Linear, Pruning::Condense, Pruning::Symmetric];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Pruning::Linear => "linear",
            Pruning::Condense => "condense",
            Pruning::Symmetric => "symmetric",
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
            push("loads in iterations", format!("{} terms without unknowns: once a step", of(Class::Constant)), None);
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
        if system.mesh.dim() < 3 {
            push("third component", format!("the mesh has {} dimensions", system.mesh.dim()), None);
        }
        list
    }
}

/// Raises linear terms to terms of which nothing is known.
pub(crate) fn forget_linear(system: &mut System) {
    for term in system.terms.iter_mut().filter(|t| t.law.class == Class::Linear) {
        term.law.class = Class::Nonlinear;
    }
}
