//! Where a run starts, which step comes next, and where it lies among the others. Solves nothing.

use wfl_discrete::window::Window;
use wfl_problem::{Scene, StepPlace};

use super::{Run, StepResult};

/// Rounding of a difference in parts of it, up to which increments that differ by it only are taken as one number.
const ONE_INCREMENT: f64 = 1e-9;

/// A step that a run is asked for: its window, of which nothing is done yet, and its place in the run.
#[derive(Clone, Copy)]
pub(super) struct StepRequest {
    /// Its number from 0.
    pub(super) number: usize,
    /// How many there are; `None` for a step that ends where the run finds right, at the end of the window at the latest.
    pub(super) count: Option<usize>,
    /// Where the step before has ended, which the start of the window is but for rounding; `None` for the first step.
    pub(super) from: Option<f64>,
    /// The whole step; the first one, which has none before, counts as long as the second one.
    pub(super) window: Window,
    /// What the scene says that its increment is at most, where the run finds that; infinite where it says nothing.
    pub(super) limit: f64,
}

impl StepRequest {
    /// A step that the scene lists.
    fn listed(scene: &Scene, number: usize) -> Self {
        let values = &scene.steps.values;
        let from = number.checked_sub(1).map(|k| values[k]);
        Self { number, count: Some(values.len()), from, window: scene.steps.window(number), limit: f64::INFINITY }
    }

    /// True if the run finds where the step ends: there is one before, whose end says something of it.
    pub(super) fn is_chosen(&self) -> bool {
        self.count.is_none() && self.from.is_some()
    }
}

/// The step from one value to another where the scene does not say how long it is; `None` before the first one.
///
/// Values of equal steps differ by rounding from those of exact ones; their increments are the same number, so that
/// matrices made with it stay. Where rounding is a larger part of them they stay what they are: their sum is then the time
/// that passes.
pub(super) fn between(from: Option<f64>, to: f64, first_increment: f64) -> Window {
    let Some(from) = from else { return Window::new(to, first_increment) };
    let rounding = 2.0 * f64::EPSILON * from.abs().max(to.abs());
    let increment = to - from;
    let is_one = (increment - first_increment).abs() <= rounding.min(ONE_INCREMENT * increment.abs());
    Window::new(to, if is_one { first_increment } else { increment })
}

impl Run {
    /// The next step of the scene; `None` where none is left.
    pub(super) fn next_request(&self, scene: &Scene) -> Option<StepRequest> {
        let (number, steps) = (self.steps.len(), &scene.steps);
        if steps.auto.is_none() {
            return (number < steps.values.len()).then(|| StepRequest::listed(scene, number));
        }
        let from = self.last_value();
        if from.is_some_and(|at| at >= steps.last()) {
            return None;
        }
        let to = from.map_or(steps.first(), |at| self.stop(scene, at));
        let window = between(from, to, steps.first_increment());
        Some(StepRequest { number, count: None, from, window, limit: self.limit() })
    }

    /// The value of the step variable at the end of the last step.
    pub(super) fn last_value(&self) -> Option<f64> {
        self.steps.last().map(|s| s.window.end)
    }

    /// Where a step behind a value of the step variable has to end at the latest.
    fn stop(&self, scene: &Scene, at: f64) -> f64 {
        let corner = scene.tables.corners.get(scene.tables.corners.partition_point(|c| *c <= at)).copied();
        // what lies within rounding of a corner is met there
        let is_apart = |t: &f64| corner.is_none_or(|c| (t - c).abs() > scene.tables.forcing.same());
        let met = scene.cadences().filter_map(|c| c.next_met(at, &scene.steps)).filter(is_apart).chain(corner);
        met.fold(scene.steps.last(), f64::min)
    }

    /// Where a step lies among the others.
    pub(super) fn place_of<'e>(&self, step: &StepResult, events: &'e [bool], number: usize) -> StepPlace<'e> {
        let time = step.window.end;
        let before = number.checked_sub(1).map_or(time, |k| self.steps[k].window.end);
        StepPlace { number, time, before, events }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_steps_have_one_increment_and_long_sums_of_small_ones_their_own() {
        // 3 * 0.1 is rounded up, and so is its distance from 0.2
        let third = between(Some(0.2), 3.0 * 0.1, 0.1);
        assert_eq!([third.end, third.increment], [3.0 * 0.1, 0.1]);
        assert_ne!(third.end - 0.2, 0.1);
        let other = between(Some(0.2), 0.35, 0.1);
        assert_eq!(other.increment, 0.35 - 0.2);
        // behind 1e9 rounding is a larger part of 0.1 than two values of one number may differ by
        let late = between(Some(1e9), 1e9 + 0.1, 0.1);
        assert_eq!(late.increment, (1e9 + 0.1) - 1e9);
        assert_ne!(late.increment, 0.1);
        assert_eq!(between(None, 5.0, 0.1), Window::new(5.0, 0.1));
    }
}
