//! Terms and loads compiled on their regions; one quadrature rule for each region.

use std::sync::Arc;

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{Ident, TargetPart},
};
use wfl_compiler::{
    Class, Env, FrozenLaw, LoadPart, PrintLaw, TermLaw, TermSource, compile_frozen, compile_prints, compile_term,
    types::{FieldId, PlaceSig},
};
use wfl_discrete::{
    assemble::Domain,
    field::{Field, FieldSpace},
    space::Support,
};
use wfl_mesh::{
    mesh::{CellKind, Mesh, RegionKind, RegionSet},
    quadrature::{Rule, beside_axis, composite, nodal, one_per_node, vertex},
};

use crate::{
    Parts, Scene,
    constants::number,
    edges,
    fields::{global_place, has_neighbours, place_sig},
    regions::NamedRegion,
    rule_choice::end_on_axis,
};

/// Where a load is written and what it pulls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loaded {
    pub(super) field: usize,
    pub(super) span: Span,
    /// `load u.Normal`
    pub(super) normal: bool,
}

/// Which statement a law comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// `term`, `energy`: its number among them.
    Term(usize),
    /// `load`: its number, and that of its target.
    Load(usize, usize),
}

/// A compiled term with its place, before kernels and dofs.
pub(super) struct PlacedLaw {
    pub(super) law: TermLaw,
    /// The same term in its frozen form.
    pub(super) frozen: Option<FrozenLaw>,
    /// What it prints.
    pub(super) prints: Vec<PrintLaw>,
    /// The name of the region, or of the restricted region of a load.
    pub(super) place: String,
    pub(super) set: Option<RegionSet>,
    /// The points of a load on nodes; others follow from set and rule.
    pub(super) at_nodes: Option<Arc<Domain>>,
    /// What it is as a load, if it is one.
    pub(super) load: Option<Loaded>,
    pub(super) origin: Origin,
    pub(super) span: Span,
}

pub use super::rule_choice::RuleChoice;
pub(super) use super::rule_choice::Rules;

