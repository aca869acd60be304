//! `wfl run --accuracy`: the run that was picked, ended, and what was found in words.

use std::{process::ExitCode, time::Instant};

use wfl_adapt::accuracy::{Demand, Out, Short, Ways};
use wfl_compiler::backend::KernelBackend;
use wfl_output::{REPORT_FILE, record::AccuracyRecord};
use wfl_problem::Scene;
use wfl_run::Outcome;
use wfl_tasks::{
    Loaded,
    accuracy::{Given, Job, Picked, WholeRun, pick, rewrite},
    folder::{error_line, told as told_of_folder},
    setting_text,
    words::error,
};

use crate::{
    args::RunArgs,
    console::Console,
    ended::finish,
    load::{out, say},
    prepared::EXIT_ERROR,
    ready::{self, Ready},
    table::{Table, number},
};

/// The demanded accuracy was not reached.
const EXIT_ACCURACY: u8 = 4;

/// The demand, on the command line or in the scene.
pub(crate) fn demand(args: &RunArgs, scene: &Scene) -> Option<Demand> {
    let given =
        Given { error: args.accuracy, quantity: args.of.clone(), budget: args.budget, from_coarsest: args.coarsest };
    wfl_tasks::accuracy::demand(scene, given)
}

/// Whole runs as the command line shapes them; the last one is kept to be ended.
struct Whole<'a> {
    args: &'a RunArgs,
    last: Option<Ready>,
}

impl WholeRun for Whole<'_> {
    fn shaped(&self, scene: Scene) -> Scene {
        ready::shaped(self.args, scene)
    }

    fn run(
        &mut self,
        loaded: &mut Loaded,
        scene: &Scene,
        parse_seconds: f64,
        begun: Instant,
    ) -> Result<Outcome, String> {
        let checks = ready::checked(self.args, loaded, scene)?;
        let times = ready::Times { parse: parse_seconds, checks, started: begun };
        let mut ready = ready::ready(self.args, loaded, times)?;
        ready.resumable = false;
        let ended = ready.go(scene).map_err(|e| e.to_string());
        self.last = Some(ready);
        ended
    }
}

