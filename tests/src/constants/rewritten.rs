//! The sources of a crate with its constants as functions, whose values the environment may change.
//!
//! Works on the text: a constant `NAME` becomes a function `NAME()`, and so does each place that names it. What cannot be a
//! function (the length of a list, a row of a table, a pattern) is found by whoever builds the sources, and left out.

use std::collections::{BTreeMap, BTreeSet};

/// The variable of the environment that changes one constant: `file:NAME=factor`.
pub(super) const VARIABLE: &str = "WFL_VARIED";

/// The variable of the environment that names a folder, where each constant that is asked for leaves a file.
pub(super) const ASKED: &str = "WFL_ASKED";

/// Names of constants by the file that declares them, as it is named in the crate.
pub(super) type Names = BTreeMap<String, BTreeSet<String>>;

/// The function that every rewritten constant asks for its value; it stands in the lowest crate.
pub(super) const SOURCE: &str = r#"
/// The value of a constant, times the factor that the environment gives for it.
#[doc(hidden)]
pub fn varied<T: Scaled>(name: &str, value: T) -> T {
    static GIVEN: std::sync::OnceLock<Option<(String, f64)>> = std::sync::OnceLock::new();
    let given = GIVEN.get_or_init(|| {
        let text = std::env::var("WFL_VARIED").ok()?;
        let (name, factor) = text.split_once('=')?;
        Some((name.to_owned(), factor.parse().ok()?))
    });
    static ASKED: std::sync::OnceLock<Option<String>> = std::sync::OnceLock::new();
    static TOLD: std::sync::Mutex<std::collections::BTreeSet<String>> = std::sync::Mutex::new(std::collections::BTreeSet::new());
    if let Some(folder) = ASKED.get_or_init(|| std::env::var("WFL_ASKED").ok()) {
        let mut told = TOLD.lock().expect("nobody fails with it");
        if !told.contains(name) {
            told.insert(name.to_owned());
            let _ = std::fs::write(format!("{folder}/{}", name.replace('/', "!")), "");
        }
    }
    match given {
        Some((varied, factor)) if varied == name => value.times(*factor),
        _ => value,
    }
}
/// A number that can be multiplied.
#[doc(hidden)]
pub trait Scaled {
    /// Times a factor; whole numbers are rounded.
    fn times(self, factor: f64) -> Self; }
impl Scaled for f64 { fn times(self, factor: f64) -> f64 { self * factor } }
macro_rules! whole { ($($t:ty)*) => { $(impl Scaled for $t {
    fn times(self, factor: f64) -> $t { (self as f64 * factor).round() as $t }
})* } }
whole!(usize u8 u32 u64 i32);
"#;

/// A word of a text, or what stands between two words.
fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut rest = 0;
    std::iter::from_fn(move || {
        let first = text[rest..].chars().next()?;
        let here = &text[rest..];
        let end = here.find(|c| is_word(c) != is_word(first)).unwrap_or(here.len());
        let start = rest;
        rest += end;
        Some((start, &here[..end]))
    })
}

/// The file whose module a file of tests, or a file that takes everything of its parent, sees; candidates in their order.
fn parents(file: &str) -> Vec<String> {
    let (folder, _) = file.rsplit_once('/').unwrap_or(("", file));
    let mut found = Vec::new();
    if folder.is_empty() {
        found.extend(["lib.rs".to_owned(), "mod.rs".to_owned()]);
    } else {
        found.push(format!("{folder}.rs"));
        found.push(format!("{folder}/mod.rs"));
    }
    found
}

/// What a file can call by its bare name.
fn visible<'a>(file: &str, text: &str, names: &'a Names) -> BTreeSet<&'a str> {
    let mut seen: BTreeSet<&str> = names.get(file).into_iter().flatten().map(String::as_str).collect();
    let everywhere: BTreeSet<&str> = names.values().flatten().map(String::as_str).collect();
    for (at, _) in text.match_indices("use ") {
        let statement = text[at..].split(';').next().unwrap_or_default();
        seen.extend(words(statement).filter_map(|(_, word)| everywhere.get(word).copied()));
        if statement.contains("super::*") {
            let own = parents(file).into_iter().find_map(|parent| names.get(&parent));
            seen.extend(own.into_iter().flatten().map(String::as_str));
        }
    }
    seen
}

