//! What keeps the rounding of values out of second rates.
//!
//! Rates are changes of values times 1/h and 1/h^2. Two errors of rounding would add up over the steps. What rounding takes
//! from a value at the end of a step is lost to all later ones: it is carried beside the value (compensated summation). And
//! the mass in the matrix, M/h^2, is rounded otherwise than the mass in the forces of the rates before, which it nearly
//! cancels: times the change of a step the difference is a small damping of either sign, in each step of the same. So the
//! forces are taken at the predictor x_n + h r_n, where the trapezoidal rule has the second rate -s_n and the first one r_n,
//! and the matrix acts on the change from there, which is of the size h^2 s. Knows no equations.

use super::{Rates, Scheme};
use wfl_compiler::types::RateForm;

impl Rates {
    /// True if rounding of the values is carried from step to step.
    #[must_use]
    pub fn carries_rounding(&self) -> bool {
        self.fields.iter().any(|of| !of.lost[0].is_empty())
    }

    /// The solution `u` of the step that was begun, by dof, from which rounding has taken `lost`: what was lost before is
    /// added to it, and what rounding takes then is carried on.
    pub fn carry_rounding(&mut self, u: &mut [f64], lost: &[f64]) {
        for of in self.fields.iter_mut().filter(|of| !of.lost[0].is_empty()) {
            let [before, now] = &mut of.lost;
            for ((d, before), now) in of.dofs.clone().zip(before).zip(now) {
                let whole = lost[d] + *before;
                let sum = u[d] + whole;
                *now = whole - (sum - u[d]);
                u[d] = sum;
            }
        }
    }

    /// The predictor of the step that was begun at `before`, and rates that are held there whatever the unknowns are; `None`
    /// but under the trapezoidal rule, where alone energies are kept, and between two steps. Fields with first rates stay.
    #[must_use]
    pub fn predicted(&self, before: &[f64]) -> Option<(Vec<f64>, Rates)> {
        let (h, true) = (self.open?, self.carries_rounding() && self.scheme == Scheme::TRAPEZOIDAL) else {
            return None;
        };
        let (mut base, mut held) = (before.to_vec(), self.clone());
        let (velocity, acceleration) = (self.factors.velocity, self.of_second().0);
        let driven = self.added_to_histories();
        for of in self.fields.iter().filter(|of| of.form == RateForm::Second) {
            let [first, second, ..] = &of.kept;
            let [of_first, of_second] = held.all_histories_mut();
            let histories = of_first[of.field].iter_mut().zip(&mut of_second[of.field]);
            for ((d, rates), (r, s)) in of.dofs.clone().zip(histories).zip(first.iter().zip(second)) {
                base[d] = before[d] + h * r;
                // what the rounding of the predictor leaves of a second rate of -s
                let beside = (base[d] - before[d]) - 2.0 * r / velocity;
                (*rates.0, *rates.1) = (r + velocity * beside, acceleration * beside - s);
            }
            for (history, added) in [of_first, of_second].into_iter().zip(&driven) {
                let added = added.get(of.dofs.clone()).unwrap_or_default();
                history[of.field].iter_mut().zip(added).for_each(|(rate, added)| *rate += added);
            }
        }
        held.hold_factors();
        Some((base, held))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rates::{Alpha, tests::rates};
    use wfl_compiler::types::RateOrder;

    #[test]
    fn what_rounding_takes_from_values_with_second_rates_is_in_the_rates() {
        let mut made = rates(Scheme::Newmark { beta: 0.25, gamma: 0.5 });
        let (before, lost) = ([1.0; 5], [0.0, 0.0, 0.0, 1e-17, -1e-17]);
        let mut after = [1.0; 5];
        for step in 0..10 {
            made.begin(0.5);
            let start = after;
            made.carry_rounding(&mut after, &lost);
            made.keep(&after, &start);
            // nothing is left of a change in the values until it is as large as half of their rounding
            assert!(step > 4 || after == before, "{step}: {after:?}");
        }
        assert!(made.carries_rounding() && after[3] == 1.0 && after[4] < 1.0 && after[..3] == before[..3], "{after:?}");
        // r = 2 (x - x_n)/h - r_n ten times, from r = 1
        let rate = made.fields()[1].kept[0][0];
        assert_eq!(rate, 1.0);
        assert!(
            !rates(Scheme::Explicit).carries_rounding() && !rates(Scheme::Alpha(Alpha::hht(-0.1))).carries_rounding()
        );
    }

    #[test]
    fn rates_at_the_predictor_are_those_of_the_equations_there() {
        let mut made = rates(Scheme::TRAPEZOIDAL);
        let before = [1.0, 2.0, 3.0, 4.0, 5.0];
        assert!(made.predicted(&before).is_none());
        made.begin(0.3);
        let (base, held) = made.predicted(&before).unwrap();
        assert_eq!(base, [1.0, 2.0, 3.0, 4.0 + 0.3, 5.0 - 0.6]);
        for (order, factor) in
            [(RateOrder::First, made.factors.velocity), (RateOrder::Second, made.factors.acceleration)]
        {
            for k in 0..2 {
                let there = factor * (base[3 + k] - before[3 + k]) + made.history(order, 2)[k];
                assert!((there - held.history(order, 2)[k]).abs() < 1e-13, "{order:?} {k}: {there}");
            }
            assert_eq!(held.history(order, 1), made.history(order, 1));
        }
        let near = |found: &[f64], known: [f64; 2]| found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-13);
        assert!(
            near(held.history(RateOrder::Second, 2), [-0.5, -3.0])
                && near(held.history(RateOrder::First, 2), [1.0, -2.0])
        );
    }
}
