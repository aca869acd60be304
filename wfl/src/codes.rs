//! Every code a message can have, with what it means: the text of `wfl explain E101`.
//!
//! A code is used for one kind of mistake and is never given a new meaning. Codes of later stages are here too.

mod names;
mod run;
mod scene;
mod syntax;
mod warnings;

/// What a code means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodePage {
    /// `E101`: errors; `W702`: warnings.
    pub code: &'static str,
    /// One line, lower case, no full stop.
    pub title: &'static str,
    /// What is wrong, why it matters, and what to do.
    pub explanation: &'static str,
    /// The smallest lines that show it, in place of the same statements of a scene that is right.
    pub wrong: &'static str,
    /// The same lines, put right.
    pub fixed: &'static str,
}

const fn page(
    code: &'static str,
    title: &'static str,
    explanation: &'static str,
    wrong: &'static str,
    fixed: &'static str,
) -> CodePage {
    CodePage { code, title, explanation, wrong, fixed }
}

/// All pages, errors first, by code.
pub fn codes() -> impl Iterator<Item = &'static CodePage> {
    syntax::PAGES.iter().chain(names::PAGES).chain(scene::PAGES).chain(run::PAGES).chain(warnings::PAGES)
}

/// The page of a code; letters may be small.
#[must_use]
pub fn explain(code: &str) -> Option<&'static CodePage> {
    codes().find(|p| p.code.eq_ignore_ascii_case(code.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_sorted_and_each_is_there_once() {
        let all: Vec<&str> = codes().map(|p| p.code).collect();
        assert!(all.windows(2).all(|w| w[0] < w[1]), "{all:?}");
        assert_eq!(explain("e107").map(|p| p.code), Some("E107"));
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
