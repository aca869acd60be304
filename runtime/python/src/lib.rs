//! What the Python package `wfl` is made of: a scene with its runs, and the command.
//!
//! The classes that people see are written in Python (`python/wfl`); here are the calls behind them. Promises: no logic of
//! scenes and runs, which stands in the crates of the runtime; the interpreter is released while they work.
#![forbid(unsafe_code)]

mod arrays;
mod desk;
mod outcome;
mod scene;
mod steps;
mod told;
mod work;

use std::{ffi::OsString, path::PathBuf, process::ExitCode};

use pyo3::prelude::*;

/// Does what the command `wfl` does with these arguments, the name of the program first, and returns its exit code.
#[pyfunction]
fn command(py: Python<'_>, program: PathBuf, arguments: Vec<OsString>) -> u8 {
    let code = py.detach(|| wfl_cli::main_with(wfl_cli::Call { program, arguments }));
    // an exit code does not tell its number
    (0..=u8::MAX).find(|n| ExitCode::from(*n) == code).unwrap_or(1)
}

#[pymodule]
fn _wfl(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<scene::PyScene>()?;
    module.add_class::<scene::PyStanding>()?;
    module.add_class::<outcome::PyOutcome>()?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    module.add("version", wfl_tasks::VERSION)
}
