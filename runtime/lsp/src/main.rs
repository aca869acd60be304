//! The language server as a program of its own, for editors that want no more than that; `wfl lsp` is the same.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use wfl_lsp::{Options, serve_stdio};

fn main() -> ExitCode {
    let served = std::thread::Builder::new()
        .stack_size(wfl_tasks::STACK)
        .spawn(|| serve_stdio(Options::default()))
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
