//! Fluxes along faces at the rim of the faces: without a condition nothing flows out there.
//!
//! Promises: only what was made is looked at, when it is asked for; a run does not.

use std::collections::{BTreeMap, BTreeSet};

use wfl_compiler::types::{FieldId, FieldKind, FieldOp};

use super::{Scene, constraints::extent, edges};
use crate::{
    assemble::{AssembledTerm, Over},
    element::Family,
    field::{Field, FieldSpace},
    mesh::{FaceEdge, FacetRef},
    space::{Space, Support},
    system::FIXED,
};

/// A node and a point of a load are one place within this part of the size of the mesh.
const SAME_PLACE: f64 = 1e-9;

/// The rim of the faces that an unknown lives on, which flows along them.
#[derive(Clone, Debug, PartialEq)]
pub struct RimOfField {
    /// The name of the unknown.
    pub field: String,
    /// Its nodes on the rim.
    pub nodes: usize,
    /// The connected pieces of it without a condition.
    pub open: Vec<OpenRim>,
}

/// A piece of a rim where nothing is prescribed, loaded or integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenRim {
    /// Nodes of the unknown there.
    pub nodes: usize,
    /// Smallest coordinates.
    pub low: [f64; 3],
    /// Largest coordinates.
    pub high: [f64; 3],
}

impl Scene {
    /// The rims of all unknowns on faces whose gradient along the faces is tested, in the order of the fields.
    #[must_use]
    pub fn rims_of_fields(&self) -> Vec<RimOfField> {
        let fields = self.system.fields.iter().enumerate();
        fields.filter_map(|(k, field)| self.rim_of(k, field)).collect()
    }

    fn rim_of(&self, k: usize, field: &Field) -> Option<RimOfField> {
        let FieldSpace::Nodal(space) = &field.space else { return None };
        let Support::Facets(faces) = space.support() else { return None };
        let tests = |term: &&AssembledTerm| term.law.tests.iter().any(|slot| slot.field == FieldId::new(k));
        let own = || self.system.terms.iter().filter(tests);
        let flows = own().flat_map(|term| &term.law.tests).any(|t| t.field == FieldId::new(k) && t.op == FieldOp::Grad);
        if field.kind != FieldKind::Unknown || space.family() != Family::Continuous || !flows {
            return None;
        }
        let held = self.held_nodes(k, field, space, &own().collect::<Vec<_>>());
        let rim = edges::rim(&self.system.mesh, faces);
        let nodes: BTreeSet<u32> = rim.iter().flat_map(|edge| nodes_of(space, *edge)).collect();
        let pieces = pieces(space, &rim, &held);
        let open = pieces.iter().map(|nodes| OpenRim::of(space, nodes)).collect();
        Some(RimOfField { field: field.name.clone(), nodes: nodes.len(), open })
    }

    /// Nodes with a condition: prescribed, a load at the node, a term on edges.
    fn held_nodes(&self, k: usize, field: &Field, space: &Space, terms: &[&AssembledTerm]) -> BTreeSet<u32> {
        let mut held = BTreeSet::new();
        if let Some(range) = self.system.range(k) {
            let is_held = |dof: usize| self.system.numbering.free[dof] == FIXED;
            let of_node = |node: &u32| {
                let first = range.start + *node as usize * field.n_components;
                (first..first + field.n_components).any(is_held)
            };
            held.extend((0..space.n_nodes()).filter_map(|n| u32::try_from(n).ok()).filter(of_node));
        }
        let size = extent(&self.system.mesh);
        for term in terms {
            let domain = &term.integrator.domain;
            match domain.over {
                Over::Edges => {
                    // what goes from face to face is no condition where they end
                    let ends = domain.edges().filter(|edge| edge.across.is_none());
                    held.extend(ends.flat_map(|edge| nodes_of(space, edge)));
                }
                Over::Points if domain.groups.iter().any(|g| !g.here.facets.is_empty()) => {
                    let points: Vec<[f64; 3]> =
                        (0..domain.n_entities).map(|point| domain.position(&self.system.mesh, point)).collect();
                    let is_loaded = |x: &[f64; 3]| {
                        let apart = |p: &[f64; 3]| (0..3).map(|d| (x[d] - p[d]).abs()).fold(0.0, f64::max);
                        points.iter().any(|p| apart(p) < SAME_PLACE * size)
                    };
                    let all = (0u32..).zip(space.node_coordinates());
                    held.extend(all.filter(|(_, x)| is_loaded(x)).map(|(node, _)| node));
                }
                _ => {}
            }
        }
        held
    }
}

impl OpenRim {
    fn of(space: &Space, nodes: &BTreeSet<u32>) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for x in nodes.iter().map(|node| space.node_coordinates()[*node as usize]) {
            low = std::array::from_fn(|i| x[i].min(low[i]));
            high = std::array::from_fn(|i| x[i].max(high[i]));
        }
        Self { nodes: nodes.len(), low, high }
    }
}

/// The nodes of a space on an edge of its faces.
fn nodes_of(space: &Space, edge: FaceEdge) -> Vec<u32> {
    let FaceEdge { face, local, .. } = edge;
    let on = |face: FacetRef| space.on_facet(face);
    on(face).map_or_else(Vec::new, |(element, nodes)| {
        element.facet_closure(usize::from(local)).iter().map(|dof| nodes[*dof]).collect()
    })
}

/// The nodes of a rim that are not held, by connected piece.
fn pieces(space: &Space, rim: &[FaceEdge], held: &BTreeSet<u32>) -> Vec<BTreeSet<u32>> {
    let mut piece_of: BTreeMap<u32, usize> = BTreeMap::new();
    let mut pieces: Vec<BTreeSet<u32>> = Vec::new();
    for edge in rim {
        let open: BTreeSet<u32> = nodes_of(space, *edge).into_iter().filter(|node| !held.contains(node)).collect();
        let met: BTreeSet<usize> = open.iter().filter_map(|node| piece_of.get(node).copied()).collect();
        let mut whole = open;
        for piece in met {
            whole.append(&mut pieces[piece]);
        }
        whole.iter().for_each(|node| _ = piece_of.insert(*node, pieces.len()));
        pieces.push(whole);
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}
