//! The past as matrices: what affine terms make of the state at the start of a step, without going to their points again.
//!
//! A term that is affine in all that it reads, `f(0) + S u + P u_n + C h + M g`, with the unknowns `u`, their values `u_n` at
//! the end of the last step and what the past gives of their rates `h` and `g`, has constants in every step. With few steps they
//! are evaluated at the points; with many, matrices are assembled once, again where the increment is another one, and
//! multiplied by what each step reads. Whether that is so says the scene before the first step ([`System::plan_past`]), so
//! that a run that goes on from a checkpoint has the same bits.
//!
//! With rates, constants are those at the base of the step ([`System::begin_step`]), where the scalars of rates multiply
//! nothing: the matrices have the scalars zero, and what rates multiply stays in the histories.

use std::sync::Arc;

use wfl_compiler::{
    Class, Prologue, Reading, TermLaw, interpret, is_affine, run_prologue,
    types::{InputSlot, RateOrder, UniformSlot},
};
use wfl_host::memory::claim_numbers;
use wfl_sparse::csr::{Csr, Pattern, product_and_size};

use super::{System, SystemError, pattern};
use crate::{
    assemble::{AssembledTerm, Integrator},
    rates::{RateFactors, Rates},
};

/// The derivative of a term in the unknowns as it reads them at one state.
#[derive(Clone)]
pub struct PastForm {
    /// Position of the term.
    pub term: usize,
    /// The state.
    pub reading: Reading,
    /// A term whose tangent it is.
    pub form: AssembledTerm,
}

/// The matrices of all forms, by dof in the axes of the scene: the rows of this rank.
pub(super) struct PastMatrices {
    /// By form: the uniforms that it was assembled with.
    uniforms: Vec<Vec<f64>>,
    /// By state, each once; those without entries that act are left out.
    matrices: Vec<(Reading, Csr)>,
}

/// The states that the constants of a term read: all with rates, else the past.
#[must_use]
pub fn readings(has_rates: bool) -> &'static [Reading] {
    const ALL: [Reading; 4] =
        [Reading::Previous, Reading::History(RateOrder::First), Reading::History(RateOrder::Second), Reading::Current];
    if has_rates { &ALL } else { &ALL[..1] }
}

/// Whether a term is affine in the unknowns as it reads them, now and in the past, and reads no other field, and its constants
/// at the states of `readings` change from step to step. `starts` are the first dofs of the fields.
#[must_use]
pub fn is_affine_in_the_past(
    law: &TermLaw,
    integrator: &Integrator,
    starts: &[Option<usize>],
    readings: &[Reading],
) -> bool {
    let is_past = |slot: &InputSlot| matches!(slot, InputSlot::Previous(_) | InputSlot::History(..));
    let field = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    };
    let changes = law.inputs.iter().any(is_past) || readings.contains(&Reading::Current) && law.class == Class::Linear;
    changes
        && law.class <= Class::Linear
        && !integrator.moves()
        && law.inputs.iter().filter_map(field).all(|k| starts[k].is_some())
        && is_affine(&law.residual, |slot| field(&law.inputs[slot]).is_some())
}

/// Whether a matrix of this law stays while the increment does.
#[must_use]
pub fn stays(prologue: &Prologue) -> bool {
    !prologue.slots.contains(&UniformSlot::Time)
}

/// Whether the tangent of an affine law is zero where the scalars of rates are: then they multiply all of it.
#[must_use]
pub fn is_of_rates(law: &TermLaw) -> bool {
    /// Numbers that are read at a point: no two alike, so that nothing cancels by chance.
    fn number(k: u32) -> f64 {
        0.7 + 0.1 / (1.0 + f64::from(k))
    }
    if !law.prologue.slots.iter().any(|slot| matches!(slot, UniformSlot::Rate(_))) {
        return false;
    }
    let slot = |slot: &UniformSlot| if matches!(slot, UniformSlot::Rate(_)) { 0.0 } else { 1.0 };
    let uniforms = run_prologue(&law.prologue, &law.prologue.slots.iter().map(slot).collect::<Vec<_>>());
    let inputs: Vec<f64> = (0..).take(law.inputs.len()).map(number).collect();
    let mut out = vec![0.0; law.tangent.kernel().outputs.len()];
    interpret(&law.tangent, &uniforms, &inputs, &mut Vec::new(), &mut out);
    out[law.tests.len()..].iter().all(|entry| *entry == 0.0)
}

