//! Further messages about a scene that cannot be prepared: statements without a message so far are compiled on regions
//! that allow every field, so shapes, names and test functions of all statements are checked in one run.
//!
//! Needs the dimension and no mesh. Promises no follow-up messages: whatever depends on a broken declaration is
//! skipped.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, FieldKind as Declared, Lost, ResolvedScript, Span, StartKind,
    ast::{
        Cond, EntityKind, Expr, ExprKind, Ident, MappingKind, MeshSource, OptionValue, Place, QuadratureRule,
        RegionExpr, TargetPart,
    },
};
use wfl_compiler::{
    Constant, Env, LoadPart, TermSource, check_condition, check_term, check_value, constant,
    types::{FieldId, FieldKind, FieldSig, ImageBy, MappingSig, Moves, PlaceKind, PlaceSig, RateForm, Shape},
};

use super::{
    auto::is_auto,
    constants::{bare_env, number, parameters},
    constraints::wrong_size,
    fields::{global_place, shape},
    mesh::position_place,
};

/// A scene as its text shows it, without its mesh: regions allow every field.
pub struct Sketch<'s> {
    script: &'s ResolvedScript,
    dim: usize,
    params: BTreeMap<String, Constant>,
    sigs: Vec<FieldSig>,
    mappings: Vec<MappingSig>,
    rates: Vec<RateForm>,
}

impl<'s> Sketch<'s> {
    /// The sketch of a scene. `dim` is the dimension of the mesh, if it is known; `None` if the text does not show it
    /// either. Fields of unknown shape are lost.
    pub(super) fn with_lost(script: &'s ResolvedScript, dim: Option<usize>, lost: &mut Lost) -> Option<Self> {
        let dim = dim.or_else(|| written_dimension(script))?;
        let params = parameters(script, dim, &mut Vec::new());
        let sigs = signatures(script, &bare_env(script, dim, &params), lost);
        let mappings = mappings(script, sigs.len());
        let rates = super::rates::forms(script, &sigs, &params);
        Some(Self { script, dim, params, sigs, mappings, rates })
    }

    /// The sketch of a scene, of [`without_auto`] where a param is `auto`. `dim` is the dimension of the mesh, 1 to 3, if
    /// it is known; `None` if the text does not show it either.
    #[must_use]
    pub fn new(script: &'s ResolvedScript, dim: Option<usize>) -> Option<Self> {
        Self::with_lost(script, dim, &mut Lost::default())
    }

    /// What expressions can see.
    #[must_use]
    pub fn env(&self) -> Env<'_> {
        let step_variable = self.script.steps.as_ref().map(|s| s.variable.name.as_str());
        let bare = bare_env(self.script, self.dim, &self.params);
        Env { fields: &self.sigs, mappings: &self.mappings, step_variable, rates: &self.rates, ..bare }
    }

    /// A place of the kind that the declaration of a region shows, on which every field lives; the most permissive kind
    /// where only a mesh file knows, and for the empty name. `None` for regions of nodes.
    #[must_use]
    pub fn place(&self, name: &str) -> Option<PlaceSig> {
        let n = self.sigs.len();
        let kind = kind_of(self.script, name)?;
        if kind == PlaceKind::Global {
            return Some(global_place(n));
        }
        let description = match kind {
            PlaceKind::Cells => "a region of cells",
            PlaceKind::Interface => "an interface",
            PlaceKind::Edges => "edges of faces",
            PlaceKind::InnerEdges => "edges between faces",
            _ => "faces with one side",
        };
        Some(PlaceSig {
            name: name.to_owned(),
            kind,
            here: vec![true; n],
            there: vec![kind.has_two_sides(); n],
            entities: Vec::new(),
            description: description.to_owned(),
            here_name: None,
            inside: false,
        })
    }

    /// A point of which only the position is known: what conditions, first values and prescribed values see.
    #[must_use]
    pub fn position(&self) -> PlaceSig {
        position_place(self.sigs.len())
    }

    /// The value of a param.
    #[must_use]
    pub fn param(&self, name: &str) -> Option<&Constant> {
        self.params.get(name)
    }
}

