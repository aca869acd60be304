//! `wfl explain`.

use std::{fmt::Write as _, process::ExitCode};

use wfl::{codes, nearest};

use crate::{
    args::ExplainArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn explain(args: &ExplainArgs) -> ExitCode {
    let Some(code) = args.code.as_deref().filter(|_| !args.list) else {
        let mut text = String::new();
        for page in codes() {
            let _ = writeln!(text, "{}  {}", page.code, page.title);
        }
        out(&text);
        return ExitCode::SUCCESS;
    };
    let Some(page) = wfl::explain(code) else {
        let near = nearest(code, codes().map(|p| p.code));
        let near = near.map_or_else(String::new, |n| format!("; the nearest is {n}"));
        say(&format!("error: no message has the code `{code}`{near}\n  = help: wfl explain --list shows all codes\n"));
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
