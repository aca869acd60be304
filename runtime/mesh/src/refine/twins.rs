//! Nodes at one place: the two sides of bodies that touch without common nodes.
//!
//! Faces that lie on each other must match after a refinement, too, so edges with the same ends are halved together.
//! Promises: only nodes of matching faces of the outer boundary are the same. Does not join anything.

use crate::mesh::{Mesh, MeshError, NodeId, Topology, coincident_nodes, outer_boundary};

/// For each node the lowest node at its place; empty where every node is alone.
#[derive(Debug)]
pub(super) struct Twins(Vec<u32>);

impl Twins {
    /// Finds them among the outer faces of a mesh.
    pub(super) fn new(shape: &Mesh) -> Result<Self, MeshError> {
        let topology = Topology::new(shape)?;
        let pairs = coincident_nodes(shape, &outer_boundary(&topology));
        if pairs.is_empty() {
            return Ok(Self(Vec::new()));
        }
        let mut same: Vec<u32> = (0..shape.n_nodes() as u32).collect();
        let find = |same: &[u32], node: NodeId| {
            let mut node = node.index() as u32;
            while same[node as usize] != node {
                node = same[node as usize];
            }
            node
        };
        for (a, b) in pairs {
            let (a, b) = (find(&same, a), find(&same, b));
            same[a.max(b) as usize] = a.min(b);
        }
        let all = (0..same.len()).map(|node| find(&same, NodeId::new(node))).collect();
        Ok(Self(all))
    }

    /// Of nodes that have been found.
    pub(super) fn from_list(same: Vec<u32>) -> Self {
        Self(same)
    }

    /// True where every node is alone.
    pub(super) fn none(&self) -> bool {
        self.0.is_empty()
    }

    /// The node that stands for all at the place of `node`.
    pub(super) fn of(&self, node: u32) -> u32 {
        self.0.get(node as usize).copied().unwrap_or(node)
    }
}
