//! Mistakes of newcomers who know FEniCS, NGSolve, FreeFEM, GetFEM or a textbook, in every statement: each gives one error,
//! at its line, with a cure. The table is beside this file: `CODE LINE | a part of the message`, then the lines that are
//! added to a scene that is right, or a whole scene. The changes that an editor offers for them are in `fixes.txt`, which
//! `WFL_WRITE=1 cargo test --workspace --test suites mistakes::` writes.

use std::{fmt::Write as _, path::Path};

use wfl::{Diagnostic, Edit, NoFiles, SourceMap, edits, one_per_cause, render, resolve};
use wfl_compiler::InterpreterBackend;
use wfl_problem::prepare;

const TABLE: &str = include_str!("table.txt");

/// Ten lines that are right.
const SCENE: &str = include_str!("scene.wfl");

/// The errors of a scene.
struct Told {
    sources: SourceMap,
    errors: Vec<Diagnostic>,
}

impl Told {
    fn of(text: &str) -> Self {
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", text);
        let mut checked = resolve(&mut sources, main, &mut NoFiles, &[]);
        let mut found = std::mem::take(&mut checked.diagnostics);
        if let Some(script) = &checked.value {
            found.extend(prepare(script, Path::new(""), &InterpreterBackend).diagnostics);
        }
        found.retain(Diagnostic::is_error);
        let errors = one_per_cause(&found, &sources).0;
        Self { sources, errors }
    }

    /// As they are printed.
    fn printed(&self) -> Vec<String> {
        self.errors.iter().map(|d| render(d, &self.sources)).collect()
    }
}

/// A mistake of the table.
struct Mistake {
    entry: &'static str,
    head: &'static str,
    text: &'static str,
}

impl Mistake {
    fn all() -> impl Iterator<Item = Self> {
        TABLE.split("\n\n").map(str::trim_end).filter(|e| !e.is_empty()).map(|entry| {
            let (head, text) = entry.split_once('\n').expect("a head and a text");
            Self { entry, head, text }
        })
    }

    fn scene(&self) -> String {
        let whole = self.head.split(" | ").next().is_some_and(|place| place.split(' ').any(|w| w == "whole"));
        if whole { format!("{}\n", self.text) } else { format!("{SCENE}{}\n", self.text) }
    }
}

#[test]
fn each_mistake_gives_one_message_at_its_place_with_a_cure() {
    assert_eq!(Told::of(SCENE).printed(), Vec::<String>::new());
    let mut wrong = Vec::new();
    for mistake in Mistake::all() {
        let (place, phrase) = mistake.head.split_once(" | ").expect("a phrase");
        let words: Vec<&str> = place.split(' ').collect();
        let told = Told::of(&mistake.scene()).printed();
        let at = format!("scene.wfl:{}:", words[1]);
        let good = told.len() == 1
            && told[0].starts_with(&format!("error[{}]", words[0]))
            && (words[1] == "0" || told[0].contains(&at))
            && told[0].contains(phrase);
        if !good {
            wrong.push(format!("{}\n{}", mistake.entry, told.concat()));
        }
    }
    assert!(wrong.is_empty(), "{} mistakes are told otherwise:\n\n{}", wrong.len(), wrong.join("\n"));
}

/// A change with its title, as `fixes.txt` has it: `LINE:COLUMN "what stands there" -> "what is meant" | title`.
fn change(sources: &SourceMap, edit: &Edit) -> String {
    let Edit { title, span, text } = edit;
    let (line, column) = sources.line_column(*span);
    format!("= {line}:{column} {:?} -> {text:?} | {title}", sources.snippet(*span))
}

#[test]
fn the_fixes_of_mistakes_are_those_of_the_list() {
    let mut list = String::new();
    for mistake in Mistake::all() {
        let told = Told::of(&mistake.scene());
        let of = |d: &Diagnostic| edits(d, &told.sources).iter().map(|e| change(&told.sources, e)).collect::<Vec<_>>();
        let lines: Vec<String> = told.errors.iter().flat_map(of).collect();
        if !lines.is_empty() {
            let _ = writeln!(list, "{}\n{}\n", mistake.text, lines.join("\n"));
        }
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("mistakes/fixes.txt");
    if std::env::var_os("WFL_WRITE").is_some() {
        std::fs::write(&path, &list).expect("the list can be written");
    }
    assert_eq!(list, std::fs::read_to_string(&path).unwrap_or_default());
}

#[test]
fn a_fix_takes_its_message_away() {
    let mut left = Vec::new();
    for mistake in Mistake::all() {
        let scene = mistake.scene();
        let told = Told::of(&scene);
        for d in &told.errors {
            for edit in edits(d, &told.sources) {
                let mut text = scene.clone();
                text.replace_range(edit.span.start as usize..edit.span.end as usize, &edit.text);
                // the same mistake further on is one of its own
                let mended = Told::of(&text);
                let place = |e: &Diagnostic, sources: &SourceMap| e.labels.first().map(|l| sources.line_column(l.span));
                let is_same = |e: &Diagnostic| {
                    (e.code, &e.message) == (d.code, &d.message) && place(e, &mended.sources) == place(d, &told.sources)
                };
                if mended.errors.iter().any(is_same) {
                    left.push(format!("{}\n{}\n", mistake.text, change(&told.sources, &edit)));
                }
            }
        }
    }
    assert!(left.is_empty(), "{} fixes leave their message:\n\n{}", left.len(), left.join("\n"));
}
