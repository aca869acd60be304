//! Further messages about a scene that cannot be prepared: statements without a message so far are compiled on regions
//! that allow every field, so shapes, names and test functions of all statements are checked in one run.
//!
//! Needs the dimension and no mesh. Promises no follow-up messages: whatever depends on a broken declaration is
//! skipped.

use std::collections::BTreeMap;

use wfl::{
    Diagnostic, FieldKind as Declared, Lost, ResolvedScript, Span, StartKind,
    ast::{
        Cond, EntityKind, Expr, ExprKind, Ident, MappingKind, MeshSource, Place, QuadratureRule, RegionExpr, TargetPart,
    },
};
use wfl_compiler::{
    Constant, Env, LoadPart, TermSource, compile_condition, compile_term, compile_value,
    types::{FieldId, FieldKind, FieldSig, MappingSig, PlaceKind, PlaceSig, Shape},
};

use super::{
    constants::{bare_env, number, parameters},
    constraints::wrong_size,
    fields::{global_place, shape},
    mesh::position_place,
};

/// Adds the messages of all statements that have none yet. `dim` is the dimension of the mesh, if there is one.
pub(super) fn rest(script: &ResolvedScript, dim: Option<usize>, lost: &mut Lost, diagnostics: &mut Vec<Diagnostic>) {
    let Some(dim) = dim.or_else(|| written_dimension(script)) else { return };
    let params = parameters(script, dim, &mut Vec::new());
    let sigs = signatures(script, &bare_env(script, dim, &params), lost);
    let step_variable = script.steps.as_ref().map(|s| s.variable.name.as_str());
    let mappings = mappings(script, sigs.len());
    let env = Env { fields: &sigs, mappings: &mappings, step_variable, ..bare_env(script, dim, &params) };
    let mut rest = Rest { script, env: &env, found: Vec::new(), told: diagnostics };
    rest.numbers();
    rest.positions();
    rest.fixes();
    rest.terms();
    rest.loads();
    rest.values();
    let found = rest.found;
    diagnostics.extend(found);
    expects(script, &params, dim, diagnostics);
}

/// The messages of the conditions behind `expect`, in which measures are numbers.
pub(super) fn expects(
    script: &ResolvedScript,
    params: &BTreeMap<String, Constant>,
    dim: usize,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut known = params.clone();
    for measure in &script.measures {
        let value = Constant { shape: Shape::SCALAR, values: vec![f64::NAN], declared: None };
        known.insert(measure.name.name.clone(), value);
    }
    let env = bare_env(script, dim, &known);
    for expect in &script.expects {
        let law = compile_condition(&env, &global_place(0), "expect", &expect.condition);
        let over_space = |d: Diagnostic| match d.code {
            "E105" | "E202" if d.helps.is_empty() => {
                d.help("an `expect` compares measures and params: measure m = max(u(1)) on all, then expect m < 1")
            }
            _ => d,
        };
        diagnostics.extend(
            law.diagnostics.into_iter().map(over_space).filter(|d| !diagnostics.contains(d)).collect::<Vec<_>>(),
        );
    }
}

/// The dimension that the statement of a box shows.
fn written_dimension(script: &ResolvedScript) -> Option<usize> {
    match &script.mesh.as_ref()?.source {
        MeshSource::Box { from, .. } => match &from.kind {
            ExprKind::Tensor(rows) => Some(rows.iter().map(Vec::len).sum()).filter(|n| (1..=3).contains(n)),
            ExprKind::Number(_) => Some(1),
            _ => None,
        },
        MeshSource::File { .. } => None,
    }
}

/// What the declarations of fields say without a mesh; a field of unknown shape is lost.
fn signatures(script: &ResolvedScript, env: &Env<'_>, lost: &mut Lost) -> Vec<FieldSig> {
    let mut out = Vec::new();
    for field in &script.fields {
        let name = field.name.name.clone();
        let Some(shape) = shape(&field.space.rank, env, &mut Vec::new()) else {
            lost.add(&name);
            continue;
        };
        let kind = match &field.kind {
            Declared::Unknown => FieldKind::Unknown,
            Declared::Multiplier { .. } => FieldKind::Multiplier,
            Declared::Data { .. } => FieldKind::Data,
            Declared::State { .. } => FieldKind::State,
        };
        let global = matches!(field.space.place, Place::Global(_));
        out.push(FieldSig { name, shape, degree: 1, kind, global });
    }
    out
}

