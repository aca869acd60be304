//! What leaving something out saves: the scene solved again with each switch turned, nothing written.

use std::{path::Path, time::Instant};

use thiserror::Error;
use wfl::ResolvedScript;
use wfl_compiler::backend::KernelBackend;

use crate::{
    pruning::{Pruning, Saving},
    run::{Outcome, Quiet, RunError, RunOptions, run},
    scene::prepare_keeping,
};

/// Why a saving could not be measured.
#[derive(Debug, Error)]
pub enum SavingError {
    /// The scene has errors, which are told where it is prepared to be solved.
    #[error("the scene cannot be prepared")]
    Scene,
    /// A run stopped.
    #[error("without the pruning `{}`: {error}", .pruning.map_or("nothing", Pruning::name))]
    Run {
        /// The pruning that was turned off.
        pruning: Option<Pruning>,
        /// Why.
        error: RunError,
    },
}

/// Solves a scene as it is and with each of its prunings turned off, in turn and twice: the faster of two counts.
///
/// # Errors
/// [`SavingError`].
pub fn savings(
    script: &ResolvedScript,
    folder: &Path,
    backend: &dyn KernelBackend,
    threads: usize,
) -> Result<Vec<Saving>, SavingError> {
    let mut script = script.clone();
    script.outputs.clear();
    script.expects.clear();
    let solve = |pruning: Option<Pruning>| {
        let started = Instant::now();
        let keep: Vec<Pruning> = pruning.into_iter().collect();
        let mut scene = prepare_keeping(&script, folder, backend, &keep).scene.ok_or(SavingError::Scene)?;
        let options = RunOptions::without_files(threads, started);
        let outcome = run(&mut scene, &options, &mut Quiet).map_err(|error| SavingError::Run { pruning, error })?;
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

/// The largest difference of a measure at a step, in parts of the largest value it takes.
fn moved(with: &Outcome, without: &Outcome) -> f64 {
    let mut worst = 0.0f64;
    let names = with.steps.first().map_or(0, |s| s.measures.len());
    for k in 0..names {
        let value = |outcome: &Outcome, step: usize| outcome.steps.get(step).map_or(f64::NAN, |s| s.measures[k].1);
        let largest = (0..with.steps.len()).fold(0.0f64, |m, n| m.max(value(with, n).abs()));
        for n in (0..with.steps.len()).filter(|_| largest > 0.0) {
            let change = (value(with, n) - value(without, n)).abs() / largest;
            // a step that is missing or not a number moves by everything
            worst = worst.max(if change.is_nan() { f64::INFINITY } else { change });
        }
    }
    worst
}
