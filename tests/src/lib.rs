//! Scenes as text, solved through the library: what the suites share.

pub mod blocks;
pub mod constants;
pub mod corpus;
pub mod driven;
pub mod fuzz;
pub mod gradient_cost;
pub mod mutants;
pub mod operators;
pub mod plate;
pub mod ranks;
mod side_by_side;
pub mod verification;

pub use side_by_side::side_by_side;

use std::path::{Path, PathBuf};

use wfl::{Diagnostic, Loader, Override, ResolvedScript, SourceId, SourceMap, parse_expr, render, resolve};
use wfl_compiler::backend::KernelBackend;
use wfl_gradient::{Differentiated, Gradients, Request, gradients, settle};
use wfl_jit::JitBackend;
use wfl_problem::{Scene, prepare};
use wfl_run::{Outcome, Quiet, RunOptions, run};

/// Files by name, changed by text replacements on the way.
struct Edited<'a> {
    folder: PathBuf,
    edits: &'a [(&'a str, String)],
}

impl Loader for Edited<'_> {
    fn load(&mut self, path: &str, _from: SourceId) -> Result<(String, String), wfl::Unloaded> {
        let full = self.folder.join(path);
        let text = std::fs::read_to_string(&full).map_err(|e| e.to_string())?;
        Ok((full.display().to_string(), edited(text, self.edits)))
    }

    fn table(&mut self, path: &str) -> Result<String, wfl::Unloaded> {
        let text = std::fs::read_to_string(self.folder.join(path)).map_err(|e| e.to_string())?;
        Ok(edited(text, self.edits))
    }
}

fn edited(text: String, edits: &[(&str, String)]) -> String {
    edits.iter().fold(text, |t, (from, to)| t.replace(from, to))
}

/// The folder of the examples.
#[must_use]
pub fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples")
}

/// Files with this ending below a folder of the repository, in order.
///
/// # Panics
/// If a folder cannot be read.
#[must_use]
pub fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder)];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder of the repository") {
            let path = entry.expect("a readable folder").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == ending) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// A fixed sequence of numbers in [-1, 1).
#[derive(Clone, Copy, Debug)]
pub struct Sequence(
    /// The start, not 0.
    pub u64,
);

