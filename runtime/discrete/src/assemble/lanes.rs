//! Points with fixed images as entities of their own, for assembly.
//!
//! The points of an entity whose images lie in one cell are a group of one entity, which fills one lane of eight. Groups that are
//! alike are assembled as points: with the same kinds of cells, local facets, and functions that act. Promises: the
//! functions that act are those of each group, so the tangent couples nothing more. Does not change the order in which
//! other parts of a run know the points.

use std::collections::BTreeMap;

use super::binding::{Basis, GroupBinding, NO_VALUE};
use crate::{
    domain::{Domain, Group, Over},
    field::{Field, FieldSpace},
};
use wfl_mesh::mesh::Mesh;

/// What groups that are assembled together have in common.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Alike {
    key: [u8; 5],
    is_own: bool,
    image: (usize, Option<u8>),
    supports: Vec<Vec<u16>>,
}

/// The points of a domain as entities, for a law with these bases; `None` where they are not parts of entities with images.
pub(super) fn in_lanes(mesh: &Mesh, domain: &Domain, fields: &[Field], bound: &[GroupBinding]) -> Option<Domain> {
    let keys = || domain.groups.iter().map(|group| group.key);
    let repeat = keys().zip(keys().skip(1)).any(|(a, b)| a == b);
    if domain.moving.is_some() || !repeat || !matches!(domain.over, Over::Facets | Over::Cells) {
        return None;
    }
    let mut sets: BTreeMap<Alike, Vec<usize>> = BTreeMap::new();
    for (g, (group, bound)) in domain.groups.iter().zip(bound).enumerate() {
        if let Some(alike) = alike(group, fields, bound) {
            sets.entry(alike).or_default().push(g);
        }
    }
    let sets: Vec<Vec<usize>> = sets.into_values().filter(|set| set.len() > 1).collect();
    if sets.is_empty() { None } else { domain.with_joined(mesh, &sets) }
}

/// `None` for a group that is assembled by itself.
fn alike(group: &Group, fields: &[Field], bound: &GroupBinding) -> Option<Alike> {
    let there = group.there.as_ref().filter(|_| group.entities.len() == 1 && group.own.is_none())?;
    let has_own_nodes = |basis: &&Basis| !matches!(fields[basis.field.index()].space, FieldSpace::Points(_));
    let mut supports = Vec::with_capacity(bound.bases.len());
    for basis in bound.bases.iter().filter(has_own_nodes) {
        let mut rows = basis.table.values.chunks_exact(basis.n_nodes.max(1));
        // a function that acts at some of the points alone, as under a rule with its points at the nodes
        if !rows.all(|row| basis.support.iter().all(|i| row[usize::from(*i)].abs() > NO_VALUE)) {
            return None;
        }
        supports.push(basis.support.clone());
    }
    let image = (there.kind.index(), there.facets.first().map(|facet| facet.local));
    Some(Alike { key: group.key, is_own: group.is_own, image, supports })
}
