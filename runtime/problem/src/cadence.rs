//! Of which steps files are written.

use super::Steps;

/// Of which steps the files of an output are written; those of the first and the last step always are.
#[derive(Clone, Debug, PartialEq)]
pub struct Cadence {
    /// How far apart.
    pub every: Every,
    /// The event, by its number, during which they are written; always without one.
    pub when: Option<usize>,
}

/// How far apart the steps are of which files are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Every {
    /// Of so many steps the first one.
    Count(usize),
    /// The first step in each part of this length of the step variable; with `met` steps that the run chooses end where
    /// a part begins.
    Spaced {
        /// The length.
        by: f64,
        /// Whether steps end there.
        met: bool,
    },
}

/// Parts of the range of the step variable that steps chosen by the run are written for, where the scene does not say.
const PARTS: f64 = 100.0;
/// Rounding of a quotient of values of the step variable, relative to it.
const ROUNDING: f64 = 1e-9;

/// A step among the others of a run: beside its end its number, where the one before has ended, and what lasts. How long it was
/// in its last part, as a window says, files do not depend on.
#[derive(Clone, Copy, Debug)]
pub struct StepPlace<'e> {
    /// Counted from 0.
    pub number: usize,
    /// The step variable at its end.
    pub time: f64,
    /// The step variable at the end of the step before; of the first step its own.
    pub before: f64,
    /// Which events last at its end.
    pub events: &'e [bool],
}

impl Cadence {
    /// What holds where the scene says nothing: every step that the scene lists; of those that the run chooses about a
    /// hundred.
    #[must_use]
    pub fn usual(steps: &Steps) -> Self {
        let every = match steps.auto {
            Some(_) => Every::Spaced { by: (steps.last() - steps.first()) / PARTS, met: false },
            None => Every::Count(1),
        };
        Self { every, when: None }
    }

    /// Whether the files of a step are written.
    #[must_use]
    pub fn has(&self, step: StepPlace<'_>, steps: &Steps) -> bool {
        let chosen = match self.every {
            Every::Count(n) => step.number.is_multiple_of(n),
            Every::Spaced { by, .. } => {
                let part = |t: f64| ((t - steps.first()) / by + ROUNDING).floor();
                part(step.time) != part(step.before)
            }
        };
        let lasts = self.when.is_none_or(|event| step.events.get(event).copied().unwrap_or(false));
        chosen && lasts || step.number == 0 || steps.is_last(step.number, step.time)
    }

    /// The next value of the step variable behind `at` where a step is to end.
    #[must_use]
    pub fn next_met(&self, at: f64, steps: &Steps) -> Option<f64> {
        let Every::Spaced { by, met: true } = self.every else { return None };
        let part = ((at - steps.first()) / by + ROUNDING).floor();
        Some(steps.first() + (part + 1.0) * by)
    }

    /// How many files are written; of steps that the run chooses, about how many, and `None` where nothing bounds them.
    #[must_use]
    pub fn n_files(&self, steps: &Steps) -> Option<usize> {
        match (self.every, &steps.auto) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "positive, and a number to show"
            )]
            (Every::Spaced { by, .. }, Some(_)) => Some(((steps.last() - steps.first()) / by + ROUNDING) as usize + 1),
            (_, Some(_)) => None,
            (_, None) => {
                let values = &steps.values;
                let place = |k: usize| StepPlace {
                    number: k,
                    time: values[k],
                    before: values[k.saturating_sub(1)],
                    events: &[],
                };
                Some((0..values.len()).filter(|k| self.has(place(*k), steps)).count())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Auto;

    fn listed(values: &[f64]) -> Steps {
        Steps {
            variable: None,
            values: values.to_vec(),
            equal: None,
            auto: None,
            orders: Vec::new(),
            go_on: false,
            halve: 0,
            from_start: true,
        }
    }

    fn always(every: Every) -> Cadence {
        Cadence { every, when: None }
    }

    fn written(cadence: &Cadence, times: &[f64], steps: &Steps) -> Vec<f64> {
        let place = |k: usize| StepPlace { number: k, time: times[k], before: times[k.saturating_sub(1)], events: &[] };
        (0..times.len()).filter(|k| cadence.has(place(*k), steps)).map(|k| times[k]).collect()
    }

    #[test]
    fn of_listed_steps_each_nth_is_written_and_the_last_one() {
        let times: Vec<f64> = (0..=10).map(f64::from).collect();
        let steps = listed(&times);
        assert_eq!(written(&always(Every::Count(4)), &times, &steps), [0.0, 4.0, 8.0, 10.0]);
        assert_eq!(always(Every::Count(4)).n_files(&steps), Some(4));
        let spaced = always(Every::Spaced { by: 2.5, met: false });
        assert_eq!(written(&spaced, &times, &steps), [0.0, 3.0, 5.0, 8.0, 10.0]);
    }

    #[test]
    fn chosen_steps_are_written_about_a_hundred_times_and_meet_what_is_asked_for() {
        let auto = Auto { first: 1.0, error: 1e-3, least: 0.0, most: 1.0, limit: None, fields: Vec::new() };
        let steps = Steps { auto: Some(auto), ..listed(&[0.0, 1000.0]) };
        let times: Vec<f64> = (0..=10_000).map(|k| f64::from(k) * 0.1).collect();
        assert_eq!(written(&Cadence::usual(&steps), &times, &steps).len(), 101);
        assert_eq!(Cadence::usual(&steps).n_files(&steps), Some(101));
        let yearly = always(Every::Spaced { by: 0.1, met: true });
        // 0.1 has no exact binary fraction: parts that begin within rounding of a value are met there
        let mut at = 0.0;
        for k in 1..=1000 {
            at = yearly.next_met(at, &steps).unwrap();
            assert!((at - f64::from(k) * 0.1).abs() < 1e-9, "{k}: {at}");
        }
    }

    #[test]
    fn during_an_event_every_other_step_is_written() {
        let steps = listed(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let cadence = Cadence { every: Every::Count(2), when: Some(1) };
        let has = |k: usize| {
            let events = [true, (2..5).contains(&k)];
            cadence.has(StepPlace { number: k, time: steps.values[k], before: 0.0, events: &events }, &steps)
        };
        assert_eq!((0..7).filter(|k| has(*k)).collect::<Vec<_>>(), [0, 2, 4, 6]);
        let listed = |k: usize| StepPlace { number: k, time: steps.values[k], before: 0.0, events: &[true, false] };
        assert!(!cadence.has(listed(4), &steps) && cadence.has(listed(6), &steps));
    }
}
