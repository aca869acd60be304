//! The increments of steps that the run chooses: a rule of numbers alone, without fields.
//!
//! An increment h with the estimated error e, relative to the demanded one, allows r = 0.9 e^(-1/(p+1)) times itself, where
//! p is the order of the method (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4, equation 4.13);
//! where fields are integrated by methods of different orders, the smallest of these. The next one is that of the digital
//! filter H211b with b = 4 (Soederlind, Digital filters in adaptive time-stepping, ACM Transactions on Mathematical Software
//! 29 (2003) 1-26): h (r R)^(1/4) (h/H)^(-1/4) with R and H of the step before. Errors go up and down where a front passes
//! from node to node; the rule without a filter follows that, and tries many steps that are too long. Where a matrix can be
//! used again if the increment is kept, increments change seldom, and the next one is h r.
//!
//! Of the orders that a step can have that one is taken which allows the longest next step.
//! Promises: increments lie between `least` and `most`, except for one that ends at a value to be met; such values are met
//! exactly, and the two increments before one are equal. Does not know why an attempt came to nothing.

use wfl_discrete::rates::MOST_ORDER;
use wfl_problem::Auto;

/// Part of the increment with the demanded error that is tried: estimates have errors of their own.
const SAFETY: f64 = 0.9;
/// Largest growth of an increment by the order of the next step: backward differentiation with variable increments is stable
/// below 1 + sqrt(2) = 2.414 with order 2 and below (1 + sqrt(5))/2 = 1.618 with order 3 (Calvo, Grande, Grigorieff, On the
/// zero stability of the variable order variable stepsize BDF-formulas, Numerische Mathematik 57 (1990) 39-50).
const GROWTH: [f64; MOST_ORDER] = [2.0, 2.0, 1.5];
/// The exponent of the filter.
const FILTER: f64 = 0.25;
/// What the filter hears at most of one step: the allowed increment in units of the present one, and its inverse.
const HEARD: f64 = 100.0;
/// An increment that could grow by less is kept where the matrix of the linear terms depends on it; so is the order.
const WORTHWHILE: f64 = 1.2;
/// Smallest factor after an accepted step, and after a rejected one.
const SHRINK: f64 = 0.2;
/// The factor after an attempt without a solution.
const FAILED: f64 = 0.25;
/// Values of the step variable closer than this part of an increment are one.
const SAME: f64 = 1e-9;
/// Smallest increment in units of the rounding of the step variable.
const ROUNDING: f64 = 16.0;

/// Estimated errors of a step, relative to the demanded one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    /// The largest over what is integrated with each order from 1, whatever the run chooses; 0 where nothing is.
    pub(super) by_order: [f64; 2],
    /// Of what the run has a choice of orders for.
    pub(super) chosen: Option<Chosen>,
}

/// Errors of fields whose order the run chooses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chosen {
    /// The order of the step.
    pub(super) order: u32,
    /// With an order less, with that of the step and with one more; `None` where it is not to be had.
    pub(super) around: [Option<f64>; 3],
}

/// What became of the step before: behind one that was rejected the order does not rise.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Tried {
    Accepted,
    Rejected,
}

/// The matrix of a step that keeps its increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Matrix {
    /// That of the step before, with its factor.
    Kept,
    New,
}

impl Errors {
    /// The largest of those of the step; no number where one is no number.
    pub(super) fn largest(&self) -> f64 {
        let of_step = self.chosen.and_then(|c| c.around[1]).unwrap_or(0.0);
        self.by_order.iter().fold(of_step, |most, e| if most.is_nan() || most > *e { most } else { *e })
    }

    /// Takes another error, of what is integrated with this order.
    pub(super) fn count(&mut self, error: f64, order: usize) {
        let largest = &mut self.by_order[order - 1];
        *largest = if largest.is_nan() || *largest > error { *largest } else { error };
    }

