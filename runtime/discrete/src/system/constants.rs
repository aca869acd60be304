//! The constants of a step: what affine terms give at the state that their matrix acts on the change from.
//!
//! What depends on nothing but the uniforms of its law is kept from step to step, matrices make what is linear in the past
//! ([`super::past`]), the rest is evaluated at the points.

use wfl_compiler::{
    Class,
    types::{InputSlot, UniformSlot},
};

use super::{StateValues, System, SystemError};
use crate::assemble::AssembledTerm;

/// What some terms give at the state zero where neither known fields nor the past enter.
#[derive(Clone, Default)]
pub(super) struct Steady {
    /// By such term: the uniforms that it was evaluated with.
    uniforms: Vec<Vec<f64>>,
    /// Their sum by dof.
    sum: Vec<f64>,
}

impl System {
    /// Sums the constants of the present step at the state `start`, or at zero where that is empty.
    pub(super) fn sum_constants(&mut self, start: Vec<f64>, zero: &[f64]) -> Result<(), SystemError> {
        self.prepare_past()?;
        let base = if start.is_empty() { zero } else { &start };
        let steady = self.steady_parts(&start, zero)?;
        let mut constant: Vec<f64> = steady[0].sum.iter().zip(&steady[1].sum).map(|(a, b)| a + b).collect();
        let mut loaded = Vec::new();
        // loads first, so that what they act on is known also where constants hold the past
        for loads in [true, false] {
            let values = self.values(base);
            for (_, term) in
                self.affine_terms().filter(|(k, t)| !self.stays_steady(*k, t, &start) && is_load(self, t) == loads)
            {
                self.add_own(term, values.view(), &mut constant)?;
            }
            if loads {
                loaded = self.loaded_by(&constant);
            }
        }
        self.add_redistributed_at(base, &mut constant);
        let mut sizes: Vec<f64> = constant.iter().map(|x| x.abs()).collect();
        self.add_past(base, self.known.rates.as_ref(), &mut constant, &mut sizes);
        (self.constant, self.constant_sizes, self.loaded) = (constant, sizes, loaded);
        (self.steady, self.base) = (Some(steady), start);
        Ok(())
    }

    /// What the terms give whose part without known fields and without the past is that of the step before, unless their
    /// uniforms have changed: those that read the step variable, and the others.
    fn steady_parts(&mut self, start: &[f64], zero: &[f64]) -> Result<[Steady; 2], SystemError> {
        let mut before = self.steady.take().unwrap_or_default();
        for (part, moves) in before.iter_mut().zip([true, false]) {
            let is_part = |(k, t): &(usize, &AssembledTerm)| {
                self.stays_steady(*k, t, start) && t.law.prologue.slots.contains(&UniformSlot::Time) == moves
            };
            let terms = || self.affine_terms().filter(is_part).map(|(_, t)| t);
            if part.sum.len() == zero.len() && part.uniforms.iter().map(|u| &u[..]).eq(terms().map(|t| t.uniforms())) {
                continue;
            }
            let (rates, nothing) = (self.known.rates.clone(), vec![0.0; zero.len()]);
            let rates = rates.map(|mut rates| {
                rates.clear();
                rates
            });
            let values = StateValues {
                current: self.slices(zero),
                previous: if self.known.previous.is_some() { self.slices(&nothing) } else { Vec::new() },
                rates: rates.as_ref(),
            };
            let mut sum = zero.to_vec();
            for term in terms() {
                self.add_own(term, values.view(), &mut sum)?;
            }
            *part = Steady { uniforms: terms().map(|t| t.uniforms().to_vec()).collect(), sum };
        }
        Ok(before)
    }

    fn affine_terms(&self) -> impl Iterator<Item = (usize, &AssembledTerm)> {
        self.terms.iter().enumerate().filter(|(_, t)| t.law.class <= Class::Linear)
    }

    /// Whether what a term adds to the constants, but for what matrices make of the past, depends on its uniforms alone; they
    /// are summed at the state `start`, or at zero where that is empty.
    fn stays_steady(&self, k: usize, term: &AssembledTerm, start: &[f64]) -> bool {
        self.is_by_past(k) || (start.is_empty() || term.law.class == Class::Constant) && self.is_steady(term)
    }

    /// Whether what a term gives at the state zero depends on its uniforms alone.
    fn is_steady(&self, term: &AssembledTerm) -> bool {
        term.law.inputs.iter().all(|input| match input {
            InputSlot::Previous(_) | InputSlot::History(..) => false,
            InputSlot::Field(slot) => self.numbering.starts[slot.field.index()].is_some(),
            _ => true,
        })
    }
}

/// Whether a term is a load: it depends neither on the unknowns nor on the past.
fn is_load(system: &System, term: &AssembledTerm) -> bool {
    term.law.class == Class::Constant && system.is_steady(term)
}
