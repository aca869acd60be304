//! Syntax trees to a resolved script: files included, macros expanded, names of statements checked.
//!
//! Every statement is checked even when another one is wrong. Words inside expressions are left to the compiler,
//! which knows shapes and places; here only macros among them are replaced.

mod elsewhere;
mod gradient;
mod include;
mod names;
mod options;
mod parts;
mod statements;
mod tables;
mod watch;

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    ast::{
        Cond, Expr, ExprKind, Ident, Item, ItemKind, MeasureAt, OutputItem, Reduction, RegionExpr, Target, TargetPart,
    },
    codes::Code,
    diag::{Checked, Diagnostic, nearest},
    fix::Fix,
    lost::Lost,
    macros::Expander,
    script::{Balance, Condition, Event, MacroInfo, Measure, OutputQuantity, Region, ResolvedScript},
    source::{SourceId, SourceMap, Span},
    units::check_units,
    walk::{cond_children, each_name as names_of},
    words::{REGIONS, split_prefixes},
};
use include::{Includes, Origin};
pub use include::{LIBRARY, Loader, NoFiles, Unloaded};
use names::{Kind, Names};

/// A value given from outside, such as `gamma=1e4` on the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// The param.
    pub name: String,
    /// Its new value.
    pub value: Expr,
    /// The place of the whole override, in a source named `(command line)`.
    pub span: Span,
}

/// The options each statement takes. A statement that is not listed takes none.
pub const OPTIONS: &[(&str, &[&str])] = &[
    ("mesh", &["idle_cells"]),
    ("multiplier", &["crosspoints"]),
    ("steps", &["count", "error", "first", "halve", "least", "limit", "most", "on_fail"]),
    ("scheme", &["alpha", "beta", "energy", "fraction", "gamma", "massless", "rho_inf"]),
    ("solver", &["accuracy", "amg", "cg", "direct", "gmres", "max_iter", "of", "perturb", "search", "tol"]),
    ("output", &["points"]),
];

/// What may stand where a place is named.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Allowed {
    Regions,
    /// Also `global`: what needs no place.
    RegionsAndGlobal,
}

/// Formats of `output`.
pub const FORMATS: &[&str] = &["vtk", "csv"];

/// Schemes of time integration.
pub const SCHEMES: &[&str] = &["backward_euler", "bdf2", "bdf3", "newmark", "hht", "generalised_alpha", "explicit"];

/// Methods of `solver`.
pub const SOLVERS: &[&str] = &["newton", "linear"];

/// Resolves the scene `main`. Files it uses are added to `sources`. The value is present beside errors, without the
/// statements that are wrong, so that later stages can find more.
#[must_use]
pub fn resolve(
    sources: &mut SourceMap,
    main: SourceId,
    loader: &mut dyn Loader,
    overrides: &[Override],
) -> Checked<ResolvedScript> {
    let mut includes = Includes::new(sources, &mut *loader);
    includes.read(main, Origin::Scene);
    let (items, mut diagnostics, lost, replaced) = includes.finish();
    let complete = !diagnostics.iter().any(Diagnostic::is_error);
    let names = Names::collect(&items, &mut diagnostics);
    let defs = || items.iter().filter_map(|i| if let ItemKind::Def(d) = &i.kind { Some(d) } else { None });
    let mut resolver = Resolver {
        sources,
        loader,
        names: &names,
        expander: Expander::new(sources, defs()),
        words: BTreeSet::new(),
        regions: BTreeSet::new(),
        reduces: false,
        diagnostics,
        complete,
        script: ResolvedScript { lost, ..empty(main) },
    };
    resolver.no_unknown(&items);
    for item in &items {
        // `None` drops a statement whose error is already reported.
        let _ = resolver.item(item);
    }
    resolver.overrides(overrides);
    resolver.sort_regions();
    resolver.missing(&items);
    let used = resolver.expander.used().to_vec();
    resolver.diagnostics.extend(replaced.in_use(resolver.sources, defs().zip(used.iter().copied())));
    let info =
        |(d, used): (&crate::ast::MacroDef, &bool)| MacroInfo { name: d.name.clone(), head: d.head, used: *used };
    resolver.script.macros = defs().zip(&used).map(info).collect();
    resolver.exact_solutions(&defs().collect::<Vec<_>>());
    resolver.finish(main)
}

