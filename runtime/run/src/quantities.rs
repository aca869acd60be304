//! What a run measures and prints at the end of a step. Does not judge it: what is not finite is kept and told later.

use wfl_discrete::{
    finite::{BadMeasure, BadOutput},
    window::Window,
};
use wfl_problem::{CsvOutput, Measure, Measured, Scene, Solving, StepPlace, Turnover};

use super::{Progress, Run, StepResult, events::Sides};

/// The golden section, whose multiples modulo one have no pattern.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Samples of rounding: one of them may cancel.
const SAMPLES: u32 = 3;

/// What is measured at the end of a step: the fields of [`StepResult`].
pub(super) struct Taken {
    pub(super) measures: Vec<(String, f64)>,
    pub(super) bad: Vec<BadMeasure>,
    pub(super) moved: Vec<Turnover>,
}

impl Run {
    /// The measures of the scene by name, and those that are not finite with the place.
    pub(super) fn measures(&self, scene: &Solving<'_>, window: Window) -> Taken {
        let Solving { system, scene: Scene { measures: asked, .. }, .. } = scene;
        let u = &self.u;
        let (mut measures, mut bad_measures) = (Vec::with_capacity(asked.len()), Vec::new());
        let at = self.measured(scene, window);
        for measure in asked {
            let value = measure.evaluate(&at);
            if !value.is_finite() {
                bad_measures.push(measure.bad(value, system, u));
            }
            measures.push((measure.name.clone(), value));
        }
        measures.extend(self.stepper.energies(scene));
        let made = computed(scene, &at, window.end, &measures);
        bad_measures.extend(made.iter().zip(&scene.computed).filter(|((_, value), _)| !value.is_finite()).map(
            |((name, value), of)| BadMeasure {
                name: name.clone(),
                span: of.span,
                value: *value,
                at: None,
                is_made: true,
            },
        ));
        measures.extend(made);
        let moved = asked.iter().filter_map(|measure| measure.moved(&at)).collect();
        Taken { measures, bad: bad_measures, moved }
    }

    /// What rounding of the unknowns makes of a measure at the present state, in its unit: the largest of a few samples. Made by all ranks
    /// together.
    pub(super) fn rounding_of(&self, scene: &Solving<'_>, measure: &Measure) -> f64 {
        let Some(last) = self.steps.last() else { return 0.0 };
        let at = |u: &[f64]| measure.evaluate(&Measured::new(scene.system, last.window, u));
        let here = at(&self.u);
        let sample = |sample: u32| {
            #[expect(clippy::cast_precision_loss, reason = "numbers in -1..1 without a pattern")]
            let number = |k: usize| 2.0 * ((k as f64 + f64::from(sample)) * GOLDEN).fract() - 1.0;
            let rounded = |(k, x): (usize, &f64)| x * (1.0 + f64::EPSILON * number(k));
            (at(&self.u.iter().enumerate().map(rounded).collect::<Vec<_>>()) - here).abs()
        };
        (1..=SAMPLES).map(sample).fold(0.0, f64::max)
    }

