//! Messages at their places.

use lsp_types::{DiagnosticRelatedInformation, DiagnosticSeverity, DiagnosticTag, Location, NumberOrString, Range};
use wfl::{Code, Diagnostic, SourceId, Span, unquoted};

use crate::{analysis::Analysis, lines::Lines, places};

/// The messages of one file of a scene. A message is told where its first mark in a text of the scene is; one without a
/// mark at the start of the scene.
pub(crate) fn of_file(analysis: &Analysis, file: SourceId, messages: &[Diagnostic]) -> Vec<lsp_types::Diagnostic> {
    let text = &analysis.sources.get(file).text;
    let lines = Lines::new(text);
    let mut list: Vec<lsp_types::Diagnostic> = Vec::new();
    for message in messages {
        let home = home(analysis, message);
        if home.map_or(analysis.script.main, |span| span.source) != file {
            continue;
        }
        let range = home.map_or_else(Range::default, |s| lines.range(text, s.start as usize, s.end as usize));
        let told = one(analysis, message, home, range);
        if !list.contains(&told) {
            list.push(told);
        }
    }
    list
}

/// The place of a message.
pub(crate) fn home(analysis: &Analysis, message: &Diagnostic) -> Option<Span> {
    let own = |span: &Span| !analysis.is_library(span.source);
    message.labels.iter().map(|l| l.span).find(own)
}

fn one(analysis: &Analysis, message: &Diagnostic, home: Option<Span>, range: Range) -> lsp_types::Diagnostic {
    let plain = |text: &str| unquoted(text, &analysis.sources);
    let mut text = plain(&message.message);
    for label in message.labels.iter().filter(|l| Some(l.span) == home && !l.text.is_empty()) {
        text.push_str(&format!("\n{}", plain(&label.text)));
    }
    message.notes.iter().for_each(|n| text.push_str(&format!("\nnote: {}", plain(n))));
    message.helps.iter().for_each(|h| text.push_str(&format!("\nhelp: {}", plain(h))));
    let others: Vec<DiagnosticRelatedInformation> = message
        .labels
        .iter()
        .filter(|l| Some(l.span) != home)
        .filter_map(|l| {
            let location = location(analysis, l.span)?;
            let text = if l.text.is_empty() { "here, too".to_owned() } else { plain(&l.text) };
            Some(DiagnosticRelatedInformation { location, message: text })
        })
        .collect();
    let severity = if message.is_error() { DiagnosticSeverity::ERROR } else { DiagnosticSeverity::WARNING };
    lsp_types::Diagnostic {
        range,
        severity: Some(severity),
        code: Some(NumberOrString::String(message.code.to_string())),
        source: Some("wfl".to_owned()),
        message: text,
        related_information: (!others.is_empty()).then_some(others),
        tags: (message.code == Code::W702).then(|| vec![DiagnosticTag::UNNECESSARY]),
        ..lsp_types::Diagnostic::default()
    }
}

/// A place of any text of a scene.
pub(crate) fn location(analysis: &Analysis, span: Span) -> Option<Location> {
    let source = analysis.sources.get(span.source);
    let range = Lines::new(&source.text).range(&source.text, span.start as usize, span.end as usize);
    Some(Location { uri: places::address_of(&source.name)?, range })
}