fn empty(main: SourceId) -> ResolvedScript {
    ResolvedScript {
        main,
        mesh: None,
        refinements: Vec::new(),
        params: Vec::new(),
        regions: Vec::new(),
        mappings: Vec::new(),
        fields: Vec::new(),
        groups: Vec::new(),
        splits: Vec::new(),
        terms: Vec::new(),
        fixes: Vec::new(),
        loads: Vec::new(),
        starts: Vec::new(),
        steps: None,
        solver: None,
        scheme: None,
        quadratures: Vec::new(),
        measures: Vec::new(),
        computed: Vec::new(),
        balances: Vec::new(),
        events: Vec::new(),
        gradients: Vec::new(),
        expects: Vec::new(),
        outputs: Vec::new(),
        macros: Vec::new(),
        expansions: crate::ast::Expansions::default(),
        tables: Vec::new(),
        lost: Lost::default(),
    }
}

struct Resolver<'d> {
    sources: &'d SourceMap,
    loader: &'d mut dyn Loader,
    names: &'d Names,
    expander: Expander<'d>,
    /// Words of expanded expressions, without prefixes.
    words: BTreeSet<String>,
    /// Regions that some statement names.
    regions: BTreeSet<String>,
    diagnostics: Vec<Diagnostic>,
    /// Reductions, such as `integral(V)`, may stand in the expressions that are read now.
    reduces: bool,
    /// Every statement could be read.
    complete: bool,
    script: ResolvedScript,
}

impl<'d> Resolver<'d> {
    fn finish(mut self, main: SourceId) -> Checked<ResolvedScript> {
        self.diagnostics.append(&mut self.expander.diagnostics);
        let broken = self.diagnostics.iter().any(Diagnostic::is_error);
        if !broken {
            let used = self.script.macros.iter().filter(|m| m.used).map(|m| m.name.name.clone()).collect();
            self.diagnostics.extend(names::unused(self.names, main, &self.words, &self.regions, &used));
        }
        self.measures_of_balances();
        self.lose_dropped();
        self.script.expansions = self.expander.expansions;
        // two terms of one equation cannot be compared when one of them is missing
        let told = |d: &Diagnostic| !broken || d.is_error();
        self.diagnostics.extend(check_units(&self.script, self.sources).into_iter().filter(told));
        let place = |d: &Diagnostic| d.labels.first().map(|l| (l.span.source.index(), l.span.start));
        self.diagnostics.sort_by_key(place);
        Checked { value: Some(self.script), diagnostics: self.diagnostics }
    }

    /// `exact`, `exact_u` of an unknown and `exact_slip` of an output are what `wfl sweep --reference exact` compares with:
    /// they and what they are made of are needed, though no statement says so.
    fn exact_solutions(&mut self, defs: &[&crate::ast::MacroDef]) {
        let compared = |name: &str| {
            let unknown = |f: &crate::script::Field| f.name.name == name;
            let item = |i: &OutputQuantity| i.name == name;
            self.script.fields.iter().any(unknown) || self.script.outputs.iter().flat_map(|o| &o.items).any(item)
        };
        let is_exact = |name: &str| name == "exact" || name.strip_prefix("exact_").is_some_and(compared);
        let mut left: Vec<&str> = defs.iter().map(|d| d.name.name.as_str()).filter(|name| is_exact(name)).collect();
        let mut seen: BTreeSet<&str> = left.iter().copied().collect();
        while let Some(name) = left.pop() {
            for def in defs.iter().filter(|d| d.name.name == name) {
                crate::walk::each_name(&def.body, &mut |word| {
                    if seen.insert(word) {
                        left.push(word);
                    }
                });
            }
        }
        for info in self.script.macros.iter_mut().filter(|m| seen.contains(m.name.name.as_str())) {
            info.used = true;
        }
        self.words.extend(seen.into_iter().map(|word| split_prefixes(word).1.to_owned()));
    }

