//! What a step knows beside the unknowns: data, states, the past, rates.

use wfl_compiler::types::FieldKind;

use super::System;
use crate::{
    rates::{RateFactors, Rates},
    window::Window,
};

/// Values that do not follow from the unknowns: known fields, and the past where a scene uses it.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Values of data, states and fields without terms, by field; empty for fields that are solved for.
    pub data: Vec<Vec<f64>>,
    /// The end of the previous step; `None` unless something reads it.
    pub previous: Option<Past>,
    /// Rates that are more than differences; `None` unless the scene has some.
    pub rates: Option<Rates>,
}

/// The end of the previous step.
#[derive(Clone, Debug, Default)]
pub struct Past {
    /// All unknowns.
    pub unknowns: Vec<f64>,
    /// As [`Known::data`], then.
    pub data: Vec<Vec<f64>>,
}

impl Known {
    /// Nothing is known any more: every value is zero, as before the first step.
    pub fn clear(&mut self) {
        let past = self.previous.iter_mut().flat_map(|p| std::iter::once(&mut p.unknowns).chain(&mut p.data));
        self.data.iter_mut().chain(past).for_each(|values| values.fill(0.0));
        if let Some(rates) = &mut self.rates {
            rates.clear();
        }
    }

    fn keep(&mut self, u: &[f64]) {
        if let Some(past) = &mut self.previous {
            if let Some(rates) = &mut self.rates {
                rates.keep(u, &past.unknowns);
            }
            past.unknowns.copy_from_slice(u);
            past.data.clone_from(&self.data);
        }
    }
}

/// What others read and set of it.
impl System {
    /// What is known beside the unknowns.
    #[must_use]
    pub fn known(&self) -> &Known {
        &self.known
    }

    /// A copy of these equations with another end of the previous step.
    #[must_use]
    pub fn with_past(&self, past: Option<&Past>) -> Self {
        let mut other = self.clone();
        other.known.previous = past.cloned();
        other
    }

    /// Takes over what was known to these equations, or to a copy of them.
    pub fn set_known(&mut self, known: &Known) {
        self.known.clone_from(known);
    }

    /// Values of data, states and fields without terms, by field; empty for fields that are solved for.
    #[must_use]
    pub fn data(&self) -> &[Vec<f64>] {
        &self.known.data
    }

    /// The values of one of these fields.
    pub fn data_mut(&mut self, field: usize) -> &mut Vec<f64> {
        &mut self.known.data[field]
    }

    /// Gives one of these fields its values.
    pub fn set_data(&mut self, field: usize, values: Vec<f64>) {
        self.known.data[field] = values;
    }

    /// Looks at the equations with other values of some of these fields, now and at the end of the previous step. Afterwards these
    /// are as they were.
    pub fn with_data<T>(&mut self, values: &[(usize, Vec<f64>)], look: impl FnOnce(&Self) -> T) -> T {
        let mut before = Vec::with_capacity(values.len());
        for (field, values) in values {
            let past =
                self.known.previous.as_mut().map(|past| std::mem::replace(&mut past.data[*field], values.clone()));
            before.push((*field, std::mem::replace(&mut self.known.data[*field], values.clone()), past));
        }
        let found = look(self);
        for (field, now, past) in before {
            self.known.data[field] = now;
            if let Some((kept, past)) = self.known.previous.as_mut().zip(past) {
                kept.data[field] = past;
            }
        }
        found
    }

    /// The end of the previous step, if something reads it.
    #[must_use]
    pub fn past(&self) -> Option<&Past> {
        self.known.previous.as_ref()
    }

    /// Rates that are more than differences, if the scene has some.
    #[must_use]
    pub fn rates(&self) -> Option<&Rates> {
        self.known.rates.as_ref()
    }

    /// The same, to be changed.
    pub fn rates_mut(&mut self) -> Option<&mut Rates> {
        self.known.rates.as_mut()
    }

    /// The rates, to be changed, and the end of the previous step.
    pub fn rates_and_past(&mut self) -> Option<(&mut Rates, &Past)> {
        self.known.rates.as_mut().zip(self.known.previous.as_ref())
    }

    /// Takes over rates of these equations, or of a copy of them.
    pub fn set_rates(&mut self, rates: Option<&Rates>) {
        self.known.rates = rates.cloned();
    }

    /// States become those at the end of the previous step: terms read them so while its equations were solved.
    pub fn recall_states(&mut self) {
        let Some(past) = &self.known.previous else { return };
        for (k, _) in self.fields.iter().enumerate().filter(|(_, f)| f.kind == FieldKind::State) {
            self.known.data[k].clone_from(&past.data[k]);
        }
    }

    /// What is known now, and the unknowns `u`, become the end of the previous step.
    pub fn end_step(&mut self, u: &[f64]) {
        self.known.keep(u);
    }

    /// A step as point laws are told of it, with the scalars of the present rates.
    #[must_use]
    pub fn with_present_rates(&self, window: Window) -> Window {
        window.with_rates(self.rates().map_or_else(RateFactors::default, Rates::factors))
    }

    /// Rates of a step of this length.
    pub fn begin_rates(&mut self, increment: f64) {
        if let Some(rates) = self.rates_mut() {
            rates.begin(increment);
        }
    }

    /// Rates that are those at the end of the last step, whatever the unknowns are.
    pub fn hold_rates(&mut self) {
        if let Some(rates) = self.rates_mut() {
            rates.hold();
        }
    }
}
