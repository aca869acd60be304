//! Threads of a bench, and the time they take.

use std::time::Duration;

/// A pool of so many threads.
///
/// # Errors
/// What the system says against it.
pub(crate) fn pool(threads: usize) -> Result<rayon::ThreadPool, String> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())
}

/// Time that this thread has spent on a processor, where the system tells: Linux does.
pub(crate) fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok().map(Duration::from_nanos)
}
