//! What the words of the language mean, in words: one table for the manual, `wfl explain` and editors.
//!
//! Functions are not here: their rows stand beside what builds them, in the compiler.

mod phrases;
mod statements;
mod words;

use std::fmt::Write as _;

/// One form of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatementRow {
    /// The word it starts with.
    pub word: &'static str,
    /// How it is written, in Markdown.
    pub usage: &'static str,
    /// What it means, in Markdown.
    pub meaning: &'static str,
    /// What holds without it, in Markdown; may be empty.
    pub default: &'static str,
}

/// A word that needs more than a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phrase {
    /// The word.
    pub word: &'static str,
    /// How it is written, a line each.
    pub usage: &'static str,
    /// What it means.
    pub text: &'static str,
}

/// All statements, in the order of the manual.
#[must_use]
pub fn statement_rows() -> &'static [StatementRow] {
    statements::ROWS
}

/// Words with a page of their own.
#[must_use]
pub fn phrases() -> &'static [Phrase] {
    phrases::PHRASES
}

/// What a built-in value, a prefix such as `Grad_`, a built-in region or an option means; one sentence without full stop.
#[must_use]
pub fn word_meaning(word: &str) -> Option<&'static str> {
    words::MEANINGS.iter().find(|m| m.0 == word).map(|m| m.1)
}

/// The table of statements in Markdown.
#[must_use]
pub fn statement_table() -> String {
    let mut text = "| statement | meaning | default |\n|---|---|---|\n".to_owned();
    for row in statements::ROWS {
        let default = if row.default.is_empty() { String::new() } else { format!("{} ", row.default) };
        let _ = writeln!(text, "| {} | {} | {default}|", row.usage, row.meaning);
    }
    text
}

/// The page of a statement: its forms, each with its default; `None` for a word that starts none.
#[must_use]
pub fn statement_page(word: &str) -> Option<String> {
    let mut text = String::new();
    for row in statements::ROWS.iter().filter(|r| r.word == word) {
        let _ = writeln!(text, "{}\n    {}.", row.usage, row.meaning);
        if !row.default.is_empty() {
            let _ = writeln!(text, "    Default: {}.", row.default);
        }
    }
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CONSTANTS, OPTIONS, PREFIXES, REGIONS, STATEMENTS};

    #[test]
    fn every_statement_has_a_row() {
        for word in STATEMENTS {
            assert!(statement_page(word).is_some_and(|p| p.contains(word)), "{word}");
        }
        assert_eq!(statement_page("word"), None);
    }

    #[test]
    fn every_built_in_word_has_a_meaning() {
        let options = OPTIONS.iter().flat_map(|(_, names)| names.iter());
        for word in CONSTANTS.iter().chain(PREFIXES).chain(REGIONS).chain(options) {
            let meaning = word_meaning(word).unwrap_or_else(|| panic!("{word} has no meaning"));
            assert!(!meaning.ends_with('.') && meaning.len() > 5, "{word}");
        }
    }
}
