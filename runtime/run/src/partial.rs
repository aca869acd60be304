//! Measures of the change over a step that was solved in parts: they see the change over its last part.
//!
//! A law has the end of the part before as its past, and a traction that a measure evaluates is right with it alone. A
//! slip, a work or a wear of the step is not: where a measure is much smaller with the past of the last part than with that
//! of the whole step, it is told.

use wfl::{Code, Diagnostic};
use wfl_discrete::{
    system::{Past, System},
    window::Window,
};
use wfl_problem::{Measure, Measured, Solving};

use super::{StepResult, ended::Ended};

/// A value below this part of that over the whole step is that of a part: a part is at most half of the step, and what a
/// traction that turns in the step differs by is less.
const MUCH: f64 = 0.75;

/// The past of a step as a whole.
pub(super) struct Whole {
    /// The end of the step before, where something reads it.
    past: Option<Past>,
    window: Window,
}

impl Whole {
    /// That of the step that begins, where a measure reads it and the step may be solved in parts.
    pub(super) fn new(scene: &Solving<'_>, window: Window) -> Option<Self> {
        let may_be_parted = scene.steps.halve > 0 && !scene.system.is_linear();
        let read = may_be_parted && scene.measures.iter().any(Measure::reads_change);
        read.then(|| Self { past: scene.system.known().previous.clone(), window })
    }

    /// The measures at the end of a step that have the change over its last part alone.
    pub(super) fn of_last_part(&self, scene: &Solving<'_>, u: &[f64], step: &StepResult) -> Vec<OfLastPart> {
        // a part is at most half of a step; the state where time starts has no increment
        if !step.history.converged() || step.window.increment.abs() >= MUCH * self.window.increment.abs() {
            return Vec::new();
        }
        let mut system = scene.system.with_past(self.past.as_ref());
        let before = scene.system.known().previous.as_ref();
        let window = held(&mut system, before.map_or(u, |past| &past.unknowns), u, self.window);
        let at = Measured::new(&system, window, u);
        let of = |measure: &Measure| {
            let (_, last) = step.measures.iter().find(|(name, _)| *name == measure.name)?;
            let whole = measure.evaluate(&at);
            let is_less = last.abs() < MUCH * whole.abs();
            is_less.then(|| OfLastPart { name: measure.name.clone(), last: *last, whole })
        };
        scene.measures.iter().filter(|measure| Measure::reads_change(measure)).filter_map(of).collect()
    }
}

/// A window whose rates are those at the end of a step, which ends at `u` and began at `before`, whatever the past is.
fn held(system: &mut System, before: &[f64], u: &[f64], window: Window) -> Window {
    let Some(rates) = system.rates_mut() else { return window };
    let [first, second] = rates.ended(u, before);
    rates.take(&first, &second);
    window.with_rates(rates.factors())
}

/// A measure that has the change over the last part of a step.
#[derive(Clone, Debug)]
pub(crate) struct OfLastPart {
    name: String,
    /// Its value.
    last: f64,
    /// With the past of the whole step.
    whole: f64,
}

/// W651 for the first step in which measures have the change over its last part.
pub(super) fn told(run: &Ended<'_>) -> Vec<Diagnostic> {
    let steps = || run.run.steps.iter().filter(|step| !step.partial.is_empty());
    let Some((first, step)) = steps().next().and_then(|step| Some((step.partial.first()?, step))) else {
        return Vec::new();
    };
    let OfLastPart { name, last, whole } = first;
    let text = format!(
        "`{name}` at t = {} is {last:.3e} over the last increment; over the step it is {whole:.3e}",
        step.window.end
    );
    let mut names: Vec<&str> = steps().flat_map(|step| &step.partial).map(|of| of.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let span = run.scene.measures.iter().find(|measure| measure.name == *name).map(|measure| measure.span);
    let d = Diagnostic::new(Code::W651, text)
        .note(format!(
            "the step was solved in smaller increments, and the end of the one before is what `Previous_` reads; so it is with \
             {} in {}",
            names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
            if steps().count() == 1 { "this step alone".to_owned() } else { format!("{} steps", steps().count()) }
        ))
        .help("a state that adds up: state work : scalar on .. := Previous_work + ..; or smaller steps");
    vec![match span {
        Some(span) => d.at(span, ""),
        None => d,
    }]
}
