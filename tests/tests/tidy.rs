//! The rules of the code base that a compiler does not check: who depends on whom, one owner for every outside crate,
//! where unsafe code may stand, how long files and functions are, and that every message code has its page.

use std::path::{Path, PathBuf};

/// Crates with their folder and all that they may depend on, development aside. A new arrow is a design change: it is
/// added here, and the commit says why.
const ARROWS: &[(&str, &str, &[&str])] = &[
    ("wfl-charts", "runtime/charts", &[]),
    ("wfl", "wfl", &["annotate-snippets", "pest", "pest_derive"]),
    ("wfl-compiler", "compiler", &["wfl", "libm", "thiserror"]),
    (
        "wfl-jit",
        "compiler/jit",
        &[
            "wfl-compiler",
            "cranelift-codegen",
            "cranelift-frontend",
            "cranelift-jit",
            "cranelift-module",
            "cranelift-native",
        ],
    ),
    ("wfl-host", "runtime/host", &["thiserror"]),
    ("wfl-mesh", "runtime/mesh", &["wfl", "wfl-host", "nalgebra", "thiserror"]),
    ("wfl-sparse", "runtime/sparse", &["wfl-host", "faer", "nalgebra", "pulp", "rayon", "thiserror"]),
    (
        "wfl-discrete",
        "runtime/discrete",
        &[
            "wfl",
            "wfl-compiler",
            "wfl-host",
            "wfl-mesh",
            "wfl-sparse",
            "nalgebra",
            "pulp",
            "rayon",
            "thiserror",
            "zerocopy",
        ],
    ),
    ("wfl-contact", "runtime/contact", &["wfl-compiler", "wfl-discrete", "wfl-mesh", "wfl-sparse", "nalgebra"]),
    (
        "wfl-newton",
        "runtime/newton",
        &["wfl-compiler", "wfl-contact", "wfl-discrete", "wfl-host", "wfl-sparse", "thiserror"],
    ),
    (
        "wfl-checks",
        "runtime/checks",
        &["wfl-compiler", "wfl-contact", "wfl-discrete", "wfl-mesh", "wfl-newton", "wfl-sparse", "nalgebra", "rayon"],
    ),
    (
        "wfl-runtime",
        "runtime",
        &[
            "wfl",
            "wfl-checks",
            "wfl-compiler",
            "wfl-contact",
            "wfl-discrete",
            "wfl-host",
            "wfl-mesh",
            "wfl-newton",
            "wfl-sparse",
            "nalgebra",
            "rayon",
            "serde",
            "serde_json",
            "thiserror",
        ],
    ),
    ("wfl-report", "runtime/report", &["wfl-charts", "wfl-runtime", "serde_json", "thiserror"]),
    (
        "wfl-tasks",
        "runtime/tasks",
        &["wfl", "wfl-charts", "wfl-compiler", "wfl-runtime", "serde", "serde_json", "thiserror"],
    ),
    (
        "wfl-cli",
        "runtime/cli",
        &[
            "wfl",
            "wfl-compiler",
            "wfl-jit",
            "wfl-report",
            "wfl-runtime",
            "wfl-tasks",
            "clap",
            "indicatif",
            "serde_json",
            "signal-hook",
        ],
    ),
    (
        "wfl-tests",
        "tests",
        &["wfl", "wfl-compiler", "wfl-jit", "wfl-report", "wfl-runtime", "serde", "serde_json", "proptest"],
    ),
];

/// Outside crates by the name that paths begin with, and where alone they may be named.
const OWNERS: &[(&str, &[&str])] = &[
    ("annotate_snippets", &["wfl/src/render.rs"]),
    ("pest", &["wfl/src/parse.rs", "wfl/src/parse/"]),
    ("pest_derive", &["wfl/src/parse.rs", "wfl/src/parse/"]),
    ("cranelift_codegen", &["compiler/jit/"]),
    ("cranelift_frontend", &["compiler/jit/"]),
    ("cranelift_jit", &["compiler/jit/"]),
    ("cranelift_module", &["compiler/jit/"]),
    ("cranelift_native", &["compiler/jit/"]),
    // the rows of the second are expanded in the first
    ("libm", &["compiler/src/", "wfl/src/scalar_functions.rs"]),
    ("signal_hook", &["runtime/cli/src/interrupt.rs"]),
    ("faer", &["runtime/sparse/src/solve/"]),
    ("pulp", &["runtime/discrete/src/assemble/", "runtime/sparse/src/solve/kernels.rs"]),
    ("zerocopy", &["runtime/discrete/src/assemble/"]),
    ("criterion", &["runtime/benches/"]),
    ("clap", &["runtime/cli/"]),
    ("indicatif", &["runtime/cli/"]),
];

/// Functions of more than [`FUNCTION_LIMIT`] lines, with the reason.
const LONG_FUNCTIONS: &[(&str, &str, &str)] = &[
    ("compiler/src/lower.rs", "entries", "one match over all nodes; its arms call functions"),
    ("wfl/src/resolve.rs", "item", "one match over all statements; its arms call functions"),
];