    /// The present state, as measures see it.
    fn measured<'s>(&'s self, scene: &'s Solving<'_>, window: Window) -> Measured<'s> {
        let at = Measured::new(scene.system, window, &self.u);
        let is_start = self.steps.is_empty() && scene.steps.from_start;
        if is_start { at.where_time_starts() } else { at }
    }

    /// What the next increment is at most: a limit that is no positive number limits nothing.
    pub(super) fn limit(&self) -> f64 {
        self.steps.last().map(|s| s.limit).filter(|limit| *limit > 0.0).unwrap_or(f64::INFINITY)
    }

    /// What the scene says that the increment behind the present state is at most, infinite where it says nothing; and the
    /// sides of its events.
    pub(super) fn watched(&self, scene: &Solving<'_>, window: Window) -> (f64, Vec<Sides>) {
        let limit = scene.steps.auto.as_ref().and_then(|auto| auto.limit.clone());
        if limit.is_none() && scene.events.is_empty() {
            return (f64::INFINITY, Vec::new());
        }
        let Scene { watched, measures, .. } = scene.scene;
        let mut values: Vec<(String, f64)> = Vec::new();
        let at = self.measured(scene, window);
        for measure in watched.iter().chain(measures) {
            values.push((measure.name.clone(), measure.evaluate(&at)));
        }
        values.extend(computed(scene, &at, window.end, &values));
        values.extend(scene.steps.variable.clone().map(|name| (name, window.end)));
        // a quotient by zero has no number: a slip rate of zero counts as the smallest one, behind which the increment is free
        let least = |v: f64| if v == 0.0 { f64::MIN_POSITIVE } else { v };
        let moving = || values.iter().map(|(name, v)| (name.clone(), least(*v))).collect::<Vec<_>>();
        let limit = limit.map_or(f64::INFINITY, |e| {
            let found = scene.number_of(&e, &values).or_else(|| scene.number_of(&e, &moving()));
            found.unwrap_or(f64::NAN)
        });
        let sides = scene.numbers_of(scene.events.iter().flat_map(|event| &event.sides), &values);
        let sides: Vec<f64> = sides.into_iter().map(|side| side.unwrap_or(f64::NAN)).collect();
        (limit, sides.as_chunks().0.to_vec())
    }

    /// The rows of the series of the scene at the present state: by series the values of all points; nothing of a series
    /// that leaves the step out.
    pub(super) fn series(&self, scene: &Solving<'_>, step: &StepResult, place: StepPlace<'_>) -> Vec<Vec<Vec<f64>>> {
        let Solving { system, scene: Scene { series, steps, .. }, .. } = scene;
        let state = system.values(&self.u);
        let values = state.view();
        let rows = |output: &CsvOutput| {
            if !output.every.has(place, steps) {
                return Vec::new();
            }
            // a row begins with the arc length, which points have none of
            let rows = output.line.rows(&system.mesh, step.window, values, |_, _, _| {});
            rows.into_iter()
                .map(|row| std::iter::once(step.window.end).chain(row.into_iter().skip(1)).collect())
                .collect()
        };
        series.iter().map(rows).collect()
    }

    /// What terms print at their points.
    pub(super) fn print(&mut self, scene: &Solving<'_>, window: Window, progress: &mut dyn Progress) {
        let Solving { system, scene: Scene { prints, .. }, .. } = scene;
        let u = &self.u;
        let mut bad_prints = Vec::new();
        for print in prints {
            let (term, origin) = (print.term.clone(), print.origin);
            let mut bad = None;
            print.for_each(system, window, u, |x, value| {
                bad = bad.or_else(|| value.iter().find(|v| !v.is_finite()).map(|v| (*v, x)));
                progress.printed(&term, origin, x, value);
            });
            if let Some((value, position)) = bad {
                bad_prints.push(BadOutput { what: format!("`Print` in `{term}`"), time: window.end, value, position });
            }
        }
        bad_prints.into_iter().for_each(|bad| self.add_bad(bad));
    }
}

/// The numbers that measures make, with `measures` by name, those behind them included.
fn computed(scene: &Scene, at: &Measured<'_>, time: f64, measures: &[(String, f64)]) -> Vec<(String, f64)> {
    if scene.computed.is_empty() {
        return Vec::new();
    }
    let mut values = measures.to_vec();
    values.extend(scene.steps.variable.clone().map(|name| (name, time)));
    let mut made = Vec::with_capacity(scene.computed.len());
    for of in &scene.computed {
        values.extend(of.reductions.iter().map(|m| (m.name.clone(), m.evaluate(at))));
        let value = scene.number_of(&of.expr, &values).unwrap_or(f64::NAN);
        values.push((of.name.clone(), value));
        made.push((of.name.clone(), value));
    }
    made
}
