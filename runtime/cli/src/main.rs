//! The `wfl` command: arguments, messages, progress. No logic of its own.
#![forbid(unsafe_code)]

mod accuracy;
mod args;
mod ast_text;
mod check;
mod corpus;
mod ended;
mod explain;
mod extremes;
mod fmt;
mod import;
mod knobs;
mod load;
mod nitsche;
mod prepared;
mod progress;
mod ready;
mod report;
mod run;
mod show;
mod sweep;
mod table;
mod threads;
mod verify;

use std::process::ExitCode;
use std::time::Instant;

use args::Command;
use clap::Parser;

fn main() -> ExitCode {
    let started = Instant::now();
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(message) => {
            // help and version go to standard output and are no error; a closed pipe is not our problem
            let _ = message.print();
            // 2 is a step that did not converge, so a wrong command line is 1 as other errors are
            return if message.use_stderr() { ExitCode::from(prepared::EXIT_ERROR) } else { ExitCode::SUCCESS };
        }
    };
    if let Some(bytes) = args.memory {
        wfl_runtime::memory::set_limit(bytes);
    }
    match args.command {
        Command::Run(options) => run::run(&options, started),
        Command::Extremes(options) => extremes::extremes(&options, started),
        Command::Report(options) => report::report(&options),
        Command::Check(options) => check::check(&options, started),
        Command::Show(options) => show::show(&options),
        Command::Verify(options) => verify::verify(&options),
        Command::Sweep(options) => sweep::sweep(&options),
        Command::Explain(options) => explain::explain(&options),
        Command::Fmt(options) => fmt::fmt(&options),
        Command::Import(options) => import::import(&options),
        Command::Corpus(options) => corpus::corpus(&options),
    }
}
