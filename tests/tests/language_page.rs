//! The language reference says what the program does.

use std::path::{Path, PathBuf};

use wfl_tests::{examples, prepared};

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/language.md")
}

fn page() -> String {
    std::fs::read_to_string(path()).expect("the page is in the repository")
}

/// Writes a table of the page, or says that it is not the one of the program.
fn is_on_the_page(head: &str, table: &str) {
    let page = page();
    let begin = page.find(head).expect("the table is on the page");
    let end = begin + page[begin..].find("\n\n").map_or(page.len() - begin, |length| length + 1);
    if std::env::var_os("WFL_WRITE").is_some() {
        std::fs::write(path(), [&page[..begin], table, &page[end..]].concat()).expect("the page can be written");
        return;
    }
    assert!(
        page[begin..end] == *table,
        "WFL_WRITE=1 cargo test --workspace --test suites language_page:: writes the table"
    );
}

#[test]
fn the_tables_on_the_page_are_those_of_the_program() {
    is_on_the_page("| statement | meaning | default |", &wfl::statement_table());
    is_on_the_page("| function | what it is |", &wfl_compiler::function_table());
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
    assert_eq!(words, operators, "the words of wfl on the left, the table of the compiler on the right");
}
