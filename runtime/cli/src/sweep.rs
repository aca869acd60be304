//! `wfl sweep`: scenes over lists of settings, their errors and costs in one table.

use std::{path::Path, process::ExitCode};

use wfl_tasks::{
    folder::error_line,
    sweep::{self, Job},
};

use crate::{
    args::SweepArgs,
    console::Console,
    load::say,
    prepared::{EXIT_ERROR, backend},
};

pub(crate) fn sweep(args: &SweepArgs, program: &Path) -> ExitCode {
    match done(args, program) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            say(&error_line(&why));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

fn done(args: &SweepArgs, program: &Path) -> Result<(), String> {
    let listener = &Console { quiet: args.quiet };
    if args.plot {
        let given: Vec<_> = args.words.iter().map(Into::into).collect();
        return sweep::plot(if given.is_empty() { std::slice::from_ref(&args.out) } else { &given }, listener);
    }
    let Some(backend) = backend(false) else { return Err("there is no machine code on this processor".to_owned()) };
    let job = Job {
        words: args.words.clone(),
        reference: args.reference.clone(),
        reference_knob: args.reference_knob.clone(),
        repeat: args.repeat,
        jobs: args.jobs,
        out: args.out.clone(),
        threads: args.threads,
        backend: &*backend,
        listener,
        program,
    };
    match &args.study {
        Some(docs) => sweep::study(&job, docs),
        None => sweep::sweep(&job),
    }
}
