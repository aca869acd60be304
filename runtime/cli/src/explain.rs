//! `wfl explain`: the page of a message, of a function, statement or built-in word of the language, or of a macro of the
//! library.

use std::{fmt::Write as _, process::ExitCode};

use wfl::{LIBRARY, STATEMENTS, codes, nearest, phrases, statement_page, word_meaning};
use wfl_compiler::{function_table, functions};

use crate::{
    args::ExplainArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn explain(args: &ExplainArgs) -> ExitCode {
    if args.functions {
        out(&function_table());
        return ExitCode::SUCCESS;
    }
    let Some(code) = args.code.as_deref().filter(|_| !args.list) else {
        let mut text = String::new();
        for page in codes() {
            let _ = writeln!(text, "{}  {}", page.code, page.title);
        }
        out(&text);
        return ExitCode::SUCCESS;
    };
    if let Some(page) = word_page(code) {
        out(&page);
        return ExitCode::SUCCESS;
    }
    let Some(page) = wfl::explain(code) else {
        let macros = library_macros().map(|m| m.name);
        let near = nearest(
            code,
            codes()
                .map(|p| p.code.as_str())
                .chain(functions().map(|op| op.name))
                .chain(macros)
                .chain(phrases().iter().map(|p| p.word))
                .chain(STATEMENTS.iter().copied()),
        );
        let near = near.map_or_else(String::new, |n| format!("; the nearest is {n}"));
        say(&format!(
            "error: no message has the code `{code}`, and no function, statement or macro of the library that name{near}\n  \
             = help: wfl explain --list shows all codes, --functions all functions\n"
        ));
        return ExitCode::from(EXIT_ERROR);
    };
    let indented = |text: &str| text.lines().map(|l| format!("    {l}\n")).collect::<String>();
    out(&format!(
        "{}: {}\n\n{}\n\nWrong:\n{}\nRight:\n{}",
        page.code,
        page.title,
        wrapped(page.explanation, WIDTH),
        indented(page.wrong),
        indented(page.fixed)
    ));
    ExitCode::SUCCESS
}

/// The page of a word of the language or of the library.
fn word_page(word: &str) -> Option<String> {
    if let Some(op) = functions().find(|op| op.name == word) {
        return Some(format!("{}\n\n{}\n", op.usage, wrapped(op.doc, WIDTH)));
    }
    if let Some(page) = library_macro(word) {
        return Some(page);
    }
    if let Some(phrase) = phrases().iter().find(|p| p.word == word) {
        return Some(format!("{}\n\n{}\n", phrase.usage, wrapped(phrase.text, WIDTH)));
    }
    if let Some(page) = statement_page(word) {
        // the marks of Markdown say nothing in a terminal
        let lines = page.lines().map(|l| match l.strip_prefix("    ") {
            Some(text) => wrapped(text, WIDTH - 4).lines().map(|l| format!("    {l}\n")).collect::<String>(),
            None => format!("{l}\n"),
        });
        return Some(lines.collect::<String>().replace('`', ""));
    }
    word_meaning(word).map(|meaning| format!("{word}\n\n{}.\n", wrapped(meaning, WIDTH)))
}

/// Characters of a line of a page.
const WIDTH: usize = 96;

/// A macro of the library.
struct LibraryMacro {
    name: &'static str,
    /// The file that defines it.
    file: &'static str,
    /// The paragraph of that file with its definition.
    paragraph: &'static str,
}

fn library_macros() -> impl Iterator<Item = LibraryMacro> {
    LIBRARY.iter().flat_map(|(file, text)| {
        text.split("\n\n").flat_map(move |paragraph| {
            let heads = paragraph.lines().filter_map(|line| line.strip_prefix("def "));
            heads.filter_map(move |head| Some(LibraryMacro { name: head.split('(').next()?, file, paragraph }))
        })
    })
}

/// What the library says about a macro, and its definition with the lines that continue it.
fn library_macro(name: &str) -> Option<String> {
    let found = library_macros().find(|m| m.name == name)?;
    let file = found.file.trim_end_matches(".wfl");
    let mut text = format!("`{name}` is a macro of the library: use \"{file}\"\n\n");
    let mut wanted = false;
    for line in found.paragraph.lines() {
        let comment = line.starts_with('#');
        wanted = comment || if line.starts_with(' ') { wanted } else { line.starts_with(&format!("def {name}(")) };
        if wanted {
            let _ = writeln!(text, "{}", line.strip_prefix("# ").unwrap_or(line));
        }
    }
    Some(text)
}

/// Lines of at most `width` characters where the words allow it.
fn wrapped(text: &str, width: usize) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}