    /// The order of the next step, that which allows the longest one, and what the increment may be multiplied by for the
    /// demanded error. Zero-stability limits the growth of increments by the order: that counts in the choice alone.
    fn next(&self, order: u32, behind: Tried) -> (u32, f64) {
        let fixed = factor(self.by_order[0], 1).min(factor(self.by_order[1], 2));
        let Some(Chosen { order, around }) = self.chosen else { return (order, fixed) };
        let [lower, same, higher] = around;
        let found = [(order, same), (order - 1, lower), (order + 1, higher.filter(|_| behind == Tried::Accepted))];
        let found = found.into_iter().filter_map(|(order, error)| Some((order, factor(error?, order).min(fixed))));
        let limited = |found: (u32, f64)| found.1.min(GROWTH[found.0 as usize - 1]);
        let better = |f: (u32, f64), best: (u32, f64)| limited(f) > WORTHWHILE * limited(best);
        found.reduce(|best, f| if better(f, best) { f } else { best }).unwrap_or((order, fixed))
    }
}

/// What is known of the increments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Control {
    /// The increment that is tried next, where nothing else limits it.
    pub(super) next: f64,
    /// The order of the next step, where that is to be chosen.
    pub(super) order: u32,
    /// Of the last step what its error allowed, in units of its increment, and that increment; zero before the first step.
    pub(super) last: [f64; 2],
    /// The last attempt came to nothing: the increment behind the next one does not grow.
    pub(super) failed: bool,
}

impl Control {
    pub(super) fn new(rules: &Auto) -> Self {
        Self { next: rules.first, order: 2, last: [1.0, 0.0], failed: false }
    }

