//! The numbers that Newton's method, linear solvers, contact, the checks and the search for an accuracy decide by, as `docs/constants.md`
//! lists them: what each is, its unit, and why it has this value, from its doc comment.
//!
//! A comment says first what the number is; what stands behind the first colon, semicolon or full stop says why. The unit
//! stands in it in words (`part of the residual norm`); whole numbers count something. A constant without a comment of its
//! own, right behind another one, shares that one's.
//!
//! In which range suites pass is measured ([`VariedWorkspace`]) and kept in `ranges.csv`; what was found with another value does not
//! count.

mod rewritten;
mod varied;

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

pub use varied::{BUDGET, Range, SUITES, UNREAD, VariedWorkspace, name_of, read_ranges, write_ranges};

/// Where the numbers stand, and what decides there.
const FOLDERS: [(&str, &str); 5] = [
    ("runtime/newton/src", "Newton's method"),
    ("runtime/linear/src", "Linear systems"),
    ("runtime/contact/src", "Contact"),
    ("runtime/checks/src", "Checks"),
    ("runtime/adapt/src/accuracy", "The search for an accuracy"),
];

/// The table of ranges.
pub const RANGES: &str = "tests/src/constants/ranges.csv";

/// Words that a unit begins with, and words that are one.
const UNITS_OF: [&str; 5] = ["in units of ", "parts of ", "part of ", "times ", "multiple of "];
const UNITS: [&str; 8] = ["seconds", "bytes", "degrees", "relative", "cosine", "strain", "power", "factor"];

/// Words behind which a unit does not go on.
const VERBS: [&str; 12] = [
    " is ", " are ", " has ", " have ", " that ", " which ", " from ", " may ", " pushes ", " serves ", " no ",
    " counts ",
];

/// A number that something is decided by.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constant {
    /// The file, from the folder of its crate.
    pub file: String,
    /// Its name there.
    pub name: String,
    /// Its type.
    pub kind: String,
    /// As it is written.
    pub value: String,
    /// In words; `None` if the comment has none.
    pub unit: Option<String>,
    /// What it is; empty without a comment.
    pub what: String,
    /// Why it is so large; `None` if the comment does not say it.
    pub why: Option<String>,
}

/// The constants of a folder of the repository, by file and line; those of tests are left out.
///
/// # Panics
/// If a file cannot be read.
fn constants_in(root: &Path, folder: &str) -> Vec<Constant> {
    let mut files = Vec::new();
    let mut folders: Vec<PathBuf> = vec![root.join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("sources can be read") {
            let path = entry.expect("sources can be read").path();
            let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            match path.is_dir() {
                true => folders.push(path),
                false if name.ends_with(".rs") && !name.contains("tests") => files.push(path),
                false => {}
            }
        }
    }
    files.sort();
    let start = root.join(folder);
    let of_file = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).expect("sources can be read");
        constants_of(&path.strip_prefix(&start).unwrap_or(path).display().to_string(), &text)
    };
    files.iter().flat_map(of_file).collect()
}

/// The constants of a file with this name.
#[must_use]
pub fn constants_of(file: &str, text: &str) -> Vec<Constant> {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let (mut found, mut comment, mut shared) = (Vec::new(), String::new(), String::new());
    for line in text.lines().map(str::trim) {
        if let Some(words) = line.strip_prefix("///") {
            comment += words;
            continue;
        }
        if line.starts_with("#[") {
            continue;
        }
        let own = std::mem::take(&mut comment);
        let Some([name, kind, value]) = declared(line) else {
            shared.clear();
            continue;
        };
        if !own.is_empty() {
            shared = own.trim().to_owned();
        }
        let (what, why) = parted(&shared);
        found.push(Constant {
            file: file.to_owned(),
            name: name.to_owned(),
            kind: kind.to_owned(),
            value: value.to_owned(),
            unit: unit(kind, &shared),
            what,
            why,
        });
    }
    found
}

/// Name, type and value of a number that is declared on this line.
fn declared(line: &str) -> Option<[&str; 3]> {
    let (before, rest) = line.split_once("const ")?;
    let (name, rest) = rest.split_once(": ")?;
    let (kind, value) = rest.split_once(" = ")?;
    let is_name = name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
    let is_number = ["f64", "usize", "u8", "u32", "u64", "i32"].contains(&entry(kind));
    let fits = (before.is_empty() || before.starts_with("pub")) && is_name && is_number;
    fits.then_some([name, kind, value.trim_end_matches(';')])
}

/// The type of the entries of a list, or of a single number.
fn entry(kind: &str) -> &str {
    kind.trim_start_matches('[').split(';').next().unwrap_or(kind)
}

/// What a number is, and why it is so large.
fn parted(comment: &str) -> (String, Option<String>) {
    let ends = [": ", "; ", ". "];
    let Some(at) = ends.iter().filter_map(|end| comment.find(end)).min() else {
        return (comment.trim_end_matches('.').to_owned(), None);
    };
    let (what, why) = (&comment[..at], comment[at + 2..].trim_end_matches('.'));
    (what.to_owned(), Some(why.to_owned()))
}

