//! Values at integration points: one node for each point, without interpolation.
//!
//! A field on such a space can be evaluated at the same points: the basis function of a point is 1 there and 0 at the
//! others, so gathering and assembly work as for any field. It has no gradient. At other points (another rule, another
//! region) it has no values.

use std::collections::BTreeMap;

use crate::domain::{Domain, Group};
use wfl_mesh::{
    element::Table,
    mesh::{CellId, FacetRef, Mesh},
};

/// A cell, or a facet seen from its cell.
type Entity = (CellId, Option<u8>);

/// The integration points of a domain as nodes.
#[derive(Clone, Debug, Default)]
pub struct PointSpace {
    /// Rules and first nodes of each entity: one of each, or one for each part of an entity whose points have images in
    /// different cells.
    entities: BTreeMap<Entity, Vec<(usize, u32)>>,
    /// Points of each rule, in the parameters of the entity.
    rules: Vec<Vec<[f64; 3]>>,
    coordinates: Vec<[f64; 3]>,
}

impl PointSpace {
    /// One node at each point of `domain`, entity after entity in the order of its groups.
    #[must_use]
    pub fn new(mesh: &Mesh, domain: &Domain) -> Self {
        let mut space = PointSpace::default();
        for group in &domain.groups {
            let rule = space.rules.len();
            if group.own.is_some() {
                space.rules.extend(group.parameters.iter().map(|parameter| vec![*parameter]));
            } else {
                space.rules.push(group.parameters.clone());
            }
            for k in 0..group.entities.len() {
                let first = u32::try_from(space.coordinates.len()).expect("fewer than 2^32 integration points");
                let own = if group.own.is_some() { group.here.row(k, 0) } else { 0 };
                space.entities.entry(entity(group, k)).or_default().push((rule + own, first));
                for q in 0..group.n_points() {
                    space.coordinates.push(group.position(mesh, k, q));
                }
            }
        }
        space
    }

    /// Positions of the nodes.
    #[must_use]
    pub fn coordinates(&self) -> &[[f64; 3]] {
        &self.coordinates
    }

    /// True if there are nodes in this cell (not on its facets).
    #[must_use]
    pub fn has_cell(&self, cell: CellId) -> bool {
        self.entities.contains_key(&(cell, None))
    }

    /// The cells with nodes, sorted; none for a space on facets.
    #[must_use]
    pub fn cells(&self) -> Vec<CellId> {
        self.entities.keys().filter(|(_, facet)| facet.is_none()).map(|(cell, _)| *cell).collect()
    }

    /// True if there are nodes on this facet, seen from its cell.
    #[must_use]
    pub fn has_facet(&self, facet: FacetRef) -> bool {
        self.entities.contains_key(&(facet.cell, Some(facet.local)))
    }

    /// Basis and nodes on a group; `None` where its points are not those of this space.
    #[must_use]
    pub fn tabulate(&self, dim: usize, group: &Group) -> Option<(Table, Vec<u32>)> {
        let n = group.n_points();
        let mut nodes = Vec::with_capacity(group.entities.len() * n);
        for k in 0..group.entities.len() {
            for q in 0..n {
                nodes.push(self.node_at(entity(group, k), &group.parameters[group.here.row(k, q)])?);
            }
        }
        let values = (0..n * n).map(|p| if p % (n + 1) == 0 { 1.0 } else { 0.0 }).collect();
        Some((Table { n_points: n, n_dofs: n, dim, values, ..Table::default() }, nodes))
    }

    /// The node at a point of an entity, which must be the very point of its rule.
    fn node_at(&self, entity: Entity, parameter: &[f64; 3]) -> Option<u32> {
        self.entities.get(&entity)?.iter().find_map(|(rule, first)| {
            let place = self.rules[*rule].iter().position(|p| p == parameter)?;
            Some(first + u32::try_from(place).ok()?)
        })
    }
}

fn entity(group: &Group, k: usize) -> Entity {
    (group.here.cells[k], group.here.facets.get(k).map(|f| f.local))
}
