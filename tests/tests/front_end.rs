//! The tools of the language on inputs of every kind: no text panics, the examples are canonical, every page of a code
//! holds what it says.

use std::{collections::BTreeSet, path::Path};

use proptest::prelude::*;
use wfl::{Diagnostic, NoFiles, SourceMap, codes, format, resolve};
use wfl_compiler::InterpreterBackend;
use wfl_runtime::prepare;
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

/// Codes in quotes or in `error[...]` in a text.
fn codes_in(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (at, c) in text.char_indices() {
        let code = text.get(at + 1..at + 5).unwrap_or("");
        let shaped = code.starts_with(['E', 'W']) && code[1..].bytes().all(|b| b.is_ascii_digit());
        let end = text.get(at + 5..at + 6).unwrap_or("");
        if shaped && ((c == '"' && end == "\"") || (c == '[' && end == "]")) {
            found.insert(code.to_owned());
        }
    }
    found
}

#[test]
fn every_page_has_a_code_that_is_given() {
    let mut used = BTreeSet::new();
    for folder in ["wfl/src", "compiler/src", "compiler/jit/src", "runtime/src", "runtime/cli/src"] {
        for path in files(folder, "rs") {
            // pages and tests name codes without giving them
            let shown = path.display().to_string();
            if !shown.contains("/codes") && !shown.ends_with("tests.rs") {
                let text = std::fs::read_to_string(&path).expect("a readable file");
                used.extend(codes_in(text.split("#[cfg(test)]").next().unwrap_or("")));
            }
        }
    }
    let pages: BTreeSet<String> = codes().map(|p| p.code.to_owned()).collect();
    let idle: Vec<_> = pages.difference(&used).collect();
    assert!(idle.is_empty() || idle == ["W503"], "given by nothing: {idle:?}");
}

/// A scene that is right; a line gives way to lines of an example that declare the same.
const SCENE: &[&str] = &[
    "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex",
    "region left = cells where x < 0.5",
    "region right = cells where x > 0.5",
    "region fault = interface from left to right",
    "region west = faces where x == 0",
    "unknown u : vector",
    "unknown uL : vector on left",
    "unknown uR : vector on right",
    "param gamma = 1e5",
    "param fric = 0.4",
    "param theta = 1 in {-1,0,1}",
    "def sigma(v) = Sym(Grad_v)",
    "def jump(a,b) = a - Interpolate(b, neighbor_element)",
    "def Pn = gamma*(jump(uL,uR).Normal)",
    "term base on all : sigma(u):Grad_Test_u",
    "term lefts on left : sigma(uL):Grad_Test_uL",
    "term rights on right : sigma(uR):Grad_Test_uR",
    "fix u = [0,0,0] on west",
];

fn with_scene(example: &str) -> String {
    let declares = |line: &str| -> Vec<String> {
        line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').take(2).map(str::to_owned).collect()
    };
    let own: Vec<Vec<String>> = example.lines().map(declares).collect();
    let replaced = |line: &&&str| {
        let words = declares(line);
        own.iter().any(|o| *o == words || words[0] == "mesh" && o[0] == "mesh")
    };
    let kept: Vec<&str> = SCENE.iter().filter(|l| !replaced(l)).copied().collect();
    format!("{example}\n{}\n", kept.join("\n"))
}

fn found(text: &str) -> Vec<Diagnostic> {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let resolved = resolve(&mut sources, main, &mut NoFiles, &[]);
    let mut all = resolved.diagnostics;
    if let Some(script) = resolved.value {
        all.extend(prepare(&script, Path::new("nowhere"), &InterpreterBackend).diagnostics);
    }
    all
}

/// The wrong example of a page gives its code, the right one gives no error.
#[test]
fn the_examples_of_a_page_hold_what_they_say() {
    // these need a run, a file, a command line, a scene without other fields, more text than fits a page, or a fault of
    // the program itself
    let elsewhere = [
        "E119", "E124", "E125", "E213", "E214", "E403", "E410", "E412", "E421", "E422", "E423", "E601", "E602", "E603",
        "E604", "E605", "E609", "E701", "E703", "W404", "W405", "W407", "W503", "W504", "W602", "W605", "W606", "W607",
        "W608", "W609",
    ];
    let mut wrong = Vec::new();
    for page in codes().filter(|p| !elsewhere.contains(&p.code)) {
        let (bad, good) = (found(&with_scene(page.wrong)), found(&with_scene(page.fixed)));
        // the scene around an example has names that the example does not use: W702 is told more often
        let count = |list: &[Diagnostic]| list.iter().filter(|d| d.code == page.code).count();
        if count(&bad) <= count(&good) {
            wrong.push(format!("{} wrong gives {:?}", page.code, bad.iter().map(|d| d.code).collect::<Vec<_>>()));
        }
        for d in good.iter().filter(|d| d.is_error()) {
            wrong.push(format!("{} right gives {} {}", page.code, d.code, d.message));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