impl Sequence {
    /// The next number (xorshift).
    pub fn number(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Every scene of the examples that is a problem by itself: files that another one uses are left out.
///
/// # Panics
/// If the folder cannot be read.
#[must_use]
pub fn scene_files() -> Vec<PathBuf> {
    let scenes = files("examples", "wfl");
    let texts: Vec<String> = scenes.iter().map(|s| std::fs::read_to_string(s).expect("examples can be read")).collect();
    let used = |path: &Path| {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let line = format!("use \"{name}\"");
        let beside = scenes.iter().zip(&texts).filter(|(s, _)| s.parent() == path.parent());
        beside.into_iter().any(|(_, text)| text.lines().any(|l| l.trim() == line))
    };
    scenes.iter().filter(|s| !used(s)).cloned().collect()
}

/// A reference file as JSON.
///
/// # Panics
/// If it is not in the repository.
#[must_use]
pub fn reference(name: &str) -> serde_json::Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("reference").join(name);
    let text = std::fs::read_to_string(path).expect("the reference file is in the repository");
    serde_json::from_str(&text).expect("reference files are JSON")
}

/// A scene that was solved.
pub struct Solved {
    /// The problem.
    pub scene: Scene,
    /// Its steps.
    pub outcome: Outcome,
}

/// Reads a scene; the messages tell of errors and warnings. No script after an error.
///
/// # Panics
/// For a value of a parameter that is no number.
#[must_use]
pub fn script_and_messages(
    folder: &Path,
    text: String,
    edits: &[(&str, String)],
    params: &[(&str, f64)],
) -> (Option<ResolvedScript>, SourceMap, String) {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", edited(text, edits));
    let mut overrides = Vec::new();
    for (name, value) in params {
        let id = sources.add("(command line)", format!("{value:?}"));
        let value = parse_expr(&sources, id).value.expect("a number");
        overrides.push(Override { name: (*name).to_owned(), span: value.span, value });
    }
    let mut loader = Edited { folder: folder.to_path_buf(), edits };
    let checked = resolve(&mut sources, main, &mut loader, &overrides);
    let messages = told(&checked.diagnostics, &sources);
    let script = checked.value.filter(|_| !checked.diagnostics.iter().any(Diagnostic::is_error));
    (script, sources, messages)
}

fn told(diagnostics: &[Diagnostic], sources: &SourceMap) -> String {
    diagnostics.iter().map(|d| render(d, sources)).collect::<Vec<_>>().join("\n")
}

/// Reads and prepares a scene; the messages tell of errors and warnings.
fn scene_and_messages(
    folder: &Path,
    text: String,
    edits: &[(&str, String)],
    params: &[(&str, f64)],
    backend: &dyn KernelBackend,
) -> (Option<(Scene, ResolvedScript)>, String) {
    let (script, sources, mut messages) = script_and_messages(folder, text, edits, params);
    let Some(script) = script else { return (None, messages) };
    let made = prepare(&script, folder, backend);
    messages += &told(&made.diagnostics, &sources);
    (made.scene.map(|scene| (scene, script)), messages)
}

/// Prepares a scene of `folder` from its text; `edits` are replaced in every file.
///
/// # Errors
/// The messages as text.
pub fn prepared(
    folder: &Path,
    text: String,
    edits: &[(&str, String)],
    params: &[(&str, f64)],
    backend: &dyn KernelBackend,
) -> Result<Scene, String> {
    let (scene, messages) = scene_and_messages(folder, text, edits, params, backend);
    scene.map(|(scene, _)| scene).ok_or(messages)
}

/// What became of a scene, solved or not.
pub struct Attempt {
    /// The run, if it came to its end; its steps need not have converged.
    pub solved: Option<Solved>,
    /// Every error and warning as text.
    pub messages: String,
}

/// A scene from its text alone, every step of which converges.
///
/// # Panics
/// If it is refused, or a step does not converge.
#[must_use]
pub fn solved(text: impl Into<String>) -> Solved {
    let found = solve(Path::new("."), text.into(), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged());
    found
}

/// The messages of a scene that is refused, from its text alone.
///
/// # Panics
/// If it is solved.
#[must_use]
pub fn refused(text: &str) -> String {
    match solve(Path::new("."), text.to_owned(), &[], &[]) {
        Ok(_) => panic!("solved:\n{text}"),
        Err(told) => told,
    }
}

/// What a run gives cause to doubt: codes, and all that is said in a line.
#[must_use]
pub fn doubts(outcome: &Outcome) -> Vec<(&'static str, String)> {
    outcome.warnings.iter().map(|d| (d.code.as_str(), d.line())).collect()
}

/// Tries to solve a scene of `folder` from its text.
///
/// # Panics
/// If this processor cannot run machine code.
#[must_use]
pub fn attempt(folder: &Path, text: String, edits: &[(&str, String)], params: &[(&str, f64)]) -> Attempt {
    attempt_with(&RunOptions::without_files(2, std::time::Instant::now()), folder, text, edits, params)
}

/// As [`attempt`], run with these options; the unknowns of every step are kept.
///
/// # Panics
/// If this processor cannot run machine code.
#[must_use]
pub fn attempt_with(
    options: &RunOptions,
    folder: &Path,
    text: String,
    edits: &[(&str, String)],
    params: &[(&str, f64)],
) -> Attempt {
    let backend = JitBackend::new().expect("machine code on this processor");
    let (scene, mut messages) = scene_and_messages(folder, text, edits, params, &backend);
    let Some((scene, script)) = scene else { return Attempt { solved: None, messages } };
    let states_some = !script.gradients.is_empty();
    let keep_trajectory = options.keep_trajectory || states_some;
    let options = RunOptions { keep_states: true, keep_trajectory, ..options.clone() };
    match run(&scene, &options, &mut Quiet) {
        Ok(mut outcome) => {
            if states_some
                && outcome.converged()
                && let Err(d) = settle((&scene, &script), (&backend, options.threads), None, &mut outcome)
            {
                return Attempt { solved: None, messages: messages + &d.message };
            }
            Attempt { solved: Some(Solved { scene, outcome }), messages }
        }
        Err(error) => {
            messages += &error.to_string();
            Attempt { solved: None, messages }
        }
    }
}

/// Solves a scene of `folder` from its text.
///
/// # Errors
/// The messages as text.
pub fn solve(folder: &Path, text: String, edits: &[(&str, String)], params: &[(&str, f64)]) -> Result<Solved, String> {
    let Attempt { solved, messages } = attempt(folder, text, edits, params);
    solved.ok_or(messages)
}

/// The derivatives of results of a scene of `folder` in its parameters, as `wfl run --gradient RESULTS --with PARAMETERS`.
///
/// # Errors
/// The messages as text.
///
/// # Panics
/// If this processor cannot run machine code, or the lists cannot be read.
pub fn differentiated(
    scene: (&Path, String),
    edits: &[(&str, String)],
    params: &[(&str, f64)],
    results: &str,
    with: &str,
) -> Result<(Solved, Gradients), String> {
    let request = Request::read(results, with).expect("lists of names");
    ran(scene, edits, params, |of| gradients(of, &request))
}

/// Runs a scene of `folder` and makes something of its derivatives.
///
/// # Errors
/// The messages as text.
///
/// # Panics
/// If this processor cannot run machine code.
pub fn ran<T>(
    scene: (&Path, String),
    edits: &[(&str, String)],
    params: &[(&str, f64)],
    make: impl FnOnce(Differentiated<'_>) -> Result<T, Box<Diagnostic>>,
) -> Result<(Solved, T), String> {
    let options = RunOptions { keep_trajectory: true, ..RunOptions::without_files(2, std::time::Instant::now()) };
    ran_with(&options, scene, edits, params, make)
}

/// As [`ran`], run with these options, which keep the steps.
///
/// # Errors
/// The messages as text.
///
/// # Panics
/// If this processor cannot run machine code.
pub fn ran_with<T>(
    options: &RunOptions,
    scene: (&Path, String),
    edits: &[(&str, String)],
    params: &[(&str, f64)],
    make: impl FnOnce(Differentiated<'_>) -> Result<T, Box<Diagnostic>>,
) -> Result<(Solved, T), String> {
    let (folder, text) = scene;
    let backend = JitBackend::new().expect("machine code on this processor");
    let (script, sources, messages) = script_and_messages(folder, text, edits, params);
    let script = script.ok_or(messages)?;
    let made = prepare(&script, folder, &backend);
    let scene = made.scene.ok_or_else(|| told(&made.diagnostics, &sources))?;
    let outcome = run(&scene, options, &mut Quiet).map_err(|e| e.to_string())?;
    let of = Differentiated { scene: &scene, script: &script, outcome: &outcome, backend: &backend, threads: 2 };
    let found = make(of).map_err(|d| told(&[*d], &sources))?;
    Ok((Solved { scene, outcome }, found))
}

impl Solved {
    /// A measure at a step.
    ///
    /// # Panics
    /// If there is none of that name.
    #[must_use]
    pub fn measure(&self, step: usize, name: &str) -> f64 {
        let list = &self.outcome.steps[step].measures;
        list.iter().find(|m| m.0 == name).unwrap_or_else(|| panic!("no measure {name}")).1
    }

    /// The value of a field at the node at a position.
    ///
    /// # Panics
    /// If no node is there.
    #[must_use]
    pub fn at(&self, step: usize, field: &str, x: [f64; 3]) -> Vec<f64> {
        let system = &self.scene.system;
        let k = system.fields.iter().position(|f| f.name == field).expect("a field of the scene");
        let f = &system.fields[k];
        let distance = |n: usize| {
            let y = f.node_position(n);
            (0..3).map(|d| (x[d] - y[d]).powi(2)).sum::<f64>()
        };
        let node = (0..f.n_nodes()).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).expect("fields have nodes");
        assert!(distance(node) < 1e-18, "no node of {field} at {x:?}");
        let start = system.range(k).expect("an unknown").start + node * f.n_components;
        self.outcome.steps[step].state[start..start + f.n_components].to_vec()
    }
}

/// A folder of its own with the mesh file `body.msh`; removed at the end.
pub struct MeshFolder(PathBuf);

impl MeshFolder {
    /// A folder for a suite and one of its tests.
    ///
    /// # Panics
    /// If it cannot be written.
    #[must_use]
    pub fn new(name: &str, mesh: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("wfl-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        std::fs::write(folder.join("body.msh"), mesh).expect("a temporary file");
        Self(folder)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for MeshFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
