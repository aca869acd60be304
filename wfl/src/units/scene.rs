//! What the check of units has to know of a scene, collected once: declared units, dimension, kinds of regions.
//!
//! Unknown unit names are reported here (E502) and then fit everything.

use std::collections::BTreeMap;

use crate::{
    ast::Unit as Written,
    ast::{BoxDivision, EntityKind, Expansion, ExpansionId, Expr, ExprKind, MeshSource, MulOp, RegionExpr},
    codes::Code,
    diag::Diagnostic,
    script::ResolvedScript,
    source::{SourceMap, Span},
    walk::size,
};

use super::{
    table::NamedUnit,
    unit::{Ratio, Symbol, Unit},
};

/// The unit of a param or field as it is written.
#[derive(Clone, Debug)]
pub(super) struct Declared {
    /// `None` fits everything, after an unknown name.
    pub(super) unit: Option<Unit>,
    /// The brackets; the name where none are written.
    pub(super) span: Span,
    /// True if brackets are written.
    pub(super) written: bool,
}

/// A scene and what is declared in it.
#[derive(Clone)]
pub(super) struct Scene<'s> {
    pub(super) script: &'s ResolvedScript,
    sources: &'s SourceMap,
    /// Params and fields by name.
    pub(super) declared: BTreeMap<&'s str, Declared>,
    /// Dimension of space, if the mesh is a box.
    pub(super) dimension: Option<i64>,
    /// The variable of `steps`.
    pub(super) time: Option<&'s str>,
    /// The unit that `steps` gives its variable.
    pub(super) step_unit: Option<Unit>,
    /// No field has a unit: displacements then have that of coordinates.
    pub(super) no_field: bool,
    /// Some declared unit has a length in it, so coordinates are lengths, too.
    pub(super) lengths: bool,
    kinds: BTreeMap<&'s str, EntityKind>,
    values: BTreeMap<&'s str, f64>,
}

impl<'s> Scene<'s> {
    pub(super) fn new(script: &'s ResolvedScript, sources: &'s SourceMap, found: &mut Vec<Diagnostic>) -> Self {
        let mut declared = BTreeMap::new();
        let params = script.params.iter().map(|p| (&p.name, p.unit.as_ref()));
        let fields = script.fields.iter().map(|f| (&f.name, f.space.unit.as_ref()));
        for (name, written) in params.chain(fields) {
            let unit = written.map_or_else(|| Some(Unit::pure()), |w| read(w, found));
            let (span, written) = (written.map_or(name.span, |w| w.span), written.is_some());
            declared.insert(name.name.as_str(), Declared { unit, span, written });
        }
        let in_lengths = |(s, _): &(Symbol, Ratio)| matches!(s, Symbol::Named(u) if u.has_length());
        let lengths = declared.values().filter_map(|d| d.unit.as_ref()).any(|u| u.factors().iter().any(in_lengths));
        let dimension = match script.mesh.as_ref().map(|m| &m.source) {
            Some(MeshSource::Box { from, to, division, .. }) => box_dimension(from, to, division),
            _ => None,
        };
        let heads = script.tables.iter().flat_map(|t| &t.heads).filter_map(|h| h.unit.as_ref());
        heads.for_each(|written| drop(read(written, found)));
        let step_unit = script.steps.as_ref().and_then(|s| s.unit.as_ref()).and_then(|w| read(w, found));
        let time = script.steps.as_ref().map(|s| s.variable.name.as_str());
        let mut kinds = BTreeMap::from([("all", EntityKind::Cells)]);
        for known in ["boundary", "interior"] {
            kinds.insert(known, EntityKind::Faces);
        }
        // a region stands behind those it is made of
        for region in &script.regions {
            if let Some(kind) = kind_of(&region.region, &kinds) {
                kinds.insert(&region.name.name, kind);
            }
        }
        let no_field = script.fields.iter().all(|f| f.space.unit.is_none());
        let values = values(script);
        Self { script, sources, declared, dimension, time, step_unit, no_field, lengths, kinds, values }
    }

    /// True if the scene has a unit anywhere; without one nothing is checked.
    pub(super) fn has_units(script: &ResolvedScript) -> bool {
        script.params.iter().any(|p| p.unit.is_some())
            || script.fields.iter().any(|f| f.space.unit.is_some())
            || script.steps.as_ref().is_some_and(|s| s.unit.is_some())
    }

