//! Pages that must be there: one for every message code, which code names as a constant of the table of pages, and the top
//! level as ARCHITECTURE.md draws it.

use super::{code, read, root, sources};

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
        if path.ends_with("tests.rs")
            || path.contains("/tests/")
            || path.starts_with("wfl/src/codes")
            || path.starts_with("tests/")
            // tests in a file of their own
            || path == "wfl/src/parse/limits.rs"
        {
            continue;
        }
        let own = text.find("#[cfg(test)]\nmod tests {").map_or(text.as_str(), |end| &text[..end]);
        for (line, content) in code(own) {
            seen += content.matches("Code::E").count() + content.matches("Code::W").count();
            for found in codes_in(content) {
                let quoted = format!("\"{found}\"");
                assert!(!content.contains(&quoted), "{path}:{line}: write Code::{found}, which cannot be misspelt");
                assert!(wfl::explain(found).is_some(), "{path}:{line}: {found} has no page in wfl/src/codes");
            }
        }
    }
    assert!(seen > 500, "only {seen} codes seen");
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
