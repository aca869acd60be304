//! One setting of a scene, run in this process with a fresh state: what it cost and what came out.
//!
//! A run that fails is a result with a message and the time it took. Files of the scene are not written: their
//! quantities are compared instead. Timed is everything from the text to the last step.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::Instant,
};

use wfl::{Diagnostic, ResolvedScript, render};
use wfl_adapt::{
    accuracy::lean,
    compare::Solved,
    knobs::{self, Setting},
};
use wfl_compiler::{Class, InterpreterBackend, backend::KernelBackend};
use wfl_discrete::pruning::Pruning;
use wfl_mesh::refine::Mark;
use wfl_output::{Hash, Identity, OrderedMap};
use wfl_problem::{NO_SAMPLING, Sampling, Scene, prepare_sampled};
use wfl_run::{Quiet, RunOptions};

use crate::{
    Listener, Loaded, VERSION,
    advice::hourglass,
    limited_threads,
    scene_file::{read_scene, rounds_of},
};

/// What a run ended as.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Ok,
    NotConverged(String),
    Failed(String),
}

/// What one run cost.
pub(crate) struct Run {
    pub(crate) status: Status,
    /// Wall time in seconds, text to last step.
    pub(crate) seconds: f64,
    /// Present unless it failed.
    pub(crate) solved: Option<Solved>,
}

/// A scene as a sweep needs to know it before it is run.
pub(crate) struct Known {
    /// Names of its parameters.
    pub(crate) params: Vec<String>,
    /// Regions of terms with kinks; of all terms where there are none.
    pub(crate) kinked: Vec<String>,
    /// What it reads and what read it: tells it from others.
    pub(crate) identity: Identity,
    /// Parameters as the command line gives them, `NAME=VALUE`; a setting goes before.
    pub(crate) given: Vec<String>,
    /// The scene as it stands.
    pub(crate) scene: Scene,
    pub(crate) loaded: Loaded,
}

/// Reads and prepares a scene as it stands.
pub(crate) fn known(path: &Path, given: &[String], backend: &dyn KernelBackend) -> Result<Known, String> {
    let loaded = read_scene(path, given, "sweep", "")?;
    let (scene, loaded) = prepared(loaded, backend, &[], &[])?;
    Ok(known_of(loaded, scene, given))
}

/// The same of a scene that has been prepared.
pub(crate) fn known_of(loaded: Loaded, scene: Scene, given: &[String]) -> Known {
    let params = loaded.script.params.iter().map(|p| p.name.name.clone()).collect();
    let region = |t: &wfl_problem::TermSummary| t.place.clone();
    let mut kinked: Vec<String> = scene.terms.iter().filter(|t| t.class == Class::Kinked).map(region).collect();
    if kinked.is_empty() {
        kinked = scene.terms.iter().map(region).collect();
    }
    kinked.sort();
    kinked.dedup();
    kinked.retain(|r| loaded.script.regions.iter().any(|s| s.name.name == *r) || r == "all" || r == "boundary");
    let inputs = inputs(&loaded, &scene);
    let version = VERSION.to_owned();
    let identity = Identity { version, inputs, ..Identity::default() };
    Known { params, kinked, identity, given: given.to_vec(), scene, loaded }
}

/// Everything that a scene reads.
fn inputs(loaded: &Loaded, scene: &Scene) -> OrderedMap<Hash> {
    let mut inputs = loaded.texts();
    for input in &scene.inputs {
        inputs.insert(input.name.as_str(), input.hash);
    }
    inputs
}

/// What decides the time of a run.
pub(crate) struct Size {
    pub(crate) dofs: usize,
    pub(crate) dim: usize,
    pub(crate) degree: usize,
    pub(crate) steps: usize,
}

/// Prepares a setting, without machine code, to see how large it is.
pub(crate) fn size(path: &Path, known: &Known, setting: &Setting) -> Result<Size, String> {
    let mut loaded = read_scene(path, &known.words(setting), "sweep", "")?;
    known.apply(&mut loaded.script, setting)?;
    loaded.rounds = rounds_of(setting)?;
    loaded.script.outputs.clear();
    let (scene, _) = prepared(loaded, &InterpreterBackend, &[], &[])?;
    let system = &scene.system;
    let degree = system.fields.iter().map(wfl_discrete::field::Field::degree).max().unwrap_or(1);
    Ok(Size { dofs: system.numbering.n_free(), dim: system.mesh.dim(), degree, steps: scene.steps.values.len() })
}

/// The problem of a scene that was read, its mesh refined round by round.
pub(crate) fn prepared(
    loaded: Loaded,
    backend: &dyn KernelBackend,
    keep: &[Pruning],
    rounds: &[Vec<Mark>],
) -> Result<(Scene, Loaded), String> {
    sampled(loaded, backend, keep, (rounds, &NO_SAMPLING))
}

/// The same with some integrals taken with more points.
fn sampled(
    mut loaded: Loaded,
    backend: &dyn KernelBackend,
    keep: &[Pruning],
    mesh: (&[Vec<Mark>], &Sampling),
) -> Result<(Scene, Loaded), String> {
    let rounds = [&loaded.rounds, mesh.0].concat();
    let made = prepare_sampled(&loaded.script, &loaded.folder, backend, keep, (&rounds, mesh.1));
    loaded.messages.extend(made.diagnostics);
    match made.scene.filter(|_| !loaded.messages.iter().any(Diagnostic::is_error)) {
        Some(scene) => Ok((scene, loaded)),
        None => Err(errors(&loaded)),
    }
}

