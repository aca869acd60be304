//! Names of a text: where each is declared and used. Works on the syntax tree; in statements that cannot be read every
//! word counts, so that a name is not lost while it is typed.

use wfl::{
    Source, SourceId, SourceMap, Span,
    ast::{
        AtSteps, BoxDivision, Domain, Gradients, MappingKind, MeasureAt, Place, QuadratureRule, Rank, Target,
        TargetPart,
    },
    ast::{Cond, Expr, Ident, Item, ItemKind, MacroDef, MeshSource, OptionItem, OptionValue, RegionExpr, Space},
    cond_children, each_word, split_prefixes,
};

/// What a name was declared as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Param,
    Unknown,
    Multiplier,
    Data,
    State,
    Def,
    Measure,
    Mapping,
    Steps,
    Region,
    Term,
    /// A parameter of a macro.
    Formal,
}

impl Kind {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Kind::Param => "param",
            Kind::Unknown => "unknown",
            Kind::Multiplier => "multiplier",
            Kind::Data => "data",
            Kind::State => "state",
            Kind::Def => "def",
            Kind::Measure => "measure",
            Kind::Mapping => "mapping",
            Kind::Steps => "step variable",
            Kind::Region => "region",
            Kind::Term => "term",
            Kind::Formal => "parameter of a def",
        }
    }

    pub(crate) fn is_field(self) -> bool {
        matches!(self, Kind::Unknown | Kind::Multiplier | Kind::Data | Kind::State)
    }
}

/// Which names are the same: values, regions and terms are three worlds; macros inside a term and parameters of macros
/// are known by the start of the macro or term that they belong to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Key {
    Value(String),
    Region(String),
    Term(String),
    Local(usize, u32, String),
}

impl Key {
    pub(crate) fn name(&self) -> &str {
        match self {
            Key::Value(name) | Key::Region(name) | Key::Term(name) | Key::Local(_, _, name) => name,
        }
    }
}

/// A name at a place; prefixes such as `Grad_` are not part of it.
#[derive(Clone, Debug)]
pub(crate) struct Occurrence {
    pub(crate) span: Span,
    pub(crate) key: Key,
    /// What it declares, if it does.
    pub(crate) declares: Option<Kind>,
    /// The statement of a declaration.
    pub(crate) statement: Span,
}

/// The occurrences of a text, in its order.
pub(crate) fn occurrences(sources: &SourceMap, id: SourceId) -> Vec<Occurrence> {
    let parsed = wfl::parse(sources, id).value.unwrap_or_default();
    let mut reader =
        Reader { source: sources.get(id), id, found: Vec::new(), scopes: Vec::new(), statement: whole(id, 0, 0) };
    for item in &parsed.items {
        reader.statement = item.span;
        reader.item(item);
    }
    for range in wfl::statement_ranges(&reader.source.text) {
        if !parsed.items.iter().any(|i| range.contains(&(i.span.start as usize))) {
            reader.broken(range.start, range.end);
        }
    }
    reader.found.sort_by_key(|o| (o.span.start, o.span.end));
    reader.found
}

fn whole(source: SourceId, start: usize, end: usize) -> Span {
    // texts are at most 4 MB
    Span { source, start: start as u32, end: end as u32 }
}

/// Names that are known inside a macro or a term only, and where that starts.
struct Scope<'a> {
    start: u32,
    names: Vec<&'a str>,
}

struct Reader<'a> {
    source: &'a Source,
    id: SourceId,
    found: Vec<Occurrence>,
    scopes: Vec<Scope<'a>>,
    statement: Span,
}

/// Regions are named by the words behind these.
const BEFORE_REGIONS: &[&str] = &["on", "of", "across", "onto", "from", "to", "along"];

impl<'a> Reader<'a> {
    fn add(&mut self, span: Span, key: Key, declares: Option<Kind>) {
        self.found.push(Occurrence { span, key, declares, statement: self.statement });
    }

    fn declare(&mut self, name: &Ident, kind: Kind) {
        let key = match kind {
            Kind::Region => Key::Region(name.name.clone()),
            Kind::Term => Key::Term(name.name.clone()),
            _ => Key::Value(name.name.clone()),
        };
        self.add(name.span, key, Some(kind));
    }

