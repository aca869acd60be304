//! `wfl run`: what the command line asks for, done.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use wfl_adapt::savings;
use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_discrete::pruning::Saving;
use wfl_run::finished;
use wfl_tasks::{Loaded, folder::error_line};

use crate::{
    accuracy,
    args::RunArgs,
    ended::{ended_before, explain, go},
    gradient,
    load::{load_with_knobs, out, say},
    prepared::{EXIT_ERROR, backend, prepare_scene, sign_of_life},
    progress::Loudness,
    ranks,
    ready::{Ready, Times, checked, ready, shaped},
    solvers::{self, Running},
    together::{may_do_more, may_pick, says_more_of_no_accuracy},
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
    if team.is_some() && asks_for_one_rank(args) {
        return ExitCode::from(EXIT_ERROR);
    }
    let Some(request) = gradient::request(args, team.is_some()) else { return ExitCode::from(EXIT_ERROR) };
    let loaded = load_with_knobs(&args.scene.scene, &args.scene.overrides, "run");
    let Some(mut loaded) = loaded.filter(|l| gradient::may_state(l, args.resume, team.is_some())) else {
        return ExitCode::from(EXIT_ERROR);
    };
    let parse_seconds = (started.elapsed() - started_in).as_secs_f64();
    let preparing = (!args.quiet).then(sign_of_life);
    let Some(backend) = backend(args.interpret) else { return ExitCode::from(EXIT_ERROR) };
    if let Some(team) = team {
        drop(preparing);
        return ranks::run(args, running, &team, loaded, &*backend, ranks::Begun { parse_seconds, started });
    }
    // for an accuracy the scene as it stands is looked at and not run
    let looked_at: &dyn KernelBackend = if args.accuracy.is_some() { &InterpreterBackend } else { &*backend };
    let Some(scene) = prepare_scene(&mut loaded, looked_at, &args.no_prune) else {
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
    let scene = shaped(args, scene);
    if !may_do_more(args, &loaded, &scene, request.as_ref()) {
        return ExitCode::from(EXIT_ERROR);
    }
    let ready = checked(args, &mut loaded, &scene)
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
    go(&loaded, scene, ready, &mut |scene, ready, outcome| {
        gradient::differentiate((&loaded, scene, &*backend), ready, outcome, request.as_ref())
    })
}

/// True after a message about options that several ranks do not have.
fn asks_for_one_rank(args: &RunArgs) -> bool {
    let alone = [("--savings", args.savings), ("--watch", args.watch.is_some())];
    let asked = alone.into_iter().find(|(_, asked)| *asked);
    if let Some((option, _)) = asked {
        say(&format!("error: {option} does not go with several ranks\n  = help: run it without mpirun\n"));
    }
    asked.is_some()
}

/// A run with the measured effect of its optimisations, on request.
fn measured(args: &RunArgs, loaded: &Loaded, backend: &dyn KernelBackend, mut ready: Ready) -> Result<Ready, String> {
    if args.savings {
        let begin = Instant::now();
        let shape = |scene| shaped(args, scene);
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
