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

/// Statements that cannot be read.
const SYNTAX: &[Code] = &[Code::E113, Code::E114, Code::E115, Code::E116, Code::E117, Code::E118, Code::E121];

/// What is not there where it is used: sides, normals, fields, points.
const PLACES: &[Code] = &[Code::E202, Code::E203, Code::E204, Code::E416];

/// What a word means at its place: of several messages at one place the first is enough.
const MEANINGS: &[Code] = &[Code::E201, Code::E205, Code::E216];

/// Statements with errors of shapes that are compared with each other, and statements of a scene in which that is done: who
/// has more does not read them one by one.
const MOST: usize = 200;
const MOST_STATEMENTS: usize = 2000;

/// A declared field or definition.
struct Declared<'t> {
    /// What it is made of.
    words: Vec<&'t str>,
    is_field: bool,
    line: usize,
    /// The first line of its declaration.
    text: &'t str,
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
    let mut meant = BTreeSet::new();
    for (k, (d, place)) in diagnostics.iter().zip(&places).enumerate() {
        if !d.is_error() {
            told.push((k, d.clone()));
            continue;
        }
        let follows = place.is_some_and(|place| causes.explain(d.code, place)) || causes.lost(d);
        if !follows && same_place(d, *place).is_none_or(|start| meant.insert(start)) {
            told.push((k, d.clone()));
        }
    }
    if !told.iter().any(|(_, d)| d.is_error()) {
        // two that would explain each other: nothing is left out
        return diagnostics.to_vec();
    }
    shapes_together(told, &places, &cuts, sources)
}

/// Where the first of several messages is enough: the same place, and for what is not there the same statement.
fn same_place(d: &Diagnostic, place: Option<Place<'_>>) -> Option<(SourceId, usize, bool)> {
    if PLACES.contains(&d.code) {
        return place.map(|place| (place.source, place.statement, true));
    }
    let of_a_place = SHAPES.contains(&d.code) || MEANINGS.contains(&d.code);
    d.labels.first().filter(|_| of_a_place).map(|l| (l.span.source, l.span.start as usize, false))
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
    /// The second words of statements that cannot be read: what they would have declared, perhaps.
    unread: Vec<&'t str>,
    /// Some region is unknown.
    region: bool,
    /// The corners of the box do not say which dimension the space has.
    dimension: bool,
}