    /// The lengths that declared units are made of.
    pub(super) fn named_lengths(&self) -> Vec<Symbol> {
        self.named(NamedUnit::is_length)
    }

    /// The times that declared units are made of.
    pub(super) fn named_times(&self) -> Vec<Symbol> {
        self.named(NamedUnit::is_time)
    }

    fn named(&self, wanted: fn(NamedUnit) -> bool) -> Vec<Symbol> {
        let declared = self.declared.values().filter_map(|d| d.unit.as_ref());
        let mut names: Vec<Symbol> = declared.flat_map(|u| u.factors()).map(|f| f.0).collect();
        names.retain(|s| matches!(s, Symbol::Named(u) if wanted(*u)));
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The same scene with another unit of one name.
    pub(super) fn with_unit(&self, name: &str, unit: Unit) -> Scene<'s> {
        let mut scene = self.clone();
        if let Some(declared) = scene.declared.get_mut(name) {
            *declared = Declared { unit: Some(unit), written: true, ..declared.clone() };
        }
        scene
    }

    /// The number of nodes in all terms, measures and other formulas, as a measure of work.
    pub(super) fn weight(&self) -> usize {
        let s = self.script;
        let terms = s.terms.iter().map(|t| &t.expr).chain(s.reductions().map(|m| &m.expr));
        let conditions = s.fixes.iter().chain(&s.loads).map(|c| &c.value);
        let outputs = s.outputs.iter().flat_map(|o| &o.items).map(|q| &q.expr);
        terms.chain(conditions).chain(outputs).map(size).sum::<usize>() + s.params.len() + 1
    }

    /// False if no choice of the open units makes the product 1.
    pub(super) fn can_be_one(&self, ratio: &Unit) -> bool {
        let open = |s: Symbol| !ratio.power_of(s).is_zero();
        if !self.lengths || open(Symbol::Time) || open(Symbol::Volume) || open(Symbol::Sought) {
            return true;
        }
        // the unit of coordinates is some length: only its scale is open
        let Some(metre) = NamedUnit::find("m") else { return true };
        let as_metres = Unit::of(Symbol::Named(metre)).to_power(ratio.power_of(Symbol::Length));
        let whole = as_metres.and_then(|m| m.times(&ratio.without(Symbol::Length))).and_then(|u| u.size());
        whole.is_none_or(|s| !s.has_dimension())
    }

    /// The unit of the size of a region; `None` for a region of unknown kind.
    pub(super) fn size_of(&self, region: &str, length: &Unit, volume: Option<&Unit>) -> Option<Unit> {
        if region == "global" {
            return Some(Unit::pure());
        }
        let kind = *self.kinds.get(region)?;
        let cell = match self.dimension {
            Some(n) => length.to_power(Ratio::whole(n))?,
            None => volume.cloned().unwrap_or_else(|| Unit::of(Symbol::Volume)),
        };
        match kind {
            EntityKind::Cells => Some(cell),
            EntityKind::Faces => cell.over(length),
            EntityKind::Nodes => Some(Unit::pure()),
            EntityKind::Rim | EntityKind::Interior | EntityKind::Crossings => {
                cell.over(length).and_then(|face| face.over(length))
            }
        }
    }

    /// True for a region of crossings, where a load is one at the nodes.
    pub(super) fn is_crossing(&self, region: &str) -> bool {
        self.kinds.get(region) == Some(&EntityKind::Crossings)
    }

    /// The value of an expression of numbers and params.
    pub(super) fn constant(&self, e: &Expr) -> Option<f64> {
        constant(e, &self.values)
    }