/// The errors of a scene as they are shown.
fn errors(loaded: &Loaded) -> String {
    let shown = loaded.messages.iter().filter(|d| d.is_error()).map(|d| render(d, &loaded.sources));
    shown.collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

impl Known {
    /// The parameters of a run as words of a command line.
    pub(crate) fn words(&self, setting: &Setting) -> Vec<String> {
        let set = |word: &str| setting.iter().any(|(n, _)| word.split('=').next().map(str::trim) == Some(n));
        let mut words: Vec<String> = self.given.iter().filter(|w| !set(w)).cloned().collect();
        words.extend(knobs::overrides(setting, &self.params));
        words
    }

    /// Whether a run of the scene reads what it read at first; with `more` behind it the text of
    /// the scene itself is another one.
    fn is_what_was_read(&self, inputs: &OrderedMap<Hash>, more: &str) -> Result<(), String> {
        let changed = |(name, hash): &(&str, &Hash)| self.identity.inputs.get(name) != Some(hash);
        match inputs.iter().skip(usize::from(!more.is_empty())).find(changed) {
            Some((name, _)) => Err(format!("`{name}` changed while the runs were made: begin again")),
            None => Ok(()),
        }
    }

    /// Changes the statements of a scene that was read with these words.
    pub(crate) fn apply(&self, script: &mut ResolvedScript, setting: &Setting) -> Result<(), String> {
        knobs::apply(script, setting, &self.params, &self.kinked).map_err(|e| e.to_string())
    }
}

/// Whether a step of a scene depends on those before it.
pub(crate) fn remembers(scene: &Scene) -> bool {
    scene.system.past().is_some() || !scene.states.is_empty()
}

/// What is the same for all runs.
#[derive(Clone)]
pub(crate) struct Bench<'a> {
    pub(crate) backend: &'a dyn KernelBackend,
    pub(crate) listener: &'a dyn Listener,
    pub(crate) threads: usize,
    /// The quantity of the last step that runs are made for, where nothing else is wanted of them.
    pub(crate) only: Option<String>,
    /// The last step alone is wanted: where nothing remembers the others it is solved alone.
    pub(crate) last: bool,
    /// Refinement of the mesh.
    pub(crate) rounds: &'a [Vec<Mark>],
    /// Integrals that are taken with more points.
    pub(crate) sampling: &'a Sampling,
}

impl Bench<'_> {
    /// Options of a run that writes no files and begins now.
    pub(crate) fn options(&self) -> RunOptions {
        RunOptions::without_files(self.threads, Instant::now())
    }

    /// Runs a setting of a scene; `more` are statements put behind its text.
    pub(crate) fn run(&self, path: &Path, known: &Known, setting: &Setting, more: &str) -> Run {
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
                    Status::NotConverged(format!("step t = {} did not converge in {n} iterations", step.window.end))
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
        let mut loaded = read_scene(path, &known.words(setting), "sweep", more)?;
        loaded.rounds = rounds_of(setting)?;
        let script = &mut loaded.script;
        known.apply(script, setting)?;
        if let Some(quantity) = &self.only {
            lean(script, &known.scene, quantity);
        }
        let outputs = std::mem::take(&mut script.outputs);
        if self.only.is_some() || self.last {
            // what they read is not made
            script.expects.clear();
        }
        let parse_seconds = started.elapsed().as_secs_f64();
        let kept = knobs::kept(setting).map_err(|e| e.to_string())?;
        let (mut scene, loaded) = sampled(loaded, self.backend, &kept, (self.rounds, self.sampling))?;
        known.is_what_was_read(&inputs(&loaded, &scene), more)?;
        let threads = knobs::threads(setting)
            .map_err(|e| e.to_string())?
            .map_or(self.threads, |n| limited_threads(n, self.listener));
        let precision = knobs::precision(setting).map_err(|e| e.to_string())?.unwrap_or_default();
        let options = RunOptions {
            name: loaded.name.clone(),
            version: VERSION.to_owned(),
            parse_seconds,
            precision,
            judge: self.only.is_none(),
            ..RunOptions::without_files(threads, started)
        };
        if self.last && !remembers(&scene) && scene.steps.values.len() > 1 {
            // nothing remembers the steps before the last: it is tried alone, and all of them where that fails
            let all = scene.steps.values.clone();
            scene.steps.values.drain(..all.len() - 1);
            match wfl_run::run(&scene, &options, &mut Quiet) {
                Ok(outcome) if outcome.converged() => {
                    return Ok(Solved { script: loaded.script, outputs, scene, outcome });
                }
                _ => scene.steps.values = all,
            }
        }
        match wfl_run::run(&scene, &options, &mut Quiet) {
            Ok(outcome) => Ok(Solved { script: loaded.script, outputs, scene, outcome }),
            Err(error) => Err(with_cause(&error.to_string(), &hourglass::rules(&loaded, &scene))),
        }
    }
}

/// Why a run failed, with the rules that leave cells without stiffness: what makes a matrix singular is said in the
/// first line, notes and remedies below it.
fn with_cause(error: &str, rules: &[Diagnostic]) -> String {
    let mut text = error.to_owned();
    for rule in rules {
        text += &format!("; {} [{}]", rule.message, rule.code);
    }
    for rule in rules {
        rule.notes.iter().for_each(|note| text += &format!("\n  = note: {note}"));
        rule.helps.iter().for_each(|help| text += &format!("\n  = help: {help}"));
    }
    text
}