    fn value(&mut self, name: &Ident) {
        self.add(name.span, Key::Value(name.name.clone()), None);
    }

    fn region(&mut self, name: &Ident) {
        self.add(name.span, Key::Region(name.name.clone()), None);
    }

    fn regions(&mut self, names: &[Ident]) {
        names.iter().for_each(|n| self.region(n));
    }

    fn word(&mut self, e: &Expr, word: &str) {
        let local =
            |scopes: &[Scope<'_>], name: &str| scopes.iter().rev().find(|s| s.names.contains(&name)).map(|s| s.start);
        let (prefix, root) = split_prefixes(word);
        // a name that looks prefixed cannot be declared, so the rest is the name
        let span = Span { start: e.span.start + prefix.len() as u32, ..e.span };
        let key = match local(&self.scopes, root) {
            Some(start) => Key::Local(self.id.index(), start, root.to_owned()),
            None => Key::Value(root.to_owned()),
        };
        self.add(span, key, None);
    }

    fn expr(&mut self, e: &Expr) {
        let mut words: Vec<(&Expr, &str)> = Vec::new();
        each_word(e, &mut |e, word| words.push((e, word)));
        for (e, word) in words {
            self.word(e, word);
        }
    }

    fn exprs<'e>(&mut self, list: impl IntoIterator<Item = &'e Expr>) {
        list.into_iter().for_each(|e| self.expr(e));
    }

    fn cond(&mut self, c: &Cond) {
        let mut parts = Vec::new();
        cond_children(c, &mut |e| parts.push(e));
        self.exprs(parts);
    }

    fn options(&mut self, options: &[OptionItem]) {
        for option in options {
            if let Some(OptionValue::Expr(e)) = &option.value {
                self.expr(e);
            }
            self.regions(&option.places);
        }
    }

    fn space(&mut self, space: &Space) {
        match &space.rank {
            Rank::Vector(Some(n)) => self.expr(n),
            Rank::Matrix(Some((m, n))) => self.exprs([m, n]),
            _ => {}
        }
        if let Place::On(places) = &space.place {
            self.regions(places);
        }
    }

    /// A macro: its parameters are known in its body.
    fn def(&mut self, def: &'a MacroDef, start: u32) {
        for formal in &def.formals {
            let key = Key::Local(self.id.index(), start, formal.name.clone());
            self.add(formal.span, key, Some(Kind::Formal));
        }
        self.scopes.push(Scope { start, names: def.formals.iter().map(|f| f.name.as_str()).collect() });
        self.expr(&def.body);
        self.scopes.pop();
    }

    fn region_expr(&mut self, region: &RegionExpr) {
        match region {
            RegionExpr::Name(name) => self.region(name),
            RegionExpr::Interface { from, to, .. } => {
                self.region(from);
                self.region(to);
            }
            RegionExpr::Along { surface, towards, .. } => {
                self.region(surface);
                self.exprs(towards);
            }
            RegionExpr::Picked { of, condition, .. } => {
                of.iter().for_each(|o| self.region(o));
                condition.iter().for_each(|c| self.cond(c));
            }
            RegionExpr::Combine(first, rest) => {
                self.region_expr(first);
                rest.iter().for_each(|part| self.region_expr(&part.1));
            }
        }
    }

    fn targets(&mut self, targets: &[Target]) {
        for target in targets {
            self.value(&target.field);
            if let TargetPart::Component(e) = &target.part {
                self.expr(e);
            }
        }
    }

    fn item<'i: 'a>(&mut self, item: &'i Item) {
        match &item.kind {
            ItemKind::Version(_) | ItemKind::Use { .. } | ItemKind::StartFrom { .. } => {}
            ItemKind::Mesh { .. } | ItemKind::Refine(_) | ItemKind::Region { .. } | ItemKind::Mapping { .. } => {
                self.geometry(&item.kind);
            }
            ItemKind::Term { .. } | ItemKind::Fix { .. } | ItemKind::Load { .. } | ItemKind::Start { .. } => {
                self.equation(&item.kind);
            }
            ItemKind::Steps { .. }
            | ItemKind::Scheme { .. }
            | ItemKind::Solver { .. }
            | ItemKind::Quadrature { .. } => self.request(&item.kind),
            ItemKind::Measure { .. }
            | ItemKind::Computed(..)
            | ItemKind::Balance { .. }
            | ItemKind::Event { .. }
            | ItemKind::Gradient(_)
            | ItemKind::Expect(_)
            | ItemKind::Output { .. } => self.request(&item.kind),
            _ => self.declaration(&item.kind),
        }
    }