/// The spans of `use` statements.
fn uses(text: &str) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let bare = line.trim_start();
        let bare = bare.strip_prefix("pub").map_or(bare, |rest| rest.split_once(' ').map_or(bare, |(_, rest)| rest));
        if bare.starts_with("use ") {
            let end = text[start..].find(';').map_or(text.len(), |at| start + at);
            found.push(start..end);
        }
        start += line.len();
    }
    found
}

/// A file whose constants, and those of others that it names, are functions. `file` is its name in the crate, `label` that
/// by which the environment calls its constants, before their names.
#[must_use]
pub(super) fn rewritten(file: &str, label: &str, text: &str, names: &Names) -> String {
    let seen = visible(file, text, names);
    let everywhere: BTreeSet<&str> = names.values().flatten().map(String::as_str).collect();
    let (uses, own) = (uses(text), names.get(file));
    let mut out = String::with_capacity(text.len() + 4096);
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let bare = line.trim_start();
        let is_outside = bare.starts_with("//") || uses.iter().any(|span| span.contains(&start));
        let declared = super::declared(line.trim_end()).filter(|[name, ..]| own.is_some_and(|own| own.contains(*name)));
        match declared {
            _ if is_outside => out += line,
            Some([name, kind, value]) => {
                let visibility = line.split("const ").next().unwrap_or_default();
                let value = called(value, &seen, &everywhere);
                out += &format!(
                    "#[allow(non_snake_case, clippy::all, missing_docs)]\n{visibility}fn {name}() -> {kind} {{ \
                     wfl_host::varied(\"{label}:{name}\", {value}) }}\n"
                );
            }
            None => out += &called(line, &seen, &everywhere),
        }
        start += line.len();
    }
    out
}

/// A piece of code with calls in place of constants.
fn called(code: &str, seen: &BTreeSet<&str>, everywhere: &BTreeSet<&str>) -> String {
    let (mut out, mut before) = (String::with_capacity(code.len()), "");
    let mut comment = false;
    let mut owner = "";
    for (_, word) in words(code) {
        comment |= word.contains("//");
        // the constants of a type have its name, with a capital letter or that of a number, before them
        let of_type = owner.starts_with(char::is_uppercase) || ["f64", "f32", "usize", "u32", "u64"].contains(&owner);
        let is_path = before.ends_with("::");
        let is_constant = if is_path { everywhere.contains(word) && !of_type } else { seen.contains(word) };
        out += word;
        if is_constant && !comment {
            out += "()";
        }
        if word.starts_with(|c: char| c.is_alphanumeric() || c == '_') {
            owner = word;
        }
        before = word;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(of: &[(&str, &[&str])]) -> Names {
        let set = |list: &[&str]| list.iter().map(|name| (*name).to_owned()).collect();
        of.iter().map(|(file, list)| ((*file).to_owned(), set(list))).collect()
    }

    #[test]
    fn a_constant_becomes_a_function_wherever_it_is_named() {
        let names = names(&[("a.rs", &["FEW", "ALL"]), ("b.rs", &["FEW"])]);
        let text = "/// FEW.\npub(super) const FEW: usize = 3;\nconst ALL: usize = 2 * FEW;\nfn f() { g(FEW, f64::FEW) } // FEW\n";
        let found = rewritten("a.rs", "k/a.rs", text, &names);
        assert!(found.starts_with("/// FEW.\n#[allow"), "{found}");
        assert!(found.contains("pub(super) fn FEW() -> usize { wfl_host::varied(\"k/a.rs:FEW\", 3) }"), "{found}");
        assert!(found.contains("varied(\"k/a.rs:ALL\", 2 * FEW())"), "{found}");
        assert!(found.contains("g(FEW(), f64::FEW) } // FEW"), "{found}");
    }

    #[test]
    fn other_files_call_what_they_name() {
        let names = names(&[("a.rs", &["FEW"]), ("c/mod.rs", &["MORE"])]);
        let text = "use super::{\n    a::FEW, x};\nfn f() -> usize { FEW + super::a::FEW + MORE }\n";
        let found = rewritten("b.rs", "k/b.rs", text, &names);
        assert_eq!(found, "use super::{\n    a::FEW, x};\nfn f() -> usize { FEW() + super::a::FEW() + MORE }\n");
        let found = rewritten("c/tests.rs", "k/c/tests.rs", "use super::*;\nfn f() { MORE }\n", &names);
        assert_eq!(found, "use super::*;\nfn f() { MORE() }\n");
    }
}
