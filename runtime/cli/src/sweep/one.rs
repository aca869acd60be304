//! One setting of a sweep, run in this process with a fresh state: what it cost and what came out.
//!
//! A run that fails is a result with a message and the time it took. Files of the scene are not written: their
//! quantities are compared instead. Timed is everything from the text to the last step.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::Instant,
};

use wfl::{Diagnostic, Output, Span, render};
use wfl_compiler::{Class, backend::KernelBackend};
use wfl_runtime::{Outcome, Pruning, Quiet, RunOptions, Scene, prepare_keeping, text_hash};

use super::knobs::{self, Setting};
use crate::load::{Loaded, read_scene};

/// What a run ended as.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Status {
    Ok,
    NotConverged(String),
    Failed(String),
}

/// A run that came to its end.
pub(super) struct Solved {
    pub(super) loaded: Loaded,
    /// The outputs of the scene, which were not made.
    pub(super) outputs: Vec<Output>,
    pub(super) scene: Scene,
    pub(super) outcome: Outcome,
}

impl Solved {
    /// The place that expressions of no text are given: a scene that was solved has a mesh statement.
    pub(super) fn scene_span(&self) -> Span {
        let main = self.loaded.script.main;
        self.loaded.script.mesh.as_ref().map_or(Span { source: main, start: 0, end: 0 }, |m| m.span)
    }
}

/// What one run cost.
pub(super) struct Run {
    pub(super) status: Status,
    /// Wall time in seconds, text to last step.
    pub(super) seconds: f64,
    /// Present unless it failed.
    pub(super) solved: Option<Solved>,
}

/// A scene as a sweep needs to know it before it is run.
pub(super) struct Known {
    /// Names of its parameters.
    pub(super) params: Vec<String>,
    /// Regions of terms with kinks; of all terms where there are none.
    pub(super) kinked: Vec<String>,
    /// A number that tells its text from others.
    pub(super) hash: u64,
    /// The scene as it stands.
    pub(super) scene: Scene,
    pub(super) loaded: Loaded,
}

/// Reads and prepares a scene as it stands.
pub(super) fn known(path: &Path, backend: &dyn KernelBackend) -> Result<Known, String> {
    let loaded = read_scene(path, &[], "sweep", "")?;
    let (scene, loaded) = prepared(loaded, backend, &[])?;
    let params = loaded.script.params.iter().map(|p| p.name.name.clone()).collect();
    let region = |t: &wfl_runtime::TermSummary| t.place.clone();
    let mut kinked: Vec<String> = scene.terms.iter().filter(|t| t.class == Class::Kinked).map(region).collect();
    if kinked.is_empty() {
        kinked = scene.terms.iter().map(region).collect();
    }
    kinked.sort();
    kinked.dedup();
    kinked.retain(|r| loaded.script.regions.iter().any(|s| s.name.name == *r) || r == "all" || r == "boundary");
    let hash = text_hash(loaded.texts());
    Ok(Known { params, kinked, hash, scene, loaded })
}

fn prepared(mut loaded: Loaded, backend: &dyn KernelBackend, keep: &[Pruning]) -> Result<(Scene, Loaded), String> {
    let made = prepare_keeping(&loaded.script, &loaded.folder, backend, keep);
    loaded.messages.extend(made.diagnostics);
    match made.scene.filter(|_| !loaded.messages.iter().any(Diagnostic::is_error)) {
        Some(scene) => Ok((scene, loaded)),
        None => Err(errors(&loaded)),
    }
}

/// The errors of a scene as they are shown.
fn errors(loaded: &Loaded) -> String {
    let shown = loaded.messages.iter().filter(|d| d.is_error()).map(|d| render(d, &loaded.sources, false));
    shown.collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

/// What is the same for all runs.
pub(super) struct Bench<'a> {
    pub(super) backend: &'a dyn KernelBackend,
    pub(super) threads: usize,
}

impl Bench<'_> {
    /// Runs a setting of a scene; `more` are statements put behind its text.
    pub(super) fn run(&self, path: &Path, known: &Known, setting: &Setting, more: &str) -> Run {
        let started = Instant::now();
        let attempt = AssertUnwindSafe(|| self.attempt(path, known, setting, more, started));
        let ended =
            catch_unwind(attempt).unwrap_or_else(|_| Err("the program stopped at a fault of its own".to_owned()));
        let seconds = started.elapsed().as_secs_f64();
        match ended {
            Ok(solved) => {
                let failed = solved.outcome.steps.iter().find(|s| !s.history.converged());
                let status = failed.map_or(Status::Ok, |step| {
                    let n = step.history.n_iterations();
                    Status::NotConverged(format!("step t = {} did not converge in {n} iterations", step.time))
                });
                Run { status, seconds, solved: Some(solved) }
            }
            Err(message) => Run { status: Status::Failed(message), seconds, solved: None },
        }
    }

    fn attempt(
        &self,
        path: &Path,
        known: &Known,
        setting: &Setting,
        more: &str,
        started: Instant,
    ) -> Result<Solved, String> {
        let mut loaded = read_scene(path, &knobs::overrides(setting, &known.params), "sweep", more)?;
        let script = &mut loaded.script;
        knobs::apply(script, setting, &known.params, &known.kinked).map_err(|e| e.to_string())?;
        let outputs = std::mem::take(&mut script.outputs);
        script.expects.clear();
        let parse_seconds = started.elapsed().as_secs_f64();
        let kept = knobs::kept(setting).map_err(|e| e.to_string())?;
        let (mut scene, loaded) = prepared(loaded, self.backend, kept.as_slice())?;
        let threads = knobs::threads(setting).map_err(|e| e.to_string())?.unwrap_or(self.threads);
        let options = RunOptions {
            name: loaded.name.clone(),
            text_hash: known.hash,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            parse_seconds,
            ..RunOptions::without_files(threads, started)
        };
        let outcome = wfl_runtime::run(&mut scene, &options, &mut Quiet).map_err(|e| e.to_string())?;
        Ok(Solved { loaded, outputs, scene, outcome })
    }
}