/// The mappings, which lead to places where every field lives.
fn mappings(script: &ResolvedScript, n_fields: usize) -> Vec<MappingSig> {
    let sig = |mapping: &wfl::Mapping| MappingSig {
        name: mapping.name.name.clone(),
        there: vec![true; n_fields],
        has_normal: matches!(mapping.kind, MappingKind::Search { .. }),
        description: "a mapping".to_owned(),
    };
    script.mappings.iter().map(sig).collect()
}

/// The kind of a region as its declaration shows it; the most permissive one if only a mesh file knows.
fn kind_of(script: &ResolvedScript, name: &str) -> Option<PlaceKind> {
    match name {
        "all" => return Some(PlaceKind::Cells),
        "boundary" => return Some(PlaceKind::Facets),
        "global" => return Some(PlaceKind::Global),
        _ => {}
    }
    let mut region = script.regions.iter().find(|r| r.name.name == name).map(|r| &r.region);
    // regions are sorted and made of earlier ones, so the chain ends
    loop {
        region = match region {
            Some(RegionExpr::Picked { entity: EntityKind::Cells, .. }) => return Some(PlaceKind::Cells),
            Some(RegionExpr::Picked { entity: EntityKind::Faces, .. }) => return Some(PlaceKind::Facets),
            Some(RegionExpr::Picked { entity: EntityKind::Nodes, .. }) => return None,
            Some(RegionExpr::Interface { .. } | RegionExpr::Along { .. }) | None => return Some(PlaceKind::Interface),
            Some(RegionExpr::Name(n)) if n.name == "all" => return Some(PlaceKind::Cells),
            Some(RegionExpr::Name(n)) if n.name == "boundary" => return Some(PlaceKind::Facets),
            Some(RegionExpr::Name(n)) if n.name != name => {
                script.regions.iter().find(|r| r.name.name == n.name).map(|r| &r.region)
            }
            Some(RegionExpr::Name(_)) => return Some(PlaceKind::Interface),
            Some(RegionExpr::Combine(first, _)) => Some(&**first),
        };
    }
}

struct Rest<'a> {
    script: &'a ResolvedScript,
    env: &'a Env<'a>,
    found: Vec<Diagnostic>,
    /// What has been said before.
    told: &'a [Diagnostic],
}