    /// The numbers of every balance become measures.
    fn measures_of_balances(&mut self) {
        for balance in std::mem::take(&mut self.script.balances) {
            let terms = self.script.terms_of(&balance.fields);
            for (end, part) in Balance::parts(terms.iter().map(String::as_str)) {
                let field = &balance.fields[0];
                let expr = Expr { kind: ExprKind::Name(field.name.clone()), span: field.span, expansion: None };
                let name = Ident { name: format!("{}_{end}", balance.name.name), span: balance.name.span };
                let (reduction, places, at) = (Reduction::Balance(part), Vec::new(), MeasureAt::Rule);
                self.script.measures.push(Measure { name, reduction, expr, places, at, span: balance.span });
            }
            self.script.balances.push(balance);
        }
    }

    /// Names whose statements were dropped for an error.
    fn lose_dropped(&mut self) {
        let s = &mut self.script;
        let mut kept: BTreeSet<&str> = s.params.iter().map(|p| p.name.name.as_str()).collect();
        kept.extend(s.fields.iter().map(|f| f.name.name.as_str()));
        kept.extend(s.measures.iter().map(|m| m.name.name.as_str()));
        kept.extend(s.computed.iter().map(|m| m.name.name.as_str()));
        kept.extend(s.mappings.iter().map(|m| m.name.name.as_str()));
        kept.extend(s.macros.iter().map(|m| m.name.name.as_str()));
        kept.extend(s.steps.iter().map(|t| t.variable.name.as_str()));
        let of_events = |event: &Event| Event::NUMBERS.map(|end| format!("{}{end}", event.name.name));
        let of_events: Vec<String> = s.events.iter().flat_map(of_events).collect();
        kept.extend(s.events.iter().map(|e| e.name.name.as_str()));
        kept.extend(s.gradients.iter().flat_map(|g| &g.derivatives).map(|d| d.name.as_str()));
        kept.extend(of_events.iter().map(String::as_str));
        // a measure of an energy has no statement of its own
        let energies: Vec<String> = if s.scheme.is_some() {
            let energy = |name: &&String| name.starts_with("energy_");
            self.names.values.keys().filter(energy).cloned().collect()
        } else {
            Vec::new()
        };
        kept.extend(energies.iter().map(String::as_str));
        let of_balance = |name: &&String| {
            s.balances.iter().any(|b| name.strip_prefix(&b.name.name).is_some_and(|end| end.starts_with('_')))
        };
        let of_balances: Vec<String> = self.names.values.keys().filter(of_balance).cloned().collect();
        kept.extend(of_balances.iter().map(String::as_str));
        let regions: BTreeSet<&str> = s.regions.iter().map(|r| r.name.name.as_str()).collect();
        for (name, (kind, _)) in self.names.values.iter().filter(|(n, _)| !kept.contains(n.as_str())) {
            s.lost.add(name);
            if *kind == Kind::Steps {
                s.lost.add("steps");
            }
        }
        for name in self.names.regions.keys().filter(|n| !regions.contains(n.as_str())) {
            s.lost.add(name);
        }
    }

    fn note_words(&mut self, e: &Expr) {
        let words = &mut self.words;
        names_of(e, &mut |word| {
            let (_, root) = split_prefixes(word);
            if !words.contains(root) {
                words.insert(root.to_owned());
            }
        });
    }

    fn expr(&mut self, e: &Expr) -> Option<Expr> {
        let e = self.expander.expr(e)?;
        self.note_words(&e);
        self.known_words(&[&e])?;
        Some(e)
    }

    fn cond(&mut self, c: &Cond) -> Option<Cond> {
        let c = self.expander.cond(c)?;
        let mut parts = Vec::new();
        cond_children(&c, &mut |e| parts.push(e));
        parts.iter().for_each(|e| self.note_words(e));
        self.known_words(&parts)?;
        Some(c)
    }

