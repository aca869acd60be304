//! The `wfl` command: reads arguments, calls the doors below it, prints what they give. No logic of its own.
//!
//! A library, so that a package for another language carries the same command; the program is `bin/wfl.rs`.
#![forbid(unsafe_code)]

mod accuracy;
mod args;
mod args_gradient;
mod args_mesh;
mod args_plot;
mod args_slip;
mod ast_text;
mod check;
mod console;
mod contact;
mod ended;
mod explain;
mod extremes;
mod fmt;
mod gradient;
mod heartbeat;
mod import;
mod interrupt;
mod load;
mod mesh;
mod new;
mod plot;
mod prepared;
mod progress;
mod ranks;
mod ready;
mod report;
mod run;
mod shell;
mod show;
mod solvers;
mod summary;
mod sweep;
mod table;
mod together;
mod verify;
mod watching;

use std::{ffi::OsString, path::PathBuf, process::ExitCode, time::Instant};

use clap::Parser;

use args::Command;
pub use wfl_host::memory::Telling;
use wfl_host::memory::{self, TooMuchMemory};
use wfl_tasks::STACK;

/// How the command was called.
#[derive(Clone, Debug)]
pub struct Call {
    /// The file that starts it: runs that are to be a process of their own start that.
    pub program: PathBuf,
    /// Its arguments, the name of the program first.
    pub arguments: Vec<OsString>,
}

/// Does what a call asks for and prints to the standard streams. Takes signals and memory limits of the process as its
/// own: for a process that does nothing else.
#[must_use]
pub fn main_with(call: Call) -> ExitCode {
    let started = Instant::now();
    let again = call.clone();
    // without room for such a stack (a limit on the address space) the first thread has to do
    match std::thread::Builder::new().stack_size(STACK).spawn(move || command(&call, started)) {
        Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
        Err(_) => command(&again, started),
    }
}

fn command(call: &Call, started: Instant) -> ExitCode {
    let args = match args::Args::try_parse_from(&call.arguments) {
        Ok(args) => args,
        Err(message) => {
            // help and version go to standard output and are no error; a closed pipe is not our problem
            if !message.use_stderr() {
                let _ = message.print();
                return ExitCode::SUCCESS;
            }
            let words: Vec<String> = call.arguments.iter().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
            load::say(&args_slip::told(&message, &words));
            // 2 is a step that did not converge, so a wrong command line is 1 as other errors are
            return ExitCode::from(prepared::EXIT_ERROR);
        }
    };
    if let Some(bytes) = args.memory {
        memory::set_limit(bytes);
    }
    memory::when_refused(too_much_memory);
    // a system without a thread to spare goes on without the second line of the limit
    let _ = memory::watch(too_much_memory);
    for folder in &args.allow_read {
        if let Err(e) = wfl_host::reading::allow(folder) {
            let why = wfl_host::input::InputError::from(e);
            load::say(&format!("error: cannot allow reading from {}: {why}\n", folder.display()));
            return ExitCode::from(prepared::EXIT_ERROR);
        }
    }
    match args.command {
        Command::Run(mut options) => {
            options.memory = args.memory;
            run::run(&options, started)
        }
        Command::Extremes(options) => extremes::extremes(&options, started),
        Command::Report(options) => report::report(&options),
        Command::Plot(options) => plot::plot(&options),
        Command::Mesh(options) => mesh::mesh(&options),
        Command::Check(options) => check::check(&options, started),
        Command::Show(options) => show::show(&options),
        Command::Verify(options) => verify::verify(&options),
        Command::Sweep(options) => sweep::sweep(&options, &call.program),
        Command::Explain(options) => explain::explain(&options),
        Command::Fmt(options) => fmt::fmt(&options),
        Command::Import(options) => import::import(&options),
        Command::New(options) => new::new(&options),
        Command::Lsp(_) => shell::lsp(&call.program),
        Command::Completions(options) => shell::completions(&options),
        Command::Man(options) => shell::man(&options),
    }
}

/// Ends the program where more memory was taken than may be: files have their former content or the whole new one.
fn too_much_memory(need: &TooMuchMemory) {
    ended::too_much_memory(need);
    std::process::exit(i32::from(prepared::EXIT_ERROR));
}
