//! Cases of a suite at the same time. The suites of the command have this file, too.

use std::{
    sync::atomic::{AtomicUsize, Ordering},
    thread,
};

/// What `f` finds for each item, in order; as many at a time as there are processors.
///
/// # Panics
/// If `f` does for an item.
pub fn side_by_side<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let one_after_another = || {
        let mut found = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            match items.get(k) {
                Some(item) => found.push((k, f(item))),
                None => return found,
            }
        }
    };
    let at_a_time = thread::available_parallelism().map_or(1, |n| n.get());
    let mut all: Vec<(usize, R)> = thread::scope(|scope| {
        let workers: Vec<_> = (0..at_a_time).map(|_| scope.spawn(one_after_another)).collect();
        workers.into_iter().flat_map(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, found)| found).collect()
}
