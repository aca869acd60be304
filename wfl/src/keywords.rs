//! Words that the grammar needs: no scene may use them as names.

/// Words a statement starts with, in column 1.
pub const STATEMENTS: &[&str] = &[
    "use",
    "mesh",
    "refine",
    "region",
    "mapping",
    "param",
    "unknown",
    "multiplier",
    "data",
    "state",
    "split",
    "def",
    "term",
    "energy",
    "fix",
    "load",
    "start",
    "steps",
    "scheme",
    "solver",
    "quadrature",
    "measure",
    "balance",
    "event",
    "gradient",
    "output",
    "expect",
];

/// Words that start a statement and may be names, too: a term is often called `balance`, an output `gradient`.
const ALSO_NAMES: &[&str] = &["balance", "gradient"];

/// Words inside statements; like [`STATEMENTS`] they cannot be names.
pub const KEYWORDS: &[&str] = &[
    "Def",
    "cells",
    "faces",
    "nodes",
    "interface",
    "on",
    "in",
    "from",
    "to",
    "by",
    "onto",
    "of",
    "where",
    "with",
    "as",
    "along",
    "within",
    "degree",
    "and",
    "or",
    "not",
    "if",
    "then",
    "else",
];

/// True for words that no scene may use as a name because the grammar needs them.
#[must_use]
pub fn is_keyword(word: &str) -> bool {
    STATEMENTS.contains(&word) && !ALSO_NAMES.contains(&word) || KEYWORDS.contains(&word)
}
