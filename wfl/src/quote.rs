//! Words of the scene in a message: stages that see no text name a place, and rendering puts in what stands there.
//!
//! A quotation is a mark in the text of a label, note or help. A message is a plain string for every stage before.

use crate::source::{SourceId, SourceMap, Span};

const OPEN: char = '\u{e000}';
const CLOSE: char = '\u{e001}';

/// Longer quotations are cut.
const LONGEST: usize = 120;

/// What stands at a place, on one line.
#[must_use]
pub fn quote(span: Span) -> String {
    mark('q', span)
}

/// What stands at a place, with every `Test_` left out.
#[must_use]
pub fn quote_without_tests(span: Span) -> String {
    mark('t', span)
}

/// The number of the line of a place; with its file in front of it if that is not the scene.
#[must_use]
pub fn line_of(span: Span) -> String {
    mark('l', span)
}

fn mark(kind: char, span: Span) -> String {
    format!("{OPEN}{kind}{} {} {}{CLOSE}", span.source.index(), span.start, span.end)
}

/// The text with all quotations in place. Marks that no stage has made stay as they are.
#[must_use]
pub fn unquoted(text: &str, sources: &SourceMap) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once(OPEN) {
        out.push_str(before);
        rest = behind;
        if let Some((inside, after)) = behind.split_once(CLOSE)
            && let Some(said) = said(inside, sources)
        {
            out.push_str(&said);
            rest = after;
        } else {
            out.push(OPEN);
        }
    }
    out.push_str(rest);
    out
}

fn said(mark: &str, sources: &SourceMap) -> Option<String> {
    let kind = mark.chars().next()?;
    let mut numbers = mark[kind.len_utf8()..].split(' ').map(str::parse::<u32>);
    let mut next = || numbers.next().and_then(Result::ok);
    let (source, start, end) = (next()? as usize, next()?, next()?);
    let known = sources.iter().nth(source)?.1;
    // a place that is no part of the text has nothing to say
    known.text.get(start as usize..end as usize)?;
    let span = Span { source: SourceId::new(source), start, end };
    match kind {
        'l' => Some(match (source, sources.line_column(span).0) {
            (0, line) => format!("line {line}"),
            (_, line) => format!("line {line} of {}", known.name),
        }),
        'q' => Some(one_line(sources.snippet(span))),
        't' => Some(one_line(sources.snippet(span)).replace("Test_", "")),
        _ => None,
    }
}

fn one_line(text: &str) -> String {
    let words = text.lines().map(|l| l.split('#').next().unwrap_or(l)).flat_map(str::split_whitespace);
    let joined = words.collect::<Vec<_>>().join(" ");
    if joined.chars().count() <= LONGEST {
        return joined;
    }
    joined.chars().take(LONGEST).chain("...".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_replaced_by_what_stands_there() {
        let mut sources = SourceMap::new();
        let id = sources.add("scene.wfl", "term a on all :\n  f(Test_u,  2)\n");
        let span = Span { source: id, start: 18, end: 31 };
        assert_eq!(unquoted(&format!("1 + {}.", quote(span)), &sources), "1 + f(Test_u, 2).");
        assert_eq!(unquoted(&quote_without_tests(span), &sources), "f(u, 2)");
        assert_eq!(unquoted(&format!("on {}?", line_of(span)), &sources), "on line 2?");
    }

    #[test]
    fn other_marks_stay() {
        let sources = SourceMap::new();
        for text in ["\u{e000}", "\u{e000}q0 0 1\u{e001}", "a\u{e001}b", "\u{e000}é\u{e001}"] {
            assert!(!unquoted(text, &sources).is_empty());
        }
    }
}
