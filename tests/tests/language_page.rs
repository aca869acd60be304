//! The language reference says what the program does.

use std::path::Path;

use wfl_tests::{examples, prepared};

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/language.md");
    std::fs::read_to_string(path).expect("the page is in the repository")
}

#[test]
fn every_function_is_on_the_page() {
    let page = page();
    for op in wfl_compiler::functions() {
        let row = format!("| `{}` | {} |", op.usage.replace('|', "\\|"), op.doc.replace('|', "\\|"));
        assert!(page.contains(&row), "docs/language.md lacks the row\n{row}\nmade by `wfl explain --functions`");
    }
    let rows = page.lines().skip_while(|l| *l != "| function | what it is |").filter(|l| l.starts_with("| `")).count();
    assert_eq!(rows, wfl_compiler::functions().count(), "rows of functions that are gone");
}

#[test]
fn the_scene_on_the_page_can_be_prepared() {
    let page = page();
    let scene: String = page
        .lines()
        .skip_while(|l| *l != "```wfl")
        .skip(1)
        .take_while(|l| *l != "```")
        .flat_map(|l| [l, "\n"])
        .collect();
    assert!(scene.contains("term elastic"), "the scene is found");
    let backend = wfl_jit::JitBackend::new().expect("a backend");
    prepared(&examples(), scene, &[], &[], &backend).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn the_words_of_the_language_are_the_functions_of_the_compiler() {
    let mut words: Vec<&str> = wfl::functions().collect();
    let mut operators: Vec<&str> = wfl_compiler::functions().map(|op| op.name).collect();
    words.sort_unstable();
    operators.sort_unstable();
    assert_eq!(words, operators, "wfl/src/words.rs on the left, compiler/src/ops on the right");
}
