//! The increments of steps that the run chooses: a rule of numbers alone, without fields.
//!
//! An increment h with the estimated error e, relative to the demanded one, is followed by h 0.9 e^(-1/(p+1)), where p is
//! the order of the method (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4, equation 4.13); where
//! fields are integrated by methods of different orders, by the smallest of these.
//! Promises: increments lie between `least` and `most`, except for one that ends at a value to be met; such values are met
//! exactly, and the two increments before one are equal. Does not know why an attempt came to nothing.

use crate::scene::Auto;

/// Part of the increment with the demanded error that is tried: estimates have errors of their own.
const SAFETY: f64 = 0.9;
/// Largest growth of an increment: two-step formulas with variable increments are stable below 1 + sqrt(2).
const GROWTH: f64 = 2.0;
/// An increment that could grow by less is kept where the matrix of the linear terms depends on it.
const WORTHWHILE: f64 = 1.2;
/// Smallest factor after an accepted step, and after a rejected one.
const SHRINK: f64 = 0.2;
/// The factor after an attempt without a solution.
const FAILED: f64 = 0.25;
/// Values of the step variable closer than this part of an increment are one.
const SAME: f64 = 1e-9;
/// Smallest increment in units of the rounding of the step variable.
const ROUNDING: f64 = 16.0;

/// Estimated errors of a step, relative to the demanded one: the largest over what is integrated with each order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    /// Of order 1 and of order 2; 0 where nothing has that order.
    pub(super) by_order: [f64; 2],
}

impl Errors {
    /// The largest of them; no number where one is no number.
    pub(super) fn largest(&self) -> f64 {
        let [first, second] = self.by_order;
        if first.is_nan() || first > second { first } else { second }
    }

    /// What the increment is multiplied by for the demanded error.
    fn factor(&self) -> f64 {
        let [first, second] = self.by_order;
        factor(first, 1).min(factor(second, 2))
    }
}

/// What is known of the increments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Control {
    /// The increment that is tried next, where nothing else limits it.
    pub(super) next: f64,
    /// The last attempt came to nothing: the increment behind the next one does not grow.
    pub(super) failed: bool,
}

impl Control {
    pub(super) fn new(rules: &Auto) -> Self {
        Self { next: rules.first, failed: false }
    }

    /// The smallest increment at a value of the step variable.
    pub(super) fn least(rules: &Auto, at: f64) -> f64 {
        rules.least.max(ROUNDING * f64::EPSILON * at.abs())
    }

    /// True for an increment that is not to be made smaller: differences of the step variable are rounded.
    pub(super) fn is_least(rules: &Auto, at: f64, increment: f64) -> bool {
        increment <= (1.0 + 2.0 / ROUNDING) * Self::least(rules, at)
    }

    /// Where the next attempt ends: at most at `stop`.
    pub(super) fn aim(&self, rules: &Auto, at: f64, stop: f64, limit: f64) -> f64 {
        let limited = self.next.min(rules.most).min(limit);
        let increment = limited.max(Self::least(rules, at));
        let left = stop - at;
        if increment >= left * (1.0 - SAME) {
            return stop;
        }
        at + if 2.0 * increment > left { 0.5 * left } else { increment }
    }

    /// After a step of an increment with relative errors; `None` where none is known. `keeps` says that a matrix can be
    /// used again if the increment is kept.
    pub(super) fn accept(&mut self, increment: f64, errors: Option<Errors>, keeps: bool) {
        let planned = self.next;
        let free = errors.map_or(1.0, |e| e.factor());
        let most = if self.failed { 1.0 } else { GROWTH };
        let free = if keeps && (1.0..WORTHWHILE).contains(&free) { 1.0 } else { free };
        self.next = increment * free.clamp(SHRINK, most);
        // one that a value to be met has shortened says nothing against a longer one
        if increment < planned && increment * free >= planned {
            self.next = self.next.max(planned);
        }
        self.failed = false;
    }

    /// After a step whose error is too large.
    pub(super) fn reject(&mut self, increment: f64, errors: Errors) {
        self.next = increment * errors.factor().clamp(SHRINK, SAFETY);
        self.failed = true;
    }

    /// After an attempt without a solution.
    pub(super) fn fail(&mut self, increment: f64) {
        self.next = FAILED * increment;
        self.failed = true;
    }
}