impl Rest<'_> {
    /// True if this statement has a message already.
    fn told(&self, span: Span) -> bool {
        let inside = |s: Span| s.source == span.source && span.start <= s.start && s.end <= span.end;
        self.told.iter().any(|d| d.is_error() && d.labels.iter().any(|l| inside(l.span)))
    }

    fn add(&mut self, diagnostics: Vec<Diagnostic>) {
        for d in diagnostics.into_iter().filter(Diagnostic::is_error) {
            if !self.found.contains(&d) && !self.told.contains(&d) {
                self.found.push(d);
            }
        }
    }

    /// A place of the right kind on which every field lives.
    fn place(&self, name: &Ident) -> Option<PlaceSig> {
        let n = self.env.fields.len();
        let kind = kind_of(self.script, &name.name)?;
        if kind == PlaceKind::Global {
            return Some(global_place(n));
        }
        let description = match kind {
            PlaceKind::Cells => "a region of cells",
            PlaceKind::Interface => "an interface",
            _ => "faces with one side",
        };
        Some(PlaceSig {
            name: name.name.clone(),
            kind,
            here: vec![true; n],
            there: vec![kind == PlaceKind::Interface; n],
            entities: Vec::new(),
            description: description.to_owned(),
            here_name: None,
            inside: false,
        })
    }

    /// What is computed once, before the run.
    fn numbers(&mut self) {
        let mut list: Vec<(Span, &Expr)> = Vec::new();
        if let Some(s) = &self.script.steps {
            list.extend([&s.from, &s.to, &s.by].map(|e| (s.span, e)));
        }
        for q in &self.script.quadratures {
            if let QuadratureRule::Degree(e) = &q.rule {
                list.push((q.span, e));
            }
        }
        for (span, e) in list {
            if !self.told(span) {
                let mut found = Vec::new();
                number(self.env, "this", e, &mut found);
                self.add(found);
            }
        }
    }

    /// Conditions on positions, first guesses and given fields.
    fn positions(&mut self) {
        let place = position_place(self.env.fields.len());
        for region in &self.script.regions {
            for condition in conditions(&region.region) {
                if !self.told(region.span) {
                    let law = compile_condition(self.env, &place, "a condition", condition);
                    self.add(law.diagnostics);
                }
            }
        }
        for (span, condition) in
            self.script.refinements.iter().filter_map(|r| Some((r.span, r.what.condition.as_ref()?)))
        {
            if !self.told(span) {
                self.add(compile_condition(self.env, &place, "a condition", condition).diagnostics);
            }
        }
        let starts = self.script.starts.iter().filter_map(|s| match &s.kind {
            StartKind::Field { value, .. } => Some((s.span, value)),
            StartKind::File { .. } => None,
        });
        let data = self.script.fields.iter().filter_map(|f| match &f.kind {
            Declared::Data { value: wfl::DataValue::Formula(e) } => Some((f.span, e)),
            _ => None,
        });
        let list: Vec<(Span, &Expr)> = starts.chain(data).collect();
        for (span, e) in list {
            if !self.told(span) {
                self.add(compile_value(self.env, &place, "a value", e).diagnostics);
            }
        }
    }

    fn fixes(&mut self) {
        let place = position_place(self.env.fields.len());
        for fix in &self.script.fixes {
            let law = compile_value(self.env, &place, "a value", &fix.value);
            let found = law.value.map(|l| l.shape);
            let told = self.told(fix.span);
            if !told {
                self.add(law.diagnostics);
            }
            for target in &fix.targets {
                let field = self.env.fields.iter().find(|f| f.name == target.field.name);
                let (Some(field), Some(found), false) = (field, found, told) else { continue };
                let entries = if target.part == TargetPart::Whole { field.shape.len() } else { 1 };
                self.add(wrong_size(self.env, &fix.value, found, entries).into_iter().collect());
            }
        }
    }

    fn terms(&mut self) {
        for term in &self.script.terms {
            for place in &term.places {
                let Some(sig) = self.place(place).filter(|_| !self.told(term.span)) else { continue };
                let source =
                    if term.energy { TermSource::Energy(&term.expr) } else { TermSource::Residual(&term.expr) };
                self.add(compile_term(self.env, &sig, "term", source).diagnostics);
            }
        }
    }

    fn loads(&mut self) {
        for load in &self.script.loads {
            for (target, place) in load.targets.iter().flat_map(|t| load.places.iter().map(move |p| (t, p))) {
                let position = self.env.fields.iter().position(|f| f.name == target.field.name);
                let Some(position) = position.filter(|_| !self.told(load.span)) else { continue };
                let Some(sig) = self.place(place) else { continue };
                let part = match &target.part {
                    TargetPart::Whole => LoadPart::Whole,
                    TargetPart::Normal => LoadPart::Normal,
                    TargetPart::Component(_) => LoadPart::Component(0),
                };
                let source = TermSource::Load { value: &load.value, field: FieldId::new(position), part };
                self.add(compile_term(self.env, &sig, "load", source).diagnostics);
            }
        }
    }

    /// Measures and outputs.
    fn values(&mut self) {
        for measure in &self.script.measures {
            for place in &measure.places {
                let Some(sig) = self.place(place).filter(|_| !self.told(measure.span)) else { continue };
                self.add(compile_value(self.env, &sig, "measure", &measure.expr).diagnostics);
            }
        }
        let anywhere = Ident { name: String::new(), span: Span { source: self.script.main, start: 0, end: 0 } };
        let Some(sig) = self.place(&anywhere) else { return };
        for output in &self.script.outputs {
            for item in &output.items {
                if !self.told(output.span) {
                    self.add(compile_value(self.env, &sig, "output", &item.expr).diagnostics);
                }
            }
        }
    }
}

/// All conditions in a region.
fn conditions(region: &RegionExpr) -> Vec<&Cond> {
    match region {
        RegionExpr::Picked { condition, .. } => condition.iter().collect(),
        RegionExpr::Combine(first, rest) => {
            conditions(first).into_iter().chain(rest.iter().flat_map(|(_, r)| conditions(r))).collect()
        }
        _ => Vec::new(),
    }
}
