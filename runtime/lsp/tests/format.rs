//! Formatting changes no meaning: the syntax trees of all examples and templates are the same before and after.

use std::path::{Path, PathBuf};

use crate::common::Editor;
use serde_json::Value;
use wfl::{SourceMap, parse};

/// Every scene of the examples.
fn scenes() -> Vec<PathBuf> {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the examples") {
            let path = entry.expect("the examples").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "wfl") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The statements without their places.
fn meaning(text: &str) -> String {
    let mut sources = SourceMap::new();
    let id = sources.add("scene.wfl", text);
    let parsed = parse(&sources, id);
    assert!(parsed.diagnostics.is_empty(), "{:?}", parsed.diagnostics);
    let items = parsed.value.map(|s| s.items).unwrap_or_default();
    let kinds: Vec<String> =
        items.iter().map(|i| format!("{:?}", i.kind)).filter(|k| !k.starts_with("Version")).collect();
    let joined = kinds.concat();
    let mut parts = joined.split("Span {");
    let first = parts.next().unwrap_or("").to_owned();
    parts.fold(first, |out, part| out + part.split_once('}').map_or("", |p| p.1))
}

/// The text with more blanks than it needs, outside of quotes and comments.
fn spread(text: &str) -> String {
    let line = |l: &str| {
        let code = l.split(['#', '"']).next().unwrap_or("");
        let wide = code.trim_start().replace(" = ", "   =  ").replace(", ", " ,   ");
        let indent = if l.starts_with(' ') { " " } else { "" };
        format!("{indent}{wide}{}", &l[code.len()..])
    };
    text.lines().map(|l| line(l) + "  \n").collect()
}

#[test]
fn formatting_keeps_the_meaning_of_every_scene_and_is_done_once() {
    let mut e = Editor::new("format");
    let templates = wfl::TEMPLATES.iter().map(|t| t.text.to_owned());
    let texts: Vec<String> =
        scenes().iter().map(|p| std::fs::read_to_string(p).expect("a scene")).chain(templates).collect();
    assert!(texts.len() > 40);
    e.open("scene.wfl", "");
    let mut changed = 0;
    for text in texts.iter().flat_map(|t| [t.clone(), spread(t)]) {
        e.change("scene.wfl", &text);
        let edits = e.ask_of("textDocument/formatting", "scene.wfl");
        let once = e.changed("scene.wfl", &edits);
        changed += usize::from(once != text);
        assert_eq!(meaning(&once), meaning(&text), "{text}");
        e.change("scene.wfl", &once);
        assert_eq!(e.ask_of("textDocument/formatting", "scene.wfl"), Value::Array(Vec::new()), "{once}");
    }
    assert!(changed > 40, "only {changed} texts were changed");
    e.change("scene.wfl", "term on all :");
    let uri = e.uri("scene.wfl");
    let params = serde_json::json!({"textDocument": {"uri": uri}, "options": {"tabSize": 4, "insertSpaces": true}});
    assert!(e.refused("textDocument/formatting", params).contains("not formatted"));
    e.close();
}
