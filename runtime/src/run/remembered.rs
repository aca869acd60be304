//! What steps that the run chooses remember of earlier ones: solutions, increments and the sizes of fields; and the error
//! of a step that follows from them. Does not solve anything.

use std::ops::Range;

use super::{
    control::{Control, Errors},
    past::{Past, distance},
};
use crate::{
    rates::Scheme,
    scene::{Auto, Scene},
};

/// What steps that the run chooses remember.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Adaptive {
    pub(super) control: Control,
    /// Unknowns, and states behind them.
    pub(super) past: Past,
    /// By field that counts the largest value it has had.
    pub(super) scales: Vec<f64>,
}

impl Adaptive {
    pub(super) fn new(rules: &Auto) -> Self {
        Self { control: Control::new(rules), past: Past::default(), scales: vec![0.0; rules.fields.len()] }
    }

    /// Takes a solution at the end of an increment.
    pub(super) fn add(&mut self, scene: &Scene, rules: &Auto, increment: f64, u: &[f64]) {
        let solution = joined(u, scene.states.iter().map(|s| scene.system.known.data[s.field].as_slice()));
        for (scale, range) in self.scales.iter_mut().zip(ranges(scene, rules)) {
            *scale = solution[range].iter().fold(*scale, |m, v| m.max(v.abs()));
        }
        self.past.add(increment, solution);
    }

    /// What is expected behind another increment; `None` where nothing is known of the past.
    pub(super) fn expected(&self, scene: &Scene, increment: f64) -> Option<Vec<f64>> {
        let parabola = if is_bdf2(scene) { self.past.extrapolated(increment, 2) } else { None };
        parabola.or_else(|| self.past.extrapolated(increment, 1))
    }

    /// The estimated errors of a solution, relative to the demanded one; `None` where nothing is known of the past.
    ///
    /// What BDF2 does not integrate, states among it, counts as a solution of backward Euler; so does everything in the
    /// second step, behind which no parabola is known yet: its error is smaller than that.
    pub(super) fn errors(&self, scene: &Scene, rules: &Auto, increment: f64, solution: &[f64]) -> Option<Errors> {
        let line = self.past.extrapolated(increment, 1)?;
        let parabola = if is_bdf2(scene) { self.past.extrapolated(increment, 2) } else { None };
        let size = |range: &Range<usize>| solution[range.clone()].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut errors = Errors::default();
        for (field, (range, scale)) in rules.fields.iter().zip(ranges(scene, rules).zip(&self.scales)) {
            let scale = scale.max(size(&range));
            let (order, expected) = match &parabola {
                Some(parabola) if has_rate(scene, *field) => (2, parabola),
                _ => (1, &line),
            };
            let missed = distance(solution, expected, range, scale);
            let error = self.past.share(increment, order) * missed / rules.error;
            let largest = &mut errors.by_order[order - 1];
            *largest = if error.is_nan() { error } else { largest.max(error) };
        }
        Some(errors)
    }
}

fn is_bdf2(scene: &Scene) -> bool {
    scene.system.known.rates.as_ref().is_some_and(|rates| rates.scheme() == Scheme::Bdf2)
}

/// True for a field whose rates are made by the scheme.
fn has_rate(scene: &Scene, field: usize) -> bool {
    scene.system.known.rates.iter().flat_map(|rates| rates.fields()).any(|of| of.field == field)
}

/// Where the fields that count lie in a solution.
fn ranges<'s>(scene: &'s Scene, rules: &'s Auto) -> impl Iterator<Item = Range<usize>> + 's {
    rules.fields.iter().map(|field| {
        if let Some(range) = scene.system.range(*field) {
            return range;
        }
        let mut start = scene.system.numbering.n_dofs;
        for state in &scene.states {
            let n = scene.system.known.data[state.field].len();
            if state.field == *field {
                return start..start + n;
            }
            start += n;
        }
        0..0
    })
}

pub(super) fn joined<'s>(u: &[f64], states: impl Iterator<Item = &'s [f64]>) -> Vec<f64> {
    let mut all = u.to_vec();
    states.for_each(|s| all.extend_from_slice(s));
    all
}
