//! An axis: from numbers to places between 0 and 1, with its ticks.

use crate::text::{minus, power_of_ten};

/// How an axis measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences take equal room.
    #[default]
    Linear,
    /// Equal ratios take equal room; zero and negative numbers have no place.
    Log,
}

/// Part of the largest number below which a range counts as rounding, and the axis as that of one number.
const ROUNDING: f64 = 1e-12;

/// A tick: its place from 0 to 1 and its label, empty for the lines between.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) at: f64,
    pub(crate) label: String,
}

/// An axis with its range. On a logarithmic axis the range is kept in powers of ten.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    /// A step of at least 1: all numbers are whole.
    whole: bool,
    /// Labels are numbers times ten to this power.
    pub(crate) power: i32,
    pub(crate) ticks: Vec<Tick>,
}

/// Where an axis ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ends {
    /// At the lowest and the highest number.
    Tight,
    /// 4 % beyond them.
    Margin,
}

impl Axis {
    /// The axis that shows all these numbers; those that have no place on it are skipped. `ticks` is the number of
    /// labels wanted.
    pub(crate) fn fit(scale: Scale, values: impl Iterator<Item = f64>, ends: Ends, ticks: usize) -> Self {
        let (mut low, mut high, mut whole) = (f64::INFINITY, f64::NEG_INFINITY, true);
        for v in values.filter(|v| has_place(scale, *v)) {
            whole &= v.fract() == 0.0 && v.abs() < 1e5;
            let placed = transform(scale, v);
            (low, high) = (low.min(placed), high.max(placed));
        }
        if low > high {
            (low, high) = (0.0, 1.0); // nothing to show
        }
        match scale {
            Scale::Linear => {
                let mut axis = Axis { whole, ..Self::linear(low, high, ends) };
                axis.linear_ticks(ticks);
                axis
            }
            Scale::Log => {
                let mut axis = Self::log(low, high, ends);
                axis.log_ticks(ticks);
                axis
            }
        }
    }

    fn linear(low: f64, high: f64, ends: Ends) -> Self {
        let largest = low.abs().max(high.abs());
        let (mut low, mut high) = (low, high);
        if half_range(low, high) <= ROUNDING * largest {
            let margin = if largest == 0.0 { 1.0 } else { 0.1 * largest };
            (low, high) = (low - margin, high + margin);
        } else if ends == Ends::Margin {
            let margin = 0.08 * half_range(low, high);
            (low, high) = (low - margin, high + margin);
        }
        (low, high) = (low.max(f64::MIN), high.min(f64::MAX));
        Axis { scale: Scale::Linear, low, high, whole: false, power: 0, ticks: Vec::new() }
    }

    fn linear_ticks(&mut self, wanted: usize) {
        let largest = self.low.abs().max(self.high.abs());
        #[expect(clippy::cast_possible_truncation, reason = "decades of numbers")]
        let decade = largest.log10().floor() as i32;
        self.power = if (-3..5).contains(&decade) { 0 } else { decade };
        // whole powers of ten cannot be had for the smallest numbers, so both are scaled by halves of the power
        let scaled = |x: f64| x * 10f64.powi(-self.power / 2) * 10f64.powi(-self.power + self.power / 2);
        let (low, high) = (scaled(self.low), scaled(self.high));
        #[expect(clippy::cast_precision_loss, reason = "a few ticks")]
        let mut step = nice(2.0 * half_range(low, high) / wanted.max(1) as f64);
        if self.whole && self.power == 0 {
            step = step.max(1.0);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 20")]
        let decimals = (-step.log10().floor()).clamp(0.0, 20.0) as usize;
        #[expect(clippy::cast_possible_truncation, reason = "a range has at most some tens of steps")]
        let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        for k in first..=last {
            #[expect(clippy::cast_precision_loss, reason = "the range is above rounding: k is below 1e13")]
            let value = k as f64 * step;
            let at = (value / 2.0 - low / 2.0) / half_range(low, high);
            let label = if k == 0 { "0".to_owned() } else { minus(&format!("{value:.decimals$}")) };
            self.ticks.push(Tick { at, label });
        }
    }

    fn log(low: f64, high: f64, ends: Ends) -> Self {
        let (mut low, mut high) = (low, high);
        if high - low < 0.3 {
            (low, high) = (low - 0.2, high + 0.2);
        } else if ends == Ends::Margin {
            let margin = 0.04 * (high - low);
            (low, high) = (low - margin, high + margin);
        }
        Axis { scale: Scale::Log, low, high, whole: false, power: 0, ticks: Vec::new() }
    }

    #[expect(clippy::cast_possible_truncation, reason = "decades of numbers")]
    fn log_ticks(&mut self, wanted: usize) {
        let decades = self.high - self.low;
        #[expect(clippy::cast_precision_loss, reason = "a few ticks")]
        let every = (decades / (wanted + 2) as f64).ceil().max(1.0) as i32;
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        let few = decades < 1.8;
        for decade in first..=last {
            for m in 1..10 {
                let place = f64::from(decade) + f64::from(m).log10();
                let at = (place - self.low) / (self.high - self.low);
                if !(-1e-9..=1.0 + 1e-9).contains(&at) || (m > 1 && decades > 5.0) {
                    continue;
                }
                let shown = if m == 1 { decade % every == 0 } else { few && matches!(m, 2 | 5) };
                let label = match (shown, m) {
                    (false, _) => String::new(),
                    (_, 1) => power_of_ten(decade),
                    _ => format!("{m}·{}", power_of_ten(decade)),
                };
                if m > 1 || !label.is_empty() {
                    self.ticks.push(Tick { at, label });
                }
            }
        }
    }

    /// The place of a number, 0 at the low end and 1 at the high one; `None` where it has none.
    pub(crate) fn at(&self, value: f64) -> Option<f64> {
        has_place(self.scale, value)
            .then(|| (transform(self.scale, value) / 2.0 - self.low / 2.0) / half_range(self.low, self.high))
    }

    /// What is written behind the name of the axis, empty if labels are the numbers themselves.
    pub(crate) fn factor(&self) -> String {
        if self.power == 0 { String::new() } else { format!(" × {}", power_of_ten(self.power)) }
    }
}

fn has_place(scale: Scale, value: f64) -> bool {
    value.is_finite() && (scale == Scale::Linear || value > 0.0)
}

fn transform(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Log => value.log10(),
    }
}

