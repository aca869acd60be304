//! What a run ends with: its steps, its report, and what of its outputs stays in memory.

use std::path::{Path, PathBuf};

use wfl::{Code, Diagnostic};
use wfl_compiler::Constant;
use wfl_discrete::finite::BadMeasure;
use wfl_output::{EventReport, OutputDir, Piece, Real, Report, State, write_csv, write_report, write_vtu};
use wfl_problem::{Equations, Scene, Solving, VtkOutput};

use super::{
    Attempt, AttemptEnd, Episode, Run, RunError, RunOptions, Sides, StepResult, Trajectory,
    ended::Ended,
    events::episodes,
    files::{StepFiles, write_measures},
    findings, folder, friction, others,
    remembered::Unresolved,
    report,
};

/// What a run ends with.
#[derive(Debug)]
pub struct Outcome {
    /// The steps that were tried.
    pub steps: Vec<StepResult>,
    /// The report, also written to `report.json`.
    pub report: Report,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// The run as a sequence of states, where [`RunOptions::keep_trajectory`] asks for it.
    pub trajectory: Option<Trajectory>,
    /// What the outputs of the scene hold at the steps of [`RunOptions::keep_outputs`].
    pub kept: Vec<KeptStep>,
    /// Expectations of the scene: place and whether they hold.
    pub expectations: Vec<(wfl::Expect, Option<bool>)>,
    /// What expectations know beside params: the measures and the step variable at the last step, and the numbers of the
    /// events.
    pub known: Vec<(String, f64)>,
    /// Derivatives that expectations know, once they are found (`wfl_gradient::settle`).
    pub derivatives: Vec<(String, Constant)>,
    /// Messages of the expectations.
    pub diagnostics: Vec<Diagnostic>,
    /// The events of the scene by name, each with the times that it lasted.
    pub events: Vec<(String, Vec<Episode>)>,
    /// Why the energy of friction is not tested; `None` where it is, or where there is none.
    pub friction_untested: Option<&'static str>,
    /// What the numbers themselves give cause to doubt.
    pub warnings: Vec<Diagnostic>,
    /// The equations at the end of the last step.
    pub equations: Equations,
}

impl Outcome {
    /// The measures that are not finite, each with the step variable where it first was; the place is not known for a
    /// step that another process did.
    #[must_use]
    pub fn bad_measures(&self) -> Vec<(f64, &str, f64, Option<&BadMeasure>)> {
        let mut out: Vec<(f64, &str, f64, Option<&BadMeasure>)> = Vec::new();
        for step in &self.steps {
            for (name, value) in step.measures.iter().filter(|m| !m.1.is_finite()) {
                if out.iter().all(|known| known.1 != name) {
                    let place = step.bad_measures.iter().find(|bad| bad.name == *name);
                    out.push((step.window.end, name, *value, place));
                }
            }
        }
        out
    }

    /// The conditions of mechanics at the end of a step of this run, as they are judged beside the other steps: what a body with
    /// inertia overlaps is a part of the largest displacement of the run.
    #[must_use]
    pub fn conditions_of(&self, step: &StepResult) -> Vec<wfl_checks::PhysicsCheck> {
        findings::judged_beside(step, &self.steps)
    }

    /// True if every step converged.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.steps.iter().all(|s| s.history.converged())
    }
}

/// A table of numbers under the name of its file.
#[derive(Clone, Debug)]
pub struct KeptTable {
    /// The file, with its ending.
    pub file: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// One number for each column.
    pub rows: Vec<Vec<f64>>,
}

/// What the outputs of a scene hold at one step.
#[derive(Clone, Debug)]
pub struct KeptStep {
    /// Number of the step from 0.
    pub number: usize,
    /// The step variable.
    pub time: f64,
    /// By `output vtk` that has this step: its name, and its pieces.
    pub grids: Vec<(String, Vec<Piece>)>,
    /// By `output csv` that has this step.
    pub tables: Vec<KeptTable>,
}

impl KeptStep {
    pub(super) fn new(scene: &Scene, files: StepFiles) -> Self {
        let StepFiles { number, time, grids, tables, .. } = files;
        let mesh = &scene.system.mesh;
        let of = |(v, pieces): (&VtkOutput, Option<_>)| Some((v.file.clone(), others::pieces_of_all(pieces?, mesh)));
        let grids = scene.vtk.iter().zip(grids).filter_map(of).collect();
        let tables = tables.into_iter().map(|t| KeptTable { file: t.name, columns: t.columns, rows: t.rows }).collect();
        Self { number, time, grids, tables }
    }
}

