//! What is done when a person or the system ends the program while it writes results.
//!
//! Promises: temporary files and the lock of the folder go, it is said how to go on, and the process ends as it would
//! have without this. A signal that whoever started the program wants ignored (`nohup`, a job in the background) stays
//! ignored. Does nothing where there are no signals: there the next start removes what is left.

use std::{
    path::PathBuf,
    sync::{Mutex, MutexGuard, PoisonError},
};

/// The folder that is written to, and what is said when that is interrupted.
static WRITING: Mutex<Vec<(PathBuf, &'static str)>> = Mutex::new(Vec::new());

fn writing() -> MutexGuard<'static, Vec<(PathBuf, &'static str)>> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// As long as this lives a folder is tidied when the program is interrupted.
pub(crate) struct Tidied(());

impl Tidied {
    /// `hint` says how to go on; it may be empty.
    pub(crate) fn new(folder: PathBuf, hint: &'static str) -> Self {
        writing().push((folder, hint));
        listen();
        Self(())
    }
}

impl Drop for Tidied {
    fn drop(&mut self) {
        writing().pop();
    }
}

#[cfg(unix)]
fn listen() {
    use signal_hook::{
        consts::{SIGINT, SIGTERM},
        iterator::Signals,
        low_level::emulate_default_handler,
    };
    use std::sync::Once;
    static LISTENING: Once = Once::new();
    LISTENING.call_once(|| {
        let heard = [SIGINT, SIGTERM].into_iter().filter(|signal| !is_ignored(*signal));
        let Ok(mut signals) = Signals::new(heard) else { return };
        std::thread::spawn(move || {
            for signal in signals.forever() {
                // held to the end of the process: nobody begins to write now
                let folders = writing();
                for (folder, hint) in folders.iter() {
                    wfl_output::abandon(folder);
                    if !hint.is_empty() {
                        crate::load::say(&format!("interrupted: {hint}\n"));
                    }
                }
                let _ = emulate_default_handler(signal);
            }
        });
    });
}

#[cfg(not(unix))]
fn listen() {}

/// Whether the process was started with a signal ignored, as the system tells it where it does.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}
