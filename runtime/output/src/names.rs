//! Names of result files: which are allowed, and how steps are numbered.
//!
//! Promises: a name that is accepted is one plain file name on every system, so that a scene that runs here runs
//! anywhere, and cannot leave its folder.

use super::OutputError;

/// Digits of the step number in the names of step files; longer numbers use more.
const STEP_DIGITS: usize = 4;
/// What stands in the name of a file before the number of its part, and the digits of that.
const PART_MARK: &str = "p";
const PART_DIGITS: usize = 4;
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

/// The name of the file of a part (counted from 0) of step `step` of a series whose grids come in parts:
/// `base_0003.p0000.vtu`. The file that names all of them is `step_name(base, step, "pvtu")`.
#[must_use]
pub fn part_name(base: &str, step: usize, part: usize) -> String {
    step_name(base, step, &format!("{PART_MARK}{part:0PART_DIGITS$}.vtu"))
}

/// The number of the part of a name that [`part_name`] made, for any series; `None` for other names.
#[must_use]
pub fn part_of(name: &str) -> Option<usize> {
    let (base, _) = name.rsplit_once('_')?;
    part_step_of(name, base).map(|(_, part)| part)
}

/// The step of a file of a series of grids: of a whole grid, of a part, or of the file that names the parts.
pub(super) fn grid_step_of(name: &str, base: &str) -> Option<usize> {
    let whole = step_of(name, base, "vtu").or_else(|| step_of(name, base, "pvtu"));
    whole.or_else(|| part_step_of(name, base).map(|(step, _)| step))
}

/// Step and part of a name that [`part_name`] made of this base.
fn part_step_of(name: &str, base: &str) -> Option<(usize, usize)> {
    let rest = name.strip_prefix(base)?.strip_prefix('_')?.strip_suffix(".vtu")?;
    let (step, part) = rest.split_once('.')?;
    let (step, part) = (step.parse().ok()?, part.strip_prefix(PART_MARK)?.parse().ok()?);
    (part_name(base, step, part) == name).then_some((step, part))
}

/// What the names of all files of a step of a series of grids begin with.
pub(super) fn step_beginning(base: &str, step: usize) -> String {
    step_name(base, step, "")
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

/// Names of files that one result is written under.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Names {
    /// A single one.
    One(String),
    /// One for each step: grids (`vtu`), also in parts, or tables (`csv`).
    Steps {
        /// What stands before the number of the step.
        base: String,
        /// How they end.
        extension: &'static str,
    },
}

impl Names {
    /// A name that is one of both, of any step, and whether that is so only where the case of letters does not count, as on
    /// some systems.
    #[must_use]
    pub fn shared_with(&self, other: &Self) -> Option<(String, bool)> {
        let is_exact = self.meets(other);
        if !is_exact && !self.lower().meets(&other.lower()) {
            return None;
        }
        let name = match (self, other) {
            (Self::One(name), _) | (_, Self::One(name)) => name.clone(),
            (Self::Steps { base, extension }, _) => step_name(base, 0, extension),
        };
        Some((name, !is_exact))
    }

    fn meets(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::One(name), Self::Steps { base, extension }) | (Self::Steps { base, extension }, Self::One(name)) => {
                let of_grid = || *extension == "vtu" && grid_step_of(name, base).is_some();
                step_of(name, base, extension).is_some() || of_grid()
            }
            // of two names of steps the bases are what stands before the last number
            (a, b) => a == b,
        }
    }

    fn lower(&self) -> Self {
        match self {
            Self::One(name) => Self::One(name.to_lowercase()),
            Self::Steps { base, extension } => Self::Steps { base: base.to_lowercase(), extension },
        }
    }
}

/// Names that a writer is going to use.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Names of files.
    pub files: Vec<String>,
    /// Base and extension of files of steps, and the number of steps.
    pub series: Vec<(String, &'static str, usize)>,
    /// How many files of parts a step of a series with the extension `pvtu` has.
    pub parts: usize,
}

impl Plan {
    /// Whether the writer is going to use a name.
    #[must_use]
    pub fn takes(&self, name: &str) -> bool {
        let of = |(base, extension, steps): &(String, &str, usize)| {
            let own = step_of(name, base, extension).is_some_and(|s| s < *steps);
            let part = || part_step_of(name, base).is_some_and(|(s, part)| s < *steps && part < self.parts);
            own || (*extension == "pvtu" && part())
        };
        self.files.iter().any(|f| f == name) || self.series.iter().any(of)
    }