/// Steps by `auto` of which the last is the first with an estimate of its error.
const FEWEST: usize = 3;

impl Run {
    /// Ends the run; `error` is what it ended with, if that was no solution.
    pub(super) fn outcome(self, scene: &Solving<'_>, options: &RunOptions, error: Option<&RunError>) -> Outcome {
        let last: Vec<(String, f64)> = self.steps.last().map(|s| s.measures.clone()).unwrap_or_default();
        let end = scene.steps.variable.clone().zip(self.steps.last().map(|s| s.window.end));
        let done = self.is_done(scene) && error.is_none();
        let events = self.episodes(scene);
        let mut known = last;
        known.extend(end);
        events.iter().for_each(|(name, episodes)| known.extend(numbers_of(name, episodes)));
        let (expectations, diagnostics) = if done { scene.expectations(&known, &[]) } else { (Vec::new(), Vec::new()) };
        let warnings = findings::of_run(&Ended { scene, run: &self, is_done: done });
        let mut report = report::report(scene, options, &self, &expectations);
        report.warnings.extend(warnings.iter().map(|d| format!("{}: {}", d.code, d.line())));
        let event = |e: &Episode| EventReport { begin: Real(e.begin), end: e.end.map(Real) };
        report.events = events.iter().map(|(name, list)| (name.as_str(), list.iter().map(event).collect())).collect();
        report.error = error.map(ToString::to_string);
        let friction_untested = friction::untested(scene, &self.steps).filter(|_| options.judge);
        let (kept, equations, trajectory) = (self.kept, scene.now(), self.stepper.trajectory);
        let (steps, files) = (self.steps, Vec::new());
        Outcome {
            steps,
            report,
            files,
            trajectory,
            kept,
            expectations,
            known,
            derivatives: Vec::new(),
            diagnostics,
            warnings,
            events,
            friction_untested,
            equations,
        }
    }

    /// The events of the scene by name.
    fn episodes(&self, scene: &Scene) -> Vec<(String, Vec<Episode>)> {
        let of = |k: usize| -> Vec<(f64, Sides)> {
            self.steps.iter().filter_map(|s| s.events.get(k).map(|sides| (s.window.end, *sides))).collect()
        };
        scene.events.iter().enumerate().map(|(k, e)| (e.name.clone(), episodes(&of(k)))).collect()
    }

    /// W618 for steps whose error was too large and could not be made smaller.
    pub(super) fn forced(&self, scene: &Scene) -> Option<Diagnostic> {
        let rules = scene.steps.auto.as_ref()?;
        let forced = |s: &&StepResult| {
            let too_large = |a: &Attempt| matches!(a.end, AttemptEnd::Forced(_));
            s.attempts.iter().any(too_large)
        };
        let first = self.steps.iter().find(forced)?;
        let count = self.steps.iter().filter(forced).count();
        let text = format!(
            "the error of {count} steps is larger than the demanded {:e}, the first at t = {}",
            rules.error, first.window.end
        );
        Some(Diagnostic::new(Code::W618, text).note(format!("an increment is at least {:e}", rules.least)))
    }

    /// W618 for a run whose steps are too few for an estimate of their error.
    pub(super) fn unestimated(&self, scene: &Scene) -> Option<Diagnostic> {
        let rules = scene.steps.auto.as_ref()?;
        // the state where time starts is no step
        let count = self.steps.len().checked_sub(1).filter(|n| (1..FEWEST).contains(n))?;
        let steps = if count == 1 { "1 step".to_owned() } else { format!("{count} steps") };
        let text = format!("the run made {steps}, the first of {:e}: the error of none is known", rules.first);
        let d = Diagnostic::new(Code::W618, text).note(format!("an estimate needs {FEWEST} steps"));
        Some(d.help("a smaller `first`, well below the shortest time of the scene"))
    }