    /// E424 for the second of a statement that stands once.
    fn once(&mut self, first: Option<Span>, word: &str, span: Span) -> Option<()> {
        let Some(first) = first else {
            return Some(());
        };
        let d = Diagnostic::new(Code::E424, format!("a scene has one `{word}`"));
        self.diagnostics.push(d.at(span, "").at(first, "the first one"));
        None
    }

    fn condition(
        &mut self,
        targets: &[Target],
        value: &Expr,
        places: &[Ident],
        done: &str,
        span: Span,
    ) -> Option<Condition> {
        let needed = format!("only unknowns and multipliers can be {done}");
        let mut complete = Some(());
        let mut resolved = Vec::new();
        for target in targets {
            complete = self.all_fields(std::slice::from_ref(&target.field), &needed, is_solved_for).and(complete);
            let part = match &target.part {
                TargetPart::Component(e) => self.expr(e).map(TargetPart::Component),
                other => Some(other.clone()),
            };
            match part {
                Some(part) => resolved.push(Target { field: target.field.clone(), part, span: target.span }),
                None => complete = None,
            }
        }
        let value = self.expr(value);
        let places = self.places(places, Allowed::Regions);
        complete?;
        Some(Condition { targets: resolved, value: value?, places: places?, span })
    }

    fn quantity(&mut self, item: &OutputItem) -> Option<OutputQuantity> {
        let span = item.expr.span;
        let written = self.sources.snippet(span).to_owned();
        let name = item.name.as_ref().map_or(written, |n| n.name.clone());
        Some(OutputQuantity { expr: self.expr(&item.expr)?, name, span })
    }

    /// Checks that the names are fields of a kind that `allowed` admits.
    fn all_fields(&mut self, fields: &[Ident], needed: &str, allowed: impl Fn(Kind) -> bool) -> Option<()> {
        let mut all = Some(());
        for field in fields {
            let kind = self.names.values.get(&field.name).map(|v| v.0);
            if kind.is_some_and(&allowed) {
                continue;
            }
            all = None;
            if kind.is_some() || !self.script.lost.covers(&field.name) {
                self.diagnostics.push(self.names.not_a_field(field, needed, self.sources));
            }
        }
        all
    }

    /// The name of a mapping; `None` after a message.
    fn one_mapping(&mut self, name: &Ident) -> Option<()> {
        let kind = self.names.values.get(&name.name).map(|v| v.0);
        if kind == Some(Kind::Mapping) {
            return Some(());
        }
        if kind.is_some() || !self.script.lost.covers(&name.name) {
            let mappings = self.names.values.iter().filter(|(_, (kind, _))| *kind == Kind::Mapping);
            let found = kind.map_or("unknown".to_owned(), |kind| format!("a {}", kind.word()));
            let d = Diagnostic::new(Code::E201, format!("`{}` is no mapping", name.name)).at(name.span, found);
            self.diagnostics
                .push(d.did_you_mean(name.span, nearest(&name.name, mappings.map(|(name, _)| name.as_str()))));
        }
        None
    }

    fn places(&mut self, places: &[Ident], allowed: Allowed) -> Option<Vec<Ident>> {
        for (k, place) in places.iter().enumerate() {
            if let Some(first) = places[..k].iter().find(|p| p.name == place.name) {
                let d = Diagnostic::new(Code::E218, format!("`{}` is named twice in this list of regions", place.name));
                self.diagnostics.push(d.at(place.span, "it would count twice").at(first.span, "first named here"));
            }
        }
        let found: Vec<_> = places.iter().map(|p| self.place(p, allowed)).collect();
        found.into_iter().collect()
    }

    /// A region by name, or `global`.
    fn place(&mut self, name: &Ident, allowed: Allowed) -> Option<Ident> {
        self.regions.insert(name.name.clone());
        if name.name == "global" && allowed == Allowed::Regions {
            let d = Diagnostic::new(Code::E212, "`global` is no region; only terms and measures can stand on it");
            self.diagnostics.push(d.at(name.span, ""));
            return None;
        }
        let known = self.names.regions.contains_key(&name.name) || REGIONS.contains(&name.name.as_str());
        if !known && self.names.open_regions && self.script.groups.iter().all(|g| g.name != name.name) {
            self.script.groups.push(name.clone());
        }
        if known || self.names.open_regions {
            return Some(name.clone());
        }
        if !self.script.lost.covers(&name.name) {
            self.diagnostics.push(self.names.unknown_region(name, self.sources));
        }
        None
    }

