//! Effect of the optimisations: the scene is solved again with each of them turned off, without output.

use std::{path::Path, time::Instant};

use thiserror::Error;
use wfl::ResolvedScript;
use wfl_compiler::backend::KernelBackend;
use wfl_discrete::pruning::{Pruning, Saving};
use wfl_problem::{Scene, prepare_keeping};
use wfl_run::{Outcome, Quiet, RunError, RunOptions, run};

/// Why a saving could not be measured.
#[derive(Debug, Error)]
pub enum SavingError {
    /// The scene has errors, which are reported when it is prepared.
    #[error("the scene cannot be prepared")]
    Scene,
    /// A run stopped.
    #[error("without the optimisation `{}`: {error}", .pruning.map_or("nothing", Pruning::name))]
    Run {
        /// The optimisation that was turned off.
        pruning: Option<Pruning>,
        /// Why.
        error: RunError,
    },
}

/// Solves a scene as it is and with each of its optimisations turned off, in turn and twice: the faster of two counts.
/// `shape` is what else is changed in the scene before it is solved.
///
/// # Errors
/// [`SavingError`].
pub fn savings(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    threads: usize,
    shape: &dyn Fn(Scene) -> Scene,
) -> Result<Vec<Saving>, SavingError> {
    let mut script = script.clone();
    script.outputs.clear();
    script.expects.clear();
    let solve = |pruning: Option<Pruning>| {
        let started = Instant::now();
        let keep: Vec<Pruning> = pruning.into_iter().collect();
        let scene = shape(prepare_keeping(&script, folder, backend, &keep).scene.ok_or(SavingError::Scene)?);
        let options = RunOptions::without_files(threads, started);
        let outcome = run(&scene, &options, &mut Quiet).map_err(|error| SavingError::Run { pruning, error })?;
        Ok((started.elapsed().as_secs_f64(), outcome, scene.left_out()))
    };
    let (mut base, with, left_out) = solve(None)?;
    let mut list: Vec<Saving> = Vec::new();
    for pruning in left_out.iter().filter_map(|l| l.switch) {
        let (seconds, without, _) = solve(Some(pruning))?;
        list.push(Saving { pruning, times: seconds, moved: moved(&with, &without) });
    }
    for saving in &mut list {
        base = base.min(solve(None)?.0);
        saving.times = saving.times.min(solve(Some(saving.pruning))?.0);
    }
    list.iter_mut().for_each(|s| s.times /= base);
    Ok(list)
}

/// A measure smaller than this part of the largest one is rounding itself and is compared with that one.
const ROUNDING: f64 = 1e-6;

/// The largest difference of a measure at a step, in parts of the largest value it takes.
fn moved(with: &Outcome, without: &Outcome) -> f64 {
    if !without.converged() {
        return f64::INFINITY;
    }
    let names = with.steps.first().map_or(0, |s| s.measures.len());
    let largest = |k: usize| with.steps.iter().fold(0.0f64, |m, s| m.max(s.measures[k].1.abs()));
    let all = (0..names).map(largest).fold(0.0, f64::max);
    let mut worst = 0.0f64;
    for k in (0..names).filter(|_| all > 0.0) {
        let size = largest(k).max(ROUNDING * all);
        for (n, step) in with.steps.iter().enumerate() {
            let other = without.steps.get(n).map_or(f64::NAN, |s| s.measures[k].1);
            let change = (step.measures[k].1 - other).abs() / size;
            // a step that is missing or not a number moves by everything
            worst = worst.max(if change.is_nan() { f64::INFINITY } else { change });
        }
    }
    worst
}
