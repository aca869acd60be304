//! Every code a message can have, with what it means: the text of `wfl explain E101`.
//!
//! A code is used for one kind of mistake and is never given a new meaning. Codes of later stages are here too.

mod names;
mod scene;
mod syntax;

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
    syntax::PAGES.iter().chain(names::PAGES).chain(scene::PAGES)
}

/// The page of a code; letters may be small.
#[must_use]
pub fn explain(code: &str) -> Option<&'static CodePage> {
    codes().find(|p| p.code.eq_ignore_ascii_case(code.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        resolve::{NoFiles, resolve},
        source::SourceMap,
    };

    /// A scene that is right; a line gives way to lines of the example that declare the same.
    const SCENE: &[&str] = &[
        "mesh box [0,0,0] to [1,1,1] cells [4,4,4] hex",
        "region left = cells where x < 0.5",
        "region right = cells where x > 0.5",
        "region fault = interface from left to right",
        "region west = faces where x == 0",
        "unknown u : vector",
        "unknown uL : vector on left",
        "unknown uR : vector on right",
        "param gamma = 1e5",
        "param fric = 0.4",
        "param theta = 1 in {-1, 0, 1}",
        "def sigma(v) = Sym(Grad_v)",
        "def jump(a,b) = a - Interpolate(b, neighbor_element)",
        "def Pn = gamma*(jump(uL,uR).Normal)",
        "term base on all : sigma(u):Grad_Test_u",
        "fix u = [0,0,0] on west",
    ];

    fn found(example: &str) -> Vec<&'static str> {
        let declares = |line: &str| -> Vec<String> {
            line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').take(2).map(str::to_owned).collect()
        };
        let own: Vec<Vec<String>> = example.lines().map(declares).collect();
        let replaced = |line: &str| {
            let words = declares(line);
            own.iter().any(|o| *o == words || words[0] == "mesh" && o[0] == "mesh")
        };
        let scene: Vec<&str> = SCENE.iter().copied().filter(|l| !replaced(l)).collect();
        let text = format!("{example}\n{}\n", scene.join("\n"));
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", text);
        resolve(&mut sources, main, &mut NoFiles, &[]).diagnostics.iter().map(|d| d.code).collect()
    }

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

    /// Codes of this crate are given by their wrong example and not by the right one; examples of later stages are
    /// read and resolved without an error.
    #[test]
    fn examples_show_what_they_say() {
        // needs a file, a command line, or more text than fits a page
        let not_shown = ["E119", "E124", "E125", "E214", "E701", "E703"];
        let here = |c: &str| {
            let ranges = [
                ("E106", "E107"),
                ("E113", "E126"),
                ("E207", "E207"),
                ("E209", "E214"),
                ("E421", "E424"),
                ("E501", "E502"),
                ("W505", "W505"),
            ];
            ranges.iter().any(|(first, last)| (*first..=*last).contains(&c))
        };
        for p in codes().filter(|p| !not_shown.contains(&p.code)) {
            let errors = |text: &str| found(text).into_iter().filter(|c| c.starts_with('E')).collect::<Vec<_>>();
            let fixed = errors(p.fixed);
            // what is missing is added by the fixed example alone
            assert!(fixed.is_empty(), "{} fixed: {fixed:?}", p.code);
            if here(p.code) {
                let missing = ["E421", "E422", "E423"].contains(&p.code);
                assert!(missing || found(p.wrong).contains(&p.code), "{} wrong: {:?}", p.code, found(p.wrong));
                assert!(!found(p.fixed).contains(&p.code), "{} fixed", p.code);
            } else {
                let wrong: Vec<_> = errors(p.wrong).into_iter().filter(|c| *c != p.code).collect();
                assert!(wrong.is_empty(), "{} wrong: {wrong:?}", p.code);
            }
        }
    }
}
