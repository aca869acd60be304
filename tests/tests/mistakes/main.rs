//! Mistakes of newcomers who know FEniCS, NGSolve, FreeFEM, GetFEM or a textbook, in every statement: each gives one error,
//! at its line, with a cure. The table is beside this file: `CODE LINE | a part of the message`, then the lines that are
//! added to a scene that is right, or a whole scene.

use std::path::Path;

use wfl::{Diagnostic, NoFiles, SourceMap, one_per_cause, render, resolve};
use wfl_compiler::InterpreterBackend;
use wfl_runtime::prepare;

const TABLE: &str = include_str!("table.txt");

/// Ten lines that are right.
const SCENE: &str = include_str!("scene.wfl");

/// The errors of a scene, as they are printed.
fn errors(text: &str) -> Vec<String> {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text);
    let mut checked = resolve(&mut sources, main, &mut NoFiles, &[]);
    let mut found = std::mem::take(&mut checked.diagnostics);
    if let Some(script) = &checked.value {
        found.extend(prepare(script, Path::new(""), &InterpreterBackend).diagnostics);
    }
    found.retain(Diagnostic::is_error);
    one_per_cause(&found, &sources).0.iter().map(|d| render(d, &sources, false)).collect()
}

#[test]
fn each_mistake_gives_one_message_at_its_place_with_a_cure() {
    assert_eq!(errors(SCENE), Vec::<String>::new());
    let mut wrong = Vec::new();
    for entry in TABLE.split("\n\n").map(str::trim_end).filter(|e| !e.is_empty()) {
        let (head, text) = entry.split_once('\n').expect("a head and a text");
        let (place, phrase) = head.split_once(" | ").expect("a phrase");
        let words: Vec<&str> = place.split(' ').collect();
        let scene = if words.contains(&"whole") { format!("{text}\n") } else { format!("{SCENE}{text}\n") };
        let told = errors(&scene);
        let at = format!("scene.wfl:{}:", words[1]);
        let good = told.len() == 1
            && told[0].starts_with(&format!("error[{}]", words[0]))
            && (words[1] == "0" || told[0].contains(&at))
            && told[0].contains(phrase);
        if !good {
            wrong.push(format!("{entry}\n{}", told.concat()));
        }
    }
    assert!(wrong.is_empty(), "{} mistakes are told otherwise:\n\n{}", wrong.len(), wrong.join("\n"));
}
