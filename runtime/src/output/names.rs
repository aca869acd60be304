//! Names of result files: which are allowed, and how steps are numbered.
//!
//! Promises: a name that is accepted is one plain file name on every system, so that a scene that runs here runs
//! anywhere, and cannot leave its folder.

use super::OutputError;

/// Digits of the step number in the names of step files; longer numbers use more.
const STEP_DIGITS: usize = 4;
/// Bytes that a file name may have on the usual file systems.
const LONGEST: usize = 255;
/// What Windows keeps for devices, with any ending; the last two also with a digit behind.
const DEVICES: [&str; 6] = ["CON", "PRN", "AUX", "NUL", "COM", "LPT"];

/// How temporary names begin and end. A leading dot is refused in final names.
const TEMPORARY: [&str; 2] = [".wfl-", ".tmp"];

/// Whether a text can be the name of a result file.
///
/// # Errors
/// [`OutputError::BadName`] with the reason.
pub fn check_name(name: &str) -> Result<(), OutputError> {
    let reason = if name.is_empty() {
        "it is empty"
    } else if name.starts_with('.') {
        "it begins with a dot"
    } else if name.contains(['/', '\\']) {
        "it has a path separator"
    } else if name.chars().any(char::is_control) {
        "it has a control character"
    } else if name.contains(['<', '>', ':', '"', '|', '?', '*']) {
        "it has a character that Windows does not allow (one of < > : \" | ? *)"
    } else if name.ends_with(['.', ' ']) {
        "it ends with a dot or a blank, which Windows drops"
    } else if is_device(name) {
        "Windows keeps it for a device"
    } else if name.len() > LONGEST {
        "it is longer than 255 bytes"
    } else {
        return Ok(());
    };
    Err(OutputError::BadName { name: name.to_owned(), reason })
}

/// `NUL`, `nul.csv`, `COM1.vtu`.
fn is_device(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().trim_end_matches(' ').to_uppercase();
    let numbered = |device: &str| {
        let rest = stem.strip_prefix(device).unwrap_or_default();
        rest.chars().count() == 1 && rest.contains(['0', '1', '2', '3', '4', '5', '6', '7', '8', '9', '¹', '²', '³'])
    };
    DEVICES[..4].contains(&stem.as_str()) || DEVICES[4..].iter().any(|d| numbered(d))
}

/// The name of the file of step `step` (counted from 0) of a series: `base_0000.extension`.
#[must_use]
pub fn step_name(base: &str, step: usize, extension: &str) -> String {
    format!("{base}_{step:0STEP_DIGITS$}.{extension}")
}

/// The step of a name that [`step_name`] made.
pub(super) fn step_of(name: &str, base: &str, extension: &str) -> Option<usize> {
    let rest = name.strip_prefix(base)?.strip_prefix('_')?;
    let step = rest.strip_suffix(extension)?.strip_suffix('.')?.parse().ok()?;
    (step_name(base, step, extension) == name).then_some(step)
}

/// A name under which this process writes a file before it gets its own.
pub(super) fn temporary_name(count: u64) -> String {
    let [start, end] = TEMPORARY;
    format!("{start}{}-{count}{end}", std::process::id())
}

/// Exactly the names that temporary files have.
pub(super) fn is_temporary(name: &str) -> bool {
    writer_of(name).is_some()
}

/// Those of one process.
pub(super) fn is_temporary_of(name: &str, process: u32) -> bool {
    writer_of(name).is_some_and(|digits| digits == process.to_string())
}

/// The digits of the number of the process that made a temporary file.
fn writer_of(name: &str) -> Option<&str> {
    let [start, end] = TEMPORARY;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let (process, count) = name.strip_prefix(start)?.strip_suffix(end)?.split_once('-')?;
    (is_number(process) && is_number(count)).then_some(process)
}

/// Names that a writer is going to use.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Names of files.
    pub files: Vec<String>,
    /// Base and extension of files of steps, and the number of steps.
    pub series: Vec<(String, &'static str, usize)>,
}

impl Plan {
    /// Whether the writer is going to use a name.
    #[must_use]
    pub fn takes(&self, name: &str) -> bool {
        let of = |(base, extension, steps): &(String, &str, usize)| {
            step_of(name, base, extension).is_some_and(|s| s < *steps)
        };
        self.files.iter().any(|f| f == name) || self.series.iter().any(of)
    }

    /// The names with the most letters of each kind: where these are allowed, all are.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        let last =
            |(base, extension, steps): &(String, &str, usize)| step_name(base, steps.saturating_sub(1), extension);
        self.files.iter().cloned().chain(self.series.iter().map(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_visible_names_that_every_system_has_are_accepted() {
        let long = "a".repeat(256);
        for name in
            ["", ".", "..", ".hidden", "a/b", "../up", "a\\b", "a\nb", "a\0b", "a:b", "c:", "x.", "x ", "a?.csv"]
                .into_iter()
                .chain(["NUL", "con.csv", "Aux.tar.gz", "com1.vtu", "LPT9", "nul .csv", "COM².x", &long])
        {
            assert!(matches!(check_name(name), Err(OutputError::BadName { .. })), "{name:?}");
        }
        for name in ["Spannung σ (1).csv", "console.csv", "com.csv", "com10.csv", "nulls", "a..b", "lpt.vtu"] {
            assert!(check_name(name).is_ok(), "{name:?}");
        }
    }

    #[test]
    fn a_step_has_one_name() {
        for step in [0, 7, 9999, 10_000] {
            assert_eq!(step_of(&step_name("u", step, "csv"), "u", "csv"), Some(step));
        }
        let others =
            ["u_00007.csv", "u_007.csv", "u_0007.vtu", "u_0007_0001.csv", "u_+007.csv", "u_x007.csv", "uu_0007.csv"];
        for name in others.iter().chain(&["u_.csv", "u_0007csv", "u"]) {
            assert_eq!(step_of(name, "u", "csv"), None, "{name}");
        }
    }
}
