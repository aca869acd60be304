//! The page of the verification suite as Markdown.

use std::fmt::Write;

use super::{Benchmark, Case, Tolerance};

const HEAD: &str = "This page is written by `cargo run --release -p wfl-tests --bin verification`; the tests assert the same cases. Every expected
number comes from a closed form or from another program; `tests/reference/README.md` has the sources. A row of a table
stands for many numbers and shows the one closest to its tolerance. `share` is the deviation divided by the tolerance (1 is
the limit); for limits it is the value divided by the limit.

| id | what | origin | numbers | result |
|---|---|---|---|---|
";

/// Title and summary above the rows of the overview.
fn head(rows: &str) -> String {
    let cells = |row: &str| row.split(" | ").map(|c| c.trim_matches([' ', '|']).to_owned()).collect::<Vec<_>>();
    let numbers: usize = rows.lines().filter_map(|r| cells(r).iter().rev().nth(1)?.parse::<usize>().ok()).sum();
    let passed = rows.lines().filter(|r| cells(r).last().is_some_and(|c| c == "pass")).count();
    let groups = rows.lines().count();
    format!(
        "# Verification\n\nIn short: {passed} of {groups} groups of cases pass, {numbers} numbers in total.\n\n{HEAD}"
    )
}

/// The page: an overview with one row an identifier, then the cases of each.
#[must_use]
pub fn page(results: &[(Benchmark, Vec<Case>)]) -> String {
    let mut rows = String::new();
    for (b, cases) in results {
        let count: usize = cases.iter().map(|c| c.numbers.len()).sum();
        let holds = !cases.is_empty() && cases.iter().all(Case::passes);
        let result = verdict(b, holds);
        line(&mut rows, &format!("| {} | {} | {} | {count} | {result} |", b.id, b.title, b.origin));
    }
    let mut text = head(&rows) + &rows;
    for (b, cases) in results {
        line(&mut text, &format!("\n## {}: {}\n", b.id, b.title));
        if let Some(why) = b.open {
            line(&mut text, &format!("Open: {why}.\n"));
        }
        text.push_str("| case | numbers | closest to its tolerance | expected | WFL | tolerance | share | |\n");
        text.push_str("|---|---|---|---|---|---|---|---|\n");
        for case in cases {
            line(&mut text, &row(case, verdict(b, case.passes())));
        }
    }
    text
}

/// The page with these results in the place of their identifiers; every other row and section stays as it is in `old`.
#[must_use]
pub fn updated(old: &str, order: &[&str], results: &[(Benchmark, Vec<Case>)]) -> String {
    let fresh = page(results);
    let made = |id: &str| results.iter().any(|(b, _)| b.id == id);
    let source = |id: &str| if made(id) { fresh.as_str() } else { old };
    // an identifier may have several groups
    let groups = || order.iter().enumerate().map(|(at, id)| (id, order[..at].iter().filter(|o| *o == id).count()));
    let mut rows = String::new();
    for (id, group) in groups() {
        let start = format!("| {id} | ");
        let row = source(id).lines().filter(|l| l.starts_with(&start)).nth(group);
        row.iter().for_each(|l| line(&mut rows, l));
    }
    let mut text = head(&rows) + &rows;
    for (id, group) in groups() {
        let start = format!("{id}: ");
        let section = source(id).split("\n## ").filter(|s| s.starts_with(&start)).nth(group);
        section.iter().for_each(|s| line(&mut text, &format!("\n## {}", s.trim_end())));
    }
    text
}

fn verdict(benchmark: &Benchmark, holds: bool) -> &'static str {
    match (holds, benchmark.open) {
        (true, _) => "pass",
        (false, Some(_)) => "open",
        (false, None) => "FAIL",
    }
}

fn line(text: &mut String, content: &str) {
    // writing to a string cannot fail
    let _ = writeln!(text, "{content}");
}

fn row(case: &Case, result: &str) -> String {
    let what = &case.what;
    if let Some(why) = &case.failure {
        let why = why.lines().next().unwrap_or_default();
        return format!("| {what} | {} | {why} | | | | | {result} |", case.numbers.len());
    }
    let Some(n) = case.worst() else { return format!("| {what} | 0 | nothing compared | | | | | {result} |") };
    let tolerance = match n.tolerance {
        Tolerance::Relative(t) => format!("{t:.0e} relative"),
        Tolerance::Absolute(t) => format!("{t:.0e}"),
        Tolerance::AtMost => "at most".to_owned(),
        Tolerance::AtLeast => "at least".to_owned(),
        Tolerance::Bitwise => "the same bits".to_owned(),
    };
    format!(
        "| {what} | {} | {} | {} | {} | {tolerance} | {:.1e} | {result} |",
        case.numbers.len(),
        n.label,
        shown(n.expected),
        shown(n.got),
        n.severity()
    )
}

/// Eight digits, without an exponent where a reader does not need one.
fn shown(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) {
        let digits = 7 - x.abs().max(1e-300).log10().floor().clamp(-3.0, 6.0) as i32;
        let text = format!("{x:.*}", usize::try_from(digits.max(0)).unwrap_or(0));
        return if x == 0.0 { "0".to_owned() } else { text };
    }
    format!("{x:.7e}")
}