impl<'t> Causes<'t> {
    fn of(diagnostics: &[Diagnostic], places: &[Option<Place<'t>>]) -> Self {
        let mut causes = Causes {
            heads: BTreeMap::new(),
            statements: BTreeMap::new(),
            unread: Vec::new(),
            region: false,
            dimension: false,
        };
        for (d, place) in diagnostics.iter().zip(places).filter(|(d, _)| d.is_error()) {
            causes.dimension |= d.code == Code::E408 && d.message.starts_with("the corners of a box");
            causes.region |= d.code == Code::E201 && d.message.starts_with("unknown region");
            if let Some(place) = place {
                if SYNTAX.contains(&d.code) {
                    causes.unread.extend(words(place.text).nth(1));
                }
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

    /// True if a name may be one that a statement which cannot be read declares: `sn` of `def snv) = ..`, `water_lost` of
    /// a balance `water`, `energy_heat` of a term `heat`.
    fn lost(&self, d: &Diagnostic) -> bool {
        let quoted = || d.message.split('`').nth(1);
        let Some(name) = d.about.as_deref().or_else(quoted).filter(|_| [Code::E201, Code::E216].contains(&d.code))
        else {
            return false;
        };
        let part = |whole: &str, word: &str| {
            whole.strip_prefix(word).is_some_and(|rest| rest.starts_with('_'))
                || whole.strip_suffix(word).is_some_and(|rest| rest.ends_with('_'))
        };
        let energy = name.starts_with("energy_") && self.any(&["term", "energy", "def"], &[]);
        energy || self.unread.iter().any(|word| word.starts_with(name) || part(name, word))
    }

    /// True if an error of this code at this place follows from others.
    fn explain(&self, code: Code, place: Place<'_>) -> bool {
        let own = |codes: &[Code]| {
            let there = self.statements.get(&(place.source, place.statement));
            there.is_some_and(|there| there.iter().any(|code| codes.contains(code)))
        };
        if self.dimension && (SHAPES.contains(&code) || [Code::E205, Code::E501].contains(&code)) {
            return true;
        }
        match code {
            Code::E425 => self.any(&["term", "energy", "region", "unknown", "def"], &[Code::E425]),
            // a reaction without the prescribed values or the unknown that it is of
            Code::E460 => {
                self.heads.values().flatten().any(|code| SYNTAX.contains(code) || *code == Code::E423)
                    || self.any(&["fix", "region", "unknown"], &[Code::E460])
            }
            // a balance of a field that is no scalar, where its terms are told
            Code::E462 => self.heads.values().flatten().any(|code| SHAPES.contains(code)),
            // a rate that no term has, where a term cannot be read
            Code::E454 | Code::E457 => self.any(&["term", "energy", "def"], &[code]),
            Code::E414 => own(&[Code::E201]),
            Code::E452 => own(&[Code::E457]),
            code if PLACES.contains(&code) => self.explains_places(code, place),
            _ => false,
        }
    }

    fn explains_places(&self, code: Code, place: Place<'_>) -> bool {
        let but = [PLACES, &[Code::E425, Code::E460]].concat();
        let there = self.statements.get(&(place.source, place.statement));
        let beside = there.is_some_and(|codes| codes.iter().any(|code| !but.contains(code)));
        // points of integration are those of the statements that integrate
        let points =
            [Code::E202, Code::E416].contains(&code) && self.any(&["term", "energy", "quadrature", "state"], &but);
        beside || points || self.region || self.any(&["region", "def", "unknown", "mesh"], &but)
    }
}

/// Errors of shapes of one cause.
struct Group<'t> {
    /// The declarations that all of their statements read.
    names: BTreeSet<&'t str>,
    /// The place of the first in the list.
    first: usize,
    /// The lines of the others.
    lines: BTreeSet<usize>,
}

/// Shapes that do not fit in statements of the same declaration become one message, where that is what is wrong.
fn shapes_together(
    told: Vec<(usize, Diagnostic)>,
    places: &[Option<Place<'_>>],
    cuts: &BTreeMap<SourceId, Vec<std::ops::Range<usize>>>,
    sources: &SourceMap,
) -> Vec<Diagnostic> {
    let of_shape = |(k, d): &(usize, Diagnostic)| places[*k].filter(|_| d.is_error() && SHAPES.contains(&d.code));
    let wrong: BTreeSet<(SourceId, usize)> =
        told.iter().filter_map(of_shape).map(|place| (place.source, place.statement)).collect();
    if wrong.len() < 2 || wrong.len() > MOST || cuts.values().map(Vec::len).sum::<usize>() > MOST_STATEMENTS {
        return told.into_iter().map(|(_, d)| d).collect();
    }
    let declared = declarations(cuts, sources);
    let suspects = suspects(&wrong, &declared, cuts, sources);
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut out: Vec<Diagnostic> = Vec::new();
    for (k, d) in told {
        let place = places[k].filter(|_| d.is_error() && SHAPES.contains(&d.code));
        let names: BTreeSet<&str> = place
            .map(|place| read_by(place.text, &declared))
            .into_iter()
            .flatten()
            .filter(|n| suspects.contains(n))
            .collect();
        match groups.iter_mut().find(|g| !g.names.is_disjoint(&names)) {
            Some(group) => {
                group.names.retain(|name| names.contains(name));
                group.lines.extend(d.labels.first().map(|l| sources.line_column(l.span).0));
            }
            None => {
                groups.push(Group { names, first: out.len(), lines: BTreeSet::new() });
                out.push(d);
            }
        }
    }
    for Group { names, first, mut lines } in groups {
        let d = &mut out[first];
        lines.retain(|line| d.labels.first().is_none_or(|l| sources.line_column(l.span).0 != *line));
        if lines.is_empty() {
            continue;
        }
        let list = lines.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let word = if lines.len() == 1 { "line" } else { "lines" };
        // of definitions and fields in them it is the field
        let fields = names.iter().any(|name| declared[name].is_field);
        let of = names.iter().map(|name| &declared[name]).filter(|d| d.is_field || !fields);
        let of: Vec<String> = of.map(|d| format!("line {}: {}", d.line, d.text)).collect();
        d.notes.push(format!("shapes do not fit on {word} {list} either; common to them is {}", of.join(" and ")));
    }
    out
}

/// Declarations that may be what is wrong: as many statements that read them have an error of shapes as have none. Three
/// errors are seldom made one by one, and measures of a norm or of a component fit any shape: a quarter is enough then.
fn suspects<'t>(
    wrong: &BTreeSet<(SourceId, usize)>,
    declared: &BTreeMap<&'t str, Declared<'t>>,
    cuts: &BTreeMap<SourceId, Vec<std::ops::Range<usize>>>,
    sources: &'t SourceMap,
) -> BTreeSet<&'t str> {
    let mut readers: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for (source, ranges) in cuts {
        let all: &str = &sources.get(*source).text;
        for (k, range) in ranges.iter().enumerate() {
            let Some(text) = all.get(range.clone()).map(without_comments) else { continue };
            // what only names a field or writes it says nothing of its shape
            if words(text).next().is_none_or(|head| DECLARE.contains(&head) || head == "def" || head == "output") {
                continue;
            }
            for name in read_by(text, declared) {
                let count = readers.entry(name).or_default();
                count[usize::from(wrong.contains(&(*source, k)))] += 1;
            }
        }
    }
    let is_wrong = |right: usize, wrong: usize| wrong > 1 && wrong >= right || wrong > 2 && 3 * wrong >= right;
    readers.into_iter().filter(|(_, [right, wrong])| is_wrong(*right, *wrong)).map(|(name, _)| name).collect()
}

/// Statements that declare fields.
const DECLARE: &[&str] = &["unknown", "multiplier", "state", "data"];

/// What the texts declare: fields, and definitions with what they are made of.
fn declarations<'t>(
    cuts: &BTreeMap<SourceId, Vec<std::ops::Range<usize>>>,
    sources: &'t SourceMap,
) -> BTreeMap<&'t str, Declared<'t>> {
    let mut declared = BTreeMap::new();
    for (source, ranges) in cuts {
        let all: &str = &sources.get(*source).text;
        let (mut line, mut counted) = (1, 0);
        for range in ranges {
            let Some(text) = all.get(range.clone()).map(without_comments) else { continue };
            line += all[counted..range.start].matches('\n').count();
            counted = range.start;
            let shown = text.lines().next().unwrap_or("").split('#').next().unwrap_or("").trim();
            let mut list = words(text);
            match list.next() {
                Some(head) if DECLARE.contains(&head) => {
                    for name in words(text.split(':').next().unwrap_or("")).skip(1) {
                        declared.insert(name, Declared { words: Vec::new(), is_field: true, line, text: shown });
                    }
                }
                Some("def") => {
                    if let Some(name) = list.next() {
                        declared.insert(name, Declared { words: list.collect(), is_field: false, line, text: shown });
                    }
                }
                _ => {}
            }
        }
    }
    declared
}

/// The declarations that a statement reads, through definitions too.
fn read_by<'t>(text: &'t str, declared: &BTreeMap<&'t str, Declared<'t>>) -> BTreeSet<&'t str> {
    let mut seen = BTreeSet::new();
    let mut open: Vec<&str> = words(text).collect();
    while let Some(word) = open.pop() {
        let name = split_prefixes(word).1;
        if let Some((name, found)) = declared.get_key_value(name).filter(|(name, _)| !seen.contains(*name)) {
            seen.insert(*name);
            open.extend(&found.words);
        }
    }
    seen
}
