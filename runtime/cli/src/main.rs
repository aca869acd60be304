//! The `wfl` command: arguments, messages, progress. No logic of its own.
#![forbid(unsafe_code)]

mod args;
mod load;
mod progress;
mod run;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;

fn main() -> ExitCode {
    let started = Instant::now();
    let args = args::Args::parse();
    match args.command {
        args::Command::Run(options) => run::run(&options, started),
    }
}
