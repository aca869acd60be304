//! The fields of a scene as grids: all that live on a body, on one set of points, without a statement that asks for it.
//!
//! Points are the nodes of a Lagrange space on the body, of degree 1, or 2 where a field of it has degree 2 or more. A
//! continuous field is taken as it is; one that jumps between cells is averaged over the cells at a point. Fields on
//! faces, at integration points and single numbers are not on these grids.

use wfl_discrete::{
    field::{Field, FieldSpace},
    space::{Space, Support},
};
use wfl_mesh::{
    element::{Family, Table},
    mesh::{CellId, CellKind},
};
use wfl_output::{Cells, Piece, PieceError, array, split_as, vtk_cell};
use wfl_problem::Scene;

/// The cells of a field on its own nodes, in the order of VTK. `None` for fields that are no Lagrange elements of degree 1
/// or 2 on cells or faces.
#[must_use]
pub fn field_cells(field: &Field) -> Option<Cells> {
    let FieldSpace::Nodal(space) = &field.space else { return None };
    (1..=2).contains(&space.degree()).then(|| cells_of(space))
}

/// A grid of the nodes of a field, with numbers at them by name: `[node * components + component]`. `None` where
/// [`field_cells`] is.
#[must_use]
pub fn field_grid(scene: &Scene, field: usize, named: &[(String, &[f64])]) -> Option<Piece> {
    let own = &scene.system.fields[field];
    let (cells, points) = (field_cells(own)?, (0..own.n_nodes()).map(|node| own.node_position(node)).collect());
    let of = |(name, values): &(String, &[f64])| array(name, scene.sigs[field].shape, values.to_vec());
    Some(Piece { points, cells, point_data: named.iter().map(of).collect(), ..Piece::default() })
}

fn cells_of(space: &Space) -> Cells {
    let mut cells = Cells::default();
    for position in 0..space.n_positions() {
        let kind = vtk_cell(space.element_at(position).kind(), space.degree());
        cells.push_local(kind, space.entity_nodes(position));
    }
    cells
}

/// One grid for each body with the fields on its cells at the unknowns `u` and the values `data` of known fields: bodies in the order of the fields that live on
/// them. A vector in 2-D has two components, matrices are 3 by 3 in rows.
///
/// # Errors
/// `PieceError` when a body has no such element.
///
/// # Panics
/// If `u` has not as many numbers as there are unknowns.
pub fn field_grids(scene: &Scene, data: &[Vec<f64>], u: &[f64]) -> Result<Vec<Piece>, PieceError> {
    let system = &scene.system;
    let values = system.slices_of(data, u);
    let mut bodies: Vec<Vec<CellId>> = Vec::new();
    for (space, _) in system.fields.iter().zip(&values).filter_map(|(f, v)| on_cells(f, v)) {
        let Support::Cells(cells) = space.support() else { continue };
        let mut cells = cells.clone();
        cells.sort_unstable();
        if !cells.is_empty() && !bodies.contains(&cells) {
            bodies.push(cells);
        }
    }
    let mut pieces = Vec::new();
    for cells in bodies {
        let covers = |space: &Space| cells.iter().all(|c| space.position_of_cell(*c).is_some());
        let homes: Vec<(usize, &Space)> = (system.fields.iter().enumerate())
            .filter_map(|(k, f)| Some((k, on_cells(f, values[k])?.0)))
            .filter(|(_, space)| covers(space))
            .collect();
        let degree = homes.iter().map(|(_, s)| s.degree()).max().unwrap_or(1).clamp(1, 2);
        let mut grid = Space::on_cells(&system.mesh, &scene.topology, &cells, degree, Family::Continuous)?;
        split_as(&mut grid, &scene.topology, &system.fields);
        let mut piece = Piece { points: grid.node_coordinates().to_vec(), cells: cells_of(&grid), ..Piece::default() };
        for (k, space) in homes {
            let field = &system.fields[k];
            let found = at_points(&grid, &cells, space, values[k], field.n_components);
            piece.point_data.push(array(&field.name, scene.sigs[k].shape, found));
        }
        pieces.push(piece);
    }
    Ok(pieces)
}

/// The space of a field on cells, if it has values.
fn on_cells<'a>(field: &'a Field, values: &'a [f64]) -> Option<(&'a Space, &'a [f64])> {
    match &field.space {
        FieldSpace::Nodal(space) if matches!(space.support(), Support::Cells(_)) && !values.is_empty() => {
            Some((space, values))
        }
        _ => None,
    }
}

/// Values of a field at the points of a grid over some of its cells: `out[point * n_components + component]`.
fn at_points(grid: &Space, cells: &[CellId], space: &Space, values: &[f64], n_components: usize) -> Vec<f64> {
    let n = grid.n_nodes();
    let (mut sums, mut counts) = (vec![0.0; n * n_components], vec![0u32; n]);
    let continuous = space.family() == Family::Continuous && space.degree() > 0;
    let mut tables: Vec<(CellKind, Table)> = Vec::new();
    for cell in cells {
        let (Some(at), Some(home)) = (grid.position_of_cell(*cell), space.position_of_cell(*cell)) else { continue };
        let (points, element) = (grid.element_at(at), space.element_at(home));
        if tables.iter().all(|(kind, _)| *kind != element.kind()) {
            tables.push((element.kind(), element.tabulate(points.points(), 0)));
        }
        let table = tables.iter().find(|(kind, _)| *kind == element.kind()).map(|(_, t)| t).expect("made above");
        let nodes = space.entity_nodes(home);
        for (q, point) in grid.entity_nodes(at).iter().map(|p| *p as usize).enumerate() {
            if continuous && counts[point] > 0 {
                continue;
            }
            counts[point] += 1;
            let basis = &table.values[q * table.n_dofs..][..table.n_dofs];
            for (value, node) in basis.iter().zip(nodes).filter(|(value, _)| **value != 0.0) {
                let own = &values[*node as usize * n_components..][..n_components];
                sums[point * n_components..][..n_components].iter_mut().zip(own).for_each(|(s, v)| *s += value * v);
            }
        }
    }
    for (point, count) in counts.iter().enumerate().filter(|(_, c)| **c > 1) {
        sums[point * n_components..][..n_components].iter_mut().for_each(|s| *s /= f64::from(*count));
    }
    sums
}