/// Half the distance, which cannot overflow.
fn half_range(low: f64, high: f64) -> f64 {
    high / 2.0 - low / 2.0
}

/// The next of 1, 2, 5 times a power of ten that is at least four fifths of `step`: where the next one above would leave
/// half of the labels, there are a quarter more than wanted.
fn nice(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let m = step / power;
    let rounded = if m <= 1.25 {
        1.0
    } else if m <= 2.5 {
        2.0
    } else if m <= 6.25 {
        5.0
    } else {
        10.0
    };
    rounded * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|t| t.label.as_str()).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        let axis = Axis::fit(Scale::Linear, [0.0, 9.5].into_iter(), Ends::Tight, 5);
        assert_eq!(labels(&axis), ["0", "2", "4", "6", "8"]);
        assert_eq!(axis.at(0.0), Some(0.0));
        assert_eq!(axis.at(9.5), Some(1.0));
        let axis = Axis::fit(Scale::Linear, [-0.3, 0.1].into_iter(), Ends::Tight, 4);
        assert_eq!(labels(&axis), ["−0.3", "−0.2", "−0.1", "0", "0.1"]);
    }

    #[test]
    fn a_range_a_little_above_a_round_one_keeps_its_labels() {
        let axis = Axis::fit(Scale::Linear, [0.0, 1.3].into_iter(), Ends::Tight, 6);
        assert_eq!(labels(&axis), ["0", "0.2", "0.4", "0.6", "0.8", "1.0", "1.2"]);
        let axis = Axis::fit(Scale::Linear, [0.0, 108.0].into_iter(), Ends::Tight, 5);
        assert_eq!(labels(&axis), ["0", "20", "40", "60", "80", "100"]);
    }

    #[test]
    fn large_and_small_numbers_share_a_power_of_ten() {
        let axis = Axis::fit(Scale::Linear, [0.0, 7.1e-4].into_iter(), Ends::Tight, 4);
        assert_eq!((axis.power, axis.factor().as_str()), (-4, " × 10⁻⁴"));
        assert_eq!(labels(&axis), ["0", "2", "4", "6"]);
        let axis = Axis::fit(Scale::Linear, [-2e11, 4e11].into_iter(), Ends::Tight, 3);
        assert_eq!(axis.power, 11);
        assert_eq!(labels(&axis), ["−2", "0", "2", "4"]);
    }

    #[test]
    fn decades_are_labelled() {
        let axis = Axis::fit(Scale::Log, [1e-12, 1.0].into_iter(), Ends::Tight, 6);
        assert_eq!(labels(&axis), ["10⁻¹²", "10⁻¹⁰", "10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"]);
        assert!((axis.at(1e-6).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!((axis.at(0.0), axis.at(-1.0), axis.at(f64::NAN)), (None, None, None));
    }

    #[test]
    fn whole_numbers_have_whole_ticks() {
        let axis = Axis::fit(Scale::Linear, [0.0, 2.0].into_iter(), Ends::Tight, 6);
        assert_eq!(labels(&axis), ["0", "1", "2"]);
    }

    #[test]
    fn extreme_ranges_have_places_and_few_ticks() {
        let cases: [&[f64]; 8] = [
            &[-1.7e308, 1.7e308],
            &[0.0, 1e-320],
            &[5e-324, 1e-320],
            &[1.0, 1.0 + 1e-15],
            &[0.0],
            &[],
            &[f64::NAN, f64::INFINITY],
            &[3.0, f64::NAN],
        ];
        for values in cases {
            for scale in [Scale::Linear, Scale::Log] {
                for ends in [Ends::Tight, Ends::Margin] {
                    let axis = Axis::fit(scale, values.iter().copied(), ends, 5);
                    assert!(axis.ticks.len() < 60, "{values:?} {scale:?}: {}", axis.ticks.len());
                    assert!(axis.ticks.iter().all(|t| t.at.is_finite()), "{values:?} {scale:?} {:?}", axis.ticks);
                    for v in values.iter().filter(|v| has_place(scale, **v)) {
                        let at = axis.at(*v).unwrap();
                        assert!((-1e-9..=1.0 + 1e-9).contains(&at), "{values:?} {scale:?}: {v:e} at {at}");
                    }
                }
            }
        }
    }
}
