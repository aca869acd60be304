//! The rules of measures and states on regions that have no terms by their name: those of the terms on the same entities.
//!
//! A force is what its term sums over the points of its rule. Measured on a part of the region of the term, on the same faces
//! under another name or from the other side of an interface, it is the sum over the same points. Promises: the rule of a
//! region's own terms comes first; where none is, a law with kinks takes the rule at nodes that terms with kinks have there.

use super::{
    regions::Regions,
    rule_choice::{RuleChoice, Rules},
};
use crate::mesh::{Mesh, RegionSet};

/// What is asked for a rule.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    /// The name of its region.
    pub(super) place: &'a str,
    /// Its entities.
    pub(super) set: &'a RegionSet,
    /// The rule of that region is given by a statement.
    pub(super) is_given: bool,
    /// It has kinks.
    pub(super) is_kinked: bool,
    /// The mapping that it reads through.
    pub(super) mapping: Option<usize>,
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
    /// How well a rule suits the law: the largest suits best.
    fn rank(&self, choice: RuleChoice) -> (usize, usize) {
        match choice {
            RuleChoice::Degree(degree) => (usize::from(!self.is_kinked), degree),
            RuleChoice::Nodes { degree, .. } => (if self.is_kinked { 2 } else { 0 }, degree),
            RuleChoice::Vertex => (3, 0),
            RuleChoice::Segments { degree, .. } => (4, degree),
        }
    }

    /// The parts of the set by the rule of the terms there; `None` where there are none.
    pub(super) fn by_rule(
        &self,
        mesh: &Mesh,
        regions: &Regions,
        rules: &Rules,
    ) -> Vec<(RegionSet, Option<RuleChoice>)> {
        let own = rules.get(self.place).map(|choice| choice.through(self.mapping));
        let is_of_degree = matches!(own, Some(RuleChoice::Degree(_)) | None);
        if self.is_given || !self.is_kinked || !is_of_degree {
            return vec![(self.set.clone(), own)];
        }
        let Some(entities) = keys(mesh, self.set) else { return vec![(self.set.clone(), own)] };
        let mut found: Vec<Option<RuleChoice>> = vec![own; entities.len()];
        let mut choices: Vec<Option<RuleChoice>> = vec![None, own];
        let is_alike = |set: &&RegionSet| matches!(set, RegionSet::Cells(_)) == matches!(self.set, RegionSet::Cells(_));
        for (name, choice) in rules {
            let Some(set) = regions.get(name).map(|region| &region.set).filter(is_alike) else { continue };
            let choice = choice.through(self.mapping);
            let Some(members) = keys(mesh, set) else { continue };
            let mut members: Vec<Key> = members.into_iter().flatten().collect();
            members.sort_unstable();
            choices.push(Some(choice));
            for (entity, best) in entities.iter().zip(&mut found) {
                let suits = best.is_none_or(|best| self.rank(choice) > self.rank(best));
                if suits && entity.iter().any(|key| members.binary_search(key).is_ok()) {
                    *best = Some(choice);
                }
            }
        }
        let mut parts = Vec::new();
        for (n, choice) in choices.iter().enumerate().filter(|(n, choice)| !choices[..*n].contains(choice)) {
            let at: Vec<usize> = (0..found.len()).filter(|k| found[*k] == *choice).collect();
            // on all ranks or none
            if mesh.team().any(!at.is_empty()) || n == 0 && mesh.team().all(found.is_empty()) {
                parts.push((some(self.set, &at), *choice));
            }
        }
        parts
    }
}
