//! What is done with scenes, without a terminal: a scene file is read and judged, the end of a run is told, a setting is
//! found for a wanted accuracy, derivatives are compared with differences, many settings are run and compared, a scene is driven to its extremes, a foreign assembly
//! string becomes statements.
//!
//! The command, a server or a binding calls these doors; who wants to hear how long work goes on hands over a
//! [`Listener`]. Promises that nothing is printed and no process is ended here, and that a message has the same words
//! whoever shows it. Does not compile point laws (a kernel backend is handed over) and does not solve: `wfl-run` does.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod advice;
mod bench;
pub mod ending;
mod exact;
pub mod extremes;
pub mod folder;
pub mod formula;
pub mod gradient;
pub mod import;
mod listener;
pub mod scene_file;
pub mod sweep;
pub mod tangents;
pub mod words;

pub use listener::{Listener, available_threads, limited_threads};
pub use scene_file::Loaded;

/// Bytes of stack of a thread that reads and compiles scenes: [`wfl_compiler::DEPTH_LIMIT`] nested calls, threefold in
/// second derivatives, of about 2 kB each in the slowest build, and as much to spare. Reserved, not taken: what is not
/// used costs nothing.
pub const STACK: usize = 192 << 20;

/// The version that reports, tables and references name.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A setting in words, as on the command line.
#[must_use]
pub fn setting_text(setting: &wfl_adapt::knobs::Setting) -> String {
    setting.iter().map(|(n, v)| format!("{n}={v}")).collect::<Vec<_>>().join(" ")
}
