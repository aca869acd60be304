//! The rules of measures and states on regions that have no terms by their name: those of the terms on the same entities.
//!
//! A force is what its term sums over the points of its rule. Measured on a part of the region of the term, on the same faces
//! under another name or from the other side of an interface, it is the sum over the same points. Promises: a rule that a
//! statement gives to a region is that of its measures; a law with kinks takes the rule that a statement or kinks give to terms
//! on its entities; the rule of a region's own terms comes before that of others, and what has no kinks keeps it: a second name
//! of a region is how terms get rules of their own.

use wfl_mesh::mesh::{Mesh, RegionSet};

use super::{
    regions::Regions,
    rule_choice::{RuleChoice, Rules},
};

/// What is asked for a rule.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    /// The name of its region.
    pub(super) place: &'a str,
    /// Its entities.
    pub(super) set: &'a RegionSet,
    /// The statements that give rules.
    pub(super) statements: &'a [wfl::Quadrature],
    /// It has kinks.
    pub(super) is_kinked: bool,
    /// The mapping that it reads through.
    pub(super) mapping: Option<usize>,
}

/// A rule on some entities.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Chosen {
    /// `None` where no term has one.
    pub(super) rule: Option<RuleChoice>,
    /// A statement gives it.
    pub(super) is_given: bool,
}

/// What tells an entity from others, from whichever side it is seen: its vertices, or its number for a cell.
type Key = [u32; 4];

/// The keys of the entities of a set, by entity: of an interface those of both sides, whose nodes may be two. `None` for
/// what has no rules.
fn keys(mesh: &Mesh, set: &RegionSet) -> Option<Vec<[Key; 2]>> {
    let facet = |facet| {
        let of = mesh.facet_vertices(facet);
        let mut key = [u32::MAX; 4];
        key.iter_mut().zip(&of.vertices[..of.kind.n_vertices()]).for_each(|(k, v)| *k = v.index() as u32);
        key.sort_unstable();
        key
    };
    Some(match set {
        RegionSet::Cells(cells) => cells.iter().map(|c| [[c.index() as u32, 0, 0, 0]; 2]).collect(),
        RegionSet::Facets(facets) => facets.iter().map(|f| [facet(*f); 2]).collect(),
        RegionSet::Interface(pairs) => pairs.iter().map(|p| [facet(p.here), facet(p.there)]).collect(),
        RegionSet::Edges(_) | RegionSet::Nodes(_) => return None,
    })
}

/// Whether two sets have an entity in common, under whatever names and from whichever side.
pub(super) fn share(mesh: &Mesh, a: &RegionSet, b: &RegionSet) -> bool {
    if matches!(a, RegionSet::Cells(_)) != matches!(b, RegionSet::Cells(_)) {
        return false;
    }
    let (Some(a), Some(b)) = (keys(mesh, a), keys(mesh, b)) else { return false };
    let mut all: Vec<Key> = a.into_iter().flatten().collect();
    all.sort_unstable();
    b.iter().flatten().any(|key| all.binary_search(key).is_ok())
}

/// Members of a set, by their positions.
fn some(set: &RegionSet, at: &[usize]) -> RegionSet {
    match set {
        RegionSet::Cells(list) => RegionSet::Cells(at.iter().map(|k| list[*k]).collect()),
        RegionSet::Facets(list) => RegionSet::Facets(at.iter().map(|k| list[*k]).collect()),
        RegionSet::Interface(list) => RegionSet::Interface(at.iter().map(|k| list[*k]).collect()),
        RegionSet::Edges(list) => RegionSet::Edges(at.iter().map(|k| list[*k]).collect()),
        RegionSet::Nodes(list) => RegionSet::Nodes(at.iter().map(|k| list[*k]).collect()),
    }
}

impl Asked<'_> {
    fn chosen(&self, name: &str, choice: Option<&RuleChoice>) -> Chosen {
        let is_given = self.statements.iter().flat_map(|q| &q.places).any(|p| p.name == name);
        Chosen { rule: choice.map(|choice| choice.through(self.mapping)), is_given }
    }

    /// How well a rule suits the law: the largest suits best.
    fn rank(of: Chosen) -> (bool, usize, usize) {
        let (kind, degree) = match of.rule {
            None => (0, 0),
            Some(RuleChoice::Degree(degree)) => (1, degree),
            Some(RuleChoice::Nodes { degree, .. }) => (2, degree),
            Some(RuleChoice::Vertex) => (3, 0),
            Some(RuleChoice::Segments { degree, .. }) => (4, degree),
        };
        (of.is_given, kind, degree)
    }

    /// The parts of the set by the rule of the terms there.
    pub(super) fn by_rule(&self, mesh: &Mesh, regions: &Regions, rules: &Rules) -> Vec<(RegionSet, Chosen)> {
        let own = self.chosen(self.place, rules.get(self.place));
        let others = rules.iter().map(|(name, choice)| (name, self.chosen(name, Some(choice))));
        let others: Vec<(&String, Chosen)> = others.filter(|_| self.is_kinked).collect();
        if own.is_given || others.is_empty() {
            return vec![(self.set.clone(), own)];
        }
        let is_of_degree = matches!(own.rule, Some(RuleChoice::Degree(_)) | None);
        // on cells terms with kinks have rules of a degree, too: those of the region's own
        let is_own = own.rule.is_some() && matches!(self.set, RegionSet::Cells(_));
        // a rank without faces of a region knows no rule at its nodes
        let is_last = mesh.team().any(is_own || !is_of_degree);
        let entities = keys(mesh, self.set).filter(|_| !is_last);
        let Some(entities) = entities else { return vec![(self.set.clone(), own)] };
        // by entity the best so far and where it comes from: ranks that lack a region may think another rule of it, so that parts
        // are told apart by the names of the regions
        let mut found = vec![(own, 0); entities.len()];
        let mut choices = vec![own];
        let is_alike = |set: &&RegionSet| matches!(set, RegionSet::Cells(_)) == matches!(self.set, RegionSet::Cells(_));
        for (name, other) in others {
            choices.push(other);
            let Some(set) = regions.get(name).map(|region| &region.set).filter(is_alike) else { continue };
            let Some(members) = keys(mesh, set) else { continue };
            let mut members: Vec<Key> = members.into_iter().flatten().collect();
            members.sort_unstable();
            for (entity, best) in entities.iter().zip(&mut found) {
                let is_there = || entity.iter().any(|key| members.binary_search(key).is_ok());
                if Self::rank(other) > Self::rank(best.0) && is_there() {
                    *best = (other, choices.len() - 1);
                }
            }
        }
        let mut parts = Vec::new();
        for (n, choice) in choices.into_iter().enumerate() {
            let at: Vec<usize> = (0..found.len()).filter(|k| found[*k].1 == n).collect();
            // on all ranks or none
            if mesh.team().any(!at.is_empty()) {
                parts.push((some(self.set, &at), choice));
            }
        }
        if parts.is_empty() {
            parts.push((self.set.clone(), own));
        }
        parts
    }
}
