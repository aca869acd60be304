//! Earlier solutions: what is expected of the next one, and how far it misses that.
//!
//! The error of a step is estimated by Milne's device (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
//! III.8): the extrapolation of the solutions before and the method have errors of one order with known constants, and
//! their difference is the sum of both. Promises: numbers alone; nothing of it depends on how a solution was found.

use std::ops::Range;

/// Solutions of which the newest stands first; each is one list of numbers for all fields.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Past {
    /// The increments between them: the first leads to the first solution.
    pub(super) increments: Vec<f64>,
    pub(super) solutions: Vec<Vec<f64>>,
}

impl Past {
    /// Adds the solution at the end of an increment; so many are kept.
    pub(super) fn add(&mut self, increment: f64, solution: Vec<f64>, kept: usize) {
        self.increments.insert(0, increment);
        self.solutions.insert(0, solution);
        self.increments.truncate(kept);
        self.solutions.truncate(kept);
    }

    /// The polynomial through the newest `order + 1` solutions, behind another increment; `None` where there are fewer.
    pub(super) fn extrapolated(&self, increment: f64, order: usize) -> Option<Vec<f64>> {
        let through = self.solutions.get(..=order)?;
        // Neville's coefficients: the product of (h + d_j)/(d_j - d_i), where d_k is how long ago solution k was
        let mut ages = vec![0.0];
        self.increments.iter().take(order).for_each(|h| ages.push(ages[ages.len() - 1] + h));
        let weight = |i: usize| {
            let others = (0..=order).filter(|j| *j != i);
            others.map(|j| (increment + ages[j]) / (ages[j] - ages[i])).product::<f64>()
        };
        let weights: Vec<f64> = (0..=order).map(weight).collect();
        let value = |k: usize| through.iter().zip(&weights).map(|(s, w)| w * s[k]).sum();
        Some((0..through[0].len()).map(value).collect())
    }

    /// What the polynomial through the newest `order + 1` solutions misses of the one behind another increment, times the
    /// derivative behind its order: with h the increment, g the one before and k the one before that, the line misses
    /// h (h + g)/2 times the second derivative, the parabola h (h + g) (h + g + k)/6 times the third one.
    pub(super) fn missed(&self, increment: f64, order: usize) -> f64 {
        let (mut age, mut product) = (increment, 1.0);
        for (number, before) in (1u32..).zip(&self.increments).take(order + 1) {
            product *= age / f64::from(number);
            age += before;
        }
        product
    }

    /// The part of the difference to the extrapolation through `order + 1` solutions that is the error of a method of this
    /// order, which misses the solution by `method` times its derivative of the next order, to the other side.
    pub(super) fn share(&self, increment: f64, order: usize, method: f64) -> f64 {
        method / (method + self.missed(increment, order))
    }
}

/// The largest difference of numbers; no number where one is none.
pub(super) fn distance(a: &[f64], b: &[f64], range: Range<usize>) -> f64 {
    let differences = range.map(|k| (a[k] - b[k]).abs());
    differences.fold(0.0, |most: f64, d| if most.is_nan() || most > d { most } else { d })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_extrapolated_exactly_through_unequal_increments() {
        let f = |t: f64| 3.0 - 2.0 * t + 0.5 * t * t;
        let mut past = Past::default();
        past.add(0.0, vec![f(1.0)], 3);
        assert_eq!(past.extrapolated(0.1, 1), None);
        past.add(0.3, vec![f(1.3)], 3);
        past.add(0.1, vec![f(1.4)], 3);
        let found = past.extrapolated(0.25, 2).unwrap()[0];
        assert!((found - f(1.65)).abs() < 1e-14, "{found}");
        let line = past.extrapolated(0.1, 1).unwrap()[0];
        assert!((line - (2.0 * f(1.4) - f(1.3))).abs() < 1e-14);
    }

    #[test]
    fn the_share_of_backward_euler_is_its_error_on_a_parabola() {
        // u = t^2/2: u' = t, so that backward Euler goes from u(t) to u(t) + h (t + h) and misses by h^2/2
        let (t, h, g) = (2.0, 0.3, 0.2);
        let f = |t: f64| 0.5 * t * t;
        let mut past = Past::default();
        past.add(0.0, vec![f(t - g)], 3);
        past.add(g, vec![f(t)], 3);
        let (line, method) = (past.extrapolated(h, 1).unwrap()[0], f(t) + h * (t + h));
        let estimate = past.share(h, 1, 0.5 * h * h) * (method - line).abs();
        assert!((estimate - (method - f(t + h)).abs()).abs() < 1e-14);
    }

    #[test]
    fn the_share_of_bdf2_is_its_error_on_a_cubic() {
        // u = t^3 and u' = 3 t^2: the rate of BDF2 at t + h is c (u - u_n) - h/(h + g) (u_n - u_(n-1))/g
        let (t, h, g, k) = (2.0f64, 0.3, 0.2, 0.35);
        let f = |t: f64| t.powi(3);
        let mut past = Past::default();
        past.add(0.0, vec![f(t - g - k)], 3);
        past.add(k, vec![f(t - g)], 3);
        past.add(g, vec![f(t)], 3);
        let c = (2.0 * h + g) / (h * (h + g));
        let method = f(t) + (3.0 * (t + h).powi(2) + h / (h + g) * (f(t) - f(t - g)) / g) / c;
        let (parabola, exact) = (past.extrapolated(h, 2).unwrap()[0], f(t + h));
        let estimate = past.share(h, 2, (h * (h + g)).powi(2) / (6.0 * (2.0 * h + g))) * (method - parabola).abs();
        assert!((estimate - (method - exact).abs()).abs() < 1e-13, "{estimate} {}", method - exact);
        // h^2 (h + g)^2/(6 (2 h + g)) times the third derivative, which is 6
        assert!((method - exact - (h * (h + g)).powi(2) / (2.0 * h + g)).abs() < 1e-13);
    }

    #[test]
    fn the_cubic_misses_what_is_said_of_a_fourth_power() {
        // all powers are numbers without rounding
        let f = |t: f64| t * t * (t * t);
        let mut past = Past::default();
        for (increment, t) in [(0.0, 1.0f64), (0.25, 1.25), (0.125, 1.375), (0.25, 1.625)] {
            past.add(increment, vec![f(t)], 4);
        }
        let found = f(2.0) - past.extrapolated(0.375, 3).unwrap()[0];
        assert!((found - 24.0 * past.missed(0.375, 3)).abs() < 1e-13, "{found}");
        // the last three increments before: 0.25, 0.125, 0.25
        assert!((found - 0.375 * 0.625 * 0.75 * 1.0).abs() < 1e-13, "{found}");
    }

    #[test]
    fn differences_are_those_of_a_range() {
        let (a, b) = ([1.0, 2.0, 3e-6], [1.0, 1.0, 2e-6]);
        assert_eq!((distance(&a, &b, 0..2), distance(&a, &b, 2..3)), (1.0, 3e-6 - 2e-6));
        assert_eq!(distance(&a, &b, 0..0), 0.0);
        assert!(distance(&[f64::NAN, 1.0], &[0.0, 0.0], 0..2).is_nan());
    }
}
