//! Compiled laws on their points: kernels, quadrature points and bindings of every term, and the terms of contact.
//! Does not compile expressions and does not number unknowns.

use std::{collections::BTreeMap, sync::Arc};

use wfl::{Code, Diagnostic, Span};
use wfl_compiler::{
    Class, TermLaw,
    backend::{KernelBackend, PointKernel},
    ir::VerifiedKernel,
    types::FieldKind,
};
use wfl_contact::ContactTerm;
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots, tangent_kernel},
    pruning::Pruning,
    system::{FrozenTerm, Numbering},
};
use wfl_mesh::mesh::RegionSet;

use super::{
    Builder, TermSummary,
    held::Frozen,
    low_rules,
    mappings::{Through, fields_there},
    outputs::facet_support,
    terms::{PlacedLaw, PointsOf, RuleChoice, Rules, domain},
};

/// The terms of a scene, made.
pub(super) struct Assembled {
    pub(super) terms: Vec<AssembledTerm>,
    pub(super) summaries: Vec<TermSummary>,
    pub(super) contact: Vec<(FrozenTerm, ContactTerm)>,
}

/// Where a law is integrated: the name, the entities, and the mapping it reads through with the fields it reads there.
pub(super) type Place = (String, Option<RegionSet>, Option<Through>);

/// The points of places that were made.
type Domains = Vec<((Place, PointsOf), Arc<Domain>)>;

/// Residual and tangent.
type Pair = (Box<dyn PointKernel>, Option<Box<dyn PointKernel>>);

/// The compiled kernels of one law.
struct Kernels {
    as_written: Pair,
    /// With frozen active set.
    frozen: Option<Pair>,
}

impl Builder<'_> {
    /// All terms; `None` after an error.
    pub(super) fn assemble_terms(
        &mut self,
        laws: Vec<PlacedLaw>,
        rules: &Rules,
        numbering: &Numbering,
    ) -> Option<Assembled> {
        let highest = laws.iter().map(|l| l.law.degree.rule()).max().unwrap_or(0);
        let kernels = self.kernels(&laws)?;
        // an exact rule gives the same with more points; states have values at the points of their region's rule
        let raised = self.keep.contains(&Pruning::Quadrature) && self.fields.iter().all(|f| f.kind != FieldKind::State);
        let least =
            |law: &TermLaw| if raised && law.class <= Class::Linear && law.degree.is_exact() { highest } else { 0 };
        let reasons = self.reasons(&laws);
        let mut domains = Domains::new();
        let mut made = Assembled { terms: Vec::new(), summaries: Vec::new(), contact: Vec::new() };
        let mut complete = true;
        for (placed, kernels) in laws.into_iter().zip(kernels) {
            let choice = match rules
                .get(&placed.place)
                .map_or(RuleChoice::Degree(1), |choice| choice.of(&placed.law, &self.fields))
            {
                RuleChoice::Degree(degree) => RuleChoice::Degree(degree.max(least(&placed.law))),
                nodes => nodes,
            };
            let choice = if placed.at_nodes.is_some() { RuleChoice::Vertex } else { choice };
            let points = PointsOf { rule: choice, parts: self.sampling.of_term(made.terms.len()) };
            let Some(domain) = self.domain_of(&placed, points, &mut domains) else {
                complete = false;
                continue;
            };
            self.mesh.check_whole(|| {
                let made = low_rules::Made { domain: &domain, rule: choice };
                low_rules::check(self.script, &placed, made, &self.fields, self.diagnostics);
            });
            let slots = LawSlots { inputs: &placed.law.inputs, tests: &placed.law.tests, trials: &placed.law.trials };
            match Binding::new(&self.mesh, &domain, &self.fields, slots) {
                Ok(binding) => {
                    let why = why(&placed, choice, &reasons);
                    made.summaries.push(summary(&placed, choice, why, &domain));
                    self.add_term(
                        placed,
                        kernels,
                        Integrator { domain, binding: Arc::new(binding) },
                        numbering,
                        &mut made,
                    );
                }
                Err(e) => {
                    self.diagnostics.push(Diagnostic::new(Code::E202, e.to_string()).at(placed.span, ""));
                    complete = false;
                }
            }
        }
        complete.then_some(made)
    }

    /// By region: that a statement gives its rule, or the term that asks for the highest degree.
    fn reasons(&self, laws: &[PlacedLaw]) -> Reasons {
        let mut reasons = Reasons::new();
        for law in laws {
            let (degree, name) = (law.law.degree.rule(), law.law.name.clone());
            let slot = reasons.entry(law.place.clone()).or_insert_with(|| Reason::Term(degree, name.clone()));
            if matches!(slot, Reason::Term(known, _) if *known < degree) {
                *slot = Reason::Term(degree, name);
            }
        }
        for place in self.script.quadratures.iter().flat_map(|q| &q.places) {
            reasons.insert(place.name.clone(), Reason::Given);
        }
        reasons
    }

    /// The kernels of all laws, compiled at once; `None` after a message.
    fn kernels(&mut self, laws: &[PlacedLaw]) -> Option<Vec<Kernels>> {
        let tangents: Vec<[Option<VerifiedKernel>; 2]> = laws
            .iter()
            .map(|l| [tangent_kernel(&l.law), l.frozen.as_ref().and_then(|p| tangent_kernel(&p.law))])
            .collect();
        let kernels: Vec<&VerifiedKernel> = laws
            .iter()
            .zip(&tangents)
            .flat_map(|(l, [tangent, frozen])| {
                let residual = l.frozen.as_ref().map(|p| &p.law.residual);
                std::iter::once(&l.law.residual).chain(tangent).chain(residual).chain(frozen)
            })
            .collect();
        let mut compiled = match self.batch.compile(&kernels) {
            Ok(compiled) => compiled.into_iter(),
            Err(e) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, e.to_string()));
                return None;
            }
        };
        let mut all = Vec::with_capacity(laws.len());
        for (law, [tangent, frozen_tangent]) in laws.iter().zip(&tangents) {
            let as_written = (compiled.next()?, tangent.as_ref().and_then(|_| compiled.next()));
            let frozen = match law.frozen {
                Some(_) => Some((compiled.next()?, frozen_tangent.as_ref().and_then(|_| compiled.next()))),
                None => None,
            };
            all.push(Kernels { as_written, frozen });
        }
        Some(all)
    }

    /// A term with what it prints and, where it has projections, its law of contact.
    fn add_term(
        &mut self,
        placed: PlacedLaw,
        kernels: Kernels,
        integrator: Integrator,
        numbering: &Numbering,
        made: &mut Assembled,
    ) {
        let place = placed.set.as_ref().and_then(facet_support);
        for print in placed.prints {
            match self.print(print, &placed.law.name, &integrator.domain) {
                Ok(made) => self.prints.push(made),
                Err(e) => self.diagnostics.push(Diagnostic::new(Code::E609, e)),
            }
        }
        if let (Some(law), Some(kernels)) = (placed.frozen, kernels.frozen) {
            let frozen = Frozen { term: made.terms.len(), position: made.contact.len() };
            match self.freeze(law, kernels, &integrator.domain, frozen, numbering) {
                Ok(contact) => made.contact.push(contact),
                Err(e) => self.diagnostics.push(Diagnostic::new(Code::E609, e)),
            }
        }
        let (residual, tangent) = kernels.as_written;
        made.terms.push(AssembledTerm::new(placed.law, integrator, place, residual, tangent, &numbering.starts));
    }

    /// The points of a law, shared with laws on the same place with the same rule; `None` after a message.
    fn domain_of(&mut self, placed: &PlacedLaw, points: PointsOf, known: &mut Domains) -> Option<Arc<Domain>> {
        let law = &placed.law;
        // images that move are the same whatever is read there
        let moves = law.listing.graph.moves.is_some();
        let there = if moves { Vec::new() } else { fields_there(&law.inputs, law.tests.iter().chain(&law.trials)) };
        let mapping = law.listing.graph.mapping.map(|mapping| Through { mapping, there, pieces: None });
        let place = ((placed.place.clone(), placed.set.clone(), mapping), points);
        // a set that is one with another on some ranks alone is another one
        let is_known = |d: &&((Place, PointsOf), Arc<Domain>)| self.mesh.team().all(d.0 == place);
        let shared = known.iter().find(is_known).map(|d| d.1.clone());
        placed.at_nodes.clone().or(shared).or_else(|| {
            let made = self.domain(&place.0, points, placed.span)?;
            known.push((place, made.clone()));
            Some(made)
        })
    }

    /// The points of a place, with images where a mapping is read through; `None` after a message.
    pub(super) fn domain(&mut self, place: &Place, points: impl Into<PointsOf>, span: Span) -> Option<Arc<Domain>> {
        let (_, set, mapping) = place;
        let points = points.into();
        let base = domain(&self.mesh, &self.fields, set.as_ref(), points, span, self.diagnostics)?;
        match mapping {
            None => Some(base),
            Some(at) => {
                let at = Through { pieces: points.rule.pieces(), ..at.clone() };
                self.mappings.domain(&at, &self.mesh, &self.fields, &base, span, self.diagnostics)
            }
        }
    }
}

