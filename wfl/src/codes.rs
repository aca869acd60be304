//! Every code a message can have, with what it means: the text of `wfl explain E101`.
//!
//! A code is used for one kind of mistake and is never given a new meaning. Codes of later stages are here too. Only the
//! pages make codes: one that is named, as `Code::E101`, has a page, and one that is left out does not compile.

use std::fmt;

/// Makes the pages of a file, and a constant of [`Code`] for each.
macro_rules! pages {
    ($(page($code:ident, $title:literal, $explanation:literal, $wrong:literal, $fixed:literal $(,)?)),* $(,)?) => {
        impl Code {
            $(#[doc = $title] pub const $code: Code = Code(stringify!($code));)*
        }

        pub(super) const PAGES: &[CodePage] = &[$(CodePage {
            code: Code::$code,
            title: $title,
            explanation: $explanation,
            wrong: $wrong,
            fixed: $fixed,
        }),*];
    };
}

mod names;
mod run;
mod scene;
mod syntax;
mod warnings;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// A result follows, but look here.
    Warning,
    /// No result.
    Error,
}

/// What a message is known by: a letter and three digits. Ordered as the pages are, errors first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Code(&'static str);

impl Code {
    /// `E101`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        self.0
    }

    /// How bad it is: the first letter.
    #[must_use]
    pub fn severity(self) -> Severity {
        if self.0.starts_with('W') { Severity::Warning } else { Severity::Error }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0)
    }
}

impl fmt::Debug for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// With a text that came from outside.
impl PartialEq<&str> for Code {
    fn eq(&self, other: &&str) -> bool {
        self.0 == *other
    }
}

/// What a code means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodePage {
    /// `E101`: errors; `W702`: warnings.
    pub code: Code,
    /// One line, lower case, no full stop.
    pub title: &'static str,
    /// What is wrong, why it matters, and what to do.
    pub explanation: &'static str,
    /// The smallest lines that show it, in place of the same statements of a scene that is right.
    pub wrong: &'static str,
    /// The same lines, put right.
    pub fixed: &'static str,
}

/// All pages, errors first, by code.
pub fn codes() -> impl Iterator<Item = &'static CodePage> {
    syntax::PAGES.iter().chain(names::PAGES).chain(scene::PAGES).chain(run::PAGES).chain(warnings::PAGES)
}

/// The page of a code; letters may be small.
#[must_use]
pub fn explain(code: &str) -> Option<&'static CodePage> {
    codes().find(|p| p.code.0.eq_ignore_ascii_case(code.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_sorted_and_each_is_there_once() {
        let all: Vec<Code> = codes().map(|p| p.code).collect();
        assert!(all.windows(2).all(|w| w[0] < w[1]), "{all:?}");
        assert_eq!(explain("e107").map(|p| p.code), Some(Code::E107));
        assert_eq!(explain("E999"), None);
    }

    #[test]
    fn pages_are_complete() {
        for p in codes() {
            assert!(!p.title.ends_with('.') && p.title.len() < 80, "{}", p.code);
            assert!(p.explanation.ends_with('.') && p.explanation.len() > 60, "{}", p.code);
            assert!(!p.wrong.is_empty() && !p.fixed.is_empty() && p.wrong != p.fixed, "{}", p.code);
        }
    }
}
