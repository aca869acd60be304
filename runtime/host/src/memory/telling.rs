//! An allocator of a program that says why it ends when the system gives no more memory.
//!
//! Rust ends a process whose small allocation fails with an abort and no word of ours. Large needs are asked for and
//! watched, so this happens only where little is left and something small comes next: which one it is depends on
//! chance.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    sync::{Mutex, OnceLock, PoisonError},
    time::Duration,
};

use super::{LAST, TooMuchMemory, refused_by_the_system};

/// The allocator of the system; where that gives no memory, the process ends with the message of [`when_refused`].
///
/// For `#[global_allocator]` of a program.
#[derive(Debug)]
pub struct Telling;

/// Bytes kept for the message itself: its text, the file that it may quote, the buffers of the streams.
const RESERVE: usize = 1 << 20;

/// What to do where the system gives no memory, with the memory that doing it takes.
struct Last {
    reserve: Mutex<Vec<u8>>,
    tell: fn(&TooMuchMemory),
}

static ENDING: OnceLock<Last> = OnceLock::new();

thread_local! {
    /// Whether whoever allocates on this thread looks at a refusal itself.
    static LOOKS: Cell<bool> = const { Cell::new(false) };
    /// Whether this thread is telling.
    static TELLS: Cell<bool> = const { Cell::new(false) };
}

/// What ends the process where the system gives no memory to somebody who cannot go on without it. Takes effect in a
/// program whose allocator is [`Telling`]; the first call counts.
pub fn when_refused(tell: fn(&TooMuchMemory)) {
    let _ = ENDING.set(Last { reserve: Mutex::new(vec![0; RESERVE]), tell });
}

/// Allocates by `attempt`, which looks at a refusal itself.
pub(super) fn looking<T>(attempt: impl FnOnce() -> T) -> T {
    let before = LOOKS.replace(true);
    let outcome = attempt();
    LOOKS.set(before);
    outcome
}

/// Ends the process with the message, unless nobody is to be told.
#[cold]
fn refused(bytes: usize) {
    let is = |flag: &'static std::thread::LocalKey<Cell<bool>>| flag.try_with(Cell::get).unwrap_or(true);
    let Some(Last { reserve, tell }) = ENDING.get().filter(|_| !is(&LOOKS) && !is(&TELLS)) else { return };
    TELLS.set(true);
    {
        let mut reserve = reserve.lock().unwrap_or_else(PoisonError::into_inner);
        if reserve.capacity() > 0 {
            *reserve = Vec::new();
            drop(reserve);
            let what = LAST.try_lock().map_or("the scene", |last| *last);
            tell(&refused_by_the_system(u64::try_from(bytes).ok(), what));
            // whoever tells ends the process
            return;
        }
    }
    // another thread is telling: nothing may be done with the memory that this one did not get
    std::thread::sleep(Duration::MAX);
}

// SAFETY: each function passes what it was given to the allocator of the system and gives what that gives
unsafe impl GlobalAlloc for Telling {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the promises of the caller are those that the system asks for
        given(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above
        given(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above; the memory came from the system
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above
        given(unsafe { System.realloc(memory, layout, size) }, size)
    }
}

#[inline]
fn given(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() {
        refused(bytes);
    }
    memory
}
