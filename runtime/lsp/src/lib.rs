//! `wfl lsp`: what an editor wants to know of a scene while it is written, by the language server protocol.
//!
//! A change of the text is answered at once with what the text alone shows (names, shapes, test functions, units:
//! milliseconds). When no further change follows, a second thread makes the whole problem, mesh included, and tells what
//! `wfl check` and `wfl run` would. Nothing is solved here, nothing is written, and files are read by the rules of scenes
//! (E217). One thread answers the editor, in order.
#![forbid(unsafe_code)]

mod analysis;
mod capabilities;
mod check;
mod contexts;
mod features;
mod files;
mod lines;
mod places;
mod renamed;
mod requests;
mod server;
mod state;
mod symbols;
mod view;

use std::{path::PathBuf, time::Duration};

use lsp_server::Connection;

/// How a server works.
#[derive(Clone, Debug)]
pub struct Options {
    /// The program that runs scenes for the command `wfl.run`; without it editors have to run scenes themselves.
    pub program: Option<PathBuf>,
    /// How long the text has to stay as it is before the problem is made of it.
    pub pause: Duration,
}

impl Default for Options {
    /// A third of a second: about the longest pause within a word of a slow typist.
    fn default() -> Self {
        Self { program: None, pause: Duration::from_millis(300) }
    }
}

/// Serves an editor on standard input and output until it says good-bye.
///
/// # Errors
/// What broke the connection, in words.
pub fn serve_stdio(options: Options) -> Result<(), String> {
    let (connection, threads) = Connection::stdio();
    serve(connection, options)?;
    threads.join().map_err(|e| e.to_string())
}

/// Serves an editor on a connection until it says good-bye. Needs a stack of [`wfl_tasks::STACK`] bytes for texts of the
/// deepest nesting that is allowed.
///
/// # Errors
/// What broke the connection, in words.
pub fn serve(connection: Connection, options: Options) -> Result<(), String> {
    server::serve(&connection, options)
}