fn factor(error: f64, order: u32) -> f64 {
    if error.is_nan() {
        SHRINK
    } else if error > 0.0 {
        SAFETY * error.powf(-1.0 / (f64::from(order) + 1.0))
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(first: f64, least: f64, most: f64) -> Auto {
        Auto { first, error: 1e-3, least, most, limit: None, fields: Vec::new() }
    }

    fn of_first(error: f64) -> Errors {
        Errors { by_order: [error, 0.0] }
    }

    /// The ends of the steps of a rule whose error is `error(h)`.
    fn ends(rules: &Auto, stop: f64, error: impl Fn(f64) -> f64) -> Vec<f64> {
        let (mut control, mut at, mut out) = (Control::new(rules), 0.0, Vec::new());
        while at < stop {
            let to = control.aim(rules, at, stop, f64::INFINITY);
            let (h, e) = (to - at, error(to - at));
            if e > 1.0 {
                control.reject(h, of_first(e));
                continue;
            }
            control.accept(h, Some(of_first(e)), true);
            at = to;
            out.push(at);
        }
        out
    }

    #[test]
    fn the_end_is_met_exactly_by_two_equal_increments() {
        let found = ends(&rules(0.1, 1e-9, 0.3), 1.0, |_| 0.9);
        assert_eq!(*found.last().unwrap(), 1.0);
        let n = found.len();
        let last = [found[n - 1] - found[n - 2], found[n - 2] - found[n - 3]];
        assert!((last[0] - last[1]).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn increments_grow_to_the_one_with_the_demanded_error() {
        // e = (h/0.01)^2 is 1 at 0.01, and 0.81 where the rule settles
        let found = ends(&rules(1e-6, 1e-9, 1.0), 1.0, |h| (h / 0.01).powi(2));
        let steady = found[found.len() / 2] - found[found.len() / 2 - 1];
        assert!((0.009 / WORTHWHILE..=0.01).contains(&steady), "{steady}");
        assert!(found.windows(2).all(|w| w[1] - w[0] <= 0.01));
    }

    #[test]
    fn small_growth_is_left_where_it_would_cost_a_matrix() {
        let rules = rules(1.0, 1e-9, 10.0);
        // the error allows 0.9/sqrt(0.7) = 1.08 times the increment
        let next = |keeps: bool| {
            let mut control = Control::new(&rules);
            control.accept(1.0, Some(of_first(0.7)), keeps);
            control.next
        };
        assert!(next(true) == 1.0 && (next(false) - SAFETY / 0.7f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_limit_and_the_bounds_hold() {
        let rules = rules(0.1, 0.01, 0.2);
        let control = Control::new(&rules);
        assert_eq!(control.aim(&rules, 0.0, 10.0, 0.05), 0.05);
        assert_eq!(control.aim(&rules, 0.0, 10.0, 1e-5), 0.01);
        assert_eq!(Control { next: 5.0, failed: false }.aim(&rules, 0.0, 10.0, f64::INFINITY), 0.2);
    }

    #[test]
    fn each_order_has_its_power_and_the_smaller_increment_counts() {
        let rules = rules(1.0, 1e-9, 10.0);
        let next = |by_order: [f64; 2]| {
            let mut control = Control::new(&rules);
            control.reject(1.0, Errors { by_order });
            control.next
        };
        assert!((next([4.0, 0.0]) - 0.45).abs() < 1e-15 && (next([0.0, 8.0]) - 0.45).abs() < 1e-15);
        assert!((next([4.0, 1.0]) - 0.45).abs() < 1e-15 && (next([1.0, 8.0]) - 0.45).abs() < 1e-15);
        assert_eq!((next([f64::NAN, 0.0]), next([0.0, f64::INFINITY])), (SHRINK, SHRINK));
        assert!(Errors { by_order: [f64::NAN, 1.0] }.largest().is_nan());
        assert!(Errors { by_order: [1.0, f64::NAN] }.largest().is_nan());
    }

    #[test]
    fn nothing_grows_behind_a_failure_and_a_shortened_step_keeps_the_plan() {
        let rules = rules(0.1, 1e-9, 10.0);
        let mut control = Control::new(&rules);
        control.fail(0.1);
        assert_eq!(control.next, 0.025);
        control.accept(0.025, Some(of_first(1e-9)), true);
        assert_eq!(control.next, 0.025);
        control.accept(0.025, Some(of_first(1e-9)), true);
        assert_eq!(control.next, 0.05);
        control.accept(0.001, Some(of_first(1e-9)), true);
        assert_eq!(control.next, 0.05);
    }

    #[test]
    fn the_smallest_increment_is_known_as_such_behind_its_rounding() {
        for at in [0.0, 71.091_175_007_851_8, 1e5, 3e10] {
            let rules = rules(1e-9, 1e-7, 1.0);
            let to = Control::new(&rules).aim(&rules, at, 2e11, f64::INFINITY);
            assert!(to > at && Control::is_least(&rules, at, to - at), "{at}");
            assert!(!Control::is_least(&rules, at, 2.0 * (to - at)), "{at}");
        }
    }

    #[test]
    fn an_increment_is_not_lost_in_the_rounding_of_the_step_variable() {
        let rules = rules(1e-6, 1e-6, 1.0);
        let at = 1e11;
        assert!(Control::new(&rules).aim(&rules, at, 2e11, f64::INFINITY) > at);
    }
}
