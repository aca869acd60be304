//! The memory of this process and its limits, as the operating system reports them.

use std::sync::OnceLock;

/// Part of the limit of a control group that is left to what the system counts beside resident memory: page tables and
/// files in flight. Measured below 3 % while results are written.
const OF_THE_SYSTEM: u64 = 20;

/// Memory of this process in bytes; zeros where the system does not tell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usage {
    /// In the memory of the machine.
    pub(super) resident: u64,
    /// Addresses in use, resident or not.
    pub(super) addresses: u64,
}

/// A limit, and how much of it is in use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bound {
    pub(super) in_use: u64,
    pub(super) limit: u64,
    /// Whose limit it is; empty for that of the user.
    pub(super) of: &'static str,
}

/// Limits that the system sets, in bytes; `u64::MAX` for none.
struct Limits {
    /// On resident memory, and whose it is.
    resident: (u64, &'static str),
    /// On addresses.
    addresses: u64,
}

/// Addresses that are left to small needs when the address space is limited: a need that the system refuses there ends
/// the process without a word. Bytes.
pub(super) const ADDRESSES_LEFT: u64 = 16 << 20;

/// The limit that is passed with so many bytes more, if one is; that of the user takes the place of the machine's.
pub(super) fn exceeded(user: Option<u64>, more: u64) -> Option<Bound> {
    let (resident, addresses) = nearest(user);
    let is_passed = |bound: &Bound, kept: u64| bound.in_use.saturating_add(more).saturating_add(kept) > bound.limit;
    // what is granted is taken faster than anybody watches
    match (is_passed(&resident, 0), is_passed(&addresses, ADDRESSES_LEFT)) {
        (true, _) => Some(resident),
        (false, true) => Some(addresses),
        (false, false) => None,
    }
}

/// The limits on resident memory and on addresses as they stand.
pub(super) fn nearest(user: Option<u64>) -> (Bound, Bound) {
    let limits = limits();
    let (limit, of) = user.map_or(limits.resident, |bytes| (bytes, ""));
    let used = usage();
    let resident = Bound { in_use: used.resident, limit, of };
    (resident, Bound { in_use: used.addresses, limit: limits.addresses, of: "addresses, set by `ulimit -v`" })
}

pub(super) fn usage() -> Usage {
    let status = read("/proc/self/status");
    Usage { resident: line(&status, "VmRSS:").unwrap_or(0), addresses: line(&status, "VmSize:").unwrap_or(0) }
}

fn limits() -> &'static Limits {
    static LIMITS: OnceLock<Limits> = OnceLock::new();
    LIMITS.get_or_init(|| {
        let machine = line(&read("/proc/meminfo"), "MemTotal:").unwrap_or(u64::MAX);
        // the second and third generation of control groups
        let group = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"]
            .iter()
            .filter_map(|path| read(path).trim().parse::<u64>().ok())
            .fold(u64::MAX, u64::min);
        let group = group - group / OF_THE_SYSTEM;
        let addresses = read("/proc/self/limits")
            .lines()
            .find_map(|l| l.strip_prefix("Max address space")?.split_whitespace().next()?.parse().ok())
            .unwrap_or(u64::MAX);
        let resident =
            if group < machine { (group, "of the control group") } else { (machine, "the memory of the machine") };
        Limits { resident, addresses }
    })
}

fn read(path: &str) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

/// The size on a line of a file of the system, `VmRSS:     1234 kB`, in bytes.
fn line(text: &str, name: &str) -> Option<u64> {
    let size = text.lines().find_map(|l| l.strip_prefix(name))?;
    Some(size.split_whitespace().next()?.parse::<u64>().ok()?.saturating_mul(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_that_is_met_first_is_told() {
        if cfg!(not(target_os = "linux")) {
            return;
        }
        let used = usage();
        assert!(used.resident > 0 && used.addresses >= used.resident);
        let bound = exceeded(Some(1), 0).expect("more than a byte is in use");
        assert_eq!((bound.limit, bound.of), (1, ""));
        assert!(exceeded(Some(u64::MAX / 2), 1 << 20).is_none());
        assert!(exceeded(None, u64::MAX / 2).is_some_and(|b| !b.of.is_empty()));
    }
}
