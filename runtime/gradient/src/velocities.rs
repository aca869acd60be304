//! How the nodes of a mesh and of the fields on it move with the entries of parameters. Data and look-up; what they are made
//! of, `shape.rs` knows.

use std::collections::BTreeMap;

use wfl::{
    ResolvedScript,
    ast::{Expr, MeasureAt, MeshSource},
};

/// What the entries of the parameters that change move.
pub(super) struct Velocities {
    /// By entry the velocity of each node of the mesh, as values of the field of velocities.
    pub(super) nodes: Vec<Vec<f64>>,
    /// By entry what the size of each cell moves by; empty where nothing reads it.
    pub(super) sizes: Vec<Vec<f64>>,
    /// Cells whose size has a kink in the parameters.
    pub(super) kinked: usize,
    /// By position of a node of a field the first of its velocities.
    places: BTreeMap<[u64; 3], usize>,
    /// By node of a field and entry its velocity.
    at_nodes: Vec<[f64; 3]>,
}

/// Bits of a position; zeros have no sign.
fn bits(x: [f64; 3]) -> [u64; 3] {
    x.map(|c| (c + 0.0).to_bits())
}

impl Velocities {
    pub(super) fn new(nodes: Vec<Vec<f64>>, sizes: Vec<Vec<f64>>, kinked: usize) -> Self {
        Self { nodes, sizes, kinked, places: BTreeMap::new(), at_nodes: Vec::new() }
    }

    /// Whether a node at this position is known.
    pub(super) fn knows(&self, position: [f64; 3]) -> bool {
        self.places.contains_key(&bits(position))
    }

    /// Tells how a node at a position moves, by entry.
    pub(super) fn tell(&mut self, position: [f64; 3], by_entry: impl IntoIterator<Item = [f64; 3]>) {
        self.places.insert(bits(position), self.at_nodes.len());
        self.at_nodes.extend(by_entry);
    }

    /// How a node of a field moves, by entry; `None` where there is none.
    pub(super) fn at(&self, position: [f64; 3]) -> Option<&[[f64; 3]]> {
        let first = *self.places.get(&bits(position))?;
        self.at_nodes.get(first..first + self.nodes.len())
    }
}

/// Calls `f` for every expression that says where nodes of the mesh and points of measures are.
pub(super) fn each_moving_place<'s>(script: &'s ResolvedScript, f: &mut dyn FnMut(&'s Expr)) {
    if let Some(mesh) = &script.mesh {
        if let MeshSource::Box { from, to, .. } = &mesh.source {
            f(from);
            f(to);
        }
        mesh.source.placing().for_each(&mut *f);
        mesh.map.iter().for_each(&mut *f);
    }
    let measures = script.measures.iter().chain(script.computed.iter().flat_map(|c| &c.watched));
    for measure in measures {
        if let MeasureAt::Point(e) = &measure.at {
            f(e);
        }
    }
}
