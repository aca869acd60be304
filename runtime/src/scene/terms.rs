//! Terms and loads compiled on their regions; one quadrature rule for each region.

use std::{collections::BTreeMap, sync::Arc};

use wfl::{
    Diagnostic, Span,
    ast::{Ident, QuadratureRule, TargetPart},
};
use wfl_compiler::{
    Class, Env, LoadPart, PiecesLaw, PrintLaw, TermLaw, TermSource, compile_pieces, compile_prints, compile_term,
    types::{FieldId, PlaceSig},
};

use crate::{
    assemble::Domain,
    field::Field,
    mesh::{CellKind, Mesh, RegionSet},
    quadrature::{Rule, nodal, rule, vertex},
    scene::{
        Parts,
        constants::number,
        fields::{global_place, place_sig},
        regions::NamedRegion,
    },
};

/// Where a load is written and what it pulls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loaded {
    pub(super) field: usize,
    pub(super) span: Span,
    /// `load u.Normal`
    pub(super) normal: bool,
}

/// A compiled term with its place, before kernels and dofs.
pub(super) struct PlacedLaw {
    pub(super) law: TermLaw,
    /// The same term in its frozen form.
    pub(super) pieces: Option<PiecesLaw>,
    /// What it prints.
    pub(super) prints: Vec<PrintLaw>,
    /// The name of the region, or of the restricted region of a load.
    pub(super) place: String,
    pub(super) set: Option<RegionSet>,
    /// The points of a load on nodes; others follow from set and rule.
    pub(super) at_nodes: Option<Arc<Domain>>,
    /// What it is as a load, if it is one.
    pub(super) load: Option<Loaded>,
    pub(super) span: Span,
}

/// Degree of the rule, or the nodal rule, by region name.
pub(super) type Rules = BTreeMap<String, RuleChoice>;

/// How points are chosen on a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RuleChoice {
    /// Gauss points exact to this degree.
    Degree(usize),
    /// The nodes of the fields on the region: the vertices for degree 1, Simpson's points for degree 2.
    Vertex,
}

/// Largest degree that `quadrature` takes.
const MAX_DEGREE: f64 = 60.0;

