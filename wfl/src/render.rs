//! Diagnostics to text, in the look of a compiler message: code, sentence, place, the line, marks, notes, helps.
//!
//! The only user of annotate-snippets. Any span may come in: it is clamped to its text and to character borders, so
//! rendering never panics. Also here: how the place of an expression that came out of a macro is shown.

use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use crate::{
    ast::{Expansions, Expr},
    diag::{Diagnostic, Label},
    quote::unquoted,
    source::{Source, SourceId, SourceMap, Span},
};

/// A longer mark says nothing more and would fill the screen.
const LONGEST_MARK: usize = 4000;

/// The text of a diagnostic, ending with a line feed.
#[must_use]
pub fn render(diagnostic: &Diagnostic, sources: &SourceMap) -> String {
    rendered(Renderer::plain(), diagnostic, sources)
}

/// The same with the colours of a terminal.
#[must_use]
pub fn render_coloured(diagnostic: &Diagnostic, sources: &SourceMap) -> String {
    rendered(Renderer::styled(), diagnostic, sources)
}

fn rendered(renderer: Renderer, diagnostic: &Diagnostic, sources: &SourceMap) -> String {
    let level = if diagnostic.is_error() { Level::ERROR } else { Level::WARNING };
    let title = level.primary_title(visible(&unquoted(&diagnostic.message, sources))).id(diagnostic.code.as_str());
    let mut group = Group::with_title(title);
    for (source, labels) in by_source(diagnostic, sources) {
        let ranges: Vec<Range<usize>> = labels.iter().map(|(l, _)| clamp(&source.text, l.span)).collect();
        let (window, first_line) = window(&source.text, &ranges);
        let text = &source.text[window.clone()];
        let mut snippet = Snippet::source(text).line_start(first_line).path(visible(&source.name)).fold(true);
        for ((label, primary), range) in labels.into_iter().zip(ranges) {
            let kind = if primary { AnnotationKind::Primary } else { AnnotationKind::Context };
            let mark = kind.span(range.start - window.start..range.end - window.start);
            snippet = snippet.annotation(if label.text.is_empty() {
                mark
            } else {
                mark.label(visible(&unquoted(&label.text, sources)))
            });
        }
        group = group.element(snippet);
    }
    for note in &diagnostic.notes {
        group = group.element(Level::NOTE.message(visible(&unquoted(note, sources))));
    }
    for help in &diagnostic.helps {
        group = group.element(Level::HELP.message(visible(&unquoted(help, sources))));
    }
    let mut text = renderer.render(&[group]);
    text.push('\n');
    text
}

/// The lines from the first mark to the last, and the number of the first: what is shown of a long text should not cost
/// more than it shows.
fn window(text: &str, marks: &[Range<usize>]) -> (Range<usize>, usize) {
    let start = marks.iter().map(|m| m.start).min().unwrap_or(0);
    let end = marks.iter().map(|m| m.end).max().unwrap_or(0);
    let start = text[..start].rfind('\n').map_or(0, |at| at + 1);
    let end = text[end..].find('\n').map_or(text.len(), |at| end + at + 1);
    (start..end, 1 + text[..start].bytes().filter(|b| *b == b'\n').count())
}