    /// The names with the most letters of each kind: where these are allowed, all are.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        let last = |(base, extension, steps): &(String, &str, usize)| match (*extension, steps.saturating_sub(1)) {
            ("pvtu", step) => part_name(base, step, self.parts.saturating_sub(1)),
            (extension, step) => step_name(base, step, extension),
        };
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

    #[test]
    fn a_part_has_one_name_which_is_a_plain_one_of_its_step() {
        assert_eq!(part_name("u", 3, 0), "u_0003.p0000.vtu");
        for (step, part) in [(0, 0), (9999, 12), (10_000, 10_000)] {
            for base in ["u", "a_0001", "x.p0001"] {
                let name = part_name(base, step, part);
                assert!(check_name(&name).is_ok() && name.starts_with(&step_beginning(base, step)), "{name}");
                assert_eq!((part_of(&name), part_step_of(&name, base)), (Some(part), Some((step, part))));
                assert_eq!((grid_step_of(&name, base), step_of(&name, base, "vtu")), (Some(step), None));
            }
        }
        let others = ["u_0003.vtu", "u_0003.pvtu", "u_0003.p000.vtu", "u_0003.p00000.vtu", "u_3.p0000.vtu"];
        for name in others.iter().chain(&["u.p0000.vtu", "u_0003.p+000.vtu", "u_0003.p0000.csv", "u_0003_p0000.vtu"]) {
            assert_eq!((part_of(name), part_step_of(name, "u")), (None, None), "{name}");
        }
        assert_eq!(grid_step_of("u_0003.pvtu", "u"), Some(3));
        assert_eq!((grid_step_of("u.pvd", "u"), grid_step_of("uu_0003.p0000.vtu", "u")), (None, None));
    }

    #[test]
    fn names_of_steps_meet_single_ones_of_any_step_and_case() {
        let one = |name: &str| Names::One(name.to_owned());
        let steps = |base: &str, extension| Names::Steps { base: base.to_owned(), extension };
        let meet = |a: &Names, b: &Names| {
            assert_eq!(a.shared_with(b).is_some(), b.shared_with(a).is_some(), "{a:?} {b:?}");
            a.shared_with(b)
        };
        for (a, b, name, by_case) in [
            (one("Measures.csv"), one("measures.csv"), "Measures.csv", true),
            (one("a_0001.csv"), steps("a", "csv"), "a_0001.csv", false),
            (one("A_0001.csv"), steps("a", "csv"), "A_0001.csv", true),
            (one("g_12345.vtu"), steps("g", "vtu"), "g_12345.vtu", false),
            (one("g_0001.p0000.vtu"), steps("g", "vtu"), "g_0001.p0000.vtu", false),
            (steps("a", "csv"), steps("A", "csv"), "a_0000.csv", true),
        ] {
            assert_eq!(meet(&a, &b), Some((name.to_owned(), by_case)), "{a:?} {b:?}");
        }
        for (a, b) in [
            (one("a.csv"), one("a.pvd")),
            (one("a.csv"), steps("a", "csv")),
            (one("a_001.csv"), steps("a", "csv")),
            (one("a_0001.csv"), steps("a", "vtu")),
            (steps("a_0001", "csv"), steps("a", "csv")),
            (steps("a", "vtu"), steps("a", "csv")),
        ] {
            assert_eq!(meet(&a, &b), None, "{a:?} {b:?}");
        }
    }

    #[test]
    fn a_plan_of_steps_in_parts_takes_their_parts_and_no_whole_grids() {
        let plan = Plan { series: vec![("u".to_owned(), "pvtu", 3)], parts: 2, ..Plan::default() };
        for (name, taken) in [
            ("u_0002.pvtu", true),
            ("u_0002.p0001.vtu", true),
            ("u_0002.p0002.vtu", false),
            ("u_0003.p0000.vtu", false),
            ("u_0003.pvtu", false),
            ("u_0002.vtu", false),
            ("v_0002.p0001.vtu", false),
        ] {
            assert_eq!(plan.takes(name), taken, "{name}");
        }
        assert_eq!(plan.names().collect::<Vec<_>>(), ["u_0002.p0001.vtu"]);
        let whole = Plan { series: vec![("u".to_owned(), "vtu", 3)], ..Plan::default() };
        assert!(whole.takes("u_0002.vtu") && !whole.takes("u_0002.p0000.vtu") && !whole.takes("u_0002.pvtu"));
    }
}
