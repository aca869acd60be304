//! What a scene declares: each name once, no name of the language, and the nearest one for a misspelt word.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    ast::{ExprKind, Ident, Item, ItemKind, MacroDef, MeshSource},
    codes::Code,
    diag::{Diagnostic, nearest},
    fix::Fix,
    foreign::field_slip,
    script::{Balance, Derivative, Event, ResolvedScript},
    source::{SourceMap, Span},
    words::{REGIONS, is_function, reserved, split_prefixes},
};

/// What a name was declared as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Param,
    Unknown,
    Multiplier,
    Data,
    State,
    Def,
    Measure,
    Mapping,
    Steps,
}

impl Kind {
    /// The word in messages.
    pub(super) fn word(self) -> &'static str {
        match self {
            Kind::Param => "param",
            Kind::Unknown => "unknown",
            Kind::Multiplier => "multiplier",
            Kind::Data => "data",
            Kind::State => "state",
            Kind::Def => "def",
            Kind::Measure => "measure",
            Kind::Mapping => "mapping",
            Kind::Steps => "the variable of `steps`",
        }
    }

    /// Something with degrees of freedom or values in space.
    pub(super) fn is_field(self) -> bool {
        matches!(self, Kind::Unknown | Kind::Multiplier | Kind::Data | Kind::State)
    }
}

/// All declared names. Values and regions are two worlds: `term contact on contact` is fine.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub(super) values: BTreeMap<String, (Kind, Span)>,
    pub(super) regions: BTreeMap<String, Span>,
    /// Regions may also come from the groups of a mesh file.
    pub(super) open_regions: bool,
}

/// Kind and name of a declaration of a value.
pub(super) fn declared(item: &Item) -> Option<(Kind, &Ident)> {
    Some(match &item.kind {
        ItemKind::Param { name, .. } => (Kind::Param, name),
        ItemKind::Unknown { name, .. } => (Kind::Unknown, name),
        ItemKind::Multiplier { name, .. } => (Kind::Multiplier, name),
        ItemKind::Data { name, .. } => (Kind::Data, name),
        ItemKind::State { name, .. } => (Kind::State, name),
        ItemKind::Def(def) => (Kind::Def, &def.name),
        ItemKind::Measure { name, .. } | ItemKind::Computed(name, ..) | ItemKind::Event { name, .. } => {
            (Kind::Measure, name)
        }
        ItemKind::Mapping { name, .. } => (Kind::Mapping, name),
        ItemKind::Steps { variable, .. } => (Kind::Steps, variable),
        _ => return None,
    })
}