const FILE_LIMIT: usize = 800;
const FUNCTION_LIMIT: usize = 100;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Every Rust file of the workspace by its path from the top, in order.
fn sources() -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders: Vec<String> = ARROWS.iter().map(|(_, folder, _)| (*folder).to_owned()).collect();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).expect("sources can be read") {
            let entry = entry.expect("sources can be read");
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = format!("{folder}/{name}");
            if entry.path().is_dir() {
                // the jit and the command have rows of their own
                if name != "target" && !ARROWS.iter().any(|(_, f, _)| *f == path) {
                    folders.push(path);
                }
            } else if name.ends_with(".rs") {
                found.push((path.clone(), read(&path)));
            }
        }
    }
    found.sort();
    assert!(found.len() > 80, "only {} sources found", found.len());
    found
}

/// The names under the dependency tables of a manifest, development aside.
fn dependencies(manifest: &str) -> Vec<String> {
    let mut inside = false;
    let mut names = Vec::new();
    for line in manifest.lines().map(str::trim) {
        if let Some(table) = line.strip_prefix('[') {
            let table = table.trim_end_matches(']');
            inside = table.ends_with("dependencies") && table != "dev-dependencies";
            assert!(!table.contains("dependencies."), "one line a dependency: [{table}]");
        } else if inside && !line.is_empty() && !line.starts_with('#') {
            let end = line.find(|c: char| !c.is_ascii_alphanumeric() && c != '-' && c != '_').unwrap_or(line.len());
            names.push(line[..end].to_owned());
        }
    }
    names
}

/// Code without comments; strings stay.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")).map(|(n, l)| (n + 1, l))
}

/// Whether a line names a crate: `name::` or `use name` not as the end of another word or path.
fn names_crate(line: &str, name: &str) -> bool {
    line.match_indices(name).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let free = before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != '"' && c != '.');
        let path = line[..at].ends_with("::") && !line[..at].ends_with(" ::");
        let after = &line[at + name.len()..];
        free && !path && (after.starts_with("::") || (line.contains("use ") && after.starts_with([';', ' ', ','])))
    })
}

#[test]
fn crates_depend_only_on_what_is_allowed() {
    let workspace = read("Cargo.toml");
    for (name, folder, allowed) in ARROWS {
        let manifest = read(&format!("{folder}/Cargo.toml"));
        assert!(manifest.contains(&format!("name = \"{name}\"")), "{folder} is not {name}");
        assert!(workspace.contains(&format!("\"{folder}\"")), "{folder} is not a member");
        assert!(manifest.contains("[lints]\nworkspace = true"), "{name} does not take the lints of the workspace");
        let found = dependencies(&manifest);
        assert_eq!(found.is_empty(), allowed.is_empty(), "{folder}: dependencies read: {found:?}");
        for dependency in found {
            assert!(allowed.contains(&dependency.as_str()), "{name} may not depend on {dependency}");
        }
    }
    let members = workspace.lines().find(|l| l.starts_with("members")).expect("members");
    assert_eq!(members.matches('"').count(), 2 * ARROWS.len(), "a member without a row here: {members}");
}

#[test]
fn every_version_is_written_once() {
    for (_, folder, _) in ARROWS {
        let manifest = read(&format!("{folder}/Cargo.toml"));
        let mut table = "";
        for line in manifest.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')) {
            if line.starts_with('[') {
                table = line;
            } else if table.ends_with("dependencies]") {
                assert!(line.contains(".workspace = true"), "{folder}: `{line}` belongs into the workspace's table");
            }
        }
    }
}

#[test]
fn an_outside_crate_has_one_owner() {
    // the lines of this file that try the search name crates too
    for (path, text) in sources().iter().filter(|s| !s.0.ends_with("tidy.rs")) {
        for (name, owners) in OWNERS {
            if owners.iter().any(|o| path.starts_with(o)) {
                continue;
            }
            let at = code(text).find(|(_, l)| names_crate(l, name));
            assert!(at.is_none(), "{path}:{}: only {owners:?} may name {name}", at.expect("found").0);
        }
    }
}

#[test]
fn naming_a_crate_is_seen() {
    assert!(names_crate("use faer::Mat;", "faer"));
    assert!(names_crate("    let m = faer::Mat::zeros(1, 1);", "faer"));
    assert!(names_crate("use pest_derive::Parser;", "pest_derive"));
    assert!(!names_crate("use pest_derive::Parser;", "pest"));
    assert!(!names_crate("use super::faer::lu;", "faer"));
    assert!(!names_crate("let name = \"faer\";", "faer"));
}

#[test]
fn unsafe_code_stands_only_in_the_jit() {
    for (name, folder, _) in ARROWS.iter().filter(|a| a.0 != "wfl-jit") {
        let candidates = ["lib.rs", "main.rs"].map(|f| format!("{folder}/src/{f}"));
        let door = candidates.iter().find(|p| root().join(p).is_file()).expect("a crate has a door");
        // the suites have no code of their own worth the attribute; the check of their text below is enough
        assert!(*name == "wfl-tests" || read(door).contains("#![forbid(unsafe_code)]"), "{door} allows unsafe code");
    }
    let word = concat!("un", "safe");
    for (path, text) in sources().iter().filter(|s| !s.0.starts_with("compiler/jit/") && !s.0.ends_with("tidy.rs")) {
        let at = code(text).find(|(_, l)| l.contains(&format!("{word} ")));
        assert!(at.is_none(), "{path}:{}: {word} code", at.expect("found").0);
    }
}

