//! How many threads a command works with: never more than the machine, or what its container is given of it, runs at
//! the same time. More would wait for each other, and each takes 8 MB of stack and a start of its own.

use std::{
    num::NonZeroUsize,
    sync::atomic::{AtomicBool, Ordering},
};

use crate::load::say;

/// The fewer threads were told.
static TOLD: AtomicBool = AtomicBool::new(false);

/// The threads that run at the same time here.
pub(crate) fn available() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// As many threads as are asked for, at most as many as help; what is cut off is told once.
pub(crate) fn limited(asked: usize) -> usize {
    let helpful = asked.min(available());
    if helpful < asked && !TOLD.swap(true, Ordering::Relaxed) {
        say(&format!(
            "note: {asked} threads were asked for; {helpful} run at the same time here, and so many are taken\n"
        ));
    }
    helpful
}
