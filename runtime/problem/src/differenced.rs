//! Values that a scene prescribes over the step variable and that a run differences twice: what the rounding of the step
//! variable makes of the accelerations, and of the reactions that follow from them (W421).
//!
//! A value is a formula of a number of 16 digits. An error of its last digit is divided by the square of an increment, so that
//! a step variable which resolves steps well may leave no digit of an acceleration.
//! Promises: the same on all ranks; a scene whose step variable has digits enough for any motion pays nothing.
//! Does not see formulas of unknowns and of normals.

use wfl::{Code, Condition, Diagnostic};
use wfl_compiler::types::RateForm;
use wfl_discrete::{finite::short, value::Value};

use super::{Builder, Steps, forcing::numbers};

/// What rounding may be of the largest acceleration that is prescribed, as a part of it: a thousandth, which the schemes make
/// some thousandths, is below the error of time that steps have.
const UNSEEN: f64 = 1e-3;
/// Values of the step variable at which a motion is looked at, as a count: many more than the fewest with which a motion is a
/// curve at all.
const LOOKS: usize = 400;
/// Digits by which the step variable is moved to find the slope of a formula, in units of its last one: so many that the
/// rounding of the formula itself does not count, and below a step that W421 is not told of.
const NUDGE: f64 = 16.0;

/// Increments whose ends are rounded by less than this part of them are looked at no further: a motion that is visibly rounded
/// then keeps its velocity for ten million steps.
const COARSE: f64 = 1e-10;

/// A step as a formula sees it: its ends and what comes behind it, and the shorter one of both increments.
struct Look {
    times: [f64; 3],
    increment: f64,
}

impl Look {
    /// The listed steps around a number.
    fn listed(steps: &Steps, k: usize) -> Self {
        let increment = steps.increment(k).abs().min(steps.increment(k + 1).abs());
        Self { times: [steps.values[k - 1], steps.values[k], steps.values[k + 1]], increment }
    }

    /// The first steps of a run that chooses them, and later ones that say how fast a motion is.
    fn chosen(steps: &Steps) -> Vec<Self> {
        let (from, to, h) = (steps.first(), steps.last(), steps.first_increment());
        #[expect(clippy::cast_precision_loss, reason = "a few values")]
        let wide = (to - from) / LOOKS as f64;
        let at = |from: f64, h: f64| Self { times: [from, from + h, from + 2.0 * h], increment: h };
        #[expect(clippy::cast_precision_loss, reason = "a few values")]
        let later = (0..LOOKS - 1).map(|k| at(from + k as f64 * wide, wide));
        std::iter::once(at(from, h)).chain(later).collect()
    }
}

/// Where a motion is looked at.
fn looks(steps: &Steps) -> Vec<Look> {
    let n = steps.values.len();
    match steps.auto {
        Some(_) => Look::chosen(steps),
        None if n < 3 => Vec::new(),
        None => (1..n - 1).step_by(n.div_ceil(LOOKS)).map(|k| Look::listed(steps, k)).collect(),
    }
}