/// Why a region has its rule.
enum Reason {
    /// A statement says so.
    Given,
    /// The highest degree, and the term that asks for it.
    Term(usize, String),
}

/// By region.
type Reasons = BTreeMap<String, Reason>;

/// Why a term has its rule, in words.
fn why(placed: &PlacedLaw, choice: RuleChoice, reasons: &Reasons) -> String {
    let own = placed.law.degree;
    match (choice, reasons.get(&placed.place)) {
        _ if placed.at_nodes.is_some() => "at nodes".to_owned(),
        (_, Some(Reason::Given)) => "given".to_owned(),
        (RuleChoice::Nodes { axis: Some(_), .. }, _) if own.kinked => {
            "kinks: a point a node, none on the axis".to_owned()
        }
        (RuleChoice::Nodes { .. }, _) if own.kinked => "kinks: a point a node".to_owned(),
        (RuleChoice::Degree(degree), _) if degree == own.rule() => own.why().to_owned(),
        (RuleChoice::Degree(degree), Some(Reason::Term(highest, name))) if degree == *highest => {
            format!("that of `{name}`")
        }
        _ => "shared with other terms".to_owned(),
    }
}

fn summary(placed: &PlacedLaw, choice: RuleChoice, why: String, domain: &Domain) -> TermSummary {
    TermSummary {
        name: placed.law.name.clone(),
        origin: placed.origin,
        span: placed.span,
        place: placed.place.clone(),
        class: placed.law.class,
        symmetric: placed.law.symmetric,
        rule: choice,
        why,
        n_points: domain.groups.iter().map(|g| g.n_points()).max().unwrap_or(0),
        instructions: (placed.law.residual.kernel().insts.len(), placed.law.tangent.kernel().insts.len()),
    }
}
