//! What can stand at the cursor: statements at the start of a line, regions behind `on`, options behind `with`, names and
//! functions in expressions.

use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionItemLabelDetails, CompletionResponse, Documentation,
    InsertTextFormat, MarkupContent, MarkupKind, Position,
};
use wfl::{CONSTANTS, FORMATS, LIBRARY, OPTIONS, REGIONS, SCHEMES, SOLVERS, STATEMENTS, statement_rows};
use wfl_compiler::functions;

use crate::{
    features::docs,
    symbols::{Key, Kind, Occurrence},
    view::View,
};

/// Where in a statement the cursor is.
#[derive(Debug, PartialEq, Eq)]
enum Slot<'t> {
    /// The first word of a line.
    Statement,
    /// The name of a file behind `use`.
    File,
    /// A text in quotes, or a comment: nothing is offered.
    Nothing,
    /// A region.
    Region,
    /// An option of this statement.
    Option(&'t str),
    /// One of some words.
    Words(&'static [&'static str]),
    /// An expression.
    Expression,
}

/// Words of a rank, and elements.
const SPACES: &[&str] =
    &["scalar", "vector", "matrix", "P1", "P2", "P3", "Q1", "Q2", "Q3", "DP0", "DP1", "DQ0", "DQ1", "global", "on"];

/// What a region is made of.
const ENTITIES: &[&str] = &["cells where", "faces where", "nodes where", "interface from", "interface along"];

const REDUCTIONS: &[&str] = &["mean", "max", "min", "integral", "value", "reaction"];

const SHAPES: &[&str] = &["quad", "tri", "hex", "tet", "segment", "map"];

pub(crate) fn complete(view: &View<'_>, position: Position) -> CompletionResponse {
    let offset = view.offset(position);
    let slot = slot(&view.text[..offset]);
    let items = match slot {
        Slot::Statement => statements(),
        Slot::File => used(view),
        Slot::Nothing => Vec::new(),
        Slot::Region => regions(view),
        Slot::Option(statement) => options(statement),
        Slot::Words(words) => words.iter().map(|w| plain(w, CompletionItemKind::KEYWORD, docs::word(w))).collect(),
        Slot::Expression => expression(view, offset),
    };
    CompletionResponse::Array(items)
}

/// What can stand behind a text.
fn slot(before: &str) -> Slot<'_> {
    let line = before.rsplit('\n').next().unwrap_or(before);
    if line.starts_with("use") && line.matches('"').count() == 1 {
        return Slot::File;
    }
    if line.matches('"').count() % 2 == 1 || line.contains('#') {
        return Slot::Nothing;
    }
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let written = before.trim_end_matches(is_word);
    if written.is_empty() || written.ends_with('\n') {
        return Slot::Statement;
    }
    let start = wfl::statement_ranges(before).last().map_or(0, |r| r.start);
    let statement = &written[start.min(written.len())..];
    let first = statement.split(|c| !is_word(c)).next().unwrap_or("");
    let head = statement.trim_end();
    let last = head.rsplit(|c: char| c.is_whitespace()).next().unwrap_or("");
    if let Some(slot) = after_word(first, last, head) {
        return slot;
    }
    if let Some((_, options)) = head.rsplit_once(" with")
        && (options.is_empty() || head.ends_with(','))
    {
        return Slot::Option(first);
    }
    match (first, head.ends_with(':'), head.ends_with('=')) {
        ("unknown" | "multiplier" | "data" | "state", true, _) => Slot::Words(SPACES),
        ("region", _, true) => Slot::Words(ENTITIES),
        ("measure", _, true) => Slot::Words(REDUCTIONS),
        ("output", _, _) if head == "output" => Slot::Words(FORMATS),
        ("scheme", _, _) if head == "scheme" => Slot::Words(SCHEMES),
        ("scheme", _, _) => Slot::Option("scheme"),
        ("solver", _, _) if head == "solver" => Slot::Words(SOLVERS),
        ("mesh", _, _) if head == "mesh" => Slot::Words(&["box", "file"]),
        ("mesh", _, _) if statement.ends_with("] ") && head.contains("cells") => Slot::Words(SHAPES),
        _ => Slot::Expression,
    }
}

