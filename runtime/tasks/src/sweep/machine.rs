//! The machine and the program of a sweep: what a time depends on beside the setting.

use std::path::Path;

use crate::VERSION;

/// Program and machine in words.
pub(super) struct Machine {
    pub(super) version: String,
    /// The commit the program was built from, if it still lies in its repository and that has not moved on since.
    pub(super) commit: String,
    pub(super) name: String,
}

/// What can be found out; `unknown` otherwise.
pub(super) fn describe() -> Machine {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let model = read("/proc/cpuinfo").and_then(|text| {
        let line = text.lines().find(|l| l.starts_with("model name"))?;
        line.split_once(':').map(|(_, name)| name.trim().to_owned())
    });
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
    Machine {
        version: VERSION.to_owned(),
        commit: commit().unwrap_or_else(|| "unknown".to_owned()),
        name: format!("{}, {cores} cores, {os} {arch}", model.unwrap_or_else(|| "unknown processor".to_owned())),
    }
}

/// The commit at the head of the repository the program was built in; `None` if that was written behind the program.
fn commit() -> Option<String> {
    let git = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.git");
    let head = git.join("HEAD");
    let text = std::fs::read_to_string(&head).ok()?;
    let (hash, place) = match text.trim().strip_prefix("ref: ") {
        Some(reference) => (std::fs::read_to_string(git.join(reference)).ok()?, git.join(reference)),
        None => (text, head),
    };
    let written = |path: &Path| std::fs::metadata(path).and_then(|m| m.modified()).ok();
    let built = written(&std::env::current_exe().ok()?)?;
    if written(&place)? > built { None } else { hash.get(..12).map(str::to_owned) }
}

/// Starts the largest memory of this process anew, where the system can; elsewhere it only grows from run to run.
pub(super) fn forget_peak_memory() {
    // 5 resets the high-water mark, proc(5); a system without it has no other way
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}
