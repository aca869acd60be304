//! What finer meshes say of the estimates on coarser ones.

use super::{FALL, LAGS, Level, MOST_SAFETY, ROUNDING, SAFETY, Search, error_over_distance, tell_error};
use crate::accuracy::Trials;

/// An order of convergence is that of the elements from this part of it on: measured orders of coarse meshes are a
/// little below those of theory.
const NEARLY: f64 = 0.75;
/// In scenes with kinks two checks in a row have to agree within this factor: until the active set is resolved, one says
/// little of the next.
const AGREE: f64 = 1.6;

impl<T: Trials> Search<'_, T> {
    /// Adds a level, and checks the estimates of those before with it.
    pub(super) fn check(&mut self, levels: &mut Vec<Level<T::Run>>, next: Level<T::Run>) {
        let power = if self.demand.quantity == "H1" { 2.0 } else { 1.0 };
        // a part of the error that the last round left as it was shows from further back only
        for before in levels.iter_mut().rev().take(LAGS).filter(|l| l.apart.is_finite()) {
            let truth = self.trials.distance(&before.run, &next.rich).unwrap_or(f64::NAN);
            let found = match (before.apart <= ROUNDING, truth <= ROUNDING) {
                (_, true) => Some(1.0),
                // both degrees have the same solution and the finer mesh another: nothing is known of the error
                (true, false) => Some(f64::INFINITY),
                _ => error_over_distance(truth / before.apart, next.apart / before.apart, power),
            };
            before.checked = before.checked.into_iter().chain(found).reduce(f64::max);
        }
        let mut next = next;
        if let Some(before) = levels.last().filter(|l| l.apart.is_finite() && next.apart.is_finite()) {
            next.of_rich = self.added_by_rich(before, &next);
        }
        levels.push(next);
        for k in 0..levels.len() {
            levels[k].factor = self.factor(levels, k);
            tell_error(&mut self.trial_runs, &levels[k]);
        }
    }

    /// What the error of a richer run may add to a distance from it. The richer runs fall at least as fast as distances do,
    /// by a factor q: what is left is q/(1 - q) times their last distance, and no more than that is taken. Squares of norms
    /// add up.
    fn added_by_rich(&mut self, before: &Level<T::Run>, next: &Level<T::Run>) -> f64 {
        let fell = (next.apart / before.apart).min(0.5);
        let apart = self.trials.distance(&before.rich, &next.rich).unwrap_or(0.0);
        let left = apart * fell / (1.0 - fell);
        if self.is_norm() { next.apart.hypot(left) - next.apart } else { left }
    }

    /// Whether the first two estimates fall about as fast as elements of their degree can: both degrees may share an error
    /// that falls more slowly, and a second mesh has to show it then.
    fn converges(&self, levels: &[Level<T::Run>]) -> bool {
        let [first, second, ..] = levels else { return false };
        let order = NEARLY * self.order(first.degree) as f64;
        second.apart <= ROUNDING || second.apart <= first.apart * 0.5f64.powf(order)
    }

    /// Whether an estimate is so much smaller than that of the mesh before that it may be so by accident.
    pub(super) fn fell(&self, before: &Level<T::Run>, apart: f64) -> bool {
        let order = i32::try_from(self.order(before.degree)).unwrap_or(1);
        apart * FALL < before.apart * 0.5f64.powi(order)
    }

    /// What the checks of a level and of those before say of its estimate.
    fn factor(&self, levels: &[Level<T::Run>], k: usize) -> f64 {
        let (here, first) = (&levels[k], k.saturating_sub(LAGS));
        let fell = k > 0 && self.fell(&levels[k - 1], here.apart);
        let needed = if self.ways.kinked || !self.converges(levels) { 2 } else { 1 };
        let checks: Vec<f64> = levels[first..=k].iter().filter_map(|l| l.checked).collect();
        let (least, most) = checks.iter().fold((f64::INFINITY, 0.0f64), |(a, b), c| (a.min(*c), b.max(*c)));
        let differ = self.ways.kinked && most > AGREE * least;
        if fell && here.checked.is_none() || checks.len() < needed || most > MOST_SAFETY || differ {
            return f64::INFINITY;
        }
        SAFETY * most.max(1.0)
    }
}
