//! The results folder of a run: the identity of the run, whether it may begin there, and whether it may continue.
//!
//! Promises: nothing is computed before it is known that every file of the run can be written under its name; a run
//! continues its own results only, and only unchanged ones; otherwise the message names the difference.

use std::path::Path;

use wfl_host::input::{InputKind, read_input};
use wfl_output::{Identity, Kind, MEASURES_FILE, OrderedMap, OutputDir, OutputError, Plan, REPORT_FILE, Report, State};
use wfl_problem::Scene;
use wfl_sparse::solve::{Linked, Precision};

use super::{CHECKPOINT_FILE, CheckpointError, RunError, RunOptions, checkpoint, files};

/// What goes with the results that it was made from: the page about a run, and the tables of its measures and derivatives
/// where the new run has none.
const GO_WITH_RESULTS: [&str; 3] = ["report.html", MEASURES_FILE, "gradient.csv"];

/// Everything that the numbers of a run follow from.
pub(super) fn identity(scene: &Scene, options: &RunOptions) -> Identity {
    let mut settings = options.settings.clone();
    let precision = Precision::NAMES.iter().find(|(_, p)| *p == options.precision);
    settings.insert("precision", precision.map_or("", |(name, _)| name).to_owned());
    if let Some(Linked(library)) = options.library {
        settings.insert("backend", library.name().to_owned());
    }
    settings.insert("max_iter", scene.newton.max_iterations.to_string());
    let value = |values: &[f64]| values.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
    let parameters: OrderedMap<String> =
        scene.params.iter().map(|(name, v)| (name.as_str(), value(&v.values))).collect();
    let mut inputs = options.texts.clone();
    for input in &scene.inputs {
        inputs.insert(input.name.as_str(), input.hash);
    }
    Identity { version: options.version.clone(), inputs, parameters, settings }
}

/// Whether a run of a scene could begin in a folder, and the files `more` be written beside its own: for whoever computes
/// something else before.
///
/// # Errors
/// [`RunError::Output`] for a folder that cannot be used, or that has files of others under the names of results.
pub fn may_begin(scene: &Scene, out: &Path, more: &[&str]) -> Result<(), RunError> {
    let dir = OutputDir::open(out)?;
    let mut plan = files::plan(scene);
    plan.files.extend(more.iter().map(|name| (*name).to_owned()));
    spares_inputs(scene, &dir, &plan)?;
    Ok(dir.may_begin(Kind::Run, &plan)?)
}

/// Begins a run in a folder.
pub(super) fn begin(scene: &Scene, identity: &Identity, dir: &OutputDir) -> Result<(), RunError> {
    let plan = files::plan(scene);
    spares_inputs(scene, dir, &plan)?;
    dir.begin(Kind::Run, identity, &plan)?;
    // of an earlier run: this one does not continue it
    remove_checkpoint(dir)
}

/// Goes on with a run in its folder.
pub(super) fn go_on(scene: &Scene, dir: &OutputDir) -> Result<(), RunError> {
    let plan = files::plan(scene);
    spares_inputs(scene, dir, &plan)?;
    Ok(dir.go_on(Kind::Run, &plan)?)
}

/// The checkpoint that a run continues; empty at the beginning.
pub(super) fn found(identity: &Identity, dir: &OutputDir) -> Result<checkpoint::Files, RunError> {
    let Some((Kind::Run, state, former)) = dir.holds() else { return Ok(checkpoint::Files::default()) };
    same(identity, &former, dir)?;
    // a checkpoint of this run is in its manifest; one that is not there, or is an earlier run's, is none
    if state == State::Finished || dir.verify(CHECKPOINT_FILE)?.is_none() {
        return Ok(checkpoint::Files::default());
    }
    if dir.verify(checkpoint::LOG_FILE)?.is_none() {
        let (path, name) = (dir.path().to_path_buf(), checkpoint::LOG_FILE.to_owned());
        return Err(CheckpointError::Gone { path, name }.into());
    }
    Ok(checkpoint::read(dir.path())?)
}

/// Removes the checkpoint of a run.
pub(super) fn remove_checkpoint(dir: &OutputDir) -> Result<(), RunError> {
    dir.remove(CHECKPOINT_FILE)?;
    Ok(dir.remove(checkpoint::LOG_FILE)?)
}

/// Notes how far a run got; a page about an earlier one goes.
pub(super) fn end(dir: &OutputDir, state: State) -> Result<(), OutputError> {
    let of_field = |name: &str| name.starts_with("gradient_") && name.contains("_by_") && name.ends_with(".csv");
    dir.remove_former(|name| GO_WITH_RESULTS.contains(&name) || of_field(name))?;
    dir.finish(state)
}

/// The report of a run that is to go on and has nothing left to do: everything it wrote was compared with what is in
/// the folder. `None` for a run that has to be made or to go on.
///
/// # Errors
/// [`RunError::Checkpoint`] for results of another run, [`RunError::Output`] for a folder that cannot be used, and for
/// results that are damaged or gone.
pub fn finished(scene: &Scene, options: &RunOptions) -> Result<Option<Report>, RunError> {
    let Some(path) = options.out.as_ref().filter(|path| options.resume && path.is_dir()) else { return Ok(None) };
    let dir = OutputDir::open(path)?;
    let Some((Kind::Run, State::Finished, former)) = dir.holds() else { return Ok(None) };
    same(&identity(scene, options), &former, &dir)?;
    for name in dir.own_files() {
        if dir.verify(&name)?.is_none() {
            return Err(CheckpointError::Gone { path: path.clone(), name }.into());
        }
    }
    let file = path.join(REPORT_FILE);
    let read = read_input(&file, InputKind::Results).map_err(|e| e.to_string());
    let report = read.and_then(|bytes| serde_json::from_slice::<Report>(&bytes).map_err(|e| e.to_string()));
    let report = report.map_err(|what| OutputError::Damaged { file: file.clone(), what })?;
    if !report.is_in(&dir) {
        return Err(OutputError::Damaged { file, what: "its content is not what was written".to_owned() }.into());
    }
    Ok(Some(report))
}

fn same(identity: &Identity, former: &Identity, dir: &OutputDir) -> Result<(), CheckpointError> {
    let other = |what| CheckpointError::Other { path: dir.path().to_path_buf(), what };
    identity.difference(former).map_or(Ok(()), |what| Err(other(what)))
}

/// Whether no result has the place of a file that the scene reads.
fn spares_inputs(scene: &Scene, dir: &OutputDir, plan: &Plan) -> Result<(), OutputError> {
    let Ok(folder) = dir.path().canonicalize() else { return Ok(()) };
    for input in &scene.inputs {
        let Ok(file) = input.path.canonicalize() else { continue };
        let name = file.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if file.parent() == Some(&folder) && plan.takes(name) {
            return Err(OutputError::Input { file: input.path.clone() });
        }
    }
    Ok(())
}
