//! What a term brings beside itself: the values it prints, and its frozen form.

use std::sync::Arc;

use wfl_compiler::{FrozenLaw, PrintLaw, backend::PointKernel, ir::Origin, types::FieldKind};
use wfl_contact::{ContactParts, ContactTerm};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots},
    domain::NAME,
    field::{Field, FieldSpace},
    point_space::PointSpace,
    system::{FrozenTerm, Numbering, System},
    value::{Sampled, Value},
    window::Window,
};

use super::Builder;

/// A `Print` of a term.
pub struct Printed {
    /// The term.
    pub term: String,
    /// Where it is written.
    pub origin: Option<Origin>,
    value: Value,
    sampled: Sampled,
}

impl Printed {
    /// Calls `f(position, value)` at each point of the term, at the state and step given.
    pub fn for_each(&self, system: &System, window: Window, u: &[f64], mut f: impl FnMut([f64; 3], &[f64])) {
        let printed = self.value.at_step(system.with_present_rates(window));
        let state = system.values(u);
        let values = state.view();
        let sampled = self.sampled.at(&system.mesh, values.current);
        let domain = sampled.domain.clone();
        printed.for_each_point(&system.mesh, &sampled, values, |g, entity, q, _, value| {
            if domain.groups[g].has_lost_its_image(entity) {
                return;
            }
            f(domain.groups[g].position(&system.mesh, entity, q), value);
        });
    }
}

impl Builder<'_> {
    /// A `Print` at the points of its term.
    pub(super) fn print(&self, print: PrintLaw, term: &str, domain: &Arc<Domain>) -> Result<Printed, String> {
        let value = Value::new(print.law, self.batch).map_err(|e| e.to_string())?;
        let sampled = value.bind(&self.mesh, domain.clone(), &self.fields).map_err(|e| e.to_string())?;
        Ok(Printed { term: term.to_owned(), origin: print.origin, value, sampled })
    }

    /// The frozen form of a term, whose branches and regularisation are fields behind those of the scene, and its
    /// projections.
    pub(super) fn freeze(
        &self,
        law: FrozenLaw,
        kernels: (Box<dyn PointKernel>, Option<Box<dyn PointKernel>>),
        domain: &Arc<Domain>,
        of: Frozen,
        numbering: &Numbering,
    ) -> Result<(FrozenTerm, ContactTerm), String> {
        let data = |name: String, n_components: usize, space: FieldSpace| Field {
            name,
            kind: FieldKind::Data,
            n_components,
            space,
        };
        let mut fields = self.fields.clone();
        while fields.len() < law.field.index() {
            fields.push(data(String::new(), 1, FieldSpace::Global));
        }
        let points = FieldSpace::Points(PointSpace::new(&self.mesh, domain));
        let is_cut = domain.moving.as_ref().is_some_and(|points| points.are_of_pieces());
        let n = law.sizes.point + if is_cut { NAME } else { 0 };
        fields.push(data(format!("branches of {}", law.law.name), n, points));
        fields.push(data(format!("regularisation of {}", law.law.name), law.sizes.term, FieldSpace::Global));
        let mut starts = numbering.starts.clone();
        starts.resize(fields.len(), None);
        let slots = LawSlots { inputs: &law.law.inputs, tests: &law.law.tests, trials: &law.law.trials };
        let binding = Binding::new(&self.mesh, domain, &fields, slots).map_err(|e| e.to_string())?;
        let integrator = Integrator { domain: domain.clone(), binding: Arc::new(binding) };
        let slopes = law.slopes();
        let watch = Value::new(law.watch, self.batch).map_err(|e| e.to_string())?;
        let sampled = watch.bind(&self.mesh, domain.clone(), &fields).map_err(|e| e.to_string())?;
        let form = AssembledTerm::new(law.law, integrator, None, kernels.0, kernels.1, &starts);
        let parts = ContactParts {
            term: of.term,
            frozen: of.position,
            field: law.field.index(),
            projections: law.projections,
            law: watch,
            slopes,
            sampled,
        };
        let contact = ContactTerm::new(parts, &form, &self.fields);
        Ok((FrozenTerm { term: of.term, form }, contact))
    }
}

/// Where a frozen form stands.
#[derive(Clone, Copy)]
pub(super) struct Frozen {
    /// The term that it replaces.
    pub(super) term: usize,
    /// Its position among the frozen forms.
    pub(super) position: usize,
}