    /// W618 for a field beside whose values, flight or drift the demanded error is much of what else happens to it.
    pub(super) fn beside(&self, scene: &Solving<'_>) -> Option<Diagnostic> {
        let (rules, adaptive) = scene.steps.auto.as_ref().zip(self.integrators.adaptive.as_ref())?;
        let name = |found: &Unresolved| scene.system.fields[found.field].name.as_str();
        let (found, text, why, help) = if let Some(found) = adaptive.unresolved(scene, rules) {
            let text = format!(
                "of what changes of `{}` {:.0e} is no error of steps but rounding, more than the demanded {:e}",
                name(&found),
                found.part,
                rules.error
            );
            let why = "its values, or what cancels in its equations, are too large beside its changes";
            (found, text, why, "an unknown that is the difference from the start, or a larger `error`")
        } else if let Some(found) = adaptive.in_flight(scene, rules) {
            let text = format!(
                "the demanded error of {:e} is one of the flight of `{}`: a step may miss {:.0e} of what happens beside it",
                rules.error,
                name(&found),
                found.part
            );
            let why = "nearly all of its change is the uniform motion with which it starts";
            (found, text, why, "start it at rest, with all that moves beside it, or a smaller `error`")
        } else {
            let found = adaptive.in_drift(scene, rules)?;
            let text = format!(
                "the demanded error of {:e} is one of the drift of `{}`: a step has missed about {:.0e} of what happens beside it",
                rules.error,
                name(&found),
                found.part
            );
            let why = "nearly all of its change is the same everywhere and goes on as it began";
            (found, text, why, "solve for the difference from the drift, or demand a smaller `error`")
        };
        let d = Diagnostic::new(Code::W618, text).at_or_note(scene.place_of_field(name(&found)), why);
        Some(d.help(help))
    }

    /// W619 for states behind which `limit` was no positive number.
    pub(super) fn unlimited(&self, scene: &Scene) -> Option<Diagnostic> {
        let rules = scene.steps.auto.as_ref().filter(|rules| rules.limit.is_some())?;
        // behind the last state no step follows
        let stop = scene.steps.last();
        let unlimited = |s: &&StepResult| s.window.end < stop && (s.limit.is_nan() || s.limit <= 0.0);
        let first = self.steps.iter().find(unlimited)?;
        let count = self.steps.iter().filter(unlimited).count();
        let value = if first.limit.is_nan() { "not a number".to_owned() } else { format!("{:e}", first.limit) };
        let text = format!(
            "`limit` is {value} behind the state at t = {}, and no positive number behind {count} states in all",
            first.window.end
        );
        let so = format!("there it limited nothing, and an increment was at most {:e}", rules.most);
        Some(Diagnostic::new(Code::W619, text).note(so))
    }
}

/// What `expect` knows of an event.
fn numbers_of(name: &str, episodes: &[Episode]) -> [(String, f64); 4] {
    let begin = |e: Option<&Episode>| e.map_or(f64::NAN, |e| e.begin);
    let (first, last) = (begin(episodes.first()), begin(episodes.last()));
    let before = begin(episodes.len().checked_sub(2).map(|k| &episodes[k]));
    #[expect(clippy::cast_precision_loss, reason = "fewer than steps")]
    let values = [episodes.len() as f64, first, last, last - before];
    let [a, b, c, d] = wfl::Event::NUMBERS.map(|end| format!("{name}{end}"));
    [(a, values[0]), (b, values[1]), (c, values[2]), (d, values[3])]
}

/// The name of a file without its folder.
pub(super) fn file_name(path: impl AsRef<Path>) -> Option<String> {
    path.as_ref().file_name().map(|n| n.to_string_lossy().into_owned())
}

/// Writes the report and the kept outputs of a run without files into a folder, under the names that the run would have
/// given them: for whoever wants its page afterwards.
///
/// # Errors
/// [`RunError::Output`] for a folder that cannot be used.
pub fn save(scene: &Scene, options: &RunOptions, outcome: &Outcome, folder: &Path) -> Result<(), RunError> {
    let dir = OutputDir::open(folder)?;
    folder::begin(scene, &folder::identity(scene, options), &dir)?;
    let mut files = Vec::new();
    for step in &outcome.kept {
        for (name, pieces) in &step.grids {
            let name = wfl_output::step_name(name, step.number, "vtu");
            files.push(write_vtu(&dir, &name, Some(step.time), pieces)?);
        }
        for table in &step.tables {
            files.push(write_csv(&dir, &table.file, &table.columns, &table.rows)?);
        }
    }
    files.extend(write_measures(&dir, scene.steps.variable.as_deref(), &outcome.steps)?);
    dir.sync()?;
    let mut report = outcome.report.clone();
    report.files = files.iter().filter_map(file_name).collect();
    write_report(&dir, &report)?;
    Ok(folder::end(&dir, if outcome.converged() { State::Finished } else { State::Stopped })?)
}