#[test]
fn files_are_short() {
    for (path, text) in sources() {
        let n = text.lines().count();
        assert!(n <= FILE_LIMIT, "{path} has {n} lines: split it");
    }
}

/// Functions with their first line and number of lines. Formatted code closes a function at its own indentation.
fn functions(text: &str) -> Vec<(String, usize, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (start, line) in lines.iter().enumerate() {
        let indent = &line[..line.len() - line.trim_start().len()];
        let mut words = line.trim_start().split(' ');
        let mut name = None;
        while let Some(word) = words.next() {
            match word {
                "fn" => name = words.next(),
                "pub" | "pub(crate)" | "pub(super)" | "const" | "async" | "unsafe" | "extern" | "\"C\"" => continue,
                _ => {}
            }
            break;
        }
        let Some(name) = name else { continue };
        let name = name.split(['(', '<']).next().unwrap_or(name).to_owned();
        // the signature ends with its body, or without one in a trait
        let ends = |l: &&str| l.ends_with(['{', ';', '}']);
        let Some(signature) = lines[start..].iter().position(ends) else { continue };
        let close = format!("{indent}}}");
        let body = if lines[start + signature].ends_with('{') {
            lines[start..].iter().position(|l| **l == close).expect("formatted code closes what it opens")
        } else {
            signature
        };
        found.push((name, start + 1, body + 1));
    }
    found
}

#[test]
fn functions_are_short() {
    let mut count = 0;
    for (path, text) in sources() {
        // a test that walks through a table is read from top to bottom
        let tests = path.starts_with("tests/") || path.ends_with("tests.rs") || path.contains("/tests/");
        for (name, line, n) in functions(&text) {
            count += 1;
            let listed = LONG_FUNCTIONS.iter().any(|(p, f, _)| *p == path && *f == name);
            assert!(n <= FUNCTION_LIMIT || tests || listed, "{path}:{line}: `{name}` has {n} lines: split it");
        }
    }
    assert!(count > 1000, "only {count} functions seen");
}

#[test]
fn the_length_of_a_function_is_seen() {
    let text = "impl A {\n    pub(crate) fn long<T>(\n        a: u8,\n    ) -> u8 {\n        {\n        }\n        a\n    }\n}\nfn one() {}\n";
    assert_eq!(functions(text), [("long".to_owned(), 2, 7), ("one".to_owned(), 10, 1)]);
}

/// Codes as they stand in messages: `"E203"`, `[E603]`, `(W602)`.
fn codes_in(line: &str) -> Vec<&str> {
    let bytes = line.as_bytes();
    let is_code = |s: &[u8]| matches!(s[0], b'E' | b'W') && s[1..].iter().all(u8::is_ascii_digit);
    (1..bytes.len().saturating_sub(4))
        .filter(|k| matches!((bytes[k - 1], bytes[k + 4]), (b'"', b'"') | (b'[', b']') | (b'(', b')')))
        .filter(|k| is_code(&bytes[*k..k + 4]))
        .map(|k| &line[k..k + 4])
        .collect()
}

#[test]
fn every_code_has_a_page() {
    let mut seen = 0;
    for (path, text) in sources() {
        if path.ends_with("tests.rs") || path.contains("/tests/") || path.starts_with("wfl/src/codes") {
            continue;
        }
        let own = text.find("#[cfg(test)]\nmod tests {").map_or(text.as_str(), |end| &text[..end]);
        for (line, content) in code(own) {
            for found in codes_in(content) {
                seen += 1;
                assert!(wfl::explain(found).is_some(), "{path}:{line}: {found} has no page in wfl/src/codes");
            }
        }
    }
    assert!(seen > 60, "only {seen} codes seen");
}

#[test]
fn the_top_level_is_as_drawn() {
    let files =
        ["ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "LICENSE", "README.md", "Cargo.toml", "Cargo.lock"];
    for file in files {
        assert!(root().join(file).is_file(), "{file} is missing");
    }
    let rooms = ["wfl", "compiler", "runtime", "examples", "tests", "docs", "benches"];
    // what a build or a run leaves behind is not ours
    let left = ["target", "out"];
    for entry in std::fs::read_dir(root()).expect("the repository can be read") {
        let entry = entry.expect("the repository can be read");
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() && !name.starts_with('.') {
            assert!(rooms.contains(&name.as_str()) || left.contains(&name.as_str()), "the folder {name} has no room");
        }
    }
    for room in rooms {
        assert!(root().join(room).is_dir(), "{room} is missing");
        assert!(read("ARCHITECTURE.md").contains(&format!("{room}/")), "ARCHITECTURE.md does not know {room}/");
    }
}