impl System {
    /// From now on the constants of the terms that these forms are of are made by matrices: all forms of a term, those at
    /// [`readings`] that are not zero. For terms that [`is_affine_in_the_past`] holds of.
    pub fn plan_past(&mut self, forms: Vec<PastForm>) {
        let is_affine = |form: &PastForm| self.terms[form.term].law.class <= Class::Linear;
        self.past_forms = forms.into_iter().filter(is_affine).collect();
        (self.past_matrices, self.steady) = (None, None);
    }

    /// Positions of the terms whose constants are made by matrices, sorted.
    #[must_use]
    pub fn terms_by_past(&self) -> Vec<usize> {
        let mut terms: Vec<usize> = self.past_forms.iter().map(|form| form.term).collect();
        terms.sort_unstable();
        terms.dedup();
        terms
    }

    /// Whether the constants of a term are made by matrices.
    pub(super) fn is_by_past(&self, term: usize) -> bool {
        self.past_forms.iter().any(|form| form.term == term)
    }

    /// Brings the matrices to the present step.
    ///
    /// # Errors
    /// [`SystemError`] with its place.
    pub(super) fn prepare_past(&mut self) -> Result<(), SystemError> {
        let window = self.window.with_rates(RateFactors::default());
        self.past_forms.iter_mut().for_each(|form| form.form.set_step(window));
        let uniforms = || self.past_forms.iter().map(|form| form.form.uniforms());
        let known = self.past_matrices.as_deref();
        if self.past_forms.is_empty() || known.is_some_and(|known| known.uniforms.iter().map(|u| &u[..]).eq(uniforms()))
        {
            return Ok(());
        }
        let uniforms: Vec<Vec<f64>> = uniforms().map(<[f64]>::to_vec).collect();
        self.past_matrices = None;
        let matrices = self.past_matrices()?;
        self.past_matrices = Some(Arc::new(PastMatrices { uniforms, matrices }));
        Ok(())
    }

    /// Assembles the matrices of all forms, on one pattern.
    fn past_matrices(&mut self) -> Result<Vec<(Reading, Csr)>, SystemError> {
        let n = self.numbering.n_dofs;
        let every_dof: Vec<u32> = (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect();
        let frames = &self.numbering.frames;
        let forms = self.past_forms.iter().map(|form| &form.form);
        let pattern: Arc<Pattern> = pattern(forms, n, frames, |d| d, self.share.as_deref())?.pattern().clone();
        let zero = vec![0.0; n];
        let mut matrices = Vec::new();
        let mut forms = std::mem::take(&mut self.past_forms);
        let share = self.share.clone();
        let mut made = || {
            for reading in readings(true) {
                claim_numbers(pattern.n_entries() as u64, "a matrix of the past")?;
                let mut matrix = Csr::zeros(pattern.clone());
                for form in forms.iter_mut().filter(|form| form.reading == *reading).map(|form| &mut form.form) {
                    form.locate_own(&pattern, &every_dof, share.as_ref());
                    let added = form.add_tangent(&self.mesh, self.values(&zero).view(), matrix.values_mut());
                    form.forget();
                    added?;
                }
                if self.team().any(matrix.values().iter().any(|v| *v != 0.0)) {
                    matrices.push((*reading, matrix));
                }
            }
            Ok(())
        };
        let result: Result<(), SystemError> = made();
        self.past_forms = forms;
        result.map(|()| matrices)
    }

    /// Adds what the matrices make of the present step to its constants, by dof in the rows of this rank, and what is rounded
    /// there to `sizes`; `base` is the state that constants are summed at.
    pub(super) fn add_past(&self, base: &[f64], rates: Option<&Rates>, constant: &mut [f64], sizes: &mut [f64]) {
        let (Some(past), Some(known)) = (self.past_matrices.as_deref(), &self.known.previous) else { return };
        let (mut part, mut size) = (vec![0.0; base.len()], vec![0.0; base.len()]);
        for (reading, matrix) in &past.matrices {
            let history;
            let read = match reading {
                Reading::Current => base,
                Reading::Previous => &known.unknowns,
                Reading::History(order) => {
                    history = histories(rates, *order, base.len());
                    &history
                }
            };
            product_and_size(matrix, read, [&mut part, &mut size], rayon::current_num_threads());
            constant.iter_mut().zip(&part).for_each(|(sum, x)| *sum += x);
            sizes.iter_mut().zip(&size).for_each(|(sum, x)| *sum += x);
        }
    }
}

/// What the past gives of rates of one order, by dof; zero for fields without.
fn histories(rates: Option<&Rates>, order: RateOrder, n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n];
    for of in rates.into_iter().flat_map(Rates::fields) {
        for (d, history) in of.dofs.clone().zip(rates.map_or(&[][..], |rates| rates.history(order, of.field))) {
            out[d] = *history;
        }
    }
    out
}