pub(super) struct TermMaker<'a> {
    pub(super) parts: Parts<'a>,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl TermMaker<'_> {
    /// All terms and loads of the scene.
    pub(super) fn make(&mut self) -> Vec<PlacedLaw> {
        let mut out = Vec::new();
        for (k, term) in self.parts.script.terms.iter().enumerate() {
            for place in &term.places {
                let Some((sig, set)) = self.place(place) else { continue };
                let mut name = term.name.as_ref().map_or_else(|| format!("term{}", k + 1), |n| n.name.clone());
                if term.places.len() > 1
                    || self
                        .parts
                        .script
                        .terms
                        .iter()
                        .filter(|t| t.name.as_ref().is_some_and(|n| n.name == name))
                        .count()
                        > 1
                {
                    name = format!("{name} on {}", place.name);
                }
                let source =
                    if term.energy { TermSource::Energy(&term.expr) } else { TermSource::Residual(&term.expr) };
                self.push(&sig, &name, source, set, term.span, &mut out);
            }
        }
        for (k, load) in self.parts.script.loads.iter().enumerate() {
            for target in &load.targets {
                for place in &load.places {
                    self.load(k, load, target, place, &mut out);
                }
            }
        }
        out
    }

    pub(super) fn push(
        &mut self,
        sig: &PlaceSig,
        name: &str,
        source: TermSource<'_>,
        set: Option<RegionSet>,
        span: Span,
        out: &mut Vec<PlacedLaw>,
    ) {
        let compiled = compile_term(self.parts.env, sig, name, source);
        for d in compiled.diagnostics {
            if !self.diagnostics.contains(&d) {
                self.diagnostics.push(d);
            }
        }
        if let Some(law) = compiled.value {
            let guides = FieldId::new(self.parts.fields.len() + out.iter().filter(|l| l.pieces.is_some()).count());
            let kinked = law.class == Class::Kinked;
            let pieces = if kinked { compile_pieces(self.parts.env, sig, name, &law.listing, guides) } else { None };
            let prints = compile_prints(self.parts.env, sig, name, &law.listing);
            out.push(PlacedLaw { law, pieces, prints, place: sig.name.clone(), set, at_nodes: None, load: None, span });
        }
    }

    /// What a place is; `None` after a message. Regions that failed earlier give no further message.
    pub(super) fn place(&mut self, place: &Ident) -> Option<(PlaceSig, Option<RegionSet>)> {
        if place.name == "global" {
            return Some((global_place(self.parts.fields.len()), None));
        }
        let region = self.parts.regions.get(&place.name)?;
        if let RegionSet::Nodes(_) = region.set {
            let d =
                Diagnostic::new("E405", format!("nothing can be integrated over `{}`, a region of nodes", place.name));
            let d = d.at(place.span, "cells or faces are needed");
            self.diagnostics.push(d.help("a force at nodes is a load: load u = [0,-1] on the region"));
            return None;
        }
        Some((place_sig(&place.name, region, self.parts.mesh, self.parts.fields), Some(region.set.clone())))
    }

    fn load(
        &mut self,
        k: usize,
        load: &wfl::Condition,
        target: &wfl::ast::Target,
        place: &Ident,
        out: &mut Vec<PlacedLaw>,
    ) {
        let Some(position) = self.parts.fields.iter().position(|f| f.name == target.field.name) else { return };
        let Some(region) = self.parts.regions.get(&place.name) else { return };
        let field = &self.parts.fields[position];
        let name = format!("load{} of {} on {}", k + 1, target.field.name, place.name);
        if let RegionSet::Nodes(nodes) = &region.set {
            self.point_load(load, &name, target, place, nodes, out);
            return;
        }
        let set = restricted(field, &region.set);
        if self.parts.mesh.team().all(set.is_empty()) {
            let d = Diagnostic::new(
                "E401",
                format!("`load {}` meets no part of `{}`", target.field.name, target.field.name),
            );
            let text =
                format!("the {} {} of `{}` belong to other fields", region.set.len(), region.set.kind(), place.name);
            self.diagnostics.push(d.at(place.span, text));
            return;
        }
        let named = NamedRegion { set: set.clone(), ..region.clone() };
        let sig = place_sig(&place.name, &named, self.parts.mesh, self.parts.fields);
        let part = match &target.part {
            TargetPart::Whole => LoadPart::Whole,
            TargetPart::Normal => LoadPart::Normal,
            TargetPart::Component(e) => match component(self.parts.env, e, field, self.diagnostics) {
                Some(c) => LoadPart::Component(c),
                None => return,
            },
        };
        let source = TermSource::Load { value: &load.value, field: FieldId::new(position), part };
        let before = out.len();
        self.push(&sig, &name, source, Some(set), load.span, out);
        let own = Loaded { field: position, span: load.span, normal: part == LoadPart::Normal };
        out[before..].iter_mut().for_each(|law| law.load = Some(own));
    }

    /// The rule of every region that has terms: what `quadrature` says, else the largest degree its terms need.
    pub(super) fn rules(&mut self, laws: &[PlacedLaw]) -> Rules {
        let mut rules = Rules::new();
        for law in laws {
            let degree = law.law.degree.rule();
            let slot = rules.entry(law.place.clone()).or_insert(RuleChoice::Degree(degree));
            if let RuleChoice::Degree(d) = slot {
                *d = (*d).max(degree);
            }
        }
        for statement in &self.parts.script.quadratures {
            let choice = match &statement.rule {
                QuadratureRule::Vertex => Some(RuleChoice::Vertex),
                QuadratureRule::Degree(e) => number(self.parts.env, "the degree of a rule", e, self.diagnostics)
                    .and_then(|d| {
                        #[expect(
                            clippy::cast_possible_truncation,
                            clippy::cast_sign_loss,
                            reason = "checked in the guard"
                        )]
                        if d.fract() == 0.0 && (0.0..=MAX_DEGREE).contains(&d) {
                            return Some(RuleChoice::Degree(d as usize));
                        }
                        let m = Diagnostic::new(
                            "E411",
                            format!(
                                "the degree of a quadrature rule is a whole number from 0 to {MAX_DEGREE}, found {d}"
                            ),
                        );
                        self.diagnostics.push(m.at(e.span, ""));
                        None
                    }),
            };
            let Some(choice) = choice else { continue };
            for place in &statement.places {
                rules.insert(place.name.clone(), choice);
            }
        }
        rules
    }
}