/// The errors of a script that need no mesh, with those of its params: fast enough for every keystroke of an editor.
/// Without a dimension in the text only if `dim` is known. `prepare` tells more.
#[must_use]
pub(super) fn text_messages(script: &ResolvedScript, dim: Option<usize>) -> Vec<Diagnostic> {
    let Some(known) = dim.or_else(|| written_dimension(script)) else { return Vec::new() };
    let given = without_auto(script);
    let mut diagnostics = Vec::new();
    let mut lost = given.lost.clone();
    let params = parameters(&given, known, &mut diagnostics);
    for param in given.params.iter().filter(|p| !params.contains_key(&p.name.name)) {
        lost.add(&param.name.name);
    }
    rest(&given, Some(known), &mut lost, &mut diagnostics);
    diagnostics.retain(|d| !lost.explains(d));
    diagnostics
}

/// The script with the number 1 in place of every value `auto`, which only the mesh gives.
#[must_use]
pub fn without_auto(script: &ResolvedScript) -> ResolvedScript {
    let mut given = script.clone();
    for param in given.params.iter_mut().filter(|p| is_auto(p)) {
        param.value.kind = ExprKind::Number(1.0);
        param.domain = None;
    }
    given
}

/// Adds the messages of all statements that have none yet. `dim` is the dimension of the mesh, if there is one.
pub(super) fn rest(script: &ResolvedScript, dim: Option<usize>, lost: &mut Lost, diagnostics: &mut Vec<Diagnostic>) {
    let Some(sketch) = Sketch::with_lost(script, dim, lost) else { return };
    let env = sketch.env();
    let mut rest = Rest { script, sketch: &sketch, env: &env, found: Vec::new(), told: diagnostics };
    rest.numbers();
    rest.positions();
    rest.fixes();
    rest.terms();
    rest.loads();
    rest.values();
    let found = rest.found;
    diagnostics.extend(found);
    expects(script, &sketch.params, sketch.dim, diagnostics);
}

/// The messages of the conditions behind `expect`, in which measures are numbers.
pub(super) fn expects(
    script: &ResolvedScript,
    params: &BTreeMap<String, Constant>,
    dim: usize,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut known = params.clone();
    let number = || Constant { shape: Shape::SCALAR, values: vec![f64::NAN], declared: None };
    let measures = script.measures.iter().map(|m| m.name.name.clone());
    known.extend(measures.chain(script.energies()).map(|name| (name, number())));
    let mut in_steps = known.clone();
    in_steps.extend(script.steps.iter().map(|s| (s.variable.name.clone(), number())));
    let watched = script.steps.iter().flat_map(|s| &s.watched).map(|m| m.name.name.clone());
    for computed in &script.computed {
        let own = computed.watched.iter().map(|m| (m.name.name.clone(), number()));
        let mut in_it = in_steps.clone();
        in_it.extend(own);
        let found = constant(&bare_env(script, dim, &in_it), "a measure", &computed.expr);
        diagnostics.extend(found.diagnostics);
        if let Some(value) = found.value.filter(|v| !v.shape.is_scalar_like()) {
            let d = Diagnostic::new(Code::E108, format!("a measure is a scalar, found a {}", value.shape));
            diagnostics.push(d.at(computed.expr.span, ""));
        }
        // those behind it may read it
        in_steps.insert(computed.name.name.clone(), number());
        known.insert(computed.name.name.clone(), number());
    }
    let of_events =
        script.events.iter().flat_map(|e| e.watched.iter().map(|m| format!("{}{}", e.name.name, m.name.name)));
    in_steps.extend(watched.chain(of_events).map(|name| (name, number())));
    let limits = script.steps.iter().flat_map(|s| &s.options).filter(|o| o.name.name == "limit");
    let limits = limits.filter_map(|o| match &o.value {
        Some(OptionValue::Expr(e)) => Some(e),
        _ => None,
    });
    for e in limits.chain(script.events.iter().flat_map(|e| [&e.larger, &e.smaller])) {
        let told = constant(&bare_env(script, dim, &in_steps), "a number of the steps", e).diagnostics;
        diagnostics.extend(told.into_iter().filter(|d| !diagnostics.contains(d)).collect::<Vec<_>>());
    }
    for event in &script.events {
        known.extend(wfl::Event::NUMBERS.map(|end| (format!("{}{end}", event.name.name), number())));
    }
    known.extend(derivatives(script, params));
    known.extend(script.steps.iter().map(|s| (s.variable.name.clone(), number())));
    let values = script.gradients.iter().flat_map(|g| &g.results).filter_map(|r| r.at.value());
    let of_values = |e| constant(&bare_env(script, dim, params), "a value of the step variable", e).diagnostics;
    diagnostics.extend(values.flat_map(of_values).collect::<Vec<_>>());
    let env = bare_env(script, dim, &known);
    for expect in &script.expects {
        let told = check_condition(&env, &global_place(0), &expect.condition);
        let over_space = |d: Diagnostic| match d.code {
            Code::E105 | Code::E202 if d.helps.is_empty() => {
                d.help("an `expect` compares measures and params: measure m = max(u(1)) on all, then expect m < 1")
            }
            _ => d,
        };
        diagnostics.extend(told.into_iter().map(over_space).filter(|d| !diagnostics.contains(d)).collect::<Vec<_>>());
    }
}

