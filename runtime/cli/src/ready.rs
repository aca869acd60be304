//! A scene made ready to be run: its options, and what there is to say before.

use std::{path::PathBuf, time::Instant};

use wfl::{Code, Diagnostic};
use wfl_output::check_name;
use wfl_problem::{Scene, place_of_moving};
use wfl_run::{Outcome, RunError, RunOptions};
use wfl_tasks::{
    Loaded, VERSION,
    advice::{before_run, found_parameters},
    available_threads,
};

use crate::{
    args::RunArgs,
    console::limited,
    interrupt::Tidied,
    load::{out, print_all, say},
    progress::{Loudness, Terminal},
    watching::{self, Watching},
};

/// The threads of a run.
pub(crate) fn threads(args: &RunArgs) -> usize {
    args.threads.map_or_else(available_threads, |n| limited(n.get()))
}

/// Gives a scene what the command line says of its solver.
pub(crate) fn shaped(args: &RunArgs, mut scene: Scene) -> Scene {
    if let Some(most) = args.max_iter {
        scene.newton.max_iterations = most.get();
    }
    scene
}

/// A run that can begin.
pub(crate) struct Ready {
    pub(crate) options: RunOptions,
    pub(crate) loudness: Loudness,
    /// It may go on where it was stopped.
    pub(crate) resumable: bool,
    /// The page that is written while it runs.
    watch: Option<PathBuf>,
}

/// Codes of advice on the text alone: what is declared and not needed.
const ABOUT_THE_TEXT: &str = "W7";

impl Ready {
    /// Says what there is to say of a scene.
    pub(crate) fn announce(&self, loaded: &Loaded, scene: &Scene) {
        if self.loudness == Loudness::Quiet {
            // what says that a result may be wrong is told always
            let of_results = |d: &&Diagnostic| !d.code.as_str().starts_with(ABOUT_THE_TEXT);
            let told: Vec<Diagnostic> = loaded.messages.iter().filter(of_results).cloned().collect();
            print_all(&told, &loaded.sources);
        } else {
            out(&found_parameters(loaded, scene));
            print_all(&loaded.messages, &loaded.sources);
        }
        if self.loudness == Loudness::Verbose {
            unused_nodes(scene);
        }
    }

    pub(crate) fn go(&mut self, scene: &Scene) -> Result<Outcome, RunError> {
        let mut terminal = Terminal::new(self.loudness);
        let page = self.watch.take();
        let several = scene.steps.several() && self.resumable;
        let hint = if several { "the steps done are kept: the same command with --resume continues" } else { "" };
        let _tidied = self.options.out.clone().map(|folder| Tidied::new(folder, hint));
        let Some(file) = page else { return wfl_run::run(scene, &self.options, &mut terminal) };
        let variable = self.options.about.step_variable.clone();
        let mut watching = Watching::new(terminal, file, &self.options.name, variable.as_deref().unwrap_or("t"));
        let outcome = wfl_run::run(scene, &self.options, &mut watching);
        watching.end();
        outcome
    }
}

/// Checks what there is to check before a run; the seconds that it takes.
pub(crate) fn checked(args: &RunArgs, loaded: &mut Loaded, scene: &Scene) -> Result<f64, String> {
    if args.backend.library().is_some() && scene.system.has_moving_images() {
        let d = Diagnostic::new(Code::E802, "a mapping that moves needs the solvers of this program");
        let d = d.help("leave --backend out, and mpirun");
        loaded.messages.push(match place_of_moving(&loaded.script) {
            Some(span) => d.at(span, "the matrix follows its images"),
            None => d,
        });
        print_all(&loaded.messages, &loaded.sources);
        return Err("nothing was solved".to_owned());
    }
    let begin = Instant::now();
    let found = before_run(loaded, scene);
    let check_seconds = begin.elapsed().as_secs_f64();
    let refused = args.strict && found.iter().any(|d| d.code == Code::W503);
    loaded.messages.extend(found);
    if refused {
        print_all(&loaded.messages, &loaded.sources);
        return Err("a Nitsche parameter is below its safe value, which --strict does not allow".to_owned());
    }
    if loaded.messages.iter().any(Diagnostic::is_error) {
        print_all(&loaded.messages, &loaded.sources);
        return Err("nothing was solved: the scene has no solution as it is written".to_owned());
    }
    Ok(check_seconds)
}

/// When a run began, and what it has taken so far, in seconds.
pub(crate) struct Times {
    pub(crate) parse: f64,
    pub(crate) checks: f64,
    pub(crate) started: Instant,
}

/// Makes the options of a run.
pub(crate) fn ready(args: &RunArgs, loaded: &Loaded, times: Times) -> Result<Ready, String> {
    if let Some(file) = &args.watch {
        watching::may_replace(file)?;
    }
    let loudness = match (args.quiet, args.verbose) {
        (true, _) => Loudness::Quiet,
        (_, true) => Loudness::Verbose,
        _ => Loudness::Normal,
    };
    let options = RunOptions {
        name: loaded.name.clone(),
        out: Some(folder(args, loaded)?),
        resume: args.resume,
        texts: loaded.texts(),
        settings: loaded.settings(&args.no_prune),
        threads: threads(args),
        precision: args.precision,
        library: args.backend.library(),
        version: VERSION.to_owned(),
        parse_seconds: times.parse,
        check_seconds: times.checks,
        judge: true,
        started: times.started,
        warnings: loaded.messages.iter().map(|d| format!("{}: {}", d.code, d.message)).collect(),
        about: loaded.about(),
        savings: Vec::new(),
        keep_states: false,
        // the other half is for the run itself
        trajectory_bytes: args.memory.map(|bytes| bytes / 2),
        keep_trajectory: args.gradient.gradient.is_some() || !loaded.script.gradients.is_empty(),
        keep_outputs: Vec::new(),
    };
    Ok(Ready { options, loudness, resumable: true, watch: args.watch.clone() })
}

/// The requested results folder, or the one that is named after the scene.
pub(crate) fn folder(args: &RunArgs, loaded: &Loaded) -> Result<PathBuf, String> {
    if let Some(out) = &args.out {
        return Ok(out.clone());
    }
    let named = check_name(&loaded.name).map(|()| PathBuf::from("out").join(&loaded.name));
    named.map_err(|e| {
        format!("[E710]: no results folder can be named after the scene: {e}\n  = help: name one: --out DIR")
    })
}

/// Nodes of no cell have no dofs; their numbers are told to who wants to know.
fn unused_nodes(scene: &Scene) {
    /// Numbers shown.
    const SHOWN: usize = 20;
    let mesh = &scene.system.mesh;
    let list = &mesh.warnings().unused_nodes;
    if list.is_empty() {
        return;
    }
    let names: Vec<String> = list.iter().take(SHOWN).map(|n| mesh.numbers().node(*n).0.to_string()).collect();
    let more = if list.len() > SHOWN { format!(" and {} more", list.len() - SHOWN) } else { String::new() };
    say(&format!("mesh: nodes of no cell, left out: {}{more}\n", names.join(", ")));
}
