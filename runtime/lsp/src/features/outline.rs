//! The statements of a text: for the outline, for folding, and the lenses above them.

use lsp_types::{
    CodeLens, Command, DocumentSymbol, DocumentSymbolResponse, FoldingRange, FoldingRangeKind, SymbolKind,
};
use serde_json::Value;

use crate::{
    symbols::{Kind, Occurrence},
    view::View,
};

/// The command that runs a scene.
pub(crate) const RUN: &str = "wfl.run";

/// The command that checks a scene.
pub(crate) const CHECK: &str = "wfl.check";

/// All statements but comments, in order.
pub(crate) fn symbols(view: &View<'_>) -> DocumentSymbolResponse {
    let declared: Vec<&Occurrence> =
        view.analysis.names().of(view.id).iter().filter(|o| o.declares.is_some()).collect();
    let mut list = Vec::new();
    for range in wfl::statement_ranges(view.text) {
        let text = &view.text[range.clone()];
        let end = range.start + code_length(text);
        let name =
            declared.iter().find(|o| range.contains(&(o.span.start as usize)) && o.declares != Some(Kind::Formal));
        let first = text.split(|c: char| !c.is_ascii_alphanumeric()).next().unwrap_or("");
        let line = text.lines().next().unwrap_or("").trim_end();
        let (shown, selection) = match name {
            Some(o) => (o.key.name().to_owned(), view.range(o.span)),
            None => (line.to_owned(), view.lines.range(view.text, range.start, range.start + first.len())),
        };
        if shown.is_empty() {
            continue;
        }
        #[expect(deprecated, reason = "a field that the protocol still has")]
        list.push(DocumentSymbol {
            name: shown,
            detail: name.map(|_| first.to_owned()),
            kind: kind(name.and_then(|o| o.declares), first),
            tags: None,
            deprecated: None,
            range: view.lines.range(view.text, range.start, end),
            selection_range: selection,
            children: None,
        });
    }
    DocumentSymbolResponse::Nested(list)
}

fn kind(declared: Option<Kind>, statement: &str) -> SymbolKind {
    match (declared, statement) {
        (Some(Kind::Param | Kind::Steps), _) => SymbolKind::CONSTANT,
        (Some(Kind::Def), _) => SymbolKind::FUNCTION,
        (Some(Kind::Region), _) => SymbolKind::CLASS,
        (Some(Kind::Mapping), _) => SymbolKind::INTERFACE,
        (Some(Kind::Measure), _) => SymbolKind::NUMBER,
        (Some(kind), _) if kind.is_field() => SymbolKind::FIELD,
        (_, "term" | "energy") => SymbolKind::OPERATOR,
        (_, "use" | "mesh" | "output") => SymbolKind::FILE,
        _ => SymbolKind::PROPERTY,
    }
}

/// Bytes of a statement without the comments and blank lines behind it.
fn code_length(text: &str) -> usize {
    let (mut end, mut at) = (0, 0);
    for line in text.split_inclusive('\n') {
        let content = line.trim();
        if !content.is_empty() && !content.starts_with('#') {
            end = at + line.trim_end().len();
        }
        at += line.len();
    }
    end
}

/// Statements of several lines, and blocks of comments.
pub(crate) fn folds(view: &View<'_>) -> Vec<FoldingRange> {
    let mut list = Vec::new();
    for range in wfl::statement_ranges(view.text) {
        let end = range.start + code_length(&view.text[range.clone()]);
        list.push((view.lines.range(view.text, range.start, end), None));
    }
    let mut at = 0;
    let mut block: Option<(usize, usize)> = None;
    for line in view.text.split_inclusive('\n').chain([""]) {
        match (&mut block, line.starts_with('#')) {
            (Some(block), true) => block.1 = at + line.trim_end().len(),
            (None, true) => block = Some((at, at + line.trim_end().len())),
            (_, false) => {
                let done = block.take().map(|b| view.lines.range(view.text, b.0, b.1));
                list.extend(done.map(|range| (range, Some(FoldingRangeKind::Comment))));
            }
        }
        at += line.len();
    }
    let fold = |(range, kind): (lsp_types::Range, Option<FoldingRangeKind>)| FoldingRange {
        start_line: range.start.line,
        end_line: range.end.line,
        kind,
        ..FoldingRange::default()
    };
    list.into_iter().filter(|f| f.0.end.line > f.0.start.line).map(fold).collect()
}

/// `Run` and `Check` at the top of a scene; nothing at a file that others use.
pub(crate) fn lenses(view: &View<'_>) -> Vec<CodeLens> {
    if view.root != view.path || view.analysis.script.terms.is_empty() {
        return Vec::new();
    }
    let range = lsp_types::Range::default();
    let lens = |title: &str, command: &str| CodeLens {
        range,
        command: Some(Command {
            title: title.to_owned(),
            command: command.to_owned(),
            arguments: Some(vec![Value::from(view.uri.as_str())]),
        }),
        data: None,
    };
    vec![lens("Run", RUN), lens("Check", CHECK)]
}
