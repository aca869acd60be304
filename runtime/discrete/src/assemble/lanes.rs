//! Points with fixed images as entities of their own, for assembly.
//!
//! The points of an entity whose images lie in one cell are a group of one entity, which fills one lane of eight. Groups that are
//! alike are assembled as points: with the same kinds of cells, local facets, and functions that act. Promises: the
//! functions that act are those of each group, so the tangent couples nothing more. Does not change the order in which
//! other parts of a run know the points.

use std::collections::BTreeMap;

use crate::domain::{Domain, Group, Over};
use wfl_mesh::mesh::Mesh;

/// What groups that are assembled together have in common.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Alike {
    key: [u8; 5],
    is_own: bool,
    image: (usize, Option<u8>),
    supports: Vec<Vec<u16>>,
}

/// The points of a domain as entities; `None` where they are not parts of entities with images. `acting` has by group the
/// functions that act, by field and side; `None` where some act at some of its points alone, as under a rule with its points
/// at the nodes: such a group is assembled by itself.
pub(super) fn in_lanes(mesh: &Mesh, domain: &Domain, acting: &[Option<Vec<Vec<u16>>>]) -> Option<Domain> {
    let mut sets: BTreeMap<Alike, Vec<usize>> = BTreeMap::new();
    for (g, (group, acting)) in domain.groups.iter().zip(acting).enumerate() {
        if let Some(alike) = alike(group, acting.as_ref()) {
            sets.entry(alike).or_default().push(g);
        }
    }
    let sets: Vec<Vec<usize>> = sets.into_values().filter(|set| set.len() > 1).collect();
    if sets.is_empty() { None } else { domain.with_joined(mesh, &sets) }
}

/// Whether groups of a domain are parts of entities whose images stay: those of others have keys of their own.
pub(super) fn has_parts(domain: &Domain) -> bool {
    let keys = || domain.groups.iter().map(|group| group.key);
    let repeat = keys().zip(keys().skip(1)).any(|(a, b)| a == b);
    domain.moving.is_none() && repeat && matches!(domain.over, Over::Facets | Over::Cells)
}

/// `None` for a group that is assembled by itself.
fn alike(group: &Group, acting: Option<&Vec<Vec<u16>>>) -> Option<Alike> {
    let there = group.there.as_ref().filter(|_| group.entities.len() == 1 && group.own.is_none())?;
    let image = (there.kind.index(), there.facets.first().map(|facet| facet.local));
    Some(Alike { key: group.key, is_own: group.is_own, image, supports: acting?.clone() })
}
