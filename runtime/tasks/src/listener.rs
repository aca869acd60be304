//! Who hears how long work goes on: lines, results as they come, folders that are written to.
//!
//! Promises that work does not depend on who listens. Does not print.

use std::{any::Any, num::NonZeroUsize, path::Path};

/// Hears of work that goes on. Every method may be left as it is: then nothing is heard.
pub trait Listener: Sync {
    /// A line about what is being done, without its end.
    fn progress(&self, _line: &str) {}

    /// A part of such a line; the next one goes on in it.
    fn progress_part(&self, _text: &str) {}

    /// Results as a text with its line ends.
    fn result(&self, _text: &str) {}

    /// Fewer threads help than were asked for.
    fn fewer_threads(&self, _asked: usize, _helpful: usize) {}

    /// A folder is written to as long as what is returned lives; `hint` says how to go on where that is interrupted.
    fn writing(&self, _folder: &Path, _hint: &'static str) -> Option<Box<dyn Any>> {
        None
    }
}

/// Nobody listens.
impl Listener for () {}

/// The threads that run at the same time here.
#[must_use]
pub fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// As many threads as are asked for, at most as many as the machine, or what its container is given of it, runs at the
/// same time: more would wait for each other, and each takes 8 MB of stack and a start of its own.
pub fn limited_threads(asked: usize, listener: &dyn Listener) -> usize {
    let helpful = asked.min(available_threads());
    if helpful < asked {
        listener.fewer_threads(asked, helpful);
    }
    helpful
}
