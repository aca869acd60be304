//! The refinement of a scene's mesh, before anything is made on it.
//!
//! Refined is the mesh that was generated or read; its nodes are moved by the map of the mesh afterwards, so new nodes of
//! a curved boundary lie on it. Regions, interfaces and splits are derived from the refined mesh as from any other.
//! Promises: the moved mesh of every round is usable, or a message says why not.

use super::mesh::{MeshMaker, NodeMap, mesh_error};
use crate::{
    mesh::Mesh,
    refine::{Descent, Mark, Refiner},
};

/// How the mesh of a scene was refined.
#[derive(Clone, Debug)]
pub struct Refined {
    /// Cells of the mesh as it was generated or read.
    pub cells_before: usize,
    /// For each round of [`prepare_refined`](crate::prepare_refined) the way from the cells after it to those before it.
    pub rounds: Vec<Descent>,
}

impl MeshMaker<'_> {
    /// The mesh with its nodes where they are in the end, and how it was refined; `None` after a message.
    pub(super) fn make(mut self, read: Option<Mesh>, rounds: &[Vec<Mark>]) -> Option<(Mesh, Option<Refined>)> {
        let (mesh, map) = self.unmoved(read)?;
        if rounds.is_empty() {
            return Some((self.moved(mesh, map.as_ref())?, None));
        }
        self.refined(mesh, map.as_ref(), rounds)
    }

    /// The mesh after all rounds, moved.
    fn refined(&mut self, mesh: Mesh, map: Option<&NodeMap>, rounds: &[Vec<Mark>]) -> Option<(Mesh, Option<Refined>)> {
        let cells_before = mesh.n_cells();
        let shape = self.moved(mesh.clone(), map)?;
        let mut refiner = self.checked(Refiner::new(mesh, &shape))?;
        drop(shape);
        let mut refined = Refined { cells_before, rounds: Vec::with_capacity(rounds.len()) };
        for marks in rounds {
            let descent = refiner.refine(marks);
            refined.rounds.push(self.checked(descent)?);
        }
        Some((self.moved(refiner.into_mesh(), map)?, Some(refined)))
    }

    fn checked<T>(&mut self, made: Result<T, crate::mesh::MeshError>) -> Option<T> {
        let span = self.script.mesh.as_ref()?.span;
        made.map_err(|e| self.diagnostics.push(mesh_error(&e, span))).ok()
    }
}