/// Finds the setting and runs it; the scene is given as it stands.
pub(crate) fn run(
    args: &RunArgs,
    demand: &Demand,
    loaded: Loaded,
    scene: Scene,
    backend: &dyn KernelBackend,
    started: Instant,
) -> ExitCode {
    let job = Job {
        file: &args.scene.scene,
        overrides: &args.scene.overrides,
        keep: &args.no_prune,
        demand,
        backend,
        threads: ready::threads(args),
        listener: &Console { quiet: args.quiet },
        started,
    };
    let mut whole = Whole { args, last: None };
    let picked = pick(&job, loaded, scene, &mut whole);
    match (picked, whole.last) {
        (Ok(mut picked), Some(ready)) => ended(args, &mut picked, &ready),
        (Ok(_), None) => ExitCode::from(EXIT_ERROR),
        (Err(Out::Failed(why)), _) => {
            say(&error_line(why.trim_start_matches("error: ")));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Writes what was found into the report, and tells it.
fn ended(args: &RunArgs, picked: &mut Picked, ready: &Ready) -> ExitCode {
    let Picked { solved, loaded, record, short, mesh } = picked;
    ready.announce(loaded, &solved.scene);
    if !args.quiet {
        out(&told(record));
        if let Some(folder) = ready.options.out.as_ref().filter(|_| record.rounds > 0) {
            let report = folder.join(REPORT_FILE);
            out(&format!("  again: {} marks={}\n\n", setting_text(&record.picked), report.display()));
        }
    }
    if let Some(folder) = &ready.options.out
        && let Err(error) = rewrite(folder, &mut solved.outcome.report, mesh)
    {
        say(&told_of_folder(&error));
        return ExitCode::from(EXIT_ERROR);
    }
    let code = finish(loaded, &solved.scene, ready, &solved.outcome, Some(&setting_text(&record.picked)));
    if let Some(why) = short {
        say(&format!(
            "error[E605]: an error of {:.1e} of {} was not reached: {why}\n  = note: the best of {} runs is kept; its \
             estimated error is {}\n  = help: {}\n",
            record.asked,
            record.quantity,
            record.trial_runs.len(),
            error(record.estimate.0),
            help(why)
        ));
    }
    if record.reached || code != ExitCode::SUCCESS { code } else { ExitCode::from(EXIT_ACCURACY) }
}

/// What can be done where a demand was not reached.
fn help(why: &Short) -> &'static str {
    match why {
        Short::Geometry(_) => {
            "a mesh file of second order (Gmsh: Mesh.ElementOrder = 2), or of smaller faces along the curves; a polygon \
             that is one has no error of this kind: ask for more than this part"
        }
        Short::Data(_) => {
            "a jump of the data on faces of the mesh, with a number on each region; cells or a `refine` statement that resolve \
             the data, a smoother formula, or --of another quantity"
        }
        Short::Time(_) => "a shorter step in `steps`, or a scheme of higher order",
        Short::Truth(_) => "a smaller demand refines further; the mesh of the scene is the first one that is looked at",
        _ => "--budget SECONDS allows more time, --of another quantity",
    }
}

/// What was picked and why, in lines.
fn told(record: &AccuracyRecord) -> String {
    let mut table = Table::new("runs", &["setting", "cells", "unknowns", "time [s]", "discretisation error"]);
    for trial in &record.trial_runs {
        let time = (1e4 * trial.seconds).round() / 1e4;
        table.push(vec![
            setting_text(&trial.setting).into(),
            trial.cells.into(),
            trial.dofs.into(),
            number(time).into(),
            if trial.error.0.is_finite() { error(trial.error.0).into() } else { "".into() },
        ]);
    }
    let mut text = format!(
        "{}\naccuracy {:e} of {}: {}\n",
        table.text(),
        record.asked,
        record.quantity,
        setting_text(&record.picked)
    );
    text += &format!(
        "  estimated error {}: mesh {}, tolerance {}, method {}",
        error(record.estimate.0),
        error(record.mesh.0),
        error(record.tolerance.0),
        error(record.method.0)
    );
    for (part, value) in [("steps", record.time.0), ("boundary", record.geometry.0)] {
        if value > 0.0 {
            text += &format!(", {part} {}", error(value));
        }
    }
    if record.data.0 > 0.0 {
        text += &format!("; loads and coefficients have {} of that of the mesh", error(record.data.0));
    }
    text += "\n";
    if let Some(truth) = record.truth {
        let times =
            record.over_truth().map_or_else(String::new, |x| format!(": the estimate is {x:.2} times as large"));
        text += &format!("  true error {}, against the exact solution of the scene{times}\n", error(truth.0));
    }
    for why in &record.why {
        text += &format!("  {why}\n");
    }
    if !record.others.is_empty() {
        let one = |o: &wfl_output::record::Other| format!("{} {}", o.quantity, error(o.error.0));
        let list: Vec<String> = record.others.iter().map(one).collect();
        text += &format!("  other quantities, about: {}\n", list.join(", "));
    }
    text + "\n"
}

/// The lines of `wfl check` about an accuracy.
pub(crate) fn table(loaded: &Loaded, scene: &Scene) -> Table {
    let mut table = Table::new("accuracy", &["wanted", "of", "degrees", "mesh", "gamma"]);
    let Some((error, of)) = scene.accuracy.clone() else { return table };
    let ways = Ways::of(&loaded.script, scene);
    let degrees: Vec<String> = ways.degrees.iter().map(ToString::to_string).collect();
    let mesh = if ways.refines() { "is picked, and refined locally" } else { "from a file, refined locally" };
    let gamma = match ways.role {
        wfl_adapt::accuracy::Role::None => "as it is",
        wfl_adapt::accuracy::Role::Consistent => "scales with the cell size",
        wfl_adapt::accuracy::Role::Penalty => "a penalty: increased until its error is small",
    };
    table.push(vec![number(error).into(), of.into(), degrees.join(", ").into(), mesh.into(), gamma.into()]);
    table
}
