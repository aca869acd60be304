//! Laws of derivatives on the points of the laws that they are derivatives of: terms, updates of states.

use std::sync::Arc;

use wfl::{Checked, Diagnostic, FieldKind as Declared, ResolvedScript, ast::Expr};
use wfl_compiler::{
    TermLaw, backend::KernelBackend, compile_term_gradient, compile_value_gradient, ir::LANES, types::FieldId,
};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Bound, Domain, FieldValues, Integrator, LawSlots, Workspace},
    window::Window,
};

use super::{
    extended::Extended,
    refused::{first, no_derivative, not_made},
};

/// A law on its points, before it is machine code.
pub(super) struct Placed {
    pub(super) law: TermLaw,
    pub(super) domain: Arc<Domain>,
    /// What it is the derivative of.
    pub(super) of: Of,
}

/// What a law is the derivative of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    /// The term at this position.
    Term(usize),
    /// The update of the state at this position among the states of the scene.
    State(usize),
    /// A measure by its position, and the part of its points.
    Measure(usize, usize),
}

/// The laws of derivatives of a scene.
pub(super) struct Laws {
    terms: Vec<(Of, AssembledTerm)>,
    /// By state of the scene the weight of each of its points.
    pub(super) weights: Vec<Vec<f64>>,
}

impl Laws {
    /// Laws for all terms and states, and those of measures that were made before.
    pub(super) fn new(
        extended: &Extended<'_>,
        script: &ResolvedScript,
        measures: Vec<Placed>,
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let scene = extended.scene;
        let mut placed = Vec::new();
        for (k, (summary, term)) in scene.terms.iter().zip(&scene.system.terms).enumerate() {
            let domain = &term.integrator.domain;
            let place = extended.place(domain, term.law.listing.graph.mapping);
            let Some(source) = scene.source_of(script, summary.origin) else {
                return Err(not_made(&format!("the text of `{}` is not at hand", summary.name)));
            };
            let companions = extended.companions_on(domain);
            let made = compile_term_gradient(&extended.env(), &place, &summary.name, source, companions);
            placed.extend(acts(made, &summary.name, domain, Of::Term(k))?);
        }
        let mut weights = Vec::new();
        for (k, state) in scene.states.iter().enumerate() {
            let name = &scene.system.fields[state.field].name;
            let (Some(update), Some((value, sampled))) = (update_of(script, name), state.at_points()) else {
                return Err(not_made(&format!("the update of `{name}` is not at hand")));
            };
            let place = extended.place(&sampled.domain, value.law.mapping);
            let (companions, field) = (extended.companions(), FieldId::new(state.field));
            let weight = (companions.of(field), None, companions);
            let made = compile_value_gradient(&extended.env(), &place, name, update, weight);
            placed.extend(acts(made, name, &sampled.domain, Of::State(k))?);
            weights.push(weights_of(extended, &sampled.domain));
        }
        placed.extend(measures);
        Ok(Self { terms: callable(extended, placed, backend)?, weights })
    }

    /// Brings laws to a step.
    pub(super) fn set_step(&mut self, at: Window) {
        self.terms.iter_mut().for_each(|(_, term)| term.set_step(at));
    }

    /// Adds the derivatives of what some laws are of to `out`.
    pub(super) fn add(
        &self,
        extended: &Extended<'_>,
        wanted: impl Fn(Of) -> bool,
        values: FieldValues<'_>,
        out: &mut [f64],
    ) -> Result<(), Box<Diagnostic>> {
        let mesh = &extended.scene.system.mesh;
        for (_, term) in self.terms.iter().filter(|(of, _)| wanted(*of)) {
            term.add_residual(mesh, values, out).map_err(|e| not_made(&format!("in a derivative: {e}")))?;
        }
        Ok(())
    }
}

/// The text that a state is renewed by.
pub(super) fn update_of<'s>(script: &'s ResolvedScript, state: &str) -> Option<&'s Expr> {
    script.fields.iter().find_map(|f| match &f.kind {
        Declared::State { update } if f.name.name == state => Some(update),
        _ => None,
    })
}

/// A law that acts; nothing for one whose derivatives are zero.
pub(super) fn acts(
    made: Checked<TermLaw>,
    name: &str,
    domain: &Arc<Domain>,
    of: Of,
) -> Result<Option<Placed>, Box<Diagnostic>> {
    let Some(law) = made.value else { return Err(no_derivative(name, first(made.diagnostics))) };
    Ok((!law.tests.is_empty()).then(|| Placed { law, domain: domain.clone(), of }))
}

/// The weight of each point of a domain, in the order of its points.
pub(super) fn weights_of(extended: &Extended<'_>, domain: &Arc<Domain>) -> Vec<f64> {
    let (mesh, nothing) = (&extended.scene.system.mesh, LawSlots { inputs: &[], tests: &[], trials: &[] });
    let Ok(binding) = Binding::new(mesh, domain, &extended.fields, nothing) else { return Vec::new() };
    let bound = Bound { mesh, domain, binding: &binding };
    let (mut workspace, mut out) = (Workspace::default(), Vec::new());
    for (g, group) in domain.groups.iter().enumerate() {
        for entity in 0..group.entities.len() {
            if entity % LANES == 0 {
                let values = FieldValues { current: &[], previous: &[], rates: None };
                workspace.prepare(bound, g, entity / LANES, values);
            }
            out.extend((0..group.n_points()).map(|q| workspace.weight(q)[entity % LANES]));
        }
    }
    out
}

/// Machine code for laws on their points.
pub(super) fn callable(
    extended: &Extended<'_>,
    placed: Vec<Placed>,
    backend: &dyn KernelBackend,
) -> Result<Vec<(Of, AssembledTerm)>, Box<Diagnostic>> {
    let kernels: Vec<_> = placed.iter().map(|p| &p.law.residual).collect();
    let kernels = backend.compile(&kernels).map_err(|e| not_made(&e.to_string()))?;
    let mut out = Vec::with_capacity(placed.len());
    for (Placed { law, domain, of }, kernel) in placed.into_iter().zip(kernels) {
        let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
        let mesh = &extended.scene.system.mesh;
        let binding = Binding::new(mesh, &domain, &extended.fields, slots).map_err(|e| not_made(&e.to_string()))?;
        let integrator = Integrator { domain, binding: Arc::new(binding) };
        out.push((of, AssembledTerm::new(law, integrator, None, kernel, None, &extended.starts)));
    }
    Ok(out)
}