    /// Sorts regions so that each stands behind those it is made of; a region made of itself is an error (E123).
    fn sort_regions(&mut self) {
        let regions = std::mem::take(&mut self.script.regions);
        let mut by_name: BTreeMap<&str, usize> = BTreeMap::new();
        for (i, region) in regions.iter().enumerate() {
            by_name.entry(&region.name.name).or_insert(i);
        }
        // how many parts of a region are not placed yet, and which regions a region is part of
        let (mut waits_for, mut part_of) = (vec![0usize; regions.len()], vec![Vec::new(); regions.len()]);
        for (i, region) in regions.iter().enumerate() {
            for part in parts_of(&region.region).into_iter().filter_map(|p| by_name.get(p)) {
                waits_for[i] += 1;
                part_of[*part].push(i);
            }
        }
        let mut ready: BTreeSet<usize> = (0..regions.len()).filter(|i| waits_for[*i] == 0).collect();
        let mut order = Vec::with_capacity(regions.len());
        while let Some(i) = ready.pop_first() {
            order.push(i);
            for user in &part_of[i] {
                waits_for[*user] -= 1;
                if waits_for[*user] == 0 {
                    ready.insert(*user);
                }
            }
        }
        let waiting: Vec<&Region> = regions.iter().zip(&waits_for).filter(|(_, n)| **n > 0).map(|(r, _)| r).collect();
        if let Some(first) = waiting.first() {
            let rest: Vec<&str> = waiting.iter().map(|r| r.name.name.as_str()).collect();
            let d = Diagnostic::new(Code::E123, format!("the region `{}` is made of itself", rest[0]));
            self.diagnostics.push(d.at(first.name.span, "").note(format!("in a circle: {}", rest.join(", "))));
        }
        let mut all: Vec<Option<Region>> = regions.into_iter().map(Some).collect();
        self.script.regions = order.into_iter().filter_map(|i| all[i].take()).collect();
    }

    /// E421 to E423 for what every scene needs.
    fn missing(&mut self, items: &[Item]) {
        if !self.complete {
            return;
        }
        let has = |f: fn(&ItemKind) -> bool| items.iter().any(|i| f(&i.kind));
        if !has(|k| matches!(k, ItemKind::Mesh { .. })) {
            let d = Diagnostic::new(Code::E421, "the scene has no mesh");
            let d = d.help("mesh box [0,0] to [1,1] cells [8,8] quad, or mesh file \"part.msh\"");
            self.diagnostics.push(d.fix(Fix::AddStatement("mesh box [0,0] to [1,1] cells [8,8] quad".to_owned())));
        }
        if !has(|k| matches!(k, ItemKind::Term { .. })) {
            let d = Diagnostic::new(Code::E422, "the scene has no term");
            self.diagnostics.push(d.missing("term on all : Grad_u.Grad_Test_u - Test_u"));
        }
    }
}

fn is_solved_for(kind: Kind) -> bool {
    matches!(kind, Kind::Unknown | Kind::Multiplier)
}

/// Regions that a region is made of.
fn parts_of(region: &RegionExpr) -> Vec<&str> {
    match region {
        RegionExpr::Name(name) => vec![&name.name],
        RegionExpr::Interface { from, to, .. } => vec![&from.name, &to.name],
        RegionExpr::Along { surface, .. } => vec![&surface.name],
        RegionExpr::Picked { of, .. } => of.iter().map(|o| o.name.as_str()).collect(),
        RegionExpr::Combine(first, rest) => {
            let mut parts = parts_of(first);
            parts.extend(rest.iter().flat_map(|(_, r)| parts_of(r)));
            parts
        }
    }
}

#[cfg(test)]
mod tests;
