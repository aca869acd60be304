//! Whether rates of fields without inertia change their sign from step to step: what a rule without damping keeps of a sudden load; and
//! whether measures go up and down with every step, as reactions and accelerations of a motion that is right do.
//!
//! The trapezoidal rule and its like follow a rate from the change and the rate before, r = 2 (x - x_n)/h - r_n. Of what decays within a
//! step nearly all is left, with the other sign. A motion in time that changes its sign in every step is no solution, however the steps are
//! chosen. Known are the rates at the end of each step; nothing is evaluated.
//!
//! Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, IV.3: the trapezoidal rule is A-stable and not L-stable.

use wfl::{Code, Diagnostic};
use wfl_compiler::types::RateForm;
use wfl_discrete::system::System;
use wfl_problem::{Measure, Scene};

use super::{StepResult, ended::Ended};

/// Steps in a row whose rates have the other sign: a motion that is resolved has several steps between two changes.
const STEPS: usize = 4;
/// The part of its size that a rate keeps from step to step, with the other sign, while it is said to alternate: rules that damp a little
/// (`rho_inf` of 0.8) leave as much.
const KEPT: f64 = 0.6;
/// The part of its largest change since the run began by which the rate changes a field in a step: less is nothing that one would see. A
/// temperature of 20 degrees is one of 293 kelvins: values say nothing of what would be seen.
const SEEN: f64 = 1e-4;
/// A change in a step of less than so many roundings of the values is rounding.
const ROUNDED: f64 = 16.0;

/// Steps in a row with which a measure goes up and down, and the part of all steps: what contact makes it do ends sooner, and what a
/// rule damps is over after some tens.
const TURNS: usize = 8;
const LASTS: usize = 10;
/// The part of its largest value by which a measure goes up and down, to either side of what is between: one sees it in a plot, and has a digit
/// less than steps of a hundredth of the motion give.
const SEEN_OF_MEASURES: f64 = 1e-2;

/// The rates of the last step, and what was found.
#[derive(Clone, Debug, Default)]
pub(super) struct Ringing {
    fields: Vec<OfField>,
}

#[derive(Clone, Debug)]
struct OfField {
    field: usize,
    rate: Vec<f64>,
    /// The values at the beginning of the first step, and the square of the largest change since then.
    start: Vec<f64>,
    changed: f64,
    in_a_row: usize,
}

impl Ringing {
    /// The fields whose rates have changed their sign in so many steps at the end `u` of this one.
    pub(super) fn look(&mut self, system: &System, u: &[f64]) -> Vec<usize> {
        let mut found = Vec::new();
        let Some(rates) = system.rates().filter(|rates| rates.scheme().keeps_errors_of_given()) else { return found };
        let Some(past) = system.past() else { return found };
        let is_first = |form: RateForm| form == RateForm::First;
        if !rates.fields().iter().any(|of| is_first(of.form)) {
            return found;
        }
        let increment = system.step().increment;
        let [first, _] = rates.ended(u, &past.unknowns);
        for of in rates.fields().iter().filter(|of| is_first(of.form)) {
            let now = &first[of.dofs.clone()];
            let Some(before) = self.fields.iter_mut().find(|before| before.field == of.field) else {
                let start = past.unknowns[of.dofs.clone()].to_vec();
                self.fields.push(OfField { field: of.field, rate: now.to_vec(), start, changed: 0.0, in_a_row: 0 });
                continue;
            };
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let values = &u[of.dofs.clone()];
            let change: Vec<f64> = values.iter().zip(&before.start).map(|(value, start)| value - start).collect();
            let mut sums =
                [dot(now, &before.rate), dot(&before.rate, &before.rate), dot(&change, &change), dot(values, values)];
            system.team().sum(&mut sums);
            let [along, old, changed, value] = sums;
            before.changed = before.changed.max(changed);
            let rounding = (ROUNDED * f64::EPSILON).powi(2) * value;
            let least = (SEEN * SEEN * before.changed).max(rounding);
            let alternates = along < -KEPT * old && increment * increment * old > least;
            before.in_a_row = if alternates { before.in_a_row + 1 } else { 0 };
            before.rate.copy_from_slice(now);
            if before.in_a_row == STEPS {
                found.push(of.field);
            }
        }
        found
    }
}

