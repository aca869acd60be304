//! What broken statements would have declared, so that one mistake gives one message.
//!
//! A statement with an error declares nothing. Its names are kept here: nothing is called unknown or missing because of
//! it. Works on the text alone, so names of statements that cannot be read are found too.

use std::collections::BTreeSet;

use crate::{diag::Diagnostic, keywords::STATEMENTS};

/// Names whose declarations have errors of their own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lost {
    names: BTreeSet<String>,
    everything: bool,
}

/// Statements that declare nothing.
const DECLARE_NOTHING: &[&str] = &[
    "refine",
    "split",
    "term",
    "energy",
    "fix",
    "load",
    "start",
    "scheme",
    "solver",
    "quadrature",
    "output",
    "expect",
    "wfl",
];

impl Lost {
    /// True if no declaration is broken.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.names.is_empty() && !self.everything
    }

    /// True if a broken declaration may have declared `name`.
    #[must_use]
    pub fn covers(&self, name: &str) -> bool {
        self.everything || self.names.contains(name)
    }

    /// True if a message is only the consequence of a broken declaration.
    #[must_use]
    pub fn explains(&self, diagnostic: &Diagnostic) -> bool {
        diagnostic.about.as_deref().is_some_and(|name| self.covers(name))
    }

    /// Adds a name.
    pub fn add(&mut self, name: &str) {
        self.names.insert(name.to_owned());
    }

    /// Adds all names there are: a whole file is missing.
    pub fn add_everything(&mut self) {
        self.everything = true;
    }

    /// Adds the names of another part of the scene.
    pub fn extend(&mut self, other: Lost) {
        self.names.extend(other.names);
        self.everything |= other.everything;
    }

    /// Adds what a statement that cannot be read would have declared: the words before its `=` or `:`.
    pub fn add_statement(&mut self, text: &str) {
        let head = text.split(['=', ':', '(', '"', '#']).next().unwrap_or("");
        let is_word = |w: &&str| w.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let mut words = head.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(is_word).peekable();
        let first = words.peek().copied().unwrap_or("");
        if DECLARE_NOTHING.contains(&first) {
            return;
        }
        if STATEMENTS.contains(&first) {
            words.next();
        }
        match first {
            // regions may be the groups of a file, and a file may hold any macro
            "use" => self.everything = true,
            "mesh" if text.contains('"') => self.everything = true,
            "mesh" => self.add("mesh"),
            _ => {
                self.everything |= words.peek().is_none();
                self.names.extend(words.map(str::to_owned));
                if first == "steps" {
                    self.add("steps");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_statement_hides_the_names_it_would_have_declared() {
        for (text, lost, kept) in [
            ("param gamma = 1e5 1", &["gamma"][..], &["theta"][..]),
            ("regoin south = faces where y == 0", &["south"], &["west"]),
            ("gamma = 3", &["gamma"], &["param"]),
            ("def sigma(v) = 2*", &["sigma"], &["v"]),
            ("unknown u, p : scalar", &["u", "p"], &["scalar"]),
            ("steps t = 0 to 1", &["t", "steps"], &["u"]),
            ("mesh bxo [0,0]", &["mesh"], &["west"]),
            ("mesh fil \"a.msh\"", &["mesh", "any group"], &[]),
            ("term on all : gamma*", &[], &["gamma", "all"]),
            ("def = 3", &["anything"], &[]),
        ] {
            let mut found = Lost::default();
            found.add_statement(text);
            assert!(lost.iter().all(|n| found.covers(n)), "{text}: {found:?}");
            assert!(!kept.iter().any(|n| found.covers(n)), "{text}: {found:?}");
        }
    }
}