fn unit(kind: &str, comment: &str) -> Option<String> {
    if entry(kind) != "f64" {
        return Some("a number".to_owned());
    }
    let lower = comment.to_lowercase();
    let first = UNITS_OF.iter().filter_map(|words| lower.find(words)).min();
    if let Some(at) = first {
        let words = lower[at..].split([',', ':', ';', '.', '(']).next().unwrap_or_default();
        let ends = VERBS.iter().filter_map(|verb| words.find(verb));
        let words = words[..ends.min().unwrap_or(words.len())].trim_end();
        // of what is named by its place in the sentence alone
        return Some(if words.ends_with(" of") { "relative".to_owned() } else { words.to_owned() });
    }
    let word = UNITS.iter().find(|word| lower.contains(*word)).map(|word| (*word).to_owned());
    word.or_else(|| lower.contains("number of").then(|| "a number".to_owned()))
}

/// Every constant, by folder.
///
/// # Panics
/// If a file cannot be read.
#[must_use]
pub fn constants(root: &Path) -> Vec<(&'static str, Vec<Constant>)> {
    FOLDERS.iter().map(|(folder, title)| (*title, constants_in(root, folder))).collect()
}

/// Every single number with the name that ranges have for it, `folder/file:NAME`.
///
/// # Panics
/// If a file cannot be read.
#[must_use]
pub fn single_constants(root: &Path) -> Vec<(String, Constant)> {
    let named = |folder: &str, c: Constant| (format!("{folder}/{}:{}", c.file, c.name), c);
    let of = |folder| constants_in(root, folder).into_iter().map(move |c| named(folder, c));
    FOLDERS.iter().flat_map(|(folder, _)| of(folder)).filter(|(_, c)| !c.kind.starts_with('[')).collect()
}

/// The ranges that were measured.
///
/// # Panics
/// If the table cannot be read.
#[must_use]
pub fn ranges(root: &Path) -> Vec<Range> {
    read_ranges(&std::fs::read_to_string(root.join(RANGES)).expect("the table of ranges can be read"))
}

/// A range in words; empty where none was measured for this value.
fn range_told(ranges: &[Range], constant: &str, value: &str) -> String {
    let Some(range) = ranges.iter().find(|r| r.constant == constant && r.value == value) else { return String::new() };
    let [least, most] = range.passes;
    if range.fails[0] == UNREAD {
        return UNREAD.to_owned();
    }
    let end = |factor: f64, fails: &str| match fails {
        "" => format!("{factor}"),
        suite => format!("{factor} ({suite})"),
    };
    format!("{} to {}", end(least, &range.fails[0]), end(most, &range.fails[1]))
}

/// The page, in Markdown.
///
/// # Panics
/// If a file cannot be read.
#[must_use]
pub fn page(root: &Path) -> String {
    let (all, ranges) = (constants(root), ranges(root));
    let count = |has: fn(&Constant) -> bool| all.iter().flat_map(|(_, list)| list).filter(|c| has(c)).count();
    let (n, units, reasons) = (count(|_| true), count(|c| c.unit.is_some()), count(|c| c.why.is_some()));
    let singles = single_constants(root);
    let measured = singles.iter().filter(|(name, c)| !range_told(&ranges, name, &c.value).is_empty()).count();
    let mut page = format!(
        "# Numbers that decide\n\nIn short: iterations, linear solvers, contact, checks and the search for an accuracy decide by {n} \
         constants. {units} of them have a unit in words, for {reasons} their comment says why they are so large. \
         `cargo run -p wfl-tests --bin constants` makes this page from the comments.\n\nRanges are factors of the value \
         within which tests of these suites pass, in the release profile: {}; of those that ask for the number the quickest ones, \
         as many as take {} s one after another. Tried are 1/10 and, where that fails, 1/2; 10, then 2; in brackets stands the \
         suite that failed at the last one beyond. `cargo run -p wfl-tests --bin constants -- vary NAME..` measures them; {measured} \
         of {} single numbers were measured with their present value. A wide range says that nothing in these suites hangs on \
         the number, no more.\n",
        SUITES.map(name_of).join(", "),
        BUDGET.as_secs(),
        singles.len(),
    );
    let cell = |text: &str| text.replace('|', "\\|").replace('<', "&lt;");
    for ((title, list), (folder, _)) in all.iter().zip(FOLDERS) {
        page += &format!(
            "\n## {title}\n\n| Constant | Value | Unit | What it is | Why | Range |\n|---|---|---|---|---|---|\n"
        );
        for Constant { file, name, value, unit, what, why, .. } in list {
            let [unit, why] = [unit, why].map(|text| text.as_deref().map_or_else(String::new, cell));
            let range = range_told(&ranges, &format!("{folder}/{file}:{name}"), value);
            writeln!(page, "| `{name}` ({file}) | `{value}` | {unit} | {} | {why} | {range} |", cell(what))
                .expect("a text takes all that is written");
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_says_what_a_number_is_its_unit_and_why() {
        let text = "/// A step below this part of the last: rounding.\npub(super) const SHORT: f64 = 1e-9;\nconst FEW: usize = 3;\n\n\
                    /// Bytes.\n#[allow(unused)]\nconst ALL: [f64; 2] = [1.0, 2.0];\nconst NAME: &str = \"x\";\nconst BARE: f64 = 2.0;\n";
        let found = constants_of("a.rs", text);
        let told = |k: usize| (found[k].name.as_str(), found[k].unit.as_deref(), found[k].why.as_deref());
        assert_eq!(found.len(), 4);
        assert_eq!(told(0), ("SHORT", Some("part of the last"), Some("rounding")));
        assert_eq!(told(1), ("FEW", Some("a number"), Some("rounding")));
        assert_eq!(told(2), ("ALL", Some("bytes"), None));
        assert_eq!(told(3), ("BARE", None, None));
        assert_eq!((found[0].what.as_str(), found[3].what.as_str()), ("A step below this part of the last", ""));
    }
}