/// W652 for a field.
pub(super) fn told(scene: &Scene, field: usize, time: f64) -> Diagnostic {
    let name = &scene.system.fields[field].name;
    let text = format!("at t = {time} the rate of `{name}` has changed its sign in {STEPS} steps in a row");
    Diagnostic::new(Code::W652, text)
        .note(
            "this scheme keeps what decays within a step for ever, with changing sign: values oscillate around the solution, and \
             flows are those of the oscillation",
        )
        .help("scheme bdf2 or backward_euler; or steps that begin much smaller")
}

/// W652 for the measures of a run that go up and down with every step.
pub(super) fn measures_told(run: &Ended<'_>) -> Vec<Diagnostic> {
    let Ended { scene, run, .. } = run;
    let rates = scene.system.rates().filter(|rates| rates.scheme().keeps_errors_of_given());
    let series = |measure: &Measure| -> Vec<(f64, f64)> {
        let value = |step: &StepResult| step.measures.iter().find(|(name, _)| *name == measure.name).map(|m| m.1);
        run.steps.iter().filter_map(|step| Some((step.window.end, value(step)?))).collect()
    };
    // of a force that is zero what alternates is rounding, which such a rule keeps as it keeps all else
    let is_seen = |measure: &Measure, found: &Alternation| found.size > ROUNDED * run.rounding_of(scene, measure);
    let of = |measure: &'_ Measure| alternates(&series(measure)).filter(|found| is_seen(measure, found));
    let found = rates.and_then(|_| scene.measures.iter().find_map(|measure| Some((measure, of(measure)?))));
    let told = |(measure, Alternation { time, size, largest }): (&Measure, Alternation)| {
        let size = size / largest;
        let text = format!(
            "`{}` goes up and down with every step, by {size:.1e} of its largest value to either side at t = {time}",
            measure.name
        );
        Diagnostic::new(Code::W652, text)
            .at(measure.span, "it is that of an oscillation which the steps do not resolve")
            .note(
                "this scheme damps nothing that oscillates within a step: a stiff body that is moved has accelerations, and forces that follow \
                 from them, to either side of the right ones, while its motion is right",
            )
            .help("scheme bdf2, or generalised_alpha with a small rho_inf; the mean of two steps is much nearer")
    };
    found.map(told).into_iter().collect()
}

/// A measure that has gone up and down with enough steps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Alternation {
    time: f64,
    /// To either side, and the largest value.
    size: f64,
    largest: f64,
}

/// Whether a measure, by time, has gone up and down with enough steps.
fn alternates(series: &[(f64, f64)]) -> Option<Alternation> {
    let largest = series.iter().fold(0.0f64, |most, (_, value)| most.max(value.abs()));
    let enough = TURNS.max(series.len() / LASTS);
    // a quarter of the second difference is what alternates beside a line
    let bends = series.windows(3).map(|w| (w[2].0, 0.25 * (w[0].1 - 2.0 * w[1].1 + w[2].1)));
    let (mut in_a_row, mut before) = (0, 0.0f64);
    for (time, bend) in bends {
        let goes_on = bend * before < -KEPT * before * before && bend.abs() > SEEN_OF_MEASURES * largest;
        (in_a_row, before) = (if goes_on { in_a_row + 1 } else { 0 }, bend);
        if in_a_row == enough {
            return Some(Alternation { time, size: bend.abs(), largest });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(n: u32, value: impl Fn(f64, f64) -> f64) -> Option<f64> {
        let sign = |k: u32| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let series: Vec<(f64, f64)> = (0..n).map(|k| (f64::from(k), value(f64::from(k), sign(k)))).collect();
        alternates(&series).map(|found| found.size / found.largest)
    }

    #[test]
    fn what_alternates_beside_a_motion_is_told_with_its_part() {
        let part = told(40, |k, sign| (0.1 * k).sin() + 0.06 * sign).expect("it alternates");
        assert!((part - 0.06).abs() < 0.01, "{part}");
        assert_eq!(told(40, |k, sign| 5.0 * k + sign), None, "less than a hundredth");
        assert_eq!(told(40, |k, _| (0.8 * k).sin()), None, "a motion of eight steps");
    }

    #[test]
    fn what_a_rule_damps_is_not_told() {
        assert!(told(20, |k, sign| 1.0 + 0.9f64.powf(k) * sign).is_some(), "it lasts for half of the run");
        assert_eq!(told(600, |k, sign| 1.0 + 0.9f64.powf(k) * sign), None);
        assert!(told(600, |_, sign| 1.0 + 0.02 * sign).is_some());
    }
}
