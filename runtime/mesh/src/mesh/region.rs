//! Regions: sorted sets of cells, facets, interface facets or nodes, and their selection.
//!
//! Promises: every set is sorted without repetition. A facet of a set has a side; a facet seen from both of its cells
//! is two members. `here` of an interface facet is the cell of the first region. Does not know names or the language;
//! conditions are closures.

use super::{
    Mesh,
    edge::FaceEdge,
    error::MeshError,
    index::{CellId, FacetRef, InterfaceFacet, NodeId},
    pair::pair_by_geometry,
    raw::{Group, GroupEntities},
    topology::Topology,
};

/// What the members of a region are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionKind {
    /// Cells.
    Cells,
    /// Facets with a side.
    Facets,
    /// Facets with two sides.
    Interface,
    /// Edges of faces.
    Edges,
    /// Nodes.
    Nodes,
}

impl std::fmt::Display for RegionKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            RegionKind::Cells => "cells",
            RegionKind::Facets => "faces",
            RegionKind::Interface => "an interface",
            RegionKind::Edges => "edges",
            RegionKind::Nodes => "nodes",
        })
    }
}

/// Entities that have a measure: a region without single nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SupportSet {
    /// A body.
    Cells(Vec<CellId>),
    /// Facets with one side.
    Facets(Vec<FacetRef>),
    /// Facets with two sides.
    Interface(Vec<InterfaceFacet>),
    /// Edges of facets; where several facets meet, one for each.
    Edges(Vec<FaceEdge>),
}

impl SupportSet {
    /// The same entities as a region.
    #[must_use]
    pub fn region(&self) -> RegionSet {
        match self {
            Self::Cells(c) => RegionSet::Cells(c.clone()),
            Self::Facets(f) => RegionSet::Facets(f.clone()),
            Self::Interface(i) => RegionSet::Interface(i.clone()),
            Self::Edges(e) => RegionSet::Edges(e.clone()),
        }
    }
}

/// Why a region cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// Two regions of different kinds were combined.
    #[error("a region of {here} cannot be combined with a region of {there}")]
    KindMismatch {
        /// Kind of the first operand.
        here: RegionKind,
        /// Kind of the second operand.
        there: RegionKind,
    },
    /// The two sides of an interface share cells.
    #[error("the two sides of the interface share {cells} cells")]
    Overlap {
        /// Number of shared cells.
        cells: usize,
    },
    /// A group names a facet that no cell has.
    #[error("group `{group}` has {facets} faces that belong to no cell")]
    LooseFacets {
        /// Name of the group.
        group: String,
        /// Number of such facets.
        facets: usize,
    },
    /// The facets of the two sides do not match.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// A sorted set of entities of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RegionSet {
    /// Cells.
    Cells(Vec<CellId>),
    /// Facets, each with the cell it is seen from.
    Facets(Vec<FacetRef>),
    /// Facets between two regions.
    Interface(Vec<InterfaceFacet>),
    /// Edges of faces; in the plane their ends.
    Edges(Vec<FaceEdge>),
    /// Nodes of the mesh.
    Nodes(Vec<NodeId>),
}

/// A set operation on two sorted sequences.
#[derive(Clone, Copy)]
enum Operation {
    Union,
    Difference,
    Intersection,
}

impl RegionSet {
    /// What the members are.
    #[must_use]
    pub fn kind(&self) -> RegionKind {
        match self {
            RegionSet::Cells(_) => RegionKind::Cells,
            RegionSet::Facets(_) => RegionKind::Facets,
            RegionSet::Interface(_) => RegionKind::Interface,
            RegionSet::Edges(_) => RegionKind::Edges,
            RegionSet::Nodes(_) => RegionKind::Nodes,
        }
    }

