//! Errors that follow from others.
//!
//! A statement with an error declares nothing, and what reads it finds other faces, dimensions or shapes than were meant.
//! Shapes that do not fit in several statements of the same field have one cause as a rule, a declaration: they are told
//! together, with that declaration. Works on the text alone.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    codes::Code,
    diag::Diagnostic,
    parse::statement_ranges,
    source::{SourceId, SourceMap},
    words::split_prefixes,
};

/// Shapes that do not fit.
const SHAPES: &[Code] = &[Code::E101, Code::E102, Code::E103, Code::E104, Code::E108];

/// What is not there where it is used: sides, normals, fields, points.
const PLACES: &[Code] = &[Code::E202, Code::E203, Code::E204, Code::E416];

/// What a word means at its place: of several messages at one place the first is enough.
const MEANINGS: &[Code] = &[Code::E201, Code::E205, Code::E216];

/// Errors of shapes that are compared with each other: who has more does not read them one by one.
const MOST: usize = 200;

/// A declared name: the words of its declaration, and its line if it is a field.
struct Declared<'t> {
    words: Vec<&'t str>,
    field: Option<(usize, &'t str)>,
}

/// Where a message is.
#[derive(Clone, Copy)]
struct Place<'t> {
    source: SourceId,
    statement: usize,
    /// The word that the statement starts with.
    head: &'t str,
    text: &'t str,
}

/// The messages without those that follow from others, and with shapes of one field told together.
pub(super) fn left(diagnostics: &[Diagnostic], sources: &SourceMap) -> Vec<Diagnostic> {
    if diagnostics.iter().filter(|d| d.is_error()).count() < 2 {
        return diagnostics.to_vec();
    }
    let mut cuts: BTreeMap<SourceId, Vec<std::ops::Range<usize>>> = BTreeMap::new();
    for label in diagnostics.iter().filter_map(|d| d.labels.first()) {
        cuts.entry(label.span.source).or_insert_with(|| statement_ranges(&sources.get(label.span.source).text));
    }
    let places: Vec<Option<Place<'_>>> = diagnostics.iter().map(|d| place(d, &cuts, sources)).collect();
    let causes = Causes::of(diagnostics, &places);
    let mut told: Vec<(usize, Diagnostic)> = Vec::new();
    let mut meant: BTreeSet<(SourceId, u32)> = BTreeSet::new();
    for (k, (d, place)) in diagnostics.iter().zip(&places).enumerate() {
        if !d.is_error() {
            told.push((k, d.clone()));
            continue;
        }
        let of_a_place = [SHAPES, PLACES, MEANINGS].iter().any(|codes| codes.contains(&d.code));
        let start = d.labels.first().filter(|_| of_a_place).map(|l| (l.span.source, l.span.start));
        let follows = place.is_some_and(|place| causes.explain(d.code, place));
        if !follows && start.is_none_or(|start| meant.insert(start)) {
            told.push((k, d.clone()));
        }
    }
    shapes_together(told, &places, &cuts, sources)
}

fn place<'t>(
    d: &Diagnostic,
    cuts: &BTreeMap<SourceId, Vec<std::ops::Range<usize>>>,
    sources: &'t SourceMap,
) -> Option<Place<'t>> {
    let span = d.labels.first()?.span;
    let ranges = &cuts[&span.source];
    let statement = ranges.partition_point(|r| r.start <= span.start as usize).checked_sub(1)?;
    let text = without_comments(sources.get(span.source).text.get(ranges[statement].clone())?);
    let head = words(text).next().unwrap_or("");
    Some(Place { source: span.source, statement, head, text })
}

/// Up to the comments and blank lines behind a statement; comments within stay.
fn without_comments(text: &str) -> &str {
    let mut end = 0;
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        at += line.len();
        if !line.trim().is_empty() && !line.trim_start().starts_with('#') {
            end = at;
        }
    }
    text[..end].trim_end()
}

/// Names in a text, without those in comments and quotes.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let code = text.lines().map(|line| line.split('#').next().unwrap_or(""));
    // every second piece is quoted
    let plain = code.flat_map(|line| line.split('"').step_by(2));
    let cut = |c: char| !c.is_ascii_alphanumeric() && c != '_';
    plain.flat_map(move |text| text.split(cut)).filter(|w| w.starts_with(|c: char| c.is_ascii_alphabetic()))
}

/// What errors there are that others can follow from.
struct Causes<'t> {
    /// Statements by their first word, with the codes of their errors.
    heads: BTreeMap<&'t str, BTreeSet<Code>>,
    /// The same of each statement.
    statements: BTreeMap<(SourceId, usize), BTreeSet<Code>>,
}