    fn expansion(&self, id: Option<ExpansionId>) -> Option<&'s Expansion> {
        self.script.expansions.list.get(id?.index())
    }

    /// Where `part` stands in the text that `owner` is written in: for a macro used there, its use.
    pub(super) fn local(&self, part: &Expr, owner: &Expr) -> Span {
        let mut id = part.expansion;
        let mut span = part.span;
        while id != owner.expansion {
            // an argument of the macro that `owner` belongs to stands outside: it is shown where it is
            let Some(expansion) = self.expansion(id) else { return part.span };
            (id, span) = (expansion.parent, expansion.call);
        }
        span
    }

    /// Where `e` stands in its statement.
    pub(super) fn outer(&self, e: &Expr) -> Span {
        let (mut id, mut span) = (e.expansion, e.span);
        while let Some(expansion) = self.expansion(id) {
            (id, span) = (expansion.parent, expansion.call);
        }
        span
    }

    /// The use in the statement of a macro with arguments that `e` comes from; the arguments may be what is wrong.
    pub(super) fn call_with_arguments(&self, e: &Expr) -> Option<Span> {
        let head = self.expansion(e.expansion)?.definition;
        self.sources.snippet(head).contains('(').then(|| self.outer(e))
    }
}

/// Values of params. One that uses a later param is found in a later round; one in a circle never is.
fn values(script: &ResolvedScript) -> BTreeMap<&str, f64> {
    const ROUNDS: usize = 8;
    let mut values = BTreeMap::new();
    for _ in 0..ROUNDS {
        let before = values.len();
        for param in &script.params {
            if let Some(value) = constant(&param.value, &values) {
                values.insert(param.name.name.as_str(), value);
            }
        }
        if values.len() == before {
            break;
        }
    }
    values
}

fn constant(e: &Expr, values: &BTreeMap<&str, f64>) -> Option<f64> {
    let inner = |e: &Expr| constant(e, values);
    match &e.kind {
        ExprKind::Number(x) => Some(*x),
        ExprKind::Name(word) if word == "pi" => Some(std::f64::consts::PI),
        ExprKind::Name(word) => values.get(word.as_str()).copied(),
        ExprKind::Negate(a) => inner(a).map(|x| -x),
        ExprKind::Sum(parts) => {
            let signed = |(minus, p): &(bool, Expr)| inner(p).map(|x| if *minus { -x } else { x });
            parts.iter().try_fold(0.0, |sum, part| Some(sum + signed(part)?))
        }
        ExprKind::Product(first, rest) => rest.iter().try_fold(inner(first)?, |product, (op, _, p)| match op {
            MulOp::Times => Some(product * inner(p)?),
            MulOp::Divide => Some(product / inner(p)?),
            _ => None,
        }),
        _ => None,
    }
}

/// The unit that is written; each unknown name is reported.
pub(super) fn read(written: &Written, found: &mut Vec<Diagnostic>) -> Option<Unit> {
    let mut unit = Some(Unit::pure());
    for (k, (name, power)) in written.factors.iter().enumerate() {
        let Some(named) = NamedUnit::find(name) else {
            let d = Diagnostic::new(Code::E502, format!("unknown unit `{name}`"));
            let near = NamedUnit::nearest(name);
            let d = d.at(written.span, near.as_ref().map_or_else(String::new, |n| format!("did you mean `{n}`?")));
            found.push(match (near, written.places.get(k)) {
                (Some(near), Some(place)) => d.replace(*place, near),
                _ => d,
            });
            unit = None;
            continue;
        };
        let factor = Unit::of(Symbol::Named(named)).to_power(Ratio::whole(i64::from(*power)));
        unit = unit.and_then(|u| u.times(&factor?));
    }
    unit
}

fn box_dimension(from: &Expr, to: &Expr, division: &BoxDivision) -> Option<i64> {
    let (BoxDivision::Cells(e) | BoxDivision::Size(e)) = division;
    [from, to, e].into_iter().find_map(|e| match &e.kind {
        ExprKind::Tensor(rows) => i64::try_from(rows.iter().map(Vec::len).sum::<usize>()).ok(),
        ExprKind::Number(_) => Some(1),
        _ => None,
    })
}

fn kind_of(region: &RegionExpr, kinds: &BTreeMap<&str, EntityKind>) -> Option<EntityKind> {
    match region {
        RegionExpr::Name(name) => kinds.get(name.name.as_str()).copied(),
        RegionExpr::Interface { .. } | RegionExpr::Along { .. } => Some(EntityKind::Faces),
        RegionExpr::Picked { entity, .. } => Some(*entity),
        RegionExpr::Combine(first, rest) => {
            kind_of(first, kinds).or_else(|| rest.iter().find_map(|(_, r)| kind_of(r, kinds)))
        }
    }
}
