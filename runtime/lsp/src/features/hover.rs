//! What is under the cursor: the name, the word of the language, and the expression around it.

use lsp_types::{Hover, HoverContents, MarkupContent, MarkupKind, Position, Range};
use wfl::{STATEMENTS, split_prefixes, word_meaning};

use crate::{features::docs, symbols::Kind, symbols::words, view::View};

pub(crate) fn hover(view: &View<'_>, position: Position) -> Option<Hover> {
    let offset = view.offset(position);
    let word = words(view.text).find(|w| w.0 <= offset && offset <= w.0 + w.1.len());
    let mut parts: Vec<String> = Vec::new();
    let mut range: Option<Range> = None;
    if let Some((start, word)) = word {
        parts.extend(of_word(view, start, word));
        range = Some(view.lines.range(view.text, start, start + word.len()));
    }
    if let Some(known) = view.analysis.expression_at(view.id, offset) {
        let text = view.analysis.sources.snippet(known.span);
        let shown = one_line(text);
        parts.push(format!("`{shown}`: {}", docs::about(&known.about)));
        range = range.or_else(|| Some(view.range(known.span)));
    }
    if parts.is_empty() {
        return None;
    }
    let contents = MarkupContent { kind: MarkupKind::Markdown, value: parts.join("\n\n---\n\n") };
    Some(Hover { contents: HoverContents::Markup(contents), range })
}

/// What a word means.
fn of_word(view: &View<'_>, start: usize, word: &str) -> Vec<String> {
    let column_one = start == 0 || view.text.as_bytes().get(start - 1) == Some(&b'\n');
    if column_one && (STATEMENTS.contains(&word) || word == "wfl") {
        let term = statement_facts(view, start);
        return docs::statement(word).into_iter().chain(term).collect();
    }
    let (prefixes, root) = split_prefixes(word);
    let names = view.analysis.names();
    let name = names.of(view.id).iter().find(|o| o.span.start as usize == start + prefixes.len());
    let mut parts = Vec::new();
    if !prefixes.is_empty() && name.is_some() {
        parts.extend(each_prefix(prefixes).into_iter().filter_map(|p| Some(format!("`{p}`: {}.", word_meaning(p)?))));
    }
    let declared = name.and_then(|n| names.declaration(&n.key));
    match declared {
        Some(d) if d.declares == Some(Kind::Formal) => parts.extend(docs::formal(view.analysis, &d.key)),
        Some(d) => {
            let problem = view.state.check_of(&view.root).and_then(|c| c.problem.as_ref());
            parts.push(docs::declared(view.analysis, problem, d));
        }
        None => parts.extend(docs::function(word).or_else(|| docs::word(word)).or_else(|| docs::word(root))),
    }
    parts
}

/// What a check found of the term that starts here.
fn statement_facts(view: &View<'_>, start: usize) -> Option<String> {
    let checked = view.state.check_of(&view.root)?.problem.as_ref()?;
    let here = |t: &&crate::check::TermFacts| t.span.source == view.id && t.span.start as usize == start;
    checked.terms.iter().find(here).map(docs::term)
}

fn each_prefix(prefixes: &str) -> Vec<&'static str> {
    let mut rest = prefixes;
    let mut found = Vec::new();
    while let Some(p) = wfl::PREFIXES.iter().find(|p| rest.starts_with(**p)) {
        found.push(*p);
        rest = &rest[p.len()..];
    }
    found
}

/// A text on one line, cut where it is long.
fn one_line(text: &str) -> String {
    /// Characters shown.
    const SHOWN: usize = 60;
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= SHOWN {
        return line;
    }
    line.chars().take(SHOWN).chain("...".chars()).collect()
}
