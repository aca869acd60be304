//! The memory limit of the process, and whether an allocation fits into it.
//!
//! Three mechanisms keep the limit. Every large allocation is announced with [`claim`] or made with [`zeros`]; one that
//! does not fit is an error with both numbers before anything is allocated. Memory that was not announced is detected
//! by [`watch`], which a program starts once; what the system itself refuses, by the allocator [`Telling`]. Without a
//! limit of the user the limit is the memory of the machine, of the control group (a container) or of the address space
//! (`ulimit -v`), whichever is smallest; on systems other than Linux there is none.

mod limits;
#[expect(unsafe_code, reason = "the allocator of the system behind one that tells of refusals")]
mod telling;
mod watch;

use std::sync::{
    Mutex,
    atomic::{AtomicU64, Ordering},
};

use limits::Bound;
use telling::looking;
pub use telling::{Telling, when_refused};
pub use watch::watch;

/// What the program itself takes with a scene of a few cells: its code, machine code of the terms, threads. Measured
/// 16 MB in a release build and 27 MB in a development build; a limit below it can hold no run.
pub const PROGRAM: u64 = 32_000_000;

/// A need that does not fit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TooMuchMemory {
    /// What is too large; or what was asked for last, where memory was taken without asking.
    pub what: &'static str,
    /// Bytes that it needs, estimated; `None` where memory was taken without asking.
    pub needed: Option<u64>,
    /// Bytes that the process has.
    pub in_use: u64,
    /// Bytes that it may have.
    pub limit: u64,
    /// Whose limit it is, where it is not the user's.
    pub of: &'static str,
}

impl std::fmt::Display for TooMuchMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (in_use, limit) = (shown(self.in_use), shown(self.limit));
        match self.needed {
            Some(needed) => write!(f, "{} needs about {}, {in_use} are in use", self.what, shown(needed))?,
            None => write!(f, "{in_use} are in use, more than was foreseen (the last large need was {})", self.what)?,
        }
        match self.of {
            SYSTEM => write!(f, ", and the system gives no more"),
            "" => write!(f, ", and the limit is {limit}"),
            of => write!(f, ", and the limit is {limit} ({of})"),
        }
    }
}

impl std::error::Error for TooMuchMemory {}

/// The limit of the user in bytes; 0 if there is none.
static LIMIT: AtomicU64 = AtomicU64::new(0);
/// Bytes that were granted and are being taken at this moment.
static PENDING: AtomicU64 = AtomicU64::new(0);
/// What was asked for last.
static LAST: Mutex<&str> = Mutex::new("the scene");

/// Sets the most bytes that this process may have, in place of the memory of the machine.
pub fn set_limit(bytes: u64) {
    LIMIT.store(bytes.max(1), Ordering::Relaxed);
}

/// Asks whether `bytes` more fit for `what`, a noun ("the factor of the matrix").
///
/// # Errors
/// [`TooMuchMemory`] if what the process has and the need together are above the limit.
pub fn claim(bytes: u64, what: &'static str) -> Result<(), TooMuchMemory> {
    ask(bytes, PENDING.load(Ordering::Relaxed), what)
}

/// As [`claim`], for so many numbers of double precision.
///
/// # Errors
/// As [`claim`].
pub fn claim_numbers(count: u64, what: &'static str) -> Result<(), TooMuchMemory> {
    claim(count.saturating_mul(8), what)
}

/// A buffer of default values (zero for numbers), or an error in place of an abort.
///
/// # Errors
/// As [`claim`]; also where the system gives no more although the limit allows it.
pub fn zeros<T: Clone + Default>(length: usize, what: &'static str) -> Result<Vec<T>, TooMuchMemory> {
    let mut buffer = Vec::new();
    lengthen(&mut buffer, length, what)?;
    Ok(buffer)
}

/// Lengthens a buffer by default values; one that is longer stays as it is.
///
/// # Errors
/// As [`zeros`].
pub fn lengthen<T: Clone + Default>(
    buffer: &mut Vec<T>,
    length: usize,
    what: &'static str,
) -> Result<(), TooMuchMemory> {
    let more = length.saturating_sub(buffer.len());
    let bytes = (more as u64).saturating_mul(size_of::<T>() as u64);
    let pending = Pending::new(bytes);
    if bytes >= UNASKED {
        ask(bytes, pending.before, what)?;
    }
    looking(|| buffer.try_reserve_exact(more)).map_err(|_| refused_by_the_system(Some(bytes), what))?;
    // now it becomes resident
    buffer.resize(buffer.len() + more, T::default());
    Ok(())
}

/// Buffers below this many bytes are not asked for: asking costs as much as filling them.
const UNASKED: u64 = 1 << 16;

/// Whose limit it is where an allocation fails that all known limits allow.
const SYSTEM: &str = "the system";

