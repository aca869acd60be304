//! `wfl explain`: the page of a message, or of a function of the language.

use std::{fmt::Write as _, process::ExitCode};

use wfl::{codes, nearest};
use wfl_compiler::{OpDef, functions};

use crate::{
    args::ExplainArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn explain(args: &ExplainArgs) -> ExitCode {
    if args.functions {
        out(&table());
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
    if let Some(op) = functions().find(|op| op.name == code) {
        out(&format!("{}\n\n{}\n", op.usage, wrapped(op.doc, 96)));
        return ExitCode::SUCCESS;
    }
    let Some(page) = wfl::explain(code) else {
        let near = nearest(code, codes().map(|p| p.code).chain(functions().map(|op| op.name)));
        let near = near.map_or_else(String::new, |n| format!("; the nearest is {n}"));
        say(&format!(
            "error: no message has the code `{code}`, and no function that name{near}\n  \
             = help: wfl explain --list shows all codes, --functions all functions\n"
        ));
        return ExitCode::from(EXIT_ERROR);
    };
    let indented = |text: &str| text.lines().map(|l| format!("    {l}\n")).collect::<String>();
    out(&format!(
        "{}: {}\n\n{}\n\nWrong:\n{}\nRight:\n{}",
        page.code,
        page.title,
        wrapped(page.explanation, 96),
        indented(page.wrong),
        indented(page.fixed)
    ));
    ExitCode::SUCCESS
}

/// All functions as a table in Markdown, by name.
fn table() -> String {
    let mut all: Vec<&OpDef> = functions().collect();
    all.sort_by_key(|op| (op.name.to_ascii_lowercase(), op.name));
    let cell = |text: &str| text.replace('|', "\\|");
    let mut text = "| function | what it is |\n|---|---|\n".to_owned();
    for op in all {
        let _ = writeln!(text, "| `{}` | {} |", cell(op.usage), cell(op.doc));
    }
    text
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