/// The derivatives that `gradient` statements name, each of the shape of its parameter, before they are found.
pub(super) fn derivatives(script: &ResolvedScript, params: &BTreeMap<String, Constant>) -> Vec<(String, Constant)> {
    let of = |of: &wfl::Derivative| {
        let shape = params.get(&of.parameter.name).map_or(Shape::SCALAR, |p| p.shape);
        (of.name.clone(), Constant { shape, values: vec![f64::NAN; shape.len()], declared: None })
    };
    script.gradients.iter().flat_map(|g| &g.derivatives).map(of).collect()
}

/// The dimension that the statement of a box shows.
fn written_dimension(script: &ResolvedScript) -> Option<usize> {
    match &script.mesh.as_ref()?.source {
        MeshSource::Box { from, .. } => match &from.kind {
            ExprKind::Tensor(rows) => Some(rows.iter().map(Vec::len).sum()).filter(|n| (1..=3).contains(n)),
            ExprKind::Number(_) => Some(1),
            _ => None,
        },
        MeshSource::Files(_) => None,
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
        let on_faces = kind != FieldKind::State && lives_on_faces(script, &field.space.place);
        out.push(FieldSig { name, shape, degree: 1, kind, global, on_faces });
    }
    out
}

/// True if all regions of a place are declared as faces.
fn lives_on_faces(script: &ResolvedScript, place: &Place) -> bool {
    let Place::On(list) = place else { return false };
    let is_faces = |name: &str| match kind_of(script, name) {
        Some(PlaceKind::Facets) => true,
        // what only a mesh file knows may be cells
        Some(PlaceKind::Interface) => script.regions.iter().any(|r| r.name.name == name),
        _ => false,
    };
    list.iter().all(|region| is_faces(&region.name))
}

/// The mappings, which lead to places where every field lives.
fn mappings(script: &ResolvedScript, n_fields: usize) -> Vec<MappingSig> {
    let sig = |mapping: &wfl::Mapping| MappingSig {
        name: mapping.name.name.clone(),
        there: vec![true; n_fields],
        moves: moves(mapping, script),
        has_normal: matches!(mapping.kind, MappingKind::Search { .. }),
        description: "a mapping".to_owned(),
    };
    script.mappings.iter().map(sig).collect()
}

