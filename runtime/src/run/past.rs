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

/// Solutions that are kept at most.
const KEPT: usize = 3;

impl Past {
    /// Adds the solution at the end of an increment.
    pub(super) fn add(&mut self, increment: f64, solution: Vec<f64>) {
        self.increments.insert(0, increment);
        self.solutions.insert(0, solution);
        self.increments.truncate(KEPT);
        self.solutions.truncate(KEPT);
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

    /// The part of the difference to the extrapolation that is the error of backward Euler.
    ///
    /// With h the increment and g the one before, the method misses the solution by h^2/2 and the line by h (h + g)/2, times
    /// the second derivative, to opposite sides.
    pub(super) fn share(&self, increment: f64) -> f64 {
        increment / (2.0 * increment + self.increments[0])
    }
}

/// The largest relative difference over fields; each is a range of the numbers, with the largest size it had so far.
pub(super) fn distance(a: &[f64], b: &[f64], fields: &[(Range<usize>, f64)]) -> f64 {
    let of = |(range, scale): &(Range<usize>, f64)| {
        let largest = range.clone().map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
        if largest == 0.0 { 0.0 } else { largest / scale }
    };
    fields.iter().map(of).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_extrapolated_exactly_through_unequal_increments() {
        let f = |t: f64| 3.0 - 2.0 * t + 0.5 * t * t;
        let mut past = Past::default();
        past.add(0.0, vec![f(1.0)]);
        assert_eq!(past.extrapolated(0.1, 1), None);
        past.add(0.3, vec![f(1.3)]);
        past.add(0.1, vec![f(1.4)]);
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
        past.add(0.0, vec![f(t - g)]);
        past.add(g, vec![f(t)]);
        let (line, method) = (past.extrapolated(h, 1).unwrap()[0], f(t) + h * (t + h));
        let estimate = past.share(h) * (method - line).abs();
        assert!((estimate - (method - f(t + h)).abs()).abs() < 1e-14);
    }

    #[test]
    fn differences_count_in_the_size_of_their_field() {
        let fields = [(0..2, 100.0), (2..3, 1e-3)];
        let found = distance(&[1.0, 2.0, 3e-6], &[1.0, 1.0, 2e-6], &fields);
        assert_eq!(found, 1.0 / 100.0);
        assert_eq!(distance(&[0.0], &[0.0], &[(0..1, 0.0)]), 0.0);
    }
}