/// The error for memory that the system does not give, of a size where that is known.
#[must_use]
pub fn refused_by_the_system(needed: Option<u64>, what: &'static str) -> TooMuchMemory {
    let in_use = limits::usage().resident;
    TooMuchMemory { what, needed, in_use, limit: in_use, of: SYSTEM }
}

/// Makes room for `more` elements at the end of a vector that grows, and asks for it where it is large.
///
/// # Errors
/// As [`zeros`].
pub fn grow<T>(list: &mut Vec<T>, more: usize, what: &'static str) -> Result<(), TooMuchMemory> {
    if list.capacity() - list.len() >= more {
        return Ok(());
    }
    // doubled, as a vector does by itself
    let more = more.max(list.capacity());
    let bytes = (more as u64).saturating_mul(size_of::<T>() as u64);
    if bytes >= UNASKED {
        claim(bytes, what)?;
    }
    looking(|| list.try_reserve_exact(more)).map_err(|_| refused_by_the_system(Some(bytes), what))
}

/// Memory that was granted to one thread and is not resident yet: other threads must count it.
struct Pending {
    bytes: u64,
    before: u64,
}

impl Pending {
    fn new(bytes: u64) -> Self {
        Self { bytes, before: PENDING.fetch_add(bytes, Ordering::Relaxed) }
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        PENDING.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

fn ask(bytes: u64, pending: u64, what: &'static str) -> Result<(), TooMuchMemory> {
    if let Ok(mut last) = LAST.lock() {
        *last = what;
    }
    let needed = bytes.saturating_add(pending);
    match limits::exceeded(user_limit(), needed) {
        Some(Bound { in_use, limit, of }) => {
            Err(TooMuchMemory { what, needed: Some(bytes), in_use: in_use.saturating_add(pending), limit, of })
        }
        None => Ok(()),
    }
}

fn user_limit() -> Option<u64> {
    Some(LIMIT.load(Ordering::Relaxed)).filter(|bytes| *bytes > 0)
}

/// A size in words, to two digits or so: `1.5 GB`, in powers of 1000.
#[must_use]
pub fn shown(bytes: u64) -> String {
    const UNITS: [(&str, f64); 4] = [("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)];
    #[expect(clippy::cast_precision_loss, reason = "two digits are shown")]
    let size = bytes as f64;
    match UNITS.iter().find(|(_, unit)| size >= *unit) {
        Some((name, unit)) if size / unit < 10.0 => format!("{:.1} {name}", size / unit),
        Some((name, unit)) => format!("{:.0} {name}", size / unit),
        None => format!("{bytes} bytes"),
    }
}

/// The bytes of a size as it is written: a number with a unit, `4GB`, `500 MB`, `2GiB`; `None` if it is none.
#[must_use]
pub fn parse(text: &str) -> Option<u64> {
    let text = text.trim();
    let digits = text.find(|c: char| c.is_ascii_alphabetic() && !matches!(c, 'e' | 'E')).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let factor = match unit {
        "B" => 1.0,
        "kB" | "KB" => 1e3,
        "MB" => 1e6,
        "GB" => 1e9,
        "TB" => 1e12,
        "KiB" => 1024.0,
        "MiB" => 1024.0f64.powi(2),
        "GiB" => 1024.0f64.powi(3),
        "TiB" => 1024.0f64.powi(4),
        _ => return None,
    };
    let bytes = number.trim().parse::<f64>().ok()? * factor;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be a size")]
    (1.0..1e18).contains(&bytes).then_some(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_they_are_written() {
        for (text, bytes) in
            [("4GB", 4_000_000_000), ("1.5 GiB", 1_610_612_736), ("200MB", 200_000_000), ("1e3kB", 1_000_000)]
        {
            assert_eq!(parse(text), Some(bytes), "{text}");
        }
        for text in ["", "4", "GB", "-1GB", "0MB", "4 apples", "nanGB", "infGB"] {
            assert_eq!(parse(text), None, "{text}");
        }
        assert_eq!([999, 1_500, 23_400_000_000].map(shown), ["999 bytes", "1.5 kB", "23 GB"]);
    }

    #[test]
    fn a_need_above_the_memory_of_the_machine_is_refused_with_its_size() {
        if cfg!(not(target_os = "linux")) {
            return;
        }
        assert!(claim(1, "a byte").is_ok());
        let error = claim(1 << 60, "the factor of the matrix").unwrap_err();
        assert!(error.in_use > 0 && error.limit > error.in_use && !error.of.is_empty(), "{error:?}");
        assert!(error.to_string().contains("the factor of the matrix needs about 1152922 TB"), "{error}");
        assert_eq!(zeros::<f64>(1 << 57, "a vector").unwrap_err().needed, Some(1 << 60));
    }

    #[test]
    fn memory_that_another_thread_is_taking_counts() {
        let first = Pending::new(8);
        assert!(Pending::new(16).before >= first.bytes);
    }
}