impl Builder<'_> {
    /// W421 where the rounding of the step variable is seen in the accelerations of prescribed values.
    pub(super) fn differenced(&mut self, steps: &Steps) {
        let script = self.script;
        let looks = looks(steps);
        let span = (steps.last() - steps.first()).abs();
        // of a motion whose velocity changes by itself within N steps, rounding is N times this part of the acceleration
        let visible = |look: &Look| spacing(look.times[2]) > COARSE * look.increment;
        if !looks.iter().any(visible) {
            return;
        }
        for fix in &script.fixes {
            let of = |word: &str| self.fields.iter().position(|f| f.name == word);
            let moved = fix.targets.iter().filter_map(|t| of(&t.field.name));
            if !moved.into_iter().any(|k| self.env.rates[k] == RateForm::Second) {
                continue;
            }
            let Some(value) = self.of_positions(&fix.value) else { continue };
            let names: Vec<&str> = fix.places.iter().map(|p| p.name.as_str()).collect();
            let points = if value.law.inputs.is_empty() { vec![[0.0; 3]] } else { self.points(&names) };
            let worst = Motion { value, points }.uncertainty(&looks, span);
            if let Some(worst) = worst.filter(|worst| worst.part > UNSEEN) {
                let d = self.uncertain(fix, steps, &worst);
                self.diagnostics.push(d);
            }
        }
    }

    fn uncertain(&self, fix: &Condition, steps: &Steps, worst: &Worst) -> Diagnostic {
        let name = steps.variable.as_deref().unwrap_or("t");
        let target = fix.targets.first().map_or("", |t| t.field.name.as_str());
        let text = format!(
            "numbers near {:e} lie {:.1e} apart, and this value is differenced twice over steps of {:.1e}",
            worst.time,
            spacing(worst.time),
            worst.increment
        );
        let what = match 100.0 * worst.part {
            percent if percent < 100.0 => format!("uncertain by {percent:.1} % of the largest one"),
            _ => "nothing but rounding in some steps".to_owned(),
        };
        let d = Diagnostic::new(Code::W421, format!("accelerations of `{target}` are {what}: `{name}` is rounded"));
        let help = format!(
            "count `{name}` from where the run begins: {name} = 0 to {}, here and in every formula of `{name}`",
            short(steps.last() - steps.first())
        );
        d.at(fix.value.span, text).help(help)
    }
}

/// How far numbers of this size lie apart.
fn spacing(x: f64) -> f64 {
    x.abs().next_up() - x.abs()
}

/// A prescribed value at its points.
struct Motion {
    value: Value,
    points: Vec<[f64; 3]>,
}

/// Where rounding is the largest part of the largest acceleration.
struct Worst {
    part: f64,
    time: f64,
    increment: f64,
}

impl Motion {
    /// What rounding of the step variable makes of the accelerations, beside the largest one; `None` for what does not move.
    fn uncertainty(&self, looks: &[Look], span: f64) -> Option<Worst> {
        let at = |t: f64| numbers(&self.value, &self.points, t);
        let (mut fastest, mut worst) = (0.0f64, Worst { part: 0.0, time: 0.0, increment: 0.0 });
        let mut ranges: Vec<(f64, f64)> = Vec::new();
        for look in looks {
            let [before, here, behind] = look.times.map(at);
            ranges.resize(here.len(), (f64::INFINITY, f64::NEG_INFINITY));
            let rounded = self.rounded(look.times[1], &here);
            for (c, range) in ranges.iter_mut().enumerate() {
                *range = (range.0.min(here[c]), range.1.max(here[c]));
                let [first, second] = [look.times[1] - look.times[0], look.times[2] - look.times[1]];
                let change = (behind[c] - here[c]) / second - (here[c] - before[c]) / first;
                // of second differences three values are rounded by half of a last digit, the middle one twice
                let noise = 2.0 * rounded[c] / (look.increment * look.increment);
                // which is no acceleration itself, nor is the rounding of the formula
                let of_formula = 4.0 * f64::EPSILON * here[c].abs() / (look.increment * look.increment);
                let resolved = (2.0 * change / (first + second)).abs() - noise - of_formula;
                fastest = fastest.max(if resolved > noise.max(of_formula) { resolved } else { 0.0 });
                if noise > worst.part {
                    worst = Worst { part: noise, time: look.times[1], increment: look.increment };
                }
            }
        }
        let range = ranges.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        // of a motion without an acceleration that is told from rounding, that which would take it as far in the run
        let scale = if fastest > 0.0 { fastest } else { range / (span * span) };
        (scale > 0.0).then(|| Worst { part: worst.part / scale, ..worst })
    }

    /// By how much each number changes where the step variable does by its last digit: to the side where it changes by less,
    /// so that a jump is none.
    fn rounded(&self, time: f64, here: &[f64]) -> Vec<f64> {
        let nudge = NUDGE * spacing(time);
        let beside = [-nudge, nudge].map(|d| numbers(&self.value, &self.points, time + d));
        let change = |c: usize| beside.iter().map(|v| (v[c] - here[c]).abs()).fold(f64::INFINITY, f64::min) / NUDGE;
        (0..here.len()).map(change).map(|x| if x.is_finite() { x } else { 0.0 }).collect()
    }
}
