//! The entity of a cell that carries a dof, found by the dof's place: for cells that are no product of one kind of line.

use super::DofEntity;
use crate::cell::CellKind;

/// Points that differ by less are the same: those of a lattice are at least a quarter apart.
const SAME: f64 = 1e-9;

/// The entities of the dofs at `points` of a cell, in their order.
pub(super) fn entities(kind: CellKind, degree: usize, points: &[[f64; 3]]) -> Vec<DofEntity> {
    let mut inside = 0;
    points
        .iter()
        .map(|point| {
            of_point(kind, degree, *point).unwrap_or_else(|| {
                inside += 1;
                DofEntity::Interior(inside - 1)
            })
        })
        .collect()
}

/// The vertex, edge or facet that has the point; `None` inside the cell. The place along an edge is counted from its first
/// vertex, that on a facet in its own parameters, the first one fastest.
fn of_point(kind: CellKind, degree: usize, point: [f64; 3]) -> Option<DofEntity> {
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|d| (a[d] - b[d]).abs() < SAME);
    let vertices = kind.vertices();
    if let Some(vertex) = vertices.iter().position(|v| near(*v, point)) {
        return Some(DofEntity::Vertex(vertex));
    }
    let part = |k: usize| k as f64 / degree as f64;
    let steps = 1..degree;
    for (edge, [a, b]) in kind.edges().iter().enumerate() {
        let at = |k: usize| std::array::from_fn(|d| vertices[*a][d] + part(k) * (vertices[*b][d] - vertices[*a][d]));
        if let Some(k) = steps.clone().find(|k| near(at(*k), point)) {
            return Some(DofEntity::Edge { edge, index: k - 1 });
        }
    }
    for (facet, local) in kind.facets().iter().enumerate() {
        let map = kind.facet_map(facet);
        let places = steps.clone().flat_map(|r| steps.clone().map(move |s| [s, r])).filter(|[s, r]| {
            // a triangle has the places below its oblique edge
            local.kind == CellKind::Quadrilateral || s + r < degree
        });
        let found = places.enumerate().find(|(_, [s, r])| near(map.apply([part(*s), part(*r), 0.0]), point));
        if let Some((index, _)) = found {
            return Some(DofEntity::Facet { facet, index });
        }
    }
    None
}