impl<'t> Causes<'t> {
    fn of(diagnostics: &[Diagnostic], places: &[Option<Place<'t>>]) -> Self {
        let mut causes = Causes { heads: BTreeMap::new(), statements: BTreeMap::new() };
        for (d, place) in diagnostics.iter().zip(places).filter(|(d, _)| d.is_error()) {
            if let Some(place) = place {
                causes.heads.entry(place.head).or_default().insert(d.code);
                causes.statements.entry((place.source, place.statement)).or_default().insert(d.code);
            }
        }
        causes
    }

    /// Some statement that starts with one of these words has an error that is none of `but`.
    fn any(&self, heads: &[&str], but: &[Code]) -> bool {
        heads.iter().filter_map(|head| self.heads.get(head)).flatten().any(|code| !but.contains(code))
    }

    /// True if an error of this code at this place follows from others.
    fn explain(&self, code: Code, place: Place<'_>) -> bool {
        // without a mesh the space has no dimension; a formula of it is told by the same codes
        let of_dimension = SHAPES.contains(&code) || code == Code::E205;
        if of_dimension && place.head != "mesh" {
            return self.any(&["mesh"], &[Code::E205]);
        }
        if code == Code::E425 {
            return self.any(&["term", "energy", "region", "unknown", "def"], &[Code::E425]);
        }
        if code == Code::E460 {
            return self.any(&["fix", "region"], &[Code::E460]);
        }
        if !PLACES.contains(&code) {
            return false;
        }
        let own = self.statements.get(&(place.source, place.statement));
        let but = [PLACES, &[Code::E425, Code::E460]].concat();
        let beside = own.is_some_and(|codes| codes.iter().any(|code| !but.contains(code)));
        // points of integration are those of the statements that integrate
        let points =
            [Code::E202, Code::E416].contains(&code) && self.any(&["term", "energy", "quadrature", "state"], &but);
        beside || points || self.any(&["region", "def", "unknown", "mesh"], &but)
    }
}

/// Errors of shapes of one cause.
struct Group<'t> {
    /// The fields that all of their statements have.
    fields: BTreeSet<&'t str>,
    /// The place of the first in the list.
    first: usize,
    /// The lines of the others.
    lines: BTreeSet<usize>,
}

/// Shapes that do not fit in statements of the same field become one message.
fn shapes_together(
    told: Vec<(usize, Diagnostic)>,
    places: &[Option<Place<'_>>],
    cuts: &BTreeMap<SourceId, Vec<std::ops::Range<usize>>>,
    sources: &SourceMap,
) -> Vec<Diagnostic> {
    if told.iter().filter(|(_, d)| d.is_error() && SHAPES.contains(&d.code)).count() < 2 {
        return told.into_iter().map(|(_, d)| d).collect();
    }
    let declared = declarations(cuts, sources);
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut out: Vec<Diagnostic> = Vec::new();
    let mut looked_at = 0;
    for (k, d) in told {
        let place = places[k].filter(|_| d.is_error() && SHAPES.contains(&d.code) && looked_at < MOST);
        looked_at += usize::from(place.is_some());
        let Some(place) = place else {
            out.push(d);
            continue;
        };
        let fields = fields_of(place.text, &declared);
        let same = groups.iter_mut().find(|g| !g.fields.is_disjoint(&fields));
        match same {
            Some(group) => {
                group.fields.retain(|field| fields.contains(field));
                group.lines.extend(d.labels.first().map(|l| sources.line_column(l.span).0));
            }
            None => {
                groups.push(Group { fields, first: out.len(), lines: BTreeSet::new() });
                out.push(d);
            }
        }
    }
    for Group { fields, first, mut lines } in groups {
        let d = &mut out[first];
        lines.retain(|line| d.labels.first().is_none_or(|l| sources.line_column(l.span).0 != *line));
        if lines.is_empty() {
            continue;
        }
        let list = lines.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let word = if lines.len() == 1 { "line" } else { "lines" };
        let of = fields.iter().filter_map(|field| declared.get(field)?.field);
        let of: Vec<String> = of.map(|(line, text)| format!("line {line}: {text}")).collect();
        d.notes.push(format!("shapes do not fit on {word} {list} either; common to them is {}", of.join(" and ")));
    }
    out
}

/// What the texts declare: fields, and definitions with what they are made of.
fn declarations<'t>(
    cuts: &BTreeMap<SourceId, Vec<std::ops::Range<usize>>>,
    sources: &'t SourceMap,
) -> BTreeMap<&'t str, Declared<'t>> {
    let mut declared = BTreeMap::new();
    for (source, ranges) in cuts {
        let all: &str = &sources.get(*source).text;
        let mut line = 1;
        let mut counted = 0;
        for range in ranges {
            let Some(text) = all.get(range.clone()).map(without_comments) else { continue };
            line += all[counted..range.start].matches('\n').count();
            counted = range.start;
            let mut list = words(text);
            match list.next() {
                Some("unknown" | "multiplier" | "state" | "data") => {
                    let names = text.split(':').next().unwrap_or("");
                    let shown = text.lines().next().unwrap_or("").split('#').next().unwrap_or("").trim();
                    for name in words(names).skip(1) {
                        declared.insert(name, Declared { words: Vec::new(), field: Some((line, shown)) });
                    }
                }
                Some("def") => {
                    if let Some(name) = list.next() {
                        declared.insert(name, Declared { words: list.collect(), field: None });
                    }
                }
                _ => {}
            }
        }
    }
    declared
}

/// The fields that a statement reads, through definitions too.
fn fields_of<'t>(text: &'t str, declared: &BTreeMap<&'t str, Declared<'t>>) -> BTreeSet<&'t str> {
    let mut fields = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut open: Vec<&str> = words(text).collect();
    while let Some(word) = open.pop() {
        let name = split_prefixes(word).1;
        let Some(found) = declared.get(name).filter(|_| seen.insert(name)) else { continue };
        if found.field.is_some() {
            fields.insert(name);
        }
        open.extend(&found.words);
    }
    fields
}