/// What follows a word that is followed by regions.
fn after_word<'t>(first: &str, last: &str, head: &str) -> Option<Slot<'t>> {
    let regions = match last {
        "on" | "of" | "onto" | "across" => true,
        "from" | "to" => matches!(first, "region" | "mapping"),
        "along" => first == "region",
        _ if head.ends_with(',') => {
            // a list of regions goes on behind its comma
            let on = head.rfind(" on ").or_else(|| head.rfind(" across "));
            on.is_some_and(|k| {
                head[k..]
                    .trim_start()
                    .split_once(' ')
                    .is_some_and(|(_, list)| !list.contains([':', '=', '(', '[', '.']))
            })
        }
        "+" | "-" | "&" if first == "region" => true,
        _ => false,
    };
    regions.then_some(Slot::Region)
}

fn markdown(value: String) -> Documentation {
    Documentation::MarkupContent(MarkupContent { kind: MarkupKind::Markdown, value })
}

fn plain(label: &str, kind: CompletionItemKind, doc: Option<String>) -> CompletionItem {
    CompletionItem {
        label: label.to_owned(),
        kind: Some(kind),
        documentation: doc.map(markdown),
        ..CompletionItem::default()
    }
}

/// A call with its parameters to be filled in.
fn call(name: &str, head: &str, kind: CompletionItemKind) -> CompletionItem {
    let formals = docs::formals(head);
    let mut item = plain(name, kind, None);
    if formals.is_empty() {
        return item;
    }
    let slots: Vec<String> =
        formals.iter().enumerate().map(|(k, f)| format!("${{{}:{}}}", k + 1, escaped(f))).collect();
    item.insert_text = Some(format!("{name}({})", slots.join(", ")));
    item.insert_text_format = Some(InsertTextFormat::SNIPPET);
    let signature = Some(format!("({})", formals.join(", ")));
    item.label_details = Some(CompletionItemLabelDetails { detail: signature, description: None });
    item
}

/// A text inside a snippet.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('$', "\\$").replace('}', "\\}")
}

fn statements() -> Vec<CompletionItem> {
    let item = |word: &&str| {
        let mut item = plain(word, CompletionItemKind::KEYWORD, docs::statement(word));
        item.detail = statement_rows().iter().find(|r| r.word == *word).map(|r| r.usage.replace('`', ""));
        item.insert_text = Some(format!("{word} "));
        item
    };
    STATEMENTS.iter().map(item).collect()
}

