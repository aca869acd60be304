//! Formulas of the step variable that go elsewhere between two listed steps and are back at their ends: nothing of a run sees
//! them (W425).
//!
//! A state without a memory follows from the values at its step. One with rates, states or values of the previous step depends
//! on what happened between. Formulas are sampled between listed steps on a grid that is no multiple of anything, and around the
//! zeros of the sums and comparisons in them.
//! Promises: the same on all ranks; a scene without a memory, or without such formulas, pays nothing; work is bounded
//! ([`MOST`]). Does not see what depends on unknowns, and what changes in one direction within a step.

use std::collections::BTreeMap;

use wfl::{Code, Diagnostic, ast::Expr};
use wfl_discrete::finite::short;

use super::{
    Builder, Steps,
    forcing::{Formula, changes, each_driving, numbers},
};

/// What a formula may go beyond its values at both ends of a step, as a part of its range: a sine does so by less if there
/// are three steps in a period.
const BEYOND: f64 = 0.25;
/// Steps that are looked at everywhere (number); of more some.
const STEPS: usize = 256;
/// Values of the step variable at which a formula is looked at on the grid (number): about so many.
const GRID: usize = 1024;
/// Values of the step variable at which a formula is looked at, at most (number).
const MOST: usize = 8000;
/// The golden ratio: its multiples meet those of no period.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Where a formula goes farthest beyond its values at the ends of a step.
struct Overlooked {
    /// The number of the step.
    step: usize,
    /// Where, between its ends.
    time: f64,
    /// The values at both ends, and there.
    values: [f64; 3],
    /// By how much it goes beyond, as a part of its range.
    share: f64,
}

impl Builder<'_> {
    /// W425 for each formula whose values between listed steps are overlooked.
    pub(super) fn overlooked(&mut self, steps: &Steps) {
        let Some(variable) = self.env.step_variable.filter(|_| steps.auto.is_none()) else { return };
        let increases = steps.values.windows(2).all(|t| t[0] < t[1]);
        if steps.values.len() < 2 || !increases || !(steps.from_start || self.has_memory()) {
            return;
        }
        let mut formulas = Vec::new();
        each_driving(self.script, &mut |e, places| self.collect(e, variable, places, &mut formulas));
        let mut told = Vec::new();
        for mut formula in formulas {
            let Some(worst) = formula.overlooked(steps).filter(|worst| worst.share > BEYOND) else { continue };
            let at = formula.written.span;
            if !told.contains(&at) {
                told.push(at);
                let d = self.is_overlooked(&formula.written, &worst, steps);
                self.diagnostics.push(d);
            }
        }
    }

    fn is_overlooked(&self, written: &Expr, worst: &Overlooked, steps: &Steps) -> Diagnostic {
        let name = steps.variable.as_deref().unwrap_or("t");
        let [from, to] = [worst.step - 1, worst.step].map(|k| short(steps.values[k]));
        let [first, last, there] = worst.values.map(short);
        let message = format!("no step sees what this is between {name} = {from} and {name} = {to}");
        let text = format!("{first} and {last} at these steps, {there} at {name} = {}", short(worst.time));
        let help = "take smaller steps, or let the run choose them (`by auto`), which passes over no formula";
        wfl::at_expr(Diagnostic::new(Code::W425, message), written, self.env.expansions, text).help(help)
    }
}

impl Formula {
    /// Where it goes farthest beyond its values at the ends of a step; `None` for one that stays.
    fn overlooked(&mut self, steps: &Steps) -> Option<Overlooked> {
        let listed = &steps.values;
        let inside = self.inside(listed);
        let at = |t: f64| Some(numbers(&self.value, &self.points, t)).filter(|v| v.iter().all(|x| x.is_finite()));
        let mut looks = Vec::new();
        for (step, times) in &inside {
            let Some([first, last]) = at(listed[step - 1]).zip(at(listed[*step])).map(|(a, b)| [a, b]) else {
                continue;
            };
            let between = times.iter().filter_map(|t| Some((*t, at(*t)?))).collect::<Vec<_>>();
            looks.push((*step, [first, last], between));
        }
        // a component in one size at all points: where it is small beside the others it counts as none
        let n = self.value.n_components();
        let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); looks.first()?.1[0].len()];
        let mut widen = |values: &[f64]| {
            ranges.iter_mut().zip(values).for_each(|(range, x)| *range = (range.0.min(*x), range.1.max(*x)));
        };
        for (_, ends, between) in &looks {
            ends.iter().for_each(|values| widen(values));
            between.iter().for_each(|(_, values)| widen(values));
        }
        let size = |c: usize| {
            let own = ranges.iter().skip(c).step_by(n).filter(|range| changes(**range));
            own.map(|(low, high)| high - low).fold(0.0, f64::max)
        };
        let sizes: Vec<f64> = (0..n).map(size).collect();
        let mut worst: Option<Overlooked> = None;
        for (step, [first, last], between) in &looks {
            for (time, values) in between {
                for (c, x) in values.iter().enumerate().filter(|(c, _)| sizes[c % n] > 0.0) {
                    let [low, high] = [first[c].min(last[c]), first[c].max(last[c])];
                    let share = (x - high).max(low - x) / sizes[c % n];
                    if worst.as_ref().is_none_or(|worst| share > worst.share) {
                        let values = [first[c], last[c], *x];
                        worst = Some(Overlooked { step: *step, time: *time, values, share });
                    }
                }
            }
        }
        worst
    }

    /// By step values of the step variable between its ends.
    fn inside(&mut self, listed: &[f64]) -> BTreeMap<usize, Vec<f64>> {
        let (first, last) = (listed[0], listed[listed.len() - 1]);
        let mut inside: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        let mut add = |t: f64| {
            let step = listed.partition_point(|end| *end < t);
            if step > 0 && step < listed.len() && t > listed[step - 1] && t < listed[step] {
                inside.entry(step).or_default().push(t);
            }
        };
        let steps = listed.len() - 1;
        let parts = (GRID / steps).clamp(4, 128);
        for step in (1..=steps).step_by(steps.div_ceil(STEPS)) {
            for part in 0..parts {
                #[expect(clippy::cast_precision_loss, reason = "a few parts")]
                let (part, parts, turn) = (part as f64, parts as f64, (part * step) as f64 * GOLDEN);
                let at = (part + 0.2 + 0.6 * turn.fract()) / parts;
                add(listed[step - 1] + at * (listed[step] - listed[step - 1]));
            }
        }
        let zeros = self.zeros(first, last);
        let decades = [0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7];
        let beside = decades.iter().flat_map(|d| [1.0, 0.5, 0.2].map(|part| part * d * (last - first)));
        let beside: Vec<f64> = beside.collect();
        let most = (MOST - GRID) / (2 * beside.len() + 1);
        for zero in zeros.iter().step_by(zeros.len().div_ceil(most).max(1)) {
            add(*zero);
            beside.iter().flat_map(|d| [zero - d, zero + d]).for_each(&mut add);
        }
        inside
    }
}