    /// Number of members.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            RegionSet::Cells(members) => members.len(),
            RegionSet::Facets(members) => members.len(),
            RegionSet::Interface(members) => members.len(),
            RegionSet::Edges(members) => members.len(),
            RegionSet::Nodes(members) => members.len(),
        }
    }

    /// True when there are no members.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Members of either region.
    ///
    /// # Errors
    /// [`RegionError::KindMismatch`].
    pub fn union(&self, other: &RegionSet) -> Result<RegionSet, RegionError> {
        self.combine(other, Operation::Union)
    }

    /// Members of this region that are not in `other`; of an interface also those that are not among faces.
    ///
    /// # Errors
    /// [`RegionError::KindMismatch`].
    pub fn difference(&self, other: &RegionSet) -> Result<RegionSet, RegionError> {
        self.combine(other, Operation::Difference)
    }

    /// Members of both regions; of an interface also those that are among faces seen from either side.
    ///
    /// # Errors
    /// [`RegionError::KindMismatch`].
    pub fn intersection(&self, other: &RegionSet) -> Result<RegionSet, RegionError> {
        self.combine(other, Operation::Intersection)
    }

    fn combine(&self, other: &RegionSet, operation: Operation) -> Result<RegionSet, RegionError> {
        use RegionSet::{Cells, Edges, Facets, Interface, Nodes};
        Ok(match (self, other) {
            (Cells(a), Cells(b)) => Cells(merge(a, b, operation)),
            (Facets(a), Facets(b)) => Facets(merge(a, b, operation)),
            (Interface(a), Interface(b)) => Interface(merge(a, b, operation)),
            (Edges(a), Edges(b)) => Edges(merge(a, b, operation)),
            (Nodes(a), Nodes(b)) => Nodes(merge(a, b, operation)),
            // a part of an interface, picked by faces seen from either side
            (Interface(a), Facets(b)) if !matches!(operation, Operation::Union) => {
                let wanted = matches!(operation, Operation::Intersection);
                let among = |f: &FacetRef| b.binary_search(f).is_ok();
                Interface(a.iter().copied().filter(|p| (among(&p.here) || among(&p.there)) == wanted).collect())
            }
            _ => {
                let (here, there) = (self.kind(), other.kind());
                return Err(RegionError::KindMismatch { here, there });
            }
        })
    }

    /// The region of a named group of the mesh. Facets are seen from their cell of lower number.
    ///
    /// # Errors
    /// [`RegionError::LooseFacets`].
    pub fn from_group(mesh: &Mesh, topology: &Topology, group: &Group) -> Result<Self, RegionError> {
        Ok(match &group.entities {
            GroupEntities::Cells(cells) => RegionSet::Cells(sorted(cells.clone())),
            GroupEntities::Nodes { nodes, .. } => RegionSet::Nodes(sorted(nodes.clone())),
            GroupEntities::Facets(facets) => {
                let find = |f: &super::GroupFacet| topology.find_facet(mesh, f.vertices());
                let found: Vec<FacetRef> = facets.iter().filter_map(find).map(|id| topology.facet(id).here).collect();
                if found.len() < facets.len() {
                    return Err(RegionError::LooseFacets {
                        group: group.name.clone(),
                        facets: facets.len() - found.len(),
                    });
                }
                RegionSet::Facets(sorted(found))
            }
        })
    }
}

pub(super) fn sorted<T: Ord>(mut members: Vec<T>) -> Vec<T> {
    members.sort_unstable();
    members.dedup();
    members
}

/// Linear merge of two sorted sequences.
fn merge<T: Ord + Copy>(here: &[T], there: &[T], operation: Operation) -> Vec<T> {
    use std::cmp::Ordering;
    let (mut i, mut j) = (0, 0);
    let mut result = Vec::new();
    let either = matches!(operation, Operation::Union);
    let only_here = either || matches!(operation, Operation::Difference);
    let both = either || matches!(operation, Operation::Intersection);
    while i < here.len() || j < there.len() {
        let order = match (here.get(i), there.get(j)) {
            (Some(a), Some(b)) => a.cmp(b),
            (Some(_), None) => Ordering::Less,
            _ => Ordering::Greater,
        };
        match order {
            Ordering::Less if only_here => result.push(here[i]),
            Ordering::Greater if either => result.push(there[j]),
            Ordering::Equal if both => result.push(here[i]),
            _ => {}
        }
        i += usize::from(order != Ordering::Greater);
        j += usize::from(order != Ordering::Less);
    }
    result
}

/// Cells among `of` (all when `None`) whose centroid meets the condition.
///
/// # Errors
/// The first error of the condition.
pub fn pick_cells<E>(
    mesh: &Mesh,
    of: Option<&[CellId]>,
    mut condition: impl FnMut([f64; 3]) -> Result<bool, E>,
) -> Result<RegionSet, E> {
    let mut picked = Vec::new();
    let mut judge = |cell: CellId| -> Result<(), E> {
        if condition(mesh.centroid(cell))? {
            picked.push(cell);
        }
        Ok(())
    };
    match of {
        Some(cells) => cells.iter().try_for_each(|cell| judge(*cell))?,
        None => mesh.cells().try_for_each(judge)?,
    }
    Ok(RegionSet::Cells(sorted(picked)))
}

