//! Whether rates of fields without inertia change their sign from step to step: what a rule without damping keeps of a sudden load.
//!
//! The trapezoidal rule and its like follow a rate from the change and the rate before, r = 2 (x - x_n)/h - r_n. Of what decays within a
//! step nearly all is left, with the other sign. A motion in time that changes its sign in every step is no solution, however the steps are
//! chosen. Known are the rates at the end of each step; nothing is evaluated.
//!
//! Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, IV.3: the trapezoidal rule is A-stable and not L-stable.

use wfl::{Code, Diagnostic};
use wfl_compiler::types::RateForm;
use wfl_discrete::system::System;
use wfl_problem::Scene;

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
