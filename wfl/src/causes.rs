//! Which messages have one cause: a mistake is told once.
//!
//! Errors come from all stages, each of which goes on as far as it can. The same message about the same word, the same
//! place in a macro that is used twice, one missing statement: these are one message with the lines of the others.
//! What follows from another error is found in `consequences`.

mod consequences;

use std::collections::BTreeMap;

use crate::{
    codes::Code,
    diag::{Diagnostic, Label},
    source::{SourceMap, Span},
};

/// Codes of messages about one word or sign: the same message at another place has the same cause.
const OF_A_WORD: &[Code] = &[Code::E107, Code::E118, Code::E128, Code::E201, Code::E216];

/// Codes of messages about a name that is not there, in any of its forms: `u`, `Grad_u`, `u(1)`.
const OF_A_NAME: &[Code] = &[Code::E201, Code::E216];

/// The messages with those of one cause made one: the first stays, and names the lines of the others; what only follows
/// from another error is left out. Of each code a hundred are told; the second list says how many more there are. Linear
/// in the number of messages.
#[must_use]
pub fn one_per_cause(diagnostics: &[Diagnostic], sources: &SourceMap) -> (Vec<Diagnostic>, Vec<(Code, usize)>) {
    let mut kept: Vec<Cause<'_>> = Vec::new();
    let mut by_code: BTreeMap<Code, (Vec<usize>, usize)> = BTreeMap::new();
    let left = consequences::left(diagnostics, sources);
    for d in &left {
        let (known, more) = by_code.entry(d.code).or_default();
        let same = known.iter().find(|k| kept[**k].first == d || same_cause(kept[**k].first, d));
        match same {
            Some(k) if kept[*k].first == d => {}
            Some(k) if kept[*k].others.len() < MOST_OF_A_CODE => {
                kept[*k].others.extend(d.labels.first().map(|l| l.span));
            }
            Some(k) => kept[*k].more += 1,
            None if known.len() == MOST_OF_A_CODE => *more += 1,
            None => {
                known.push(kept.len());
                kept.push(Cause { first: d, others: Vec::new(), more: 0 });
            }
        }
    }
    let told = kept.into_iter().map(|c| with_other_lines(c.first.clone(), &c.others, c.more, sources)).collect();
    (told, by_code.into_iter().map(|(code, (_, more))| (code, more)).filter(|(_, more)| *more > 0).collect())
}

/// Causes of one code that are told, and places of one cause that are looked at: who has more does not read them one by one.
const MOST_OF_A_CODE: usize = 100;

/// A message with the places of others of the same cause, and how many more there are.
struct Cause<'d> {
    first: &'d Diagnostic,
    others: Vec<Span>,
    more: usize,
}

fn same_cause(a: &Diagnostic, b: &Diagnostic) -> bool {
    /// The place in a macro that two uses of it share.
    fn origin(d: &Diagnostic) -> Option<Span> {
        let inside = |l: &&Label| l.text.starts_with("inside the definition of");
        d.labels.iter().skip(1).find(inside).map(|l| l.span)
    }
    if a.code == Code::E206 && b.code == Code::E206 {
        return true;
    }
    if OF_A_NAME.contains(&a.code) && OF_A_NAME.contains(&b.code) && a.about.is_some() && a.about == b.about {
        return true;
    }
    if a.code != b.code || a.message != b.message {
        return false;
    }
    let of_word = OF_A_WORD.contains(&a.code) && a.helps == b.helps;
    of_word || a.is_error() && origin(a).is_some() && origin(a) == origin(b)
}

/// The message with the lines of `more`, and how many `further` places there are.
fn with_other_lines(d: Diagnostic, more: &[Span], further: usize, sources: &SourceMap) -> Diagnostic {
    /// Lines that are named.
    const NAMED: usize = 12;
    let first = d.labels.first().map(|l| (l.span.source, sources.line_column(l.span).0));
    let mut lines: Vec<usize> = Vec::new();
    for span in more.iter().filter(|s| first.is_some_and(|f| f.0 == s.source)) {
        let line = sources.line_column(*span).0;
        if first != Some((span.source, line)) && !lines.contains(&line) {
            lines.push(line);
        }
    }
    if lines.is_empty() {
        return d;
    }
    let rest = lines.len().saturating_sub(NAMED) + further;
    let named: Vec<String> = lines.iter().take(NAMED).map(usize::to_string).collect();
    let word = if lines.len() == 1 { "line" } else { "lines" };
    let rest = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    d.note(format!("also on {word} {}{rest}", named.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : scalar\nunknown p : scalar # pore\n\
        def sigma(v) = Sym(Grad_v)\nregion f = faces where x == 0\nterm a on all : sigma(u):Grad_Test_u\n\
        term b on f : u.Normal\nterm c on all : p\nload u = [0,1] on all\n";

    /// Codes of what is told of errors with these codes at these words.
    fn told(errors: &[(Code, &str)]) -> (Vec<Code>, Vec<String>) {
        let mut sources = SourceMap::new();
        let id = sources.add("s.wfl", SCENE);
        let error = |(code, at): &(Code, &str)| {
            let start = SCENE.find(at).expect("a place");
            let span = Span { source: id, start: start as u32, end: (start + at.len()) as u32 };
            Diagnostic::new(
                *code,
                if *code == Code::E408 { "the corners of a box".to_owned() } else { format!("about {at}") },
            )
            .at(span, "")
        };
        let list: Vec<Diagnostic> = errors.iter().map(error).collect();
        let (told, _) = one_per_cause(&list, &sources);
        (told.iter().map(|d| d.code).collect(), told.into_iter().flat_map(|d| d.notes).collect())
    }

    #[test]
    fn shapes_of_one_field_are_told_once_with_its_declaration() {
        let (codes, notes) =
            told(&[(Code::E108, "sigma(u)"), (Code::E102, "u.Normal"), (Code::E108, "p\n"), (Code::E108, "[0,1] on")]);
        assert_eq!(codes, [Code::E108, Code::E108]);
        assert_eq!(notes, ["shapes do not fit on lines 8, 10 either; common to them is line 3: unknown u : scalar"]);
    }

    #[test]
    fn what_no_term_has_is_not_told_where_a_term_cannot_be_read() {
        for code in [Code::E454, Code::E457] {
            assert_eq!(told(&[(Code::E207, "b on f"), (code, "u : scalar")]).0, [Code::E207]);
            assert_eq!(told(&[(Code::E207, "f = faces"), (code, "u : scalar")]).0, [Code::E207, code]);
        }
    }

    #[test]
    fn what_follows_from_another_error_is_left_out() {
        assert_eq!(told(&[(Code::E408, "box"), (Code::E205, "x == 0"), (Code::E101, "sigma(u)")]).0, [Code::E408]);
        assert_eq!(told(&[(Code::E108, "x == 0"), (Code::E204, "Normal")]).0, [Code::E108]);
        assert_eq!(told(&[(Code::E425, "box"), (Code::E114, "u.Normal")]).0, [Code::E114]);
        assert_eq!(told(&[(Code::E204, "Normal"), (Code::E108, "p\n")]).0, [Code::E204, Code::E108]);
        assert_eq!(told(&[(Code::E206, "sigma(u)"), (Code::E206, "p\n")]).0, [Code::E206]);
    }
}
