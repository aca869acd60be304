//! Fluxes along faces at the rim of the faces: without a condition nothing flows out there.
//!
//! Promises: only what was made is looked at, when it is asked for; a run does not.

use std::collections::{BTreeMap, BTreeSet};

use wfl_compiler::types::{FieldId, FieldKind, FieldOp};
use wfl_discrete::{
    assemble::{AssembledTerm, Over},
    field::{Field, FieldSpace},
    space::{Space, Support},
    system::FIXED,
};
use wfl_mesh::{
    element::Family,
    mesh::{FaceEdge, FacetRef, Mesh, NodeId},
};

use super::{Scene, constraints::extent, edges};

/// A node and a point of a load are one place within this part of the size of the mesh.
const SAME_PLACE: f64 = 1e-9;

/// The rim of the faces that an unknown lives on, which flows along them.
#[derive(Clone, Debug, PartialEq)]
pub struct RimOfField {
    /// The name of the unknown.
    pub field: String,
    /// Its edges, in the plane its ends.
    pub edges: usize,
    /// The connected pieces of it without a condition.
    pub open: Vec<OpenRim>,
}

/// A piece of a rim where nothing is prescribed, loaded or integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenRim {
    /// Its edges, in the plane an end.
    pub edges: usize,
    /// Smallest coordinates.
    pub low: [f64; 3],
    /// Largest coordinates.
    pub high: [f64; 3],
}

/// Where an unknown has conditions.
#[derive(Default)]
struct Held {
    /// Nodes with a prescribed value; in the plane also those with a load.
    nodes: BTreeSet<u32>,
    /// Edges with a term or a load, by their ends.
    edges: BTreeSet<Vec<NodeId>>,
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
        let held = self.held(k, field, space, &own().collect::<Vec<_>>());
        let mesh = &self.system.mesh;
        let rim = edges::rim(mesh, faces);
        let is_open = |edge: &&FaceEdge| {
            !held.edges.contains(&ends(mesh, **edge))
                && nodes_of(space, **edge).iter().any(|node| !held.nodes.contains(node))
        };
        let open: Vec<FaceEdge> = rim.iter().filter(is_open).copied().collect();
        let open = pieces(mesh, &open).iter().map(|edges| OpenRim::of(mesh, edges)).collect();
        Some(RimOfField { field: field.name.clone(), edges: rim.len(), open })
    }

    fn held(&self, k: usize, field: &Field, space: &Space, terms: &[&AssembledTerm]) -> Held {
        let mesh = &self.system.mesh;
        let mut held = Held::default();
        if let Some(range) = self.system.range(k) {
            let is_held = |dof: usize| self.system.numbering.free[dof] == FIXED;
            let of_node = |node: &u32| {
                let first = range.start + *node as usize * field.n_components;
                (first..first + field.n_components).any(is_held)
            };
            held.nodes.extend((0..space.n_nodes()).filter_map(|n| u32::try_from(n).ok()).filter(of_node));
        }
        let size = extent(mesh);
        for term in terms {
            let domain = &term.integrator.domain;
            match domain.over {
                // what goes from face to face is no condition where they end
                Over::Edges => {
                    held.edges.extend(domain.edges().filter(|edge| edge.across.is_none()).map(|edge| ends(mesh, edge)));
                }
                // in space a source at a node of the rim is none along its edges
                Over::Points if mesh.dim() < 3 && domain.groups.iter().any(|g| !g.here.facets.is_empty()) => {
                    let points: Vec<[f64; 3]> =
                        (0..domain.n_entities).map(|point| domain.position(mesh, point)).collect();
                    let is_loaded = |x: &[f64; 3]| {
                        let apart = |p: &[f64; 3]| (0..3).map(|d| (x[d] - p[d]).abs()).fold(0.0, f64::max);
                        points.iter().any(|p| apart(p) < SAME_PLACE * size)
                    };
                    let all = (0u32..).zip(space.node_coordinates());
                    held.nodes.extend(all.filter(|(_, x)| is_loaded(x)).map(|(node, _)| node));
                }
                _ => {}
            }
        }
        held
    }
}

impl OpenRim {
    fn of(mesh: &Mesh, edges: &[FaceEdge]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for x in edges.iter().flat_map(|edge| mesh.edge_ends(*edge)).map(|node| mesh.node(node)) {
            low = std::array::from_fn(|i| x[i].min(low[i]));
            high = std::array::from_fn(|i| x[i].max(high[i]));
        }
        Self { edges: edges.len(), low, high }
    }
}

/// The ends of an edge, sorted.
fn ends(mesh: &Mesh, edge: FaceEdge) -> Vec<NodeId> {
    let mut ends = mesh.edge_ends(edge);
    ends.sort_unstable();
    ends
}

/// The nodes of a space on an edge of its faces.
fn nodes_of(space: &Space, edge: FaceEdge) -> Vec<u32> {
    let FaceEdge { face, local, .. } = edge;
    let on = |face: FacetRef| space.on_facet(face);
    on(face).map_or_else(Vec::new, |(element, nodes)| {
        element.facet_closure(usize::from(local)).iter().map(|dof| nodes[*dof]).collect()
    })
}

/// Edges by connected piece.
fn pieces(mesh: &Mesh, edges: &[FaceEdge]) -> Vec<Vec<FaceEdge>> {
    let mut piece_of: BTreeMap<NodeId, usize> = BTreeMap::new();
    let mut pieces: Vec<Vec<FaceEdge>> = Vec::new();
    for edge in edges {
        let met: BTreeSet<usize> = ends(mesh, *edge).iter().filter_map(|node| piece_of.get(node).copied()).collect();
        let mut whole = vec![*edge];
        for piece in met {
            whole.append(&mut pieces[piece]);
        }
        let nodes = whole.iter().flat_map(|edge| ends(mesh, *edge));
        nodes.for_each(|node| _ = piece_of.insert(node, pieces.len()));
        pieces.push(whole);
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}
