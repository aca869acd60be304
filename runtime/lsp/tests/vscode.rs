//! The extension for VS Code: its grammar knows the words of the language, its parts fit together, and npm packs it.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::{Value, json};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../wfl/editors/vscode")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Any of these words, the longer ones first.
fn any(words: impl IntoIterator<Item = &'static str>) -> String {
    let mut words: Vec<&str> = words.into_iter().collect();
    words.sort_by_key(|w| (std::cmp::Reverse(w.len()), *w));
    words.join("|")
}

/// The grammar, made from the tables of the language.
fn grammar() -> Value {
    let rule = |name: &str, pattern: String| json!({"name": format!("{name}.wfl"), "match": pattern});
    let prefixes = any(wfl::PREFIXES.iter().copied());
    let words = "box|file|size|map|hex|tet|quad|tri|segment|scalar|vector|matrix|project|raytrace|point|across|towards|\
                 times|every|vertex|newton|linear|vtk|csv|with|auto";
    json!({
        "$schema": "https://raw.githubusercontent.com/martinring/tmlanguage/master/tmlanguage.json",
        "name": "WFL",
        "scopeName": "source.wfl",
        "patterns": [
            rule("comment.line.number-sign", "#.*$".to_owned()),
            {"name": "string.quoted.double.wfl", "begin": "\"", "end": "\"|$"},
            {
                "match": format!("^({})\\b(?:\\s+([A-Za-z_]\\w*))?", any(wfl::STATEMENTS.iter().copied().chain(["wfl"]))),
                "captures": {"1": {"name": "keyword.control.wfl"}, "2": {"name": "entity.name.wfl"}}
            },
            rule("keyword.other", format!("\\b({}|{words})\\b", any(wfl::KEYWORDS.iter().copied()))),
            rule("constant.numeric", "(?<![\\w.])(\\d+(\\.(?!\\.)\\d*)?|\\.\\d+)([eE][+-]?\\d+)?".to_owned()),
            {
                "match": format!("\\b((?:{prefixes})+)([A-Za-z]\\w*)"),
                "captures": {"1": {"name": "support.type.prefix.wfl"}, "2": {"name": "variable.other.wfl"}}
            },
            rule("support.constant", format!("\\b({}|x|y|z|t)\\b", any(wfl::CONSTANTS.iter().copied()))),
            rule("support.function", format!("\\b({})\\b(?=\\s*[\\w(\\[])", any(wfl::functions()))),
            rule("entity.name.function", "\\b[A-Za-z_]\\w*(?=\\()".to_owned()),
            rule("constant.language.region", format!("\\b({})\\b", any(wfl::REGIONS.iter().copied()))),
            rule("keyword.operator", ":=|==|<=|>=|!=|\\.\\.|\\.\\*|\\./|[-+*/.:@^'=<>&]".to_owned()),
        ]
    })
}

#[test]
fn the_grammar_is_made_from_the_words_of_the_language() {
    let path = folder().join("syntaxes/wfl.tmLanguage.json");
    let text = format!("{:#}\n", grammar());
    if std::env::var_os("WFL_WRITE").is_some() {
        std::fs::write(&path, text).expect("the grammar can be written");
        return;
    }
    assert!(
        read("syntaxes/wfl.tmLanguage.json") == text,
        "WFL_WRITE=1 cargo test --workspace --test server vscode:: writes it"
    );
}

#[test]
fn the_parts_of_the_extension_fit_together() {
    let package: Value = serde_json::from_str(&read("package.json")).expect("JSON");
    let script = read("extension.js");
    let contributes = &package["contributes"];
    assert_eq!(contributes["languages"][0]["extensions"], json!([".wfl"]));
    let grammar: Value = serde_json::from_str(&read("syntaxes/wfl.tmLanguage.json")).expect("JSON");
    assert_eq!(contributes["grammars"][0]["scopeName"], grammar["scopeName"]);
    serde_json::from_str::<Value>(&read("language-configuration.json")).expect("JSON");
    for command in contributes["commands"].as_array().expect("commands") {
        let name = command["command"].as_str().expect("a name");
        assert!(script.contains(&format!("registerCommand('{name}'")), "{name} is not registered");
        assert!(!["wfl.run", "wfl.check"].contains(&name), "{name} is registered for the server");
    }
    for word in ["'lsp'", "wfl/library", "wfl.run", "wfl.check"] {
        assert!(script.contains(word), "{word}");
    }
}

/// Runs a program of node in a folder; `None` if it is not there.
fn node(folder: &Path, program: &str, words: &[&str]) -> Option<(bool, String)> {
    let ran = Command::new(program).args(words).current_dir(folder).output().ok()?;
    let text = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    Some((ran.status.success(), text))
}

#[test]
fn npm_packs_the_extension_where_node_is_there() {
    let at = std::env::temp_dir().join(format!("wfl-vscode-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&at);
    std::fs::create_dir_all(at.join("syntaxes")).expect("a temporary folder");
    for name in ["package.json", "extension.js", "language-configuration.json", "README.md", ".vscodeignore"] {
        std::fs::write(at.join(name), read(name)).expect("a temporary file");
    }
    let grammar = "syntaxes/wfl.tmLanguage.json";
    std::fs::write(at.join(grammar), read(grammar)).expect("a temporary file");
    let npm = if cfg!(windows) { "npm.cmd" } else { "npm" };
    let Some((parsed, told)) = node(&at, "node", &["--check", "extension.js"]) else {
        eprintln!("skipped: node is not there");
        return;
    };
    assert!(parsed, "{told}");
    if !node(&at, npm, &["view", "vscode-languageclient", "version", "--fetch-retries=0", "--fetch-timeout=10000"])
        .is_some_and(|n| n.0)
    {
        eprintln!("skipped: npm is not there, or finds no registry");
        return;
    }
    let (installed, told) = node(&at, npm, &["install", "--no-audit", "--no-fund"]).expect("npm");
    assert!(installed, "{told}");
    let (packed, told) = node(&at, npm, &["run", "package"]).expect("npm");
    assert!(packed, "{told}");
    let package = std::fs::metadata(at.join("wfl-0.1.0.vsix")).expect("the package is there");
    assert!(package.len() > 20_000, "{} bytes", package.len());
    let _ = std::fs::remove_dir_all(&at);
}