/// A text with its labels; the flag marks the primary one.
type Marked<'a> = (&'a Source, Vec<(&'a Label, bool)>);

/// Labels by text, the text of the primary label first; a label without a text of its own is left out.
fn by_source<'a>(diagnostic: &'a Diagnostic, sources: &'a SourceMap) -> Vec<Marked<'a>> {
    let mut ids: Vec<SourceId> = Vec::new();
    let mut groups: Vec<Marked<'a>> = Vec::new();
    for (i, label) in diagnostic.labels.iter().enumerate() {
        let id = label.span.source;
        if let Some(known) = ids.iter().position(|k| *k == id) {
            groups[known].1.push((label, i == 0));
        } else if let Some((_, source)) = sources.iter().nth(id.index()) {
            ids.push(id);
            groups.push((source, vec![(label, i == 0)]));
        }
    }
    groups
}

/// The range of a span inside `text`, on character borders.
fn clamp(text: &str, span: Span) -> Range<usize> {
    let border = |at: u32| {
        let mut at = (at as usize).min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let start = border(span.start);
    let end = border(span.end.min(span.start.saturating_add(LONGEST_MARK as u32))).max(start);
    start..end
}

/// A text as a terminal may get it: names, file contents and arguments may hold anything, and must neither move its
/// cursor nor turn the direction of writing. Lines and tabs stay.
#[must_use]
pub fn visible(text: &str) -> String {
    let hidden = |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    text.chars().map(|c| if c.is_control() && !"\n\t".contains(c) || hidden(c) { '\u{fffd}' } else { c }).collect()
}

/// Adds the place of an expression. Text written in place is marked itself. For a node that came out of a macro the
/// outermost use is marked with `text`, then the characters in the body, "inside the definition of `sigma`".
#[must_use]
pub fn at_expr(diagnostic: Diagnostic, expr: &Expr, expansions: &Expansions, text: impl Into<String>) -> Diagnostic {
    let Some(inner) = expr.expansion.and_then(|id| expansions.list.get(id.index())) else {
        return diagnostic.at(expr.span, text);
    };
    let mut outer = inner;
    // A parent is always an earlier entry, so the chain ends.
    while let Some(parent) = outer.parent.and_then(|id| expansions.list.get(id.index())) {
        outer = parent;
    }
    diagnostic.at(outer.call, text).at(expr.span, format!("inside the definition of `{}`", inner.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(text: &str, span: (u32, u32)) -> (Diagnostic, SourceMap) {
        let mut sources = SourceMap::new();
        let source = sources.add("scene.wfl", text);
        let d = Diagnostic::new(crate::Code::E107, "`**` is not an operator")
            .at(Span { source, start: span.0, end: span.1 }, "")
            .help("x^2, or sqr(x)");
        (d, sources)
    }

    #[test]
    fn looks_like_a_compiler_message() {
        let (d, sources) = example("# first\ndef gap = x**2/(2*R) - d\n", (19, 21));
        let expected = "\
error[E107]: `**` is not an operator
 --> scene.wfl:2:12
  |
2 | def gap = x**2/(2*R) - d
  |            ^^
  |
  = help: x^2, or sqr(x)
";
        assert_eq!(render(&d, &sources), expected);
        assert!(render_coloured(&d, &sources).contains("\u{1b}["));
    }

    #[test]
    fn any_span_is_clamped_to_characters() {
        let text = "param größe = 1 # °\n\tx\u{301} = \"μ\"\r\n\r\n\0end";
        let n = text.len() as u32;
        for start in 0..n + 3 {
            for end in [0, start, start + 1, start + 2, start + 7, n - 1, n, n + 1, u32::MAX] {
                let (d, sources) = example(text, (start, end));
                assert!(render(&d, &sources).contains("E107"));
            }
        }
        for text in ["", "\n", "\r\n", "é"] {
            for start in 0..4 {
                let (d, sources) = example(text, (start, u32::MAX));
                assert!(render(&d, &sources).contains("E107"));
            }
        }
    }

    #[test]
    fn labels_of_unknown_texts_are_left_out() {
        let (d, sources) = example("a\n", (0, 1));
        let d = d.at(Span { source: SourceId::new(7), start: 0, end: 1 }, "nowhere");
        assert!(!render(&d, &sources).contains("nowhere"));
    }

    #[test]
    fn places_in_two_files_are_both_shown() {
        let (d, mut sources) = example("term a on all : f(u)\n", (16, 20));
        let library = sources.add("laws.wfl", "def f(v) = v**2\n");
        let text = render(&d.at(Span { source: library, start: 12, end: 14 }, "here"), &sources);
        assert!(text.contains("scene.wfl:1:17") && text.contains("laws.wfl:1:13"), "{text}");
    }
}
