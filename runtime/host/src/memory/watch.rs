//! A thread that watches the memory of the process while it works.
//!
//! Estimates may be too small, and small allocations are not announced. The thread checks as often as memory can grow,
//! so the process exceeds its limit only briefly. One check takes 30 microseconds; there are ten a second far from the
//! limit and a thousand a second close to it.

use std::{
    sync::{PoisonError, atomic::Ordering},
    thread,
    time::Duration,
};

use super::{LAST, PENDING, TooMuchMemory, limits, user_limit};

/// Bytes a second by which memory can grow: pages filled with zeros by a few threads.
const GROWTH: u64 = 8_000_000_000;
const SHORTEST: Duration = Duration::from_millis(1);
const LONGEST: Duration = Duration::from_millis(100);

/// Starts the thread; `passed` is told once when the limit is passed, on that thread, and should end the process.
///
/// # Errors
/// That of the system if it gives no thread.
pub fn watch(passed: impl FnOnce(&TooMuchMemory) + Send + 'static) -> std::io::Result<()> {
    thread::Builder::new().name("memory".to_owned()).stack_size(1 << 17).spawn(|| look(passed)).map(drop)
}

fn look(passed: impl FnOnce(&TooMuchMemory)) {
    loop {
        let room = match room() {
            Ok(room) => room,
            Err(bound) => {
                let what = *LAST.lock().unwrap_or_else(PoisonError::into_inner);
                let limits::Bound { in_use, limit, of } = bound;
                return passed(&TooMuchMemory { what, needed: None, in_use, limit, of });
            }
        };
        thread::sleep(Duration::from_nanos(room / (GROWTH / 1_000_000_000)).clamp(SHORTEST, LONGEST));
    }
}

/// Bytes to the nearest limit, or the limit that is passed.
fn room() -> Result<u64, limits::Bound> {
    let (nearest, addresses) = limits::nearest(user_limit());
    if nearest.in_use > nearest.limit {
        return Err(nearest);
    }
    // granted memory is on its way; it was compared with the limit when it was granted
    let kept = if PENDING.load(Ordering::Relaxed) > 0 { 0 } else { limits::ADDRESSES_LEFT };
    if addresses.in_use.saturating_add(kept) > addresses.limit {
        return Err(addresses);
    }
    Ok((nearest.limit - nearest.in_use).min(addresses.limit - addresses.in_use))
}
