//! `wfl sweep`: scenes over lists of settings, their errors and costs in one table.

use std::{path::Path, process::ExitCode};

use wfl_tasks::{
    ending::Ending,
    folder::error_line,
    sweep::{self, Job},
};

use crate::{
    args::SweepArgs,
    console::Console,
    ended::code,
    load::say,
    prepared::{EXIT_ERROR, backend},
};

pub(crate) fn sweep(args: &SweepArgs, program: &Path) -> ExitCode {
    match done(args, program) {
        Ok(ending) => code(ending),
        Err(why) => {
            say(&error_line(&why));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// How the runs ended.
fn done(args: &SweepArgs, program: &Path) -> Result<Ending, String> {
    let listener = &Console { quiet: args.quiet };
    if args.plot {
        let given: Vec<_> = args.words.iter().map(Into::into).collect();
        sweep::plot(if given.is_empty() { std::slice::from_ref(&args.out) } else { &given }, listener)?;
        return Ok(Ending::Done);
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
        Some(docs) => sweep::study(&job, docs).map(|()| Ending::Done),
        None => sweep::sweep(&job),
    }
}