    fn geometry(&mut self, kind: &ItemKind) {
        match kind {
            ItemKind::Mesh { source, map, options } => {
                if let MeshSource::Box { from, to, division, .. } = source {
                    let (BoxDivision::Cells(n) | BoxDivision::Size(n)) = division;
                    self.exprs([from, to, n]);
                }
                self.exprs(source.placing());
                self.exprs(map);
                self.options(options);
            }
            ItemKind::Refine(what) => {
                self.regions(&what.places);
                what.condition.iter().for_each(|c| self.cond(c));
                self.exprs(&what.times);
            }
            ItemKind::Region { name, region } => {
                self.declare(name, Kind::Region);
                self.region_expr(region);
            }
            ItemKind::Mapping { name, kind, options } => {
                self.declare(name, Kind::Mapping);
                match kind {
                    MappingKind::Point(e) => self.expr(e),
                    MappingKind::Search { from, onto, moving, within, .. } => {
                        self.region(from);
                        self.region(onto);
                        moving.iter().for_each(|field| self.value(field));
                        self.exprs(within);
                    }
                }
                self.options(options);
            }
            _ => {}
        }
    }

    fn declaration<'i: 'a>(&mut self, kind: &'i ItemKind) {
        match kind {
            ItemKind::Param { name, value, domain, .. } => {
                self.declare(name, Kind::Param);
                self.expr(value);
                match domain {
                    Some(Domain::Range(a, b)) => self.exprs([a, b]),
                    Some(Domain::Set(list)) => self.exprs(list),
                    None => {}
                }
            }
            ItemKind::Unknown { name, space } => {
                self.declare(name, Kind::Unknown);
                self.space(space);
            }
            ItemKind::Multiplier { name, space, options } => {
                self.declare(name, Kind::Multiplier);
                self.space(space);
                self.options(options);
            }
            ItemKind::Data { name, space, value } => {
                self.declare(name, Kind::Data);
                self.space(space);
                if let Some(OptionValue::Expr(e)) = value {
                    self.expr(e);
                }
            }
            ItemKind::State { name, space, update } => {
                self.declare(name, Kind::State);
                self.space(space);
                self.expr(update);
            }
            ItemKind::Split(fields, places) => {
                fields.iter().for_each(|f| self.value(f));
                self.regions(places);
            }
            ItemKind::Def(def) => {
                self.declare(&def.name, Kind::Def);
                self.def(def, def.name.span.start);
            }
            _ => {}
        }
    }

    fn equation<'i: 'a>(&mut self, kind: &'i ItemKind) {
        match kind {
            ItemKind::Term { name, places, defs, expr, .. } => {
                name.iter().for_each(|n| self.declare(n, Kind::Term));
                self.regions(places);
                let start = self.statement.start;
                self.scopes.push(Scope { start, names: defs.iter().map(|d| d.name.name.as_str()).collect() });
                for def in defs {
                    let key = Key::Local(self.id.index(), start, def.name.name.clone());
                    self.add(def.name.span, key, Some(Kind::Def));
                    self.def(def, def.name.span.start);
                }
                self.expr(expr);
                self.scopes.pop();
            }
            ItemKind::Fix { targets, value, places } | ItemKind::Load { targets, value, places } => {
                self.targets(targets);
                self.expr(value);
                self.regions(places);
            }
            ItemKind::Start { field, value } => {
                // of `Dot_u` the name of the field is what stands behind the prefix
                let (prefix, root) = wfl::split_prefixes(&field.name);
                let start = field.span.start + u32::try_from(prefix.len()).unwrap_or(0);
                self.value(&Ident { name: root.to_owned(), span: Span { start, ..field.span } });
                self.expr(value);
            }
            _ => {}
        }
    }

