//! How much memory the process may take, and whether a need fits into it.
//!
//! The limit is one of the process, because its memory is: every large need is asked for with [`claim`] before it is
//! taken. Promises: a need that does not fit is an error with both numbers, nothing has been allocated by then. Without
//! a limit of the user it is the memory of the machine, or of the control group (a container) where that is less; where
//! the system does not tell (other systems than Linux) there is none. Does not count small vectors.

use std::sync::{
    OnceLock,
    atomic::{AtomicU64, Ordering},
};

/// A need that does not fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} needs about {}, {} are in use, and the limit is {}", shown(*.needed), shown(*.in_use), shown(*.limit))]
pub struct TooMuchMemory {
    /// What is too large.
    pub what: &'static str,
    /// Bytes that it needs, estimated.
    pub needed: u64,
    /// Bytes that the process has.
    pub in_use: u64,
    /// Bytes that it may have.
    pub limit: u64,
}

/// The limit of the user in bytes; 0 if there is none.
static LIMIT: AtomicU64 = AtomicU64::new(0);

/// Sets the most bytes that this process may have, in place of the memory of the machine.
pub fn set_limit(bytes: u64) {
    LIMIT.store(bytes.max(1), Ordering::Relaxed);
}

/// Asks whether `bytes` more fit for `what`, a noun ("the factor of the matrix").
///
/// # Errors
/// [`TooMuchMemory`] if what the process has and the need together are above the limit.
pub fn claim(bytes: u64, what: &'static str) -> Result<(), TooMuchMemory> {
    let limit = match LIMIT.load(Ordering::Relaxed) {
        0 => machine(),
        limit => limit,
    };
    if limit == u64::MAX {
        return Ok(());
    }
    let in_use = in_use();
    if in_use.saturating_add(bytes) <= limit {
        Ok(())
    } else {
        Err(TooMuchMemory { what, needed: bytes, in_use, limit })
    }
}

/// As [`claim`], for so many numbers of double precision.
///
/// # Errors
/// As [`claim`].
pub fn claim_numbers(count: u64, what: &'static str) -> Result<(), TooMuchMemory> {
    claim(count.saturating_mul(8), what)
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

/// The memory of the machine or of the control group, whichever is less.
fn machine() -> u64 {
    static MACHINE: OnceLock<u64> = OnceLock::new();
    *MACHINE.get_or_init(|| {
        let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let total = read("/proc/meminfo").lines().find_map(|l| kilobytes(l.strip_prefix("MemTotal:")?));
        let group = read("/sys/fs/cgroup/memory.max").trim().parse().ok();
        total.unwrap_or(u64::MAX).min(group.unwrap_or(u64::MAX))
    })
}

/// The bytes that are resident; 0 where the system does not tell.
fn in_use() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status.lines().find_map(|l| kilobytes(l.strip_prefix("VmRSS:")?)).unwrap_or(0)
}

fn kilobytes(text: &str) -> Option<u64> {
    Some(text.split_whitespace().next()?.parse::<u64>().ok()?.saturating_mul(1024))
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
        if machine() == u64::MAX {
            return;
        }
        assert!(claim(1, "a byte").is_ok());
        let error = claim(1 << 60, "the factor of the matrix").unwrap_err();
        assert!(error.in_use > 0 && error.limit == machine(), "{error:?}");
        assert!(error.to_string().contains("the factor of the matrix needs about 1152922 TB"), "{error}");
    }
}
