//! `wfl run`: what the command line asks for, done.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_runtime::{Saving, Scene, accuracy::MESH_FILE, finished, may_begin, savings};
use wfl_tasks::{Loaded, folder::error_line};

use crate::{
    accuracy,
    args::RunArgs,
    ended::{ended_before, explain, finish},
    heartbeat::Heartbeat,
    load::{load_with_knobs, out, say},
    prepared::{EXIT_ERROR, backend, prepare_scene},
    progress::Loudness,
    ranks,
    ready::{Ready, Times, checked, folder, ready, shape},
    solvers::{self, Running, Solvers},
};

pub(crate) fn run(args: &RunArgs, started: Instant) -> ExitCode {
    let starting = Instant::now();
    match solvers::start(args.backend, args.repeatable) {
        Ok(running) => {
            let code = run_with(args, &running, started, starting.elapsed());
            running.end(code)
        }
        Err(why) => {
            say(&error_line(&why));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Runs with solvers that took `started_in` to start.
fn run_with(args: &RunArgs, running: &Running, started: Instant, started_in: Duration) -> ExitCode {
    let team = running.team();
    if team.is_some() && args.savings {
        say("error: --savings does not go with several ranks\n  = help: run it without mpirun\n");
        return ExitCode::from(EXIT_ERROR);
    }
    let Some(mut loaded) = load_with_knobs(&args.scene.scene, &args.scene.overrides, "run") else {
        return ExitCode::from(EXIT_ERROR);
    };
    let parse_seconds = (started.elapsed() - started_in).as_secs_f64();
    let preparing = (!args.quiet).then(|| Heartbeat::new(|t| say(&format!("{t}\n"))));
    let Some(backend) = backend(args.interpret) else { return ExitCode::from(EXIT_ERROR) };
    if let Some(team) = team {
        drop(preparing);
        return ranks::run(args, &team, loaded, &*backend, ranks::Begun { parse_seconds, started });
    }
    // for an accuracy the scene as it stands is looked at and not run
    let looked_at: &dyn KernelBackend = if args.accuracy.is_some() { &InterpreterBackend } else { &*backend };
    let Some(mut scene) = prepare_scene(&mut loaded, looked_at, &args.no_prune) else {
        return ExitCode::from(EXIT_ERROR);
    };
    if let Some(demand) = accuracy::demand(args, &scene) {
        if !may_pick(args, &loaded, &scene) {
            return ExitCode::from(EXIT_ERROR);
        }
        drop(preparing);
        return accuracy::run(args, &demand, loaded, scene, &*backend, started);
    }
    if says_more_of_no_accuracy(args) {
        return ExitCode::from(EXIT_ERROR);
    }
    shape(args, &mut scene);
    if args.savings && !may_write(args, &loaded, &scene, &[]) {
        return ExitCode::from(EXIT_ERROR);
    }
    let ready = checked(args, &mut loaded, &mut scene)
        .and_then(|checks| ready(args, &loaded, Times { parse: parse_seconds, checks, started }));
    let ready = match ready.and_then(|ready| measured(args, &loaded, &*backend, ready)) {
        Ok(ready) => ready,
        Err(why) => {
            say(&error_line(&why));
            return ExitCode::from(EXIT_ERROR);
        }
    };
    drop(preparing);
    match finished(&scene, &ready.options) {
        Ok(Some(report)) => return ended_before(&ready, &report),
        Ok(None) => {}
        Err(error) => {
            explain(&loaded, &scene, &error);
            return ExitCode::from(EXIT_ERROR);
        }
    }
    ready.announce(&loaded, &scene);
    go(&loaded, scene, ready)
}

/// Runs what is ready.
pub(crate) fn go(loaded: &Loaded, mut scene: Scene, mut ready: Ready) -> ExitCode {
    match ready.go(&mut scene) {
        Ok(outcome) => finish(loaded, &scene, &ready, &outcome, None),
        Err(error) => {
            explain(loaded, &scene, &error);
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Says that there is no accuracy of which the command line says more.
pub(crate) fn says_more_of_no_accuracy(args: &RunArgs) -> bool {
    let says_more = args.of.is_some() || args.budget.is_some();
    if says_more {
        say("error: --of and --budget say more about an accuracy\n  = help: --accuracy 1e-3\n");
    }
    says_more
}

/// Whether a setting can be picked for an accuracy; says why not.
pub(crate) fn may_pick(args: &RunArgs, loaded: &Loaded, scene: &Scene) -> bool {
    if !loaded.knobs.is_empty() {
        say("error: mesh, degree and tolerance are picked for the accuracy: they cannot be given, too\n");
        return false;
    }
    if args.backend != Solvers::Own {
        say("error: for an accuracy a scene is run with the solvers of this program\n  = help: leave --backend out\n");
        return false;
    }
    // on the command line these exclude each other; the scene may ask for an accuracy, too
    if args.savings || args.resume {
        say(
            "error: a scene that asks for an accuracy is run on several meshes: --savings and --resume do not go with it\n",
        );
        return false;
    }
    may_write(args, loaded, scene, &[MESH_FILE])
}

/// Whether the results can be written, and the files `more` beside them, looked at before other runs are made for this
/// one; says why not.
fn may_write(args: &RunArgs, loaded: &Loaded, scene: &Scene, more: &[&str]) -> bool {
    match folder(args, loaded).map(|out| may_begin(scene, &out, more)) {
        Ok(Ok(())) => return true,
        Ok(Err(error)) => explain(loaded, scene, &error),
        Err(why) => say(&error_line(&why)),
    }
    false
}

/// A run with the measured effect of its optimisations, on request.
fn measured(args: &RunArgs, loaded: &Loaded, backend: &dyn KernelBackend, mut ready: Ready) -> Result<Ready, String> {
    if args.savings {
        let begin = Instant::now();
        let shape = |mut scene| {
            shape(args, &mut scene);
            scene
        };
        ready.options.savings = savings(&loaded.script, &loaded.folder, backend, ready.options.threads, &shape)
            .map_err(|e| format!("{e}\n  = help: without --savings the run tells more"))?;
        if ready.loudness != Loudness::Quiet {
            out(&savings_text(&ready.options.savings));
        }
        // the time of the run is that of the run
        ready.options.started += begin.elapsed();
    }
    Ok(ready)
}

/// What was measured of what the scene does without.
fn savings_text(savings: &[Saving]) -> String {
    let line = |s: &Saving| {
        let name = s.pruning.name();
        format!("without the optimisation `{name}`: {:.2} times as long, measures change by {:.1e}\n", s.times, s.moved)
    };
    if savings.is_empty() {
        "the scene uses no optimisation that can be turned off\n".to_owned()
    } else {
        savings.iter().map(line).collect()
    }
}
