//! Scenes of many steps: the derivatives of their terms in the past, which the equations make matrices of.
//!
//! A matrix costs about as much as some tens of evaluations at the points, and memory like the tangent: scenes of fewer steps, and
//! of increments that change, go without ([`Steps::are_many`]).

use std::sync::Arc;

use wfl::{Code, Diagnostic};
use wfl_compiler::{Reading, TermLaw, backend::KernelBackend, compile_linear_part};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Integrator, LawSlots, tangent_kernel},
    pruning::Pruning,
    rates::Scheme,
    system::{Numbering, PastForm, is_affine_in_the_past, is_of_rates, readings, stays},
};

use super::{Builder, Steps, assemble::Assembled, rates::Integration};

/// From so many steps on a matrix of the past pays: its pattern and its assembly take as long as 10 to 40 evaluations at the
/// points do (triangles and tetrahedra of degrees 1 and 2).
const MANY: usize = 100;

impl Steps {
    /// Whether there are so many steps that what each of them evaluates is worth a matrix or a vector that is made once. Of steps
    /// that the run chooses nobody knows; there are many, more often than not.
    #[must_use]
    pub fn are_many(&self) -> bool {
        self.listed().is_none_or(|n| n >= MANY)
    }

    /// Whether they are, and matrices made with the increment stay.
    #[must_use]
    pub fn are_many_and_equal(&self) -> bool {
        self.listed().is_some_and(|n| n >= MANY) && self.equal.is_some()
    }
}

impl Builder<'_> {
    /// The derivatives in the past of the terms whose constants matrices are to make.
    pub(super) fn past_forms(
        &mut self,
        made: &Assembled,
        numbering: &Numbering,
        steps: Option<&Steps>,
        integration: &Integration,
    ) -> Vec<PastForm> {
        let keeps = self.keep.contains(&Pruning::Past);
        // explicit steps evaluate everything at its points
        if keeps || integration.scheme == Scheme::Explicit || !steps.is_some_and(Steps::are_many_and_equal) {
            return Vec::new();
        }
        let starts = &numbering.starts;
        let has_rates = super::rates::of(integration.scheme, self.env.rates, &self.fields, numbering).is_some();
        let readings = readings(has_rates);
        let mut forms = Vec::new();
        for (k, term) in made.terms.iter().enumerate() {
            if !is_affine_in_the_past(&term.law, &term.integrator, starts, readings) {
                continue;
            }
            let laws = self.laws_in_the_past(&term.law, readings);
            forms.extend(laws.into_iter().flatten().filter_map(|(reading, law)| {
                Some(PastForm { term: k, reading, form: self.form(law, &term.integrator, starts)? })
            }));
        }
        forms
    }

    /// The derivatives of a term in all that its constants read, those that are not zero; `None` where they would not stay.
    fn laws_in_the_past(&self, law: &TermLaw, readings: &[Reading]) -> Option<Vec<(Reading, TermLaw)>> {
        let has_rates = readings.contains(&Reading::Current);
        let mut laws = Vec::new();
        for reading in readings {
            let Some(made) = compile_linear_part(self.env.fields, law, *reading) else { continue };
            if has_rates && is_of_rates(&made) {
                continue;
            }
            // a difference to the past that is no rate: of two products with whole states rounding would be left
            let is_difference = has_rates && *reading == Reading::Previous;
            if is_difference || !stays(&made.prologue) {
                return None;
            }
            laws.push((*reading, made));
        }
        Some(laws)
    }

    /// A law on the points of its term; `None` after a message.
    fn form(&mut self, law: TermLaw, integrator: &Integrator, starts: &[Option<usize>]) -> Option<AssembledTerm> {
        let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
        let domain = integrator.domain.clone();
        let told = |e: String| Diagnostic::new(Code::E609, e);
        let binding = Binding::new(&self.mesh, &domain, &self.fields, slots);
        let binding = binding.map_err(|e| self.diagnostics.push(told(e.to_string()))).ok()?;
        let tangent = tangent_kernel(&law);
        let kernels: Vec<_> = std::iter::once(&law.residual).chain(&tangent).collect();
        let kernels = self.batch.compile(&kernels).map_err(|e| self.diagnostics.push(told(e.to_string()))).ok()?;
        let mut kernels = kernels.into_iter();
        let (residual, tangent) = (kernels.next()?, kernels.next());
        let integrator = Integrator { domain, binding: Arc::new(binding) };
        Some(AssembledTerm::new(law, integrator, None, residual, tangent, starts))
    }
}
