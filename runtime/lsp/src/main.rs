//! The language server as a program of its own; `wfl lsp` is the same. Its argument is the program that runs scenes for the
//! command `wfl.run`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use wfl_lsp::{Options, serve_stdio};

fn main() -> ExitCode {
    let options = Options { program: std::env::args_os().nth(1).map(Into::into), ..Options::default() };
    let served = std::thread::Builder::new()
        .stack_size(wfl_tasks::STACK)
        .spawn(|| serve_stdio(options))
        .map_err(|e| e.to_string())
        .and_then(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
    match served {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::FAILURE
        }
    }
}
