//! The program `wfl`.
#![forbid(unsafe_code)]

use std::{path::PathBuf, process::ExitCode};

use wfl_cli::{Call, Telling, main_with};

#[global_allocator]
static ALLOCATOR: Telling = Telling;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    let named = || arguments.first().map(PathBuf::from).unwrap_or_default();
    let program = std::env::current_exe().unwrap_or_else(|_| named());
    main_with(Call { program, arguments })
}
