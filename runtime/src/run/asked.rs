//! Where a run starts, which step comes next, and where it lies among the others. Solves nothing.

use super::{Run, StepResult, leg::Leg};
use crate::scene::{Scene, StepPlace};

/// A step that is to be solved.
#[derive(Clone, Copy)]
pub(super) struct Asked {
    /// Its number from 0.
    pub(super) number: usize,
    /// How many there are; `None` for a step that ends where the run finds right, at the end of the leg at the latest.
    pub(super) count: Option<usize>,
    pub(super) leg: Leg,
}

impl Asked {
    /// A step of the scene.
    fn of_scene(scene: &Scene, number: usize) -> Self {
        let values = &scene.steps.values;
        let from = number.checked_sub(1).map(|k| values[k]);
        let told = from.map(|_| scene.steps.increment(number));
        let leg = Leg { from, to: values[number], first_increment: scene.steps.first_increment(), told };
        Self { number, count: Some(values.len()), leg }
    }
}

impl Run {
    /// The next step of the scene; `None` where none is left.
    pub(super) fn next_asked(&self, scene: &Scene) -> Option<Asked> {
        let (number, steps) = (self.steps.len(), &scene.steps);
        if steps.auto.is_none() {
            return (number < steps.values.len()).then(|| Asked::of_scene(scene, number));
        }
        let from = self.steps.last().map(|s| s.time);
        if from.is_some_and(|at| at >= steps.last()) {
            return None;
        }
        let to = from.map_or(steps.first(), |at| self.stop(scene, at));
        Some(Asked { number, count: None, leg: Leg { from, to, first_increment: steps.first_increment(), told: None } })
    }

    /// Where a step behind a value of the step variable has to end at the latest.
    fn stop(&self, scene: &Scene, at: f64) -> f64 {
        let cadences = scene.vtk.iter().map(|o| &o.every).chain(scene.csv.iter().map(|o| &o.every));
        let corner = scene.tables.corners.get(scene.tables.corners.partition_point(|c| *c <= at)).copied();
        // what lies within rounding of a corner is met there
        let is_apart = |t: &f64| corner.is_none_or(|c| (t - c).abs() > scene.tables.forcing.same());
        let met = cadences.filter_map(|c| c.next_met(at, &scene.steps)).filter(is_apart).chain(corner);
        met.fold(scene.steps.last(), f64::min)
    }

    /// Where a step lies among the others.
    pub(super) fn place_of<'e>(&self, step: &StepResult, events: &'e [bool], number: usize) -> StepPlace<'e> {
        let before = number.checked_sub(1).map_or(step.time, |k| self.steps[k].time);
        StepPlace { number, time: step.time, before, events }
    }
}