/// The component named in `u(1)`, from 0.
pub(super) fn component(
    env: &Env<'_>,
    e: &wfl::ast::Expr,
    field: &Field,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<usize> {
    let x = number(env, "a component", e, diagnostics)?;
    let n = field.n_components;
    #[expect(clippy::cast_precision_loss, reason = "few components")]
    if x.fract() == 0.0 && x >= 1.0 && x <= n as f64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        return Some(x as usize - 1);
    }
    let list: Vec<String> = (1..=n).map(|k| k.to_string()).collect();
    let d = Diagnostic::new("E104", format!("index {x} is out of range")).note("indices start at 1, as in GWFL");
    let words = if n == 1 {
        "a scalar has one component".to_owned()
    } else {
        format!("vector({n}) has the components {}", list.join(", "))
    };
    diagnostics.push(d.at(e.span, words));
    None
}

/// The part of a region where a field lives.
pub(super) fn restricted(field: &Field, set: &RegionSet) -> RegionSet {
    match set {
        RegionSet::Cells(c) => RegionSet::Cells(c.iter().copied().filter(|c| field.lives_in_cell(*c)).collect()),
        RegionSet::Facets(f) => RegionSet::Facets(f.iter().copied().filter(|f| field.lives_on_facet(*f)).collect()),
        RegionSet::Interface(i) => {
            RegionSet::Interface(i.iter().copied().filter(|p| field.lives_on_facet(p.here)).collect())
        }
        RegionSet::Nodes(n) => RegionSet::Nodes(n.clone()),
    }
}

/// The domain of a set under a rule.
pub(super) fn domain(
    mesh: &Mesh,
    fields: &[Field],
    set: Option<&RegionSet>,
    choice: RuleChoice,
    span: Span,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Arc<Domain>> {
    let Some(set) = set else { return Some(Arc::new(Domain::global(mesh))) };
    // only a field of a higher degree than those found is looked for there: scenes may have many fields
    let higher = |most: Option<usize>, f: &Field| {
        let counts = most.is_none_or(|m| f.degree() > m) && mesh.team().any(!restricted(f, set).is_empty());
        if counts { Some(f.degree()) } else { most }
    };
    let nodes = fields.iter().fold(None, higher).unwrap_or(1);
    let refused = std::cell::Cell::new(None);
    let make = |kind: CellKind| -> Rule {
        let made = match choice {
            RuleChoice::Vertex => nodal(kind, nodes),
            RuleChoice::Degree(d) => rule(kind, d),
        };
        made.unwrap_or_else(|e| {
            refused.set(Some(e));
            vertex(kind)
        })
    };
    let made = Domain::new(mesh, set, &make);
    if let Some(e) = refused.get() {
        diagnostics.push(Diagnostic::new("E411", e.to_string()).at(span, ""));
        return None;
    }
    match made {
        Ok(d) => Some(Arc::new(d)),
        Err(e) => {
            diagnostics.push(Diagnostic::new("E409", e.to_string()).at(span, ""));
            None
        }
    }
}
