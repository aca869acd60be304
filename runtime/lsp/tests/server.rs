//! The suites of the language server but `speed.rs`, in one program.

mod common;
mod format;
mod session;
mod typing;
mod vscode;