/// Facets among `of` whose vertices and centroid all meet the condition.
///
/// # Errors
/// The first error of the condition.
pub fn pick_facets<E>(
    mesh: &Mesh,
    of: &[FacetRef],
    mut condition: impl FnMut([f64; 3]) -> Result<bool, E>,
) -> Result<RegionSet, E> {
    let mut picked = Vec::new();
    'facets: for facet in of {
        for vertex in mesh.facet_vertices(*facet).vertices() {
            if !condition(mesh.node(*vertex))? {
                continue 'facets;
            }
        }
        if condition(mesh.facet_centroid(*facet))? {
            picked.push(*facet);
        }
    }
    Ok(RegionSet::Facets(sorted(picked)))
}

/// Nodes of the cells among `of` (all when `None`) that meet the condition. Nodes of no cell are
/// never picked.
///
/// # Errors
/// The first error of the condition.
pub fn pick_nodes<E>(
    mesh: &Mesh,
    of: Option<&[CellId]>,
    mut condition: impl FnMut([f64; 3]) -> Result<bool, E>,
) -> Result<RegionSet, E> {
    let mut used = vec![false; mesh.n_nodes()];
    let mut mark = |cell: CellId| {
        for node in mesh.cell_nodes(cell) {
            used[node.index()] = true;
        }
    };
    match of {
        Some(cells) => cells.iter().for_each(|cell| mark(*cell)),
        None => mesh.cells().for_each(mark),
    }
    let mut picked = Vec::new();
    for (node, x) in mesh.nodes().iter().enumerate() {
        if used[node] && condition(*x)? {
            picked.push(NodeId::new(node));
        }
    }
    Ok(RegionSet::Nodes(picked))
}

/// Facets of the outer boundary of the mesh.
#[must_use]
pub fn outer_boundary(topology: &Topology) -> Vec<FacetRef> {
    let outer = topology.facets().iter().filter(|f| f.there.is_none());
    sorted(outer.map(|f| f.here).collect())
}

/// Facets with exactly one of their cells in `cells`, seen from that cell.
#[must_use]
pub fn boundary_of(mesh: &Mesh, topology: &Topology, cells: &[CellId]) -> Vec<FacetRef> {
    let inside = mark(mesh, cells);
    let is_in = |facet: &FacetRef| inside[facet.cell.index()];
    let mut boundary = Vec::new();
    for facet in topology.facets() {
        let there = facet.there.filter(|f| is_in(f));
        match (is_in(&facet.here), there) {
            (true, None) => boundary.push(facet.here),
            (false, Some(there)) => boundary.push(there),
            _ => {}
        }
    }
    sorted(boundary)
}

fn mark(mesh: &Mesh, cells: &[CellId]) -> Vec<bool> {
    let mut inside = vec![false; mesh.n_cells()];
    for cell in cells {
        inside[cell.index()] = true;
    }
    inside
}

/// The interface from cells `from` to cells `to`: facets shared by a cell of each, and facets of
/// the outer boundary of one that coincide with facets of the outer boundary of the other (two
/// bodies with separate nodes), within 1e-6 of the facet size. Empty when they do not touch.
///
/// # Errors
/// [`RegionError::Overlap`]; [`MeshError::NotMatching`] when facets lie against each other but do
/// not match.
pub fn interface(mesh: &Mesh, topology: &Topology, from: &[CellId], to: &[CellId]) -> Result<RegionSet, RegionError> {
    let (inside_from, inside_to) = (mark(mesh, from), mark(mesh, to));
    let shared = inside_from.iter().zip(&inside_to).filter(|(a, b)| **a && **b);
    let cells = shared.count();
    if cells > 0 {
        return Err(RegionError::Overlap { cells });
    }
    let (mut pairs, mut ours, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    for facet in topology.facets() {
        let (here, cell) = (facet.here, facet.here.cell.index());
        match facet.there {
            None if inside_from[cell] => ours.push(here),
            None if inside_to[cell] => theirs.push(here),
            None => {}
            Some(there) => {
                let other = there.cell.index();
                if inside_from[cell] && inside_to[other] {
                    pairs.push(InterfaceFacet { here, there });
                } else if inside_to[cell] && inside_from[other] {
                    let (here, there) = (there, here);
                    pairs.push(InterfaceFacet { here, there });
                }
            }
        }
    }
    if !ours.is_empty() && !theirs.is_empty() {
        pairs.extend(pair_by_geometry(mesh, &ours, &theirs)?);
    }
    Ok(RegionSet::Interface(sorted(pairs)))
}
