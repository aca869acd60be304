//! Text to syntax tree.
//!
//! A file is cut into statements at every line that starts in column 1; each statement is scanned for characters
//! and brackets, parsed alone, and reports its own first error, so one run shows the errors of all statements.
//! Parsing never panics, never overflows the stack and takes time linear in the text. Names are not looked up here.
//!
//! This module and its children are the only users of pest.

mod characters;
mod expression;
mod habits;
mod mesh;
mod scan;
mod slip;
mod statement;
mod terminal;

use pest::Parser as _;

use crate::{
    ast::{Expr, MacroDef, Script},
    diag::{Checked, Diagnostic},
    source::{SourceId, SourceMap, Span},
};
pub(crate) use scan::{Piece, cut};

/// Brackets, `if`s and the tree of one expression nest at most this deep; deeper text is an error (E119).
pub const NESTING_LIMIT: usize = 200;

/// Longest accepted text in bytes: a scene is written by hand, tables of numbers belong into files of their own.
pub const TEXT_LIMIT: usize = 4 << 20;

/// The grammar; its rules are seen by the children of this module only.
#[derive(pest_derive::Parser)]
#[grammar = "wfl.pest"]
struct Grammar;

/// A result inside the parser: the first error of a statement stops it.
type Parsed<T> = Result<T, Box<Diagnostic>>;
type Pair<'i> = pest::iterators::Pair<'i, Rule>;

/// A rule is entered at most 31 times a byte (measured on sums, lists, calls and nested parentheses), so this bound is
/// met by accident only; it turns an unforeseen slowness of the grammar into an error.
const CALL_LIMIT: usize = 64 * TEXT_LIMIT;

/// Parses a scene or library file. Items of statements without error are always returned, so the value is present
/// beside errors; included files are not read here.
#[must_use]
pub fn parse(sources: &SourceMap, id: SourceId) -> Checked<Script> {
    let text = sources.get(id).text.clone();
    let mut script = Script::default();
    let (pieces, mut diagnostics) = match cut(&text, id) {
        Ok(cut) => cut,
        Err(d) => {
            script.lost.add_everything();
            return Checked { value: Some(script), diagnostics: vec![*d] };
        }
    };
    // comments before the first statement belong to no piece
    let head = Piece { start: scan::text_start(&text), end: pieces.first().map_or(text.len(), |p| p.start) };
    if diagnostics.is_empty()
        && let Err(d) = scan::scan(&text, &head, id)
    {
        return Checked { value: Some(script), diagnostics: vec![*d] };
    }
    for stray in diagnostics.iter().flat_map(|d| &d.labels) {
        script.lost.add_statement(&text[stray.span.start as usize..stray.span.end as usize]);
    }
    let mut ended = Vec::new();
    for piece in &pieces {
        match parse_piece(piece, &text, id, &mut ended) {
            Ok(item) => script.items.push(item),
            Err(d) => {
                script.lost.add_statement(&text[piece.start..piece.end]);
                diagnostics.push(*d);
            }
        }
    }
    diagnostics.extend(habits::semicolons(&ended));
    diagnostics.sort_by_key(|d| d.labels.first().map(|l| l.span.start));
    Checked { value: Some(script), diagnostics }
}

/// The bytes of each statement from its first character in column 1 to the next statement, comments and blank lines
/// behind it included; none of a text that is too long.
#[must_use]
pub fn statement_ranges(text: &str) -> Vec<std::ops::Range<usize>> {
    let id = SourceMap::new().add("", "");
    let pieces = cut(text, id).map(|cut| cut.0).unwrap_or_default();
    pieces.into_iter().map(|p| p.start..p.end).collect()
}

/// One statement. A `;` behind it is told in `ended` and passed over: it hides nothing.
fn parse_piece(piece: &Piece, text: &str, id: SourceId, ended: &mut Vec<Span>) -> Parsed<crate::ast::Item> {
    let mut masked = scan::scan(text, piece, id)?;
    let length = masked.trim_end().len();
    if masked[..length].ends_with(';') {
        ended.push(span_at(id, piece.start, length - 1, length));
        masked.replace_range(length - 1..length, " ");
    }
    scan::known_statement(&masked, piece, id, &text[..piece.start])?;
    let pair = run(Rule::statement, &masked, piece.start, id)?;
    statement::Reader { masked: &masked, base: piece.start, source: id }.statement(pair)
}

/// Parses one expression, the whole text of `id` (a value of the command line, a piece of a reference case).
#[must_use]
pub fn parse_expr(sources: &SourceMap, id: SourceId) -> Checked<Expr> {
    parse_whole(sources, id, Rule::single, |reader, pair| {
        let expr = reader.parts(pair).into_iter().next().expect("a single expression holds an expression");
        reader.value(expr)
    })
}

/// Parses one GWFL assembly string: `Def a(b):=c; ... expr`.
#[must_use]
pub fn parse_gwfl(sources: &SourceMap, id: SourceId) -> Checked<(Vec<MacroDef>, Expr)> {
    parse_whole(sources, id, Rule::gwfl, |reader, pair| reader.defs_and_value(reader.parts(pair)))
}

fn parse_whole<T>(
    sources: &SourceMap,
    id: SourceId,
    rule: Rule,
    read: impl Fn(&statement::Reader<'_>, Pair<'_>) -> Parsed<T>,
) -> Checked<T> {
    let text = sources.get(id).text.clone();
    let start = scan::text_start(&text);
    let piece = Piece { start, end: text.len() };
    let parsed = scan::check_length(&text, id).and_then(|()| scan::scan(&text, &piece, id)).and_then(|masked| {
        let pair = run(rule, &masked, start, id)?;
        read(&statement::Reader { masked: &masked, base: start, source: id }, pair)
    });
    match parsed {
        Ok(value) => Checked::ok(value),
        Err(d) => Checked::fail(*d),
    }
}

/// Runs one rule of the grammar over masked text that starts at byte `base` of the source.
fn run(rule: Rule, masked: &str, base: usize, id: SourceId) -> Parsed<Pair<'_>> {
    pest::set_call_limit(std::num::NonZeroUsize::new(CALL_LIMIT));
    match Grammar::parse(rule, masked) {
        Ok(mut pairs) => Ok(pairs.next().expect("a successful parse gives the pair of its rule")),
        Err(e) => Err(Box::new(slip::explain(&e, masked, base, id, rule))),
    }
}

/// True for text that the grammar reads as one statement.
fn is_statement(masked: &str, id: SourceId) -> bool {
    run(Rule::statement, masked, 0, id).is_ok()
}

/// The span of `start..end` in a text that starts at byte `base` of the source.
fn span_at(id: SourceId, base: usize, start: usize, end: usize) -> Span {
    // Texts are at most TEXT_LIMIT bytes, so positions fit.
    Span { source: id, start: (base + start) as u32, end: (base + end) as u32 }
}

#[cfg(test)]
mod limits;
#[cfg(test)]
mod tests;
