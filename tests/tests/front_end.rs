//! The tools of the language on inputs of every kind: no text panics, the examples are canonical, every page has a code
//! that is given. What the examples of the pages give is tested with the command (runtime/cli/tests/pairs).

use std::collections::BTreeSet;

use proptest::prelude::*;
use wfl::{SourceMap, codes, format};
use wfl_tests::{
    files,
    fuzz::{Random, expression, run_expression, run_text, text},
};

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn no_text_panics(seed: u64) {
        run_text(&text(&mut Random(seed)));
    }

    #[test]
    fn any_characters_are_read(text in "\\PC{0,60}") {
        run_text(&text);
        run_expression(&text, text.len());
    }

    #[test]
    fn no_expression_panics(seed: u64, choice in 0usize..36) {
        run_expression(&expression(&mut Random(seed)), choice);
    }
}

/// What the fuzzer found, each once.
#[test]
fn inputs_that_once_failed() {
    for text in [
        // a comment before the first statement with a character that no later line may have
        "# tria\0l\ndef a = 1",
        // a point behind a value is an operator
        "output vtk \"cohesive\" : uL, oquad.1.",
        // but not behind the word of the version
        "wfl.1e30# a version",
    ] {
        run_text(text);
    }
    for (expression, choice) in [
        // in one dimension a vector is one number, and was added to a number without a test function
        ("(Test_u)+(Grad_u')", 0),
        ("(Grad_Test_u)+(element_size)", 12),
        // every entry is a formula: too large to write out
        ("(Matrix_j2(v9@v9))*Test_p", 20),
        ("(Det(v9@v9@v9@v9@v9@v9))*Test_p", 20),
        ("Inv(Id(100)*p):Id(100)*Test_p", 12),
    ] {
        run_expression(expression, choice);
    }
}

#[test]
fn examples_and_library_are_in_the_canonical_form() {
    for path in files("examples", "wfl").into_iter().chain(files("wfl/std", "wfl")) {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        let mut sources = SourceMap::new();
        let id = sources.add(path.display().to_string(), text.as_str());
        assert_eq!(format(&sources, id).value.as_deref(), Some(text.as_str()), "{}", path.display());
    }
}

/// Codes that a text gives: `Code::E101`, `error[E101]`.
fn codes_in(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for start in ["Code::", "["] {
        for code in text.split(start).skip(1).filter_map(|behind| behind.get(..5)) {
            let shaped = code.starts_with(['E', 'W']) && code[1..4].bytes().all(|b| b.is_ascii_digit());
            if shaped && (start == "Code::" || code.ends_with(']')) {
                found.insert(code[..4].to_owned());
            }
        }
    }
    found
}

#[test]
fn every_page_has_a_code_that_is_given() {
    let mut used = BTreeSet::new();
    for folder in [
        "wfl/src",
        "compiler/src",
        "compiler/jit/src",
        "runtime/host/src",
        "runtime/mesh/src",
        "runtime/sparse/src",
        "runtime/discrete/src",
        "runtime/contact/src",
        "runtime/linear/src",
        "runtime/newton/src",
        "runtime/checks/src",
        "runtime/output/src",
        "runtime/problem/src",
        "runtime/run/src",
        "runtime/gradient/src",
        "runtime/adapt/src",
        "runtime/tasks/src",
        "runtime/cli/src",
    ] {
        for path in files(folder, "rs") {
            // pages and tests name codes without giving them
            let shown = path.display().to_string();
            if !shown.contains("/codes") && !shown.ends_with("tests.rs") {
                let text = std::fs::read_to_string(&path).expect("a readable file");
                used.extend(codes_in(text.split("#[cfg(test)]").next().unwrap_or("")));
            }
        }
    }
    let pages: BTreeSet<String> = codes().map(|p| p.code.to_string()).collect();
    let idle: Vec<_> = pages.difference(&used).collect();
    assert!(idle.is_empty() || idle == ["W503"], "given by nothing: {idle:?}");
}