    fn request(&mut self, kind: &ItemKind) {
        match kind {
            ItemKind::Steps { variable, from, to, by, options, .. } => {
                self.declare(variable, Kind::Steps);
                self.exprs([from, to]);
                self.exprs((!wfl::is_auto(by)).then_some(by));
                self.options(options);
            }
            ItemKind::Scheme { options, .. } | ItemKind::Solver { options, .. } => self.options(options),
            ItemKind::Quadrature { places, segments, rule } => {
                self.regions(places);
                segments.iter().for_each(|mapping| self.value(mapping));
                if let QuadratureRule::Degree(e) = rule {
                    self.expr(e);
                }
            }
            ItemKind::Measure { name, expr, places, at, .. } => {
                self.declare(name, Kind::Measure);
                self.expr(expr);
                self.regions(places);
                if let MeasureAt::Point(x) = at {
                    self.expr(x);
                }
            }
            ItemKind::Computed(name, expr, places) => {
                self.declare(name, Kind::Measure);
                self.expr(expr);
                self.regions(places);
            }
            ItemKind::Balance { name, fields } => {
                self.declare(name, Kind::Measure);
                fields.iter().for_each(|field| self.value(field));
            }
            ItemKind::Event { name, condition, places } => {
                self.declare(name, Kind::Measure);
                self.cond(condition);
                self.regions(places);
            }
            ItemKind::Gradient(of) => self.gradient(of),
            ItemKind::Expect(condition) => self.cond(condition),
            ItemKind::Output { every, when, items, along, at, options, .. } => {
                self.exprs(every.iter().chain(at));
                when.iter().for_each(|e| self.value(e));
                self.exprs(items.iter().map(|i| &i.expr));
                if let Some((from, to)) = along {
                    self.exprs([from, to]);
                }
                self.options(options);
            }
            _ => {}
        }
    }

    fn gradient(&mut self, of: &Gradients) {
        of.results.iter().map(|r| &r.measure).chain(&of.parameters).chain(&of.fields).for_each(|n| self.value(n));
        for result in &of.results {
            if let AtSteps::At(variable, value) = &result.at {
                variable.iter().for_each(|n| self.value(n));
                self.expr(value);
            }
        }
    }

    /// The words of a statement that cannot be read; the second one of a declaration is declared.
    fn broken(&mut self, start: usize, end: usize) {
        self.statement = whole(self.id, start, end);
        let text = &self.source.text[start..end];
        let kind = match text.split(|c: char| !c.is_ascii_alphanumeric()).next().unwrap_or("") {
            "param" => Some(Kind::Param),
            "unknown" => Some(Kind::Unknown),
            "multiplier" => Some(Kind::Multiplier),
            "data" => Some(Kind::Data),
            "state" => Some(Kind::State),
            "def" => Some(Kind::Def),
            "measure" | "balance" | "event" => Some(Kind::Measure),
            "mapping" => Some(Kind::Mapping),
            "steps" => Some(Kind::Steps),
            "region" => Some(Kind::Region),
            _ => None,
        };
        let mut before = "";
        for (k, (at, word)) in words(text).enumerate() {
            let span = whole(self.id, start + at, start + at + word.len());
            let (prefix, root) = split_prefixes(word);
            let named = Ident { name: root.to_owned(), span: Span { start: span.start + prefix.len() as u32, ..span } };
            match kind {
                _ if k == 0 => {}
                Some(kind) if k == 1 && !wfl::is_keyword(word) => self.declare(&named, kind),
                _ if BEFORE_REGIONS.contains(&before) => self.region(&named),
                _ => self.value(&named),
            }
            before = word;
        }
    }
}

/// The words of a text outside comments and quotes, with their places.
pub(crate) fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            let rest = &text[at..];
            let c = rest.chars().next()?;
            let length = match c {
                '#' => rest.find('\n').unwrap_or(rest.len()),
                '"' => rest[1..].find(['"', '\n']).map_or(rest.len(), |k| k + 2),
                c if c.is_ascii_alphanumeric() || c == '_' => {
                    let end = |c: char| !c.is_ascii_alphanumeric() && c != '_';
                    let n = rest.find(end).unwrap_or(rest.len());
                    if !c.is_ascii_digit() {
                        let found = (at, &rest[..n]);
                        at += n;
                        return Some(found);
                    }
                    n
                }
                c => c.len_utf8(),
            };
            at += length;
        }
    })
}
