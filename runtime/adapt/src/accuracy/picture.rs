//! The mesh of a result as a grid: how often each cell was halved, and where the error came from.

use std::iter;

use wfl_mesh::{mesh::CellId, refine::Descent};
use wfl_output::{
    Array, Cells, Piece,
    record::{REFINED, SHARE},
    vtk_cell,
};
use wfl_problem::Scene;

/// The mesh of a scene that went through `rounds` rounds of a search. The array [`REFINED`] counts those that divided a
/// cell or what it was a part of; [`SHARE`] has its part of the estimated error, dimensionless, 1 in sum: `parts` are
/// those of the mesh after fewer rounds, and cells have equal shares of what they were a part of.
#[must_use]
pub fn mesh_piece(scene: &Scene, rounds: usize, parts: Option<&(usize, Vec<f64>)>) -> Piece {
    let mesh = &scene.system.mesh;
    let mut cells = Cells::with_capacity(mesh.n_cells(), mesh.cells().map(|c| mesh.cell_vertices(c).len()).sum());
    for cell in mesh.cells() {
        let nodes: Vec<u32> = mesh.cell_vertices(cell).iter().filter_map(|n| u32::try_from(n.index()).ok()).collect();
        cells.push_local(vtk_cell(mesh.kind(cell), 1), &nodes);
    }
    let all = scene.refined.as_ref().map_or(&[][..], |r| &r.rounds);
    // rounds that were given before the search
    let own = &all[all.len().saturating_sub(rounds)..];
    let mut piece = Piece { points: mesh.nodes().to_vec(), cells, ..Piece::default() };
    let refined = mesh.cells().map(|cell| ancestors(own, cell).filter(|(d, c)| !d.is_whole(*c)).count() as f64);
    piece.cell_data.push(Array::scalar(REFINED, refined.collect()));
    if let Some((of, parts)) = parts.filter(|(of, _)| *of <= own.len()) {
        piece.cell_data.push(Array::scalar(SHARE, shares(scene, &own[*of..], parts)));
    }
    piece
}

/// A cell and what it was a part of, each with the round that made it, the last round first.
fn ancestors(rounds: &[Descent], cell: CellId) -> impl Iterator<Item = (&Descent, CellId)> {
    let mut here = cell;
    rounds.iter().rev().map(move |descent| {
        let parent = descent.parent(here);
        (descent, std::mem::replace(&mut here, parent))
    })
}

fn shares(scene: &Scene, rounds: &[Descent], parts: &[f64]) -> Vec<f64> {
    let origin = |cell| ancestors(rounds, cell).map(|(d, c)| d.parent(c)).last().unwrap_or(cell).index();
    let origins: Vec<usize> = scene.system.mesh.cells().map(origin).collect();
    let mut members = vec![0.0; parts.len()];
    origins.iter().for_each(|o| members[*o] += 1.0);
    let total: f64 = iter::zip(parts, &members).filter(|(_, n)| **n > 0.0).map(|(p, _)| p).sum();
    origins.iter().map(|o| if total > 0.0 { parts[*o] / (members[*o] * total) } else { 0.0 }).collect()
}