/// The names of all terms, each once; terms without a name are numbered.
fn names_of_terms(items: &[Item]) -> Vec<String> {
    let mut names = Vec::new();
    let terms = items.iter().filter_map(|i| if let ItemKind::Term { name, .. } = &i.kind { Some(name) } else { None });
    for (k, name) in terms.enumerate() {
        let name = name.as_ref().map_or_else(|| format!("term{}", k + 1), |n| n.name.clone());
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

impl Names {
    /// Collects the declarations; a clash with another one or with the language is reported.
    pub(super) fn collect(items: &[Item], diagnostics: &mut Vec<Diagnostic>) -> Self {
        // what the mesh will hold is not known without one (E421)
        let open_regions = !items.iter().any(|i| matches!(i.kind, ItemKind::Mesh { .. }));
        let mut names = Names { open_regions, ..Names::default() };
        let mut dimension = 3;
        for item in items {
            if let ItemKind::Mesh { source, .. } = &item.kind {
                match source {
                    MeshSource::Files(_) => names.open_regions = true,
                    MeshSource::Box { from, .. } => {
                        if let ExprKind::Tensor(rows) = &from.kind {
                            dimension = rows.iter().map(Vec::len).sum();
                        }
                    }
                }
            }
        }
        for item in items {
            if let Some((kind, name)) = declared(item) {
                names.value(kind, name, dimension, diagnostics);
            }
            if let ItemKind::Event { name, .. } = &item.kind {
                for end in Event::NUMBERS {
                    let number = Ident { name: format!("{}{end}", name.name), span: name.span };
                    names.value(Kind::Measure, &number, dimension, diagnostics);
                }
            }
            if let ItemKind::Gradient(of) = &item.kind {
                for of in Derivative::all(&of.results, &of.parameters) {
                    let number = Ident { name: of.name, span: of.measure.span };
                    names.value(Kind::Measure, &number, dimension, diagnostics);
                }
            }
            if let ItemKind::Balance { name, .. } = &item.kind {
                for (end, _) in Balance::parts(names_of_terms(items).iter().map(String::as_str)) {
                    let number = Ident { name: format!("{}_{end}", name.name), span: name.span };
                    names.value(Kind::Measure, &number, dimension, diagnostics);
                }
            }
            if let ItemKind::Scheme { options, .. } = &item.kind
                && let Some(option) = options.iter().find(|o| o.name.name == "energy")
            {
                for name in ResolvedScript::energies_of(&names_of_terms(items)) {
                    let number = Ident { name, span: option.name.span };
                    names.value(Kind::Measure, &number, dimension, diagnostics);
                }
            }
            if let ItemKind::Region { name, .. } = &item.kind {
                names.region(name, diagnostics);
            }
            if let ItemKind::Def(def) = &item.kind {
                check_formals(def, diagnostics);
            }
        }
        names
    }

    fn value(&mut self, kind: Kind, name: &Ident, dimension: usize, diagnostics: &mut Vec<Diagnostic>) {
        let coordinate = ["x", "y", "z"].iter().take(dimension).any(|c| *c == name.name);
        let taken = reserved(&name.name).or_else(|| coordinate.then(|| "a coordinate".to_owned()));
        if let Some(what) = taken {
            diagnostics.push(built_in(name, &what));
            return;
        }
        match self.values.get(&name.name) {
            // A second `steps` is an error of its own.
            Some((Kind::Steps, _)) if kind == Kind::Steps => {}
            Some((_, first)) => diagnostics.push(twice(name, *first)),
            None => {
                self.values.insert(name.name.clone(), (kind, name.span));
            }
        }
    }

    fn region(&mut self, name: &Ident, diagnostics: &mut Vec<Diagnostic>) {
        if REGIONS.contains(&name.name.as_str()) {
            diagnostics.push(built_in(name, "built in"));
        } else if let Some(first) = self.regions.get(&name.name) {
            diagnostics.push(twice(name, *first));
        } else {
            self.regions.insert(name.name.clone(), name.span);
        }
    }

    /// Checks the macros of one term: they may hide macros of the scene and nothing else.
    pub(super) fn check_locals(&self, defs: &[MacroDef], diagnostics: &mut Vec<Diagnostic>) {
        let mut seen: BTreeMap<&str, Span> = BTreeMap::new();
        for def in defs {
            check_formals(def, diagnostics);
            let name = &def.name;
            if let Some(what) = reserved(&name.name) {
                diagnostics.push(built_in(name, &what));
            } else if let Some(first) = seen.insert(&name.name, name.span) {
                diagnostics.push(twice(name, first));
            } else if let Some((kind, first)) = self.values.get(&name.name)
                && *kind != Kind::Def
            {
                let message = format!("the local macro `{}` would hide a name of the scene", name.name);
                let d = Diagnostic::new(Code::E209, message).at(name.span, "");
                diagnostics.push(d.at(*first, format!("{} of that name", kind.word())));
            }
        }
    }

    /// E201 for a word that is no region.
    pub(super) fn unknown_region(&self, name: &Ident, sources: &SourceMap) -> Diagnostic {
        let d = Diagnostic::new(Code::E201, format!("unknown region `{}`", name.name));
        let phrases = ["cells", "faces", "nodes", "interface"];
        let built_in = REGIONS.iter().copied().filter(|r| *r != "global");
        let known = self.regions.keys().map(String::as_str).chain(built_in).chain(phrases);
        let d = match nearest(&name.name, known) {
            None => d.at(name.span, ""),
            Some(near) => {
                let text = offer(near, "region", self.regions.get(near).copied(), name.span, sources);
                d.at(name.span, text).replace(name.span, near)
            }
        };
        match self.values.get(&name.name) {
            Some((kind, _)) => d.note(format!("`{}` is {}, not a region", name.name, article(*kind))),
            None => d,
        }
    }

    /// E201 for a word that is no field, or E212 for one that is something else.
    pub(super) fn not_a_field(&self, name: &Ident, needed: &str, sources: &SourceMap) -> Diagnostic {
        if let Some((kind, at)) = self.values.get(&name.name) {
            let d = Diagnostic::new(Code::E212, format!("`{}` is {}; {needed}", name.name, article(*kind)));
            return d.at(name.span, "").at(*at, "declared here");
        }
        let d = Diagnostic::new(Code::E201, format!("unknown field `{}`", name.name));
        let fields = self.values.iter().filter(|(_, v)| v.0.is_field());
        let names: Vec<&str> = fields.map(|(n, _)| n.as_str()).collect();
        if let Some(slip) = field_slip(&name.name, names.iter().copied()) {
            let d = d.at(name.span, slip.text);
            return slip.component.into_iter().fold(d, |d, meant| d.replace(name.span, meant));
        }
        match nearest(&name.name, names) {
            None => d.at(name.span, ""),
            Some(near) => {
                let (kind, at) = self.values[near];
                d.at(name.span, offer(near, kind.word(), Some(at), name.span, sources)).replace(name.span, near)
            }
        }
    }
}

/// "a param", "an unknown", "data".
pub(super) fn article(kind: Kind) -> String {
    match kind {
        Kind::Data | Kind::Steps => kind.word().to_owned(),
        Kind::Unknown => "an unknown".to_owned(),
        _ => format!("a {}", kind.word()),
    }
}

/// "did you mean `gamma`, param on line 6?"
pub(super) fn offer(near: &str, kind: &str, at: Option<Span>, from: Span, sources: &SourceMap) -> String {
    match at {
        None => format!("did you mean `{near}`?"),
        Some(at) => {
            let line = sources.line_column(at).0;
            let file =
                if at.source == from.source { String::new() } else { format!(" of {}", sources.get(at.source).name) };
            format!("did you mean `{near}`, {kind} on line {line}{file}?")
        }
    }
}

fn twice(name: &Ident, first: Span) -> Diagnostic {
    let d = Diagnostic::new(Code::E209, format!("`{}` is declared twice", name.name));
    if name.span == first {
        // the numbers of a balance
        let text = "a term has the name of a sum of this balance";
        return d.at(name.span, text).help("another name for the term than `in`, `out` or `lost`");
    }
    d.at(name.span, "").at(first, "first declared here")
}

fn built_in(name: &Ident, what: &str) -> Diagnostic {
    Diagnostic::new(Code::E210, format!("`{}` is {what} and cannot be declared", name.name))
        .at(name.span, "")
        .help("choose another name")
}

/// Parameters shadow everything but must be different from each other and be no function.
fn check_formals(def: &MacroDef, diagnostics: &mut Vec<Diagnostic>) {
    let mut seen: BTreeMap<&str, Span> = BTreeMap::new();
    for formal in &def.formals {
        if let Some(first) = seen.insert(&formal.name, formal.span) {
            diagnostics.push(twice(formal, first));
        }
        let (prefix, _) = split_prefixes(&formal.name);
        if is_function(&formal.name) {
            diagnostics.push(built_in(formal, "a built-in function"));
        } else if !prefix.is_empty() {
            diagnostics.push(built_in(formal, &format!("read as `{prefix}` of a field")));
        }
    }
}

/// W702 for names that no statement needs; only those of the scene itself, since files are shared.
pub(super) fn unused(
    names: &Names,
    main: crate::source::SourceId,
    words: &BTreeSet<String>,
    regions: &BTreeSet<String>,
    used_macros: &BTreeSet<String>,
) -> Vec<Diagnostic> {
    let mut found: Vec<(Span, &str)> = Vec::new();
    for (name, (kind, span)) in &names.values {
        let needed = match kind {
            Kind::Measure | Kind::Steps => true,
            Kind::Def => used_macros.contains(name),
            _ => words.contains(name),
        };
        if !needed {
            let text = match kind {
                Kind::Unknown | Kind::Multiplier => "no term or output uses it",
                Kind::Data | Kind::State | Kind::Param => "no term, load or output uses it",
                _ => "no statement uses it",
            };
            found.push((*span, text));
        }
    }
    found
        .extend(names.regions.iter().filter(|(n, _)| !regions.contains(*n)).map(|(_, s)| (*s, "no statement uses it")));
    found.retain(|(span, _)| span.source == main);
    found.sort_by_key(|(span, _)| span.start);
    let warning = |(span, text)| {
        let d = Diagnostic::new(Code::W702, "declared but not needed by this scene").at(span, text);
        d.fix(Fix::DeleteStatement)
    };
    found.into_iter().map(warning).collect()
}