/// The displacements that a mapping names.
fn moves(mapping: &wfl::Mapping, script: &ResolvedScript) -> Option<Moves> {
    let MappingKind::Search { raytrace, moving, .. } = &mapping.kind else { return None };
    let field = |name: &Ident| script.fields.iter().position(|f| f.name.name == name.name).map(FieldId::new);
    let by = if *raytrace { ImageBy::Ray } else { ImageBy::Closest };
    Some(Moves { by, here: field(moving.first()?)?, there: field(moving.last()?)? })
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
            // faces of an interface are a part of it
            Some(RegionExpr::Picked { entity: EntityKind::Faces, of, .. }) => {
                let whole = of.as_ref().filter(|of| of.name != name).and_then(|of| kind_of(script, &of.name));
                return Some(if whole == Some(PlaceKind::Interface) {
                    PlaceKind::Interface
                } else {
                    PlaceKind::Facets
                });
            }
            Some(RegionExpr::Picked { entity: EntityKind::Rim | EntityKind::Crossings, .. }) => {
                return Some(PlaceKind::Edges);
            }
            Some(RegionExpr::Picked { entity: EntityKind::Interior, .. }) => return Some(PlaceKind::InnerEdges),
            Some(RegionExpr::Picked { .. }) => return None,
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
    sketch: &'a Sketch<'a>,
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

    /// What is computed once, before the run.
    fn numbers(&mut self) {
        let mut list: Vec<(Span, &Expr)> = Vec::new();
        if let Some(s) = &self.script.steps {
            list.extend([&s.from, &s.to].map(|e| (s.span, e)));
            list.extend((!s.is_auto()).then_some((s.span, &s.by)));
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
                    self.add(check_condition(self.env, &place, condition));
                }
            }
        }
        for (span, condition) in
            self.script.refinements.iter().filter_map(|r| Some((r.span, r.what.condition.as_ref()?)))
        {
            if !self.told(span) {
                self.add(check_condition(self.env, &place, condition));
            }
        }
        let starts = self.script.starts.iter().filter_map(|s| match &s.kind {
            StartKind::Field { value, .. } | StartKind::Rate { value, .. } => Some((s.span, value)),
            StartKind::File { .. } => None,
        });
        let data = self.script.fields.iter().filter_map(|f| match &f.kind {
            Declared::Data { value: wfl::DataValue::Formula(e) } => Some((f.span, e)),
            _ => None,
        });
        let list: Vec<(Span, &Expr)> = starts.chain(data).collect();
        for (span, e) in list {
            if !self.told(span) {
                self.add(check_value(self.env, &place, "a value", e).diagnostics);
            }
        }
    }

    fn fixes(&mut self) {
        let place = position_place(self.env.fields.len());
        for fix in &self.script.fixes {
            let law = check_value(self.env, &place, "a value", &fix.value);
            let found = law.value;
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
                let Some(sig) = self.sketch.place(&place.name).filter(|_| !self.told(term.span)) else { continue };
                let source =
                    if term.energy { TermSource::Energy(&term.expr) } else { TermSource::Residual(&term.expr) };
                self.add(check_term(self.env, &sig, source));
            }
        }
    }

    fn loads(&mut self) {
        for load in &self.script.loads {
            for (target, place) in load.targets.iter().flat_map(|t| load.places.iter().map(move |p| (t, p))) {
                let position = self.env.fields.iter().position(|f| f.name == target.field.name);
                let Some(position) = position.filter(|_| !self.told(load.span)) else { continue };
                let Some(sig) = self.sketch.place(&place.name) else { continue };
                let part = match &target.part {
                    TargetPart::Whole => LoadPart::Whole,
                    TargetPart::Normal => LoadPart::Normal,
                    TargetPart::Component(_) => LoadPart::Component(0),
                };
                let source = TermSource::Load { value: &load.value, field: FieldId::new(position), part };
                self.add(check_term(self.env, &sig, source));
            }
        }
    }

    /// Measures and outputs.
    fn values(&mut self) {
        for measure in self.script.reductions() {
            // a value at a point is that of some body
            let somewhere = measure.places.is_empty().then_some("");
            for place in measure.places.iter().map(|p| p.name.as_str()).chain(somewhere) {
                let Some(sig) = self.sketch.place(place).filter(|_| !self.told(measure.span)) else { continue };
                self.add(check_value(self.env, &sig, "measure", &measure.expr).diagnostics);
            }
        }
        let Some(sig) = self.sketch.place("") else { return };
        for output in &self.script.outputs {
            for item in &output.items {
                if !self.told(output.span) {
                    self.add(check_value(self.env, &sig, "output", &item.expr).diagnostics);
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
