//! The listener of the command: progress on standard error, results on standard output, and folders that are tidied when
//! the command is interrupted.

use std::{
    any::Any,
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
};

use wfl_tasks::{Listener, limited_threads};

use crate::{
    interrupt::Tidied,
    load::{out, say},
};

/// The fewer threads were told.
static TOLD: AtomicBool = AtomicBool::new(false);

/// Prints what is heard.
pub(crate) struct Console {
    /// Nothing but errors and notes.
    pub(crate) quiet: bool,
}

impl Listener for Console {
    fn progress(&self, line: &str) {
        self.progress_part(&format!("{line}\n"));
    }

    fn progress_part(&self, text: &str) {
        if !self.quiet {
            say(text);
        }
    }

    fn result(&self, text: &str) {
        if !self.quiet {
            out(text);
        }
    }

    fn fewer_threads(&self, asked: usize, helpful: usize) {
        if !TOLD.swap(true, Ordering::Relaxed) {
            say(&format!(
                "note: {asked} threads were asked for; {helpful} run at the same time here, and so many are taken\n"
            ));
        }
    }

    fn writing(&self, folder: &Path, hint: &'static str) -> Option<Box<dyn Any>> {
        Some(Box::new(Tidied::new(folder.to_owned(), hint)))
    }
}

/// As many threads as are asked for, at most as many as help; what is cut off is told once.
pub(crate) fn limited(asked: usize) -> usize {
    limited_threads(asked, &Console { quiet: true })
}