pub(super) struct TermMaker<'a> {
    pub(super) parts: Parts<'a>,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl TermMaker<'_> {
    /// All terms and loads of the scene.
    pub(super) fn make(&mut self) -> Vec<PlacedLaw> {
        let mut out = Vec::new();
        for (k, term) in self.parts.script.terms.iter().enumerate() {
            let mut list = Listed::default();
            for place in &term.places {
                let Some((sig, set)) = self.place(place) else { continue };
                let Some(set) = list.rest(self.parts.mesh, place, set, self.diagnostics) else { continue };
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
                self.push(&sig, &name, source, (set, Origin::Term(k), term.span), &mut out);
            }
        }
        for (k, load) in self.parts.script.loads.iter().enumerate() {
            for (number, target) in load.targets.iter().enumerate() {
                let mut list = Listed::default();
                for place in &load.places {
                    self.load((Origin::Load(k, number), load), target, place, &mut list, &mut out);
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
        of: (Option<RegionSet>, Origin, Span),
        out: &mut Vec<PlacedLaw>,
    ) {
        let (set, origin, span) = of;
        let compiled = compile_term(self.parts.env, sig, name, source);
        for d in compiled.diagnostics {
            if !self.diagnostics.contains(&d) {
                self.diagnostics.push(d);
            }
        }
        if let Some(law) = compiled.value {
            let before = out.iter().filter(|l| l.frozen.is_some()).count();
            let branches = FieldId::new(self.parts.fields.len() + FrozenLaw::FIELDS * before);
            let kinked = law.class == Class::Kinked;
            let frozen = if kinked { compile_frozen(self.parts.env, sig, name, &law.listing, branches) } else { None };
            let prints = compile_prints(self.parts.env, sig, name, &law.listing);
            let place = sig.name.clone();
            out.push(PlacedLaw { law, frozen, prints, place, set, at_nodes: None, load: None, origin, span });
        }
    }

    /// What a place is; `None` after a message. Regions that failed earlier give no further message.
    pub(super) fn place(&mut self, place: &Ident) -> Option<(PlaceSig, Option<RegionSet>)> {
        if place.name == "global" {
            return Some((global_place(self.parts.fields.len()), None));
        }
        let region = self.parts.regions.get(&place.name)?;
        let support = region.support();
        if let RegionSet::Nodes(_) = support {
            let d = Diagnostic::new(
                Code::E405,
                format!("nothing can be integrated over `{}`, a region of nodes", place.name),
            );
            let d = d.at(place.span, "cells, faces or the rim of faces are needed");
            self.diagnostics.push(d.help("a force at nodes is a load: load u = [0,-1] on the region"));
            return None;
        }
        self.has_edges(place)?;
        let region = self.parts.regions.get(&place.name)?;
        Some((place_sig(&place.name, region, self.parts.mesh, self.parts.fields), Some(support)))
    }

    /// E490 for the rim of a surface of which single nodes are taken.
    fn has_edges(&mut self, place: &Ident) -> Option<()> {
        let region = self.parts.regions.get(&place.name)?;
        if region.edges.as_ref().is_none_or(|edges| !self.parts.mesh.lacks(edges)) {
            return Some(());
        }
        let d = Diagnostic::new(Code::E490, format!("no edge lies in `{}`: nothing is integrated over it", place.name));
        let text = format!("{} single nodes of a rim", region.set.len());
        let d = d.help("rim of SURFACE where ...: a condition that holds at both ends of its edges and between");
        self.diagnostics.push(d.at(place.span, text));
        None
    }

    /// E405 for edges between two faces, of which a load does not say which one it acts on.
    fn has_two_sides(&mut self, place: &Ident, set: &RegionSet) -> bool {
        let found = matches!(set, RegionSet::Edges(edges) if has_neighbours(edges, self.parts.mesh));
        if found {
            let d = Diagnostic::new(Code::E405, format!("`{}` lies between faces: a load has one side", place.name));
            let d = d.help("a term has both: term t on inner : q*(Test_p + Interpolate(Test_p, neighbor_element))");
            self.diagnostics.push(d.at(place.span, "edges with the values of two faces"));
        }
        found
    }

    fn load<'s>(
        &mut self,
        numbered: (Origin, &wfl::Condition),
        target: &wfl::ast::Target,
        place: &'s Ident,
        list: &mut Listed<'s>,
        out: &mut Vec<PlacedLaw>,
    ) {
        let (origin, load) = numbered;
        let Some(position) = self.parts.fields.iter().position(|f| f.name == target.field.name) else { return };
        let Some(region) = self.parts.regions.get(&place.name) else { return };
        // in the plane a rim is its points: a force at a node of a body
        let plain = self.parts.mesh.dim() < 3 && !lives_on_faces(&self.parts.fields[position]);
        // where faces cross, their edges are counted by each of them: a load is one at the nodes
        let cross = edges::cross(self.parts.script, &place.name);
        let set = Some(if plain || cross { region.set.clone() } else { region.support() });
        if !cross && self.has_edges(place).is_none() {
            return;
        }
        let Some(Some(of_list)) = list.rest(self.parts.mesh, place, set, self.diagnostics) else { return };
        let field = &self.parts.fields[position];
        let Origin::Load(k, _) = origin else { return };
        let name = format!("load{} of {} on {}", k + 1, target.field.name, place.name);
        if let RegionSet::Nodes(nodes) = &of_list {
            self.point_load((origin, load), &name, target, place, nodes, out);
            return;
        }
        if self.has_two_sides(place, &of_list) {
            return;
        }
        let set = restricted(field, &of_list);
        if self.parts.mesh.team().all(set.is_empty()) {
            let d = Diagnostic::new(
                Code::E401,
                format!("`load {}` meets no part of `{}`", target.field.name, target.field.name),
            );
            let text = format!("the {} {} of `{}` belong to other fields", of_list.len(), of_list.kind(), place.name);
            self.diagnostics.push(d.at(place.span, text));
            return;
        }
        let named = match &set {
            RegionSet::Edges(edges) => NamedRegion { edges: Some(edges.clone()), ..region.clone() },
            _ => NamedRegion { set: set.clone(), ..region.clone() },
        };
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
        self.push(&sig, &name, source, (Some(set), origin, load.span), out);
        let own = Loaded { field: position, span: load.span, normal: part == LoadPart::Normal };
        out[before..].iter_mut().for_each(|law| law.load = Some(own));
    }
}

/// The regions of a list so far: what lies in several of them counts once, `on a, b` is the union of both.
#[derive(Default)]
pub(super) struct Listed<'s> {
    before: Vec<(&'s Ident, RegionSet)>,
}

impl<'s> Listed<'s> {
    /// What a region adds to those before it in the list, with W420 where that is not all of it; `None` for nothing.
    #[expect(clippy::option_option, reason = "single numbers have no set")]
    pub(super) fn rest(
        &mut self,
        mesh: &Mesh,
        place: &'s Ident,
        set: Option<RegionSet>,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Option<Option<RegionSet>> {
        let Some(set) = set else { return Some(None) };
        let mut rest = set.clone();
        for (name, before) in self.before.iter().filter(|(_, before)| before.kind() == set.kind()) {
            let left = rest.difference(before).unwrap_or_else(|_| rest.clone());
            let shared = rest.len() - left.len();
            if mesh.check_whole(|| shared > 0) {
                let one = match set.kind() {
                    RegionKind::Cells => "cell",
                    RegionKind::Facets | RegionKind::Interface => "face",
                    RegionKind::Edges => "edge",
                    RegionKind::Nodes => "node",
                };
                let many = if shared == 1 { format!("1 {one}") } else { format!("{shared} {one}s") };
                let text =
                    format!("`{}` and `{}` have {many} in common: what is in both counts once", name.name, place.name);
                let d = Diagnostic::new(Code::W420, text).at(place.span, format!("{shared} of {}", set.len()));
                let d = d.at(name.span, "");
                let d = d.help("a list is the union of its regions; what is to count twice stands in two statements");
                if !diagnostics.contains(&d) {
                    diagnostics.push(d);
                }
            }
            rest = left;
        }
        // where a rank has a part of the mesh, all of them keep or leave out a region
        let adds = mesh.team().any(!rest.is_empty()) || mesh.team().all(set.is_empty());
        self.before.push((place, set));
        adds.then_some(Some(rest))
    }
}

impl Scene {
    /// The text of a law; `None` where the script has no such statement.
    #[must_use]
    pub fn source_of<'s>(&self, script: &'s ResolvedScript, origin: Origin) -> Option<TermSource<'s>> {
        match origin {
            Origin::Term(k) => {
                let term = script.terms.get(k)?;
                Some(if term.energy { TermSource::Energy(&term.expr) } else { TermSource::Residual(&term.expr) })
            }
            Origin::Load(k, target) => {
                let load = script.loads.get(k)?;
                let (field, part) = self.load_part(load.targets.get(target)?)?;
                Some(TermSource::Load { value: &load.value, field, part })
            }
        }
    }

    /// The field that a load acts on, and which part of it; `None` for a component that is none.
    fn load_part(&self, target: &wfl::ast::Target) -> Option<(FieldId, LoadPart)> {
        let position = self.system.fields.iter().position(|f| f.name == target.field.name)?;
        let part = match &target.part {
            TargetPart::Whole => LoadPart::Whole,
            TargetPart::Normal => LoadPart::Normal,
            TargetPart::Component(e) => {
                LoadPart::Component(component(&self.open_env(), e, &self.system.fields[position], &mut Vec::new())?)
            }
        };
        Some((FieldId::new(position), part))
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
    let d = Diagnostic::new(Code::E104, format!("index {x} is out of range")).note("indices start at 1, as in GWFL");
    let words = if n == 1 {
        "a scalar has one component".to_owned()
    } else {
        format!("vector({n}) has the components {}", list.join(", "))
    };
    diagnostics.push(d.at(e.span, words));
    None
}

/// True for a field whose nodes are those of faces.
fn lives_on_faces(field: &Field) -> bool {
    matches!(&field.space, FieldSpace::Nodal(space) if matches!(space.support(), Support::Facets(_)))
}

/// The part of a region where a field lives.
pub(super) fn restricted(field: &Field, set: &RegionSet) -> RegionSet {
    match set {
        RegionSet::Cells(c) => RegionSet::Cells(c.iter().copied().filter(|c| field.lives_in_cell(*c)).collect()),
        RegionSet::Facets(f) => RegionSet::Facets(f.iter().copied().filter(|f| field.lives_on_facet(*f)).collect()),
        RegionSet::Interface(i) => {
            RegionSet::Interface(i.iter().copied().filter(|p| field.lives_on_facet(p.here)).collect())
        }
        RegionSet::Edges(edges) => {
            RegionSet::Edges(edges.iter().copied().filter(|e| field.lives_on_edge(*e)).collect())
        }
        RegionSet::Nodes(n) => RegionSet::Nodes(n.clone()),
    }
}

/// How the points of a domain are chosen: a rule on each of so many even parts of an entity along each direction. Nodal
/// rules are of the whole entity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PointsOf {
    pub(super) rule: RuleChoice,
    pub(super) parts: usize,
}

impl From<RuleChoice> for PointsOf {
    fn from(rule: RuleChoice) -> Self {
        Self { rule, parts: 1 }
    }
}

/// The domain of a set under a rule.
pub(super) fn domain(
    mesh: &Mesh,
    fields: &[Field],
    set: Option<&RegionSet>,
    points: impl Into<PointsOf>,
    span: Span,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Arc<Domain>> {
    let Some(set) = set else { return Some(Arc::new(Domain::global(mesh))) };
    let PointsOf { rule, parts } = points.into();
    // only a field of a higher degree than those found is looked for there: scenes may have many fields
    let higher = |most: Option<usize>, f: &Field| {
        // both sides of an interface have forces at their nodes
        let lives = || match set {
            RegionSet::Interface(pairs) => pairs.iter().any(|p| f.lives_on_facet(p.here) || f.lives_on_facet(p.there)),
            set => !restricted(f, set).is_empty(),
        };
        let counts = most.is_none_or(|m| f.degree() > m) && mesh.team().any(lives());
        if counts { Some(f.degree()) } else { most }
    };
    let nodes = fields.iter().fold(None, higher).unwrap_or(1);
    let refused = std::cell::Cell::new(None);
    let make = |kind: CellKind| -> Rule {
        let made = match rule {
            RuleChoice::Vertex => nodal(kind, nodes),
            RuleChoice::Nodes { degree, .. } => Ok(one_per_node(kind, degree)),
            RuleChoice::Degree(d) | RuleChoice::Segments { degree: d, .. } => composite(kind, d, parts),
        };
        made.unwrap_or_else(|e| {
            refused.set(Some(e));
            vertex(kind)
        })
    };
    let made = match rule {
        RuleChoice::Nodes { degree, axis: Some(axis) } => Domain::by_facet(mesh, set, &make, &|facet| {
            let end = end_on_axis(mesh, facet, axis)?;
            Some((end, beside_axis(degree, 1 - end)))
        }),
        _ => Domain::new(mesh, set, &make),
    };
    if let Some(e) = refused.get() {
        diagnostics.push(Diagnostic::new(Code::E411, e.to_string()).at(span, ""));
        return None;
    }
    match made {
        Ok(d) => Some(Arc::new(d)),
        Err(e) => {
            diagnostics.push(Diagnostic::new(Code::E409, e.to_string()).at(span, ""));
            None
        }
    }
}
