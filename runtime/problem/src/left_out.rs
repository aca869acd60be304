//! The optimisations that a scene allows, with their reasons. Reads only; they are decided elsewhere.

use wfl_compiler::{Class, types::FieldKind};
use wfl_discrete::{pruning::Pruning, system::System};
use wfl_linear::{condenses, shares_forces};

use super::Scene;

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

impl LeftOut {
    fn new(name: &str, why: impl Into<String>, switch: Option<Pruning>) -> Self {
        Self { name: name.to_owned(), why: why.into(), switch }
    }
}

impl Scene {
    /// What is not done because the scene does not need it.
    #[must_use]
    pub fn left_out(&self) -> Vec<LeftOut> {
        let mut list = Vec::new();
        for name in &self.unused_fields {
            list.push(LeftOut::new(name, "a field in no term has no dofs", None));
        }
        for (name, why) in &self.idle {
            list.push(LeftOut::new(name, why.clone(), None));
        }
        list.extend(by_class(&self.system));
        list.extend(by_solver(&self.system));
        list.extend(by_degree(&self.system));
        for (name, value) in self.params.iter().filter(|p| p.1.values.iter().all(|x| *x == 0.0)) {
            if self.in_terms.contains(name) {
                let zero = if value.shape.rank() == 0 { "0" } else { "zero" };
                let why = format!("`{name}` is {zero}: terms with this factor are not compiled");
                list.push(LeftOut::new(name, why, None));
            }
        }
        if self.system.mesh.dim() < 3 {
            let why = format!("the mesh has {} dimensions", self.system.mesh.dim());
            list.push(LeftOut::new("third component", why, None));
        }
        list
    }
}

/// Terms that are not assembled at each state.
fn by_class(system: &System) -> Vec<LeftOut> {
    let mut list = Vec::new();
    let of = |class: Class| system.terms.iter().filter(|t| t.law.class == class).count();
    if of(Class::Constant) > 0 {
        let why = format!("{} terms without unknowns are summed once a load step", of(Class::Constant));
        let switch = (!system.is_linear()).then_some(Pruning::Constant);
        list.push(LeftOut::new("constant terms once a step", why, switch));
    }
    if system.is_linear() {
        let why = "all terms are linear: no Newton iterations";
        list.push(LeftOut::new("one linear solve", why, Some(Pruning::Linear)));
    } else if of(Class::Linear) > 0 {
        let why = format!("{} linear terms are assembled once for all iterations and load steps", of(Class::Linear));
        list.push(LeftOut::new("linear terms once", why, Some(Pruning::Linear)));
    }
    let by_past = system.terms_by_past().len();
    if by_past > 0 {
        let why = format!("{by_past} terms are linear in the past: matrices for all steps make it");
        list.push(LeftOut::new("the past by matrices", why, Some(Pruning::Past)));
    }
    list
}

/// What the linear solver need not factor.
fn by_solver(system: &System) -> Vec<LeftOut> {
    let mut list = Vec::new();
    if !system.is_linear() && condenses(system) {
        let (touched, free) = (system.n_changing_dofs(), system.numbering.n_free());
        let why = format!("{touched} of {free} dofs have nonlinear terms: the others are eliminated once");
        list.push(LeftOut::new("linear part factored once", why, Some(Pruning::Condense)));
        if shares_forces(system) {
            let why = "action equals reaction: each pair of facing dofs shares one unknown of the condensed matrix";
            list.push(LeftOut::new("contact forces once a pair", why, Some(Pruning::Forces)));
        }
    }
    if system.is_symmetric() && system.uses(Pruning::Symmetric) {
        let why = "every tangent is symmetric: LLT in place of LU, LDLT where it is not definite";
        list.push(LeftOut::new("LLT factorisation", why, Some(Pruning::Symmetric)));
    }
    list
}

/// Integration points that linear terms do not need.
fn by_degree(system: &System) -> Option<LeftOut> {
    let degrees = |known: bool| {
        let of_class = system.terms.iter().filter(move |t| !known || t.law.class <= Class::Linear);
        of_class.map(|t| t.law.degree.rule())
    };
    let (least, most) = (degrees(true).min()?, degrees(false).max()?);
    let has_states = system.fields.iter().any(|f| f.kind == FieldKind::State);
    let why = format!(
        "linear terms are integrated with the degree of their own integrands, from {least}; the highest is {most}"
    );
    let saves = least < most && system.uses(Pruning::Quadrature) && !has_states;
    saves.then(|| LeftOut::new("quadrature degrees by term", why, Some(Pruning::Quadrature)))
}