    /// Errors before say nothing of the steps that follow, which begin with the first increment.
    pub(super) fn turn(&mut self, rules: &Auto) {
        let Self { next, failed, .. } = *self;
        *self = Self { next: next.min(rules.first), failed, ..Self::new(rules) };
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

    /// After a step of an increment with relative errors; `None` where none is known.
    pub(super) fn accept(&mut self, increment: f64, errors: Option<Errors>, matrix: Matrix) {
        let keeps = matrix == Matrix::Kept;
        let planned = self.next;
        let (order, allowed) = errors.map_or((self.order, 1.0), |e| e.next(self.order, Tried::Accepted));
        let most = if self.failed { 1.0 } else { GROWTH[order as usize - 1] };
        let free = if errors.is_some() && !keeps { self.filtered(increment, allowed) } else { allowed };
        let free = if keeps && order == self.order && (1.0..WORTHWHILE).contains(&free) { 1.0 } else { free };
        self.order = order;
        self.next = increment * free.clamp(SHRINK, most);
        self.last = [allowed.clamp(1.0 / HEARD, HEARD), increment];
        // one that a value to be met has shortened says nothing against a longer one
        if increment < planned && increment * allowed >= planned {
            self.next = self.next.max(planned);
        }
        self.failed = false;
    }

    /// What a step of this increment, which allows so many times itself, is followed by in units of it.
    fn filtered(&self, increment: f64, allowed: f64) -> f64 {
        let [before, last] = self.last;
        if last > 0.0 { (allowed.clamp(1.0 / HEARD, HEARD) * before * last / increment).powf(FILTER) } else { allowed }
    }

    /// After a step whose error is too large.
    pub(super) fn reject(&mut self, increment: f64, errors: Errors) {
        let (order, factor) = errors.next(self.order, Tried::Rejected);
        self.order = order;
        self.next = increment * factor.clamp(SHRINK, SAFETY);
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
        Errors { by_order: [error, 0.0], chosen: None }
    }

    fn of_choice(order: u32, around: [Option<f64>; 3]) -> Errors {
        Errors { by_order: [0.0; 2], chosen: Some(Chosen { order, around }) }
    }

    #[test]
    fn the_order_is_that_which_allows_the_longest_next_step() {
        let rules = rules(1.0, 1e-9, 10.0);
        let after = |order: u32, around: [Option<f64>; 3], rejects: bool| {
            let mut control = Control { order, ..Control::new(&rules) };
            if rejects {
                control.reject(1.0, of_choice(order, around));
            } else {
                control.accept(1.0, Some(of_choice(order, around)), Matrix::New);
            }
            (control.order, control.next)
        };
        // 0.9 e^(-1/3) and 0.9 e^(-1/4): order 3 allows more, but little more
        assert_eq!(after(2, [None, Some(0.5), Some(0.3)], false).0, 2);
        assert_eq!(after(2, [None, Some(0.5), Some(0.1)], false), (3, (0.9 * 0.1f64.powf(-0.25)).min(1.5)));
        // a step that was rejected is made again with no higher order
        assert_eq!(after(2, [None, Some(8.0), Some(1e-3)], true), (2, 0.45));
        assert_eq!(after(3, [Some(1.2), Some(50.0), None], true).0, 2);
        // where steps double the order is two: three allows a growth of one half
        assert_eq!(after(3, [Some(1e-9), Some(1e-9), None], false), (2, 2.0));
        assert_eq!(after(2, [None, Some(1e-9), Some(1e-12)], false), (2, 2.0));
    }

    #[test]
    fn errors_that_go_up_and_down_move_increments_less_through_the_filter() {
        let rules = rules(1.0, 1e-9, 10.0);
        // what one passage of a front does to the error of equal steps
        let error = |k: u32, h: f64| h.powi(4) * if k % 4 < 2 { 0.6 } else { 1.3 };
        let spread = |matrix: Matrix| {
            let (mut control, mut all) = (Control { order: 3, ..Control::new(&rules) }, Vec::new());
            for k in 0..200 {
                let h = control.next;
                control.accept(h, Some(of_choice(3, [None, Some(error(k, h)), None])), matrix);
                all.push(h);
            }
            let (low, high) = all[100..].iter().fold((f64::MAX, 0.0f64), |m, h| (m.0.min(*h), m.1.max(*h)));
            high / low
        };
        let (new, kept) = (spread(Matrix::New), spread(Matrix::Kept));
        assert!(new < 1.1 && kept > 1.15, "{new} {kept}");
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
            control.accept(h, Some(of_first(e)), Matrix::Kept);
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
        let next = |matrix: Matrix| {
            let mut control = Control::new(&rules);
            control.accept(1.0, Some(of_first(0.7)), matrix);
            control.next
        };
        assert!(next(Matrix::Kept) == 1.0 && (next(Matrix::New) - SAFETY / 0.7f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_limit_and_the_bounds_hold() {
        let rules = rules(0.1, 0.01, 0.2);
        let control = Control::new(&rules);
        assert_eq!(control.aim(&rules, 0.0, 10.0, 0.05), 0.05);
        assert_eq!(control.aim(&rules, 0.0, 10.0, 1e-5), 0.01);
        assert_eq!(Control { next: 5.0, ..Control::new(&rules) }.aim(&rules, 0.0, 10.0, f64::INFINITY), 0.2);
    }

    #[test]
    fn each_order_has_its_power_and_the_smaller_increment_counts() {
        let rules = rules(1.0, 1e-9, 10.0);
        let next = |by_order: [f64; 2]| {
            let mut control = Control::new(&rules);
            control.reject(1.0, Errors { by_order, chosen: None });
            control.next
        };
        assert!((next([4.0, 0.0]) - 0.45).abs() < 1e-15 && (next([0.0, 8.0]) - 0.45).abs() < 1e-15);
        assert!((next([4.0, 1.0]) - 0.45).abs() < 1e-15 && (next([1.0, 8.0]) - 0.45).abs() < 1e-15);
        assert_eq!((next([f64::NAN, 0.0]), next([0.0, f64::INFINITY])), (SHRINK, SHRINK));
        assert!(Errors { by_order: [f64::NAN, 1.0], chosen: None }.largest().is_nan());
        assert!(Errors { by_order: [1.0, f64::NAN], chosen: None }.largest().is_nan());
        assert!(of_choice(2, [None, Some(f64::NAN), None]).largest().is_nan());
    }

    #[test]
    fn nothing_grows_behind_a_failure_and_a_shortened_step_keeps_the_plan() {
        let rules = rules(0.1, 1e-9, 10.0);
        let mut control = Control::new(&rules);
        control.fail(0.1);
        assert_eq!(control.next, 0.025);
        control.accept(0.025, Some(of_first(1e-9)), Matrix::Kept);
        assert_eq!(control.next, 0.025);
        control.accept(0.025, Some(of_first(1e-9)), Matrix::Kept);
        assert_eq!(control.next, 0.05);
        control.accept(0.001, Some(of_first(1e-9)), Matrix::Kept);
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
