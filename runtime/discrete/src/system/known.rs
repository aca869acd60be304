//! What a step knows beside the unknowns: data, states, the past, rates.

use crate::rates::{RateFactors, Rates, StepAt};

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

    /// What is known now, and the unknowns `u`, become the end of the previous step.
    pub fn keep(&mut self, u: &[f64]) {
        if let Some(past) = &mut self.previous {
            if let Some(rates) = &mut self.rates {
                rates.keep(u, &past.unknowns);
            }
            past.unknowns.copy_from_slice(u);
            past.data.clone_from(&self.data);
        }
    }

    /// A step with the scalars of the present rates.
    #[must_use]
    pub fn step(&self, time: f64, increment: f64) -> StepAt {
        StepAt { time, increment, factors: self.rates.as_ref().map_or_else(RateFactors::default, Rates::factors) }
    }

    /// Rates of a step of this length.
    pub fn begin_rates(&mut self, increment: f64) {
        if let Some(rates) = &mut self.rates {
            rates.begin(increment);
        }
    }

    /// Rates that are those at the end of the last step, whatever the unknowns are.
    pub fn hold_rates(&mut self) {
        if let Some(rates) = &mut self.rates {
            rates.hold();
        }
    }
}
