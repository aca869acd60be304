//! What steps that the run chooses remember of earlier ones: solutions, increments and the sizes of fields; and the error
//! of a step that follows from them. Does not solve anything.

use std::ops::Range;

use super::{
    control::Control,
    past::{Past, distance},
};
use crate::scene::{Auto, Scene};

/// The order of the method: backward Euler.
pub(super) const ORDER: u32 = 1;

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

    /// The estimated error of a solution, relative to the demanded one; `None` where nothing is known of the past.
    pub(super) fn error(&self, scene: &Scene, rules: &Auto, increment: f64, solution: &[f64]) -> Option<f64> {
        let expected = self.past.extrapolated(increment, ORDER as usize)?;
        let size = |range: &Range<usize>| solution[range.clone()].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let fields = ranges(scene, rules).zip(&self.scales).map(|(range, scale)| {
            let scale = scale.max(size(&range));
            (range, scale)
        });
        let missed = distance(solution, &expected, &fields.collect::<Vec<_>>());
        Some(self.past.share(increment) * missed / rules.error)
    }
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