/// Files beside the scene, and the library.
fn used(view: &View<'_>) -> Vec<CompletionItem> {
    let beside = view.state.files.beside(&view.path);
    let names = beside.iter().filter_map(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    let mut items: Vec<CompletionItem> = names.map(|n| plain(&n, CompletionItemKind::FILE, None)).collect();
    for (name, text) in LIBRARY {
        let about: Vec<&str> = text.lines().skip(1).take_while(|l| l.starts_with('#')).collect();
        let about = about.iter().map(|l| l.trim_start_matches('#').trim()).collect::<Vec<_>>().join("\n");
        items.push(plain(name.trim_end_matches(".wfl"), CompletionItemKind::MODULE, Some(about)));
    }
    items
}

fn regions(view: &View<'_>) -> Vec<CompletionItem> {
    let built_in = REGIONS.iter().map(|r| plain(r, CompletionItemKind::CONSTANT, docs::word(r)));
    let names = view.analysis.names();
    let declared = names.all().filter(|o| matches!(o.key, Key::Region(_)));
    let declared = declared.map(|o| known(view, o, CompletionItemKind::CLASS));
    let groups = view.analysis.script.groups.iter().map(|g| plain(&g.name, CompletionItemKind::CLASS, None));
    let mut items: Vec<CompletionItem> = declared.chain(groups).chain(built_in).collect();
    items.sort_by(|a, b| a.label.cmp(&b.label));
    items.dedup_by(|a, b| a.label == b.label);
    items
}

fn options(statement: &str) -> Vec<CompletionItem> {
    let names = OPTIONS.iter().find(|o| o.0 == statement).map_or(&[][..], |o| o.1);
    names.iter().map(|n| plain(n, CompletionItemKind::PROPERTY, docs::word(n))).collect()
}

/// A declared name with what it is.
fn known(view: &View<'_>, name: &Occurrence, kind: CompletionItemKind) -> CompletionItem {
    let head = docs::head(view.analysis, name);
    let mut item = call(name.key.name(), &head, kind);
    item.detail = name.declares.map(|k| k.word().to_owned());
    let statement = view.analysis.sources.snippet(name.statement).trim_end();
    item.documentation = Some(markdown(docs::code(statement.split("\n#").next().unwrap_or(statement))));
    item
}

/// Names, fields with their prefixes, built-in values and functions.
fn expression(view: &View<'_>, offset: usize) -> Vec<CompletionItem> {
    let mut items = Vec::new();
    for name in view.analysis.names().all() {
        let kind = match name.declares {
            Some(Kind::Def) => CompletionItemKind::FUNCTION,
            Some(Kind::Formal) if encloses(name, view, offset) => CompletionItemKind::VARIABLE,
            Some(Kind::Formal | Kind::Region | Kind::Term) | None => continue,
            Some(Kind::Param | Kind::Steps) => CompletionItemKind::CONSTANT,
            Some(Kind::Measure) => CompletionItemKind::VALUE,
            Some(_) => CompletionItemKind::FIELD,
        };
        if matches!(name.key, Key::Local(..)) && !encloses(name, view, offset) {
            continue;
        }
        items.push(known(view, name, kind));
        let solved = matches!(name.declares, Some(Kind::Unknown | Kind::Multiplier));
        if solved || name.declares == Some(Kind::Formal) {
            let field = name.key.name();
            for prefix in ["Test_", "Grad_", "Grad_Test_", "Div_", "Div_Test_", "Previous_", "Dot_", "Dot2_"] {
                items.push(plain(&format!("{prefix}{field}"), CompletionItemKind::FIELD, docs::word(prefix)));
            }
        }
    }
    items.extend(CONSTANTS.iter().map(|c| plain(c, CompletionItemKind::CONSTANT, docs::word(c))));
    items.extend(functions().map(|op| {
        let mut item = call(op.name, op.usage.split(" or ").next().unwrap_or(op.usage), CompletionItemKind::FUNCTION);
        item.detail = Some(op.usage.to_owned());
        item.documentation = Some(markdown(op.doc.to_owned()));
        item
    }));
    items
}

/// True if the statement of a name is around the cursor.
fn encloses(name: &Occurrence, view: &View<'_>, offset: usize) -> bool {
    let start = name.statement.start as usize;
    let inside =
        start <= offset && wfl::statement_ranges(view.text).iter().any(|r| r.contains(&start) && offset <= r.end);
    name.span.source == view.id && inside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_the_cursor_says_what_is_offered() {
        for (text, expected) in [
            ("", Slot::Statement),
            ("mesh box\nter", Slot::Statement),
            ("use \"con", Slot::File),
            ("output vtk \"na", Slot::Nothing),
            ("param a = 1 # te", Slot::Nothing),
            ("term a on ", Slot::Region),
            ("fix u = 0 on west, e", Slot::Region),
            ("split u across fa", Slot::Region),
            ("region f = interface from le", Slot::Region),
            ("region f = left + ", Slot::Region),
            ("steps t = 0 to 1 by 0.1 with ", Slot::Option("steps")),
            ("solver newton with tol=1e-8, ma", Slot::Option("solver")),
            ("unknown u : ve", Slot::Words(SPACES)),
            ("measure m = ", Slot::Words(REDUCTIONS)),
            ("region r = fa", Slot::Words(ENTITIES)),
            ("term a on all : Grad", Slot::Expression),
            ("steps t = 0 to ", Slot::Expression),
            ("def f(a, b) = a + ", Slot::Expression),
            ("term a on all : f(u, ", Slot::Expression),
            ("fix u(1), ", Slot::Expression),
        ] {
            assert_eq!(slot(text), expected, "{text:?}");
        }
    }
}
