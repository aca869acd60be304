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

    /// Behind a corner of a load earlier solutions say nothing of the next one: the first increment follows, as at the
    /// start.
    pub(super) fn turn(&mut self, rules: &Auto) {
        self.control.next = self.control.next.min(rules.first);
        self.past = Past::default();
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
        let parabola = if has_second_order(scene) { self.past.extrapolated(increment, 2) } else { None };
        parabola.or_else(|| self.past.extrapolated(increment, 1))
    }

    /// The estimated errors of a solution, relative to the demanded one; `None` where nothing is known of the past.
    ///
    /// What the scheme does not integrate, states among it, counts as a solution of backward Euler; so does everything in
    /// the second step, behind which no parabola is known yet: its error is smaller than that.
    pub(super) fn errors(&self, scene: &Scene, rules: &Auto, increment: f64, solution: &[f64]) -> Option<Errors> {
        let line = self.past.extrapolated(increment, 1)?;
        let parabola = if has_second_order(scene) { self.past.extrapolated(increment, 2) } else { None };
        let size = |range: &Range<usize>| solution[range.clone()].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let of_euler = [0.5 * increment * increment, 0.0];
        let mut errors = Errors::default();
        for (field, (range, scale)) in rules.fields.iter().zip(ranges(scene, rules).zip(&self.scales)) {
            let scale = scale.max(size(&range));
            let rates = scene.system.known.rates.as_ref();
            let [first, second] = rates.and_then(|rates| rates.misses(*field)).unwrap_or(of_euler);
            let known = match &parabola {
                Some(parabola) => [(1, first, &line), (2, second, parabola)],
                None => [(1, if second > 0.0 { of_euler[0] } else { first }, &line), (2, 0.0, &line)],
            };
            for (order, method, expected) in known.into_iter().filter(|(_, method, _)| *method > 0.0) {
                let missed = distance(solution, expected, range.clone(), scale);
                let error = self.past.share(increment, order, method) * missed / rules.error;
                let largest = &mut errors.by_order[order - 1];
                *largest = if error.is_nan() { error } else { largest.max(error) };
            }
        }
        Some(errors)
    }
}

/// True where the scheme integrates a field with second order.
fn has_second_order(scene: &Scene) -> bool {
    scene.system.known.rates.as_ref().is_some_and(|rates| rates.scheme() != Scheme::BackwardEuler)
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
