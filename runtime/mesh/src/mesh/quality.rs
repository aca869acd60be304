//! Sizes: cell volumes, facet areas, heights over a facet, diameters, and a summary of them.
//!
//! Promises: volumes are exact for the geometry map, areas exact on plane affine facets and by a
//! Gauss rule of degree 5 or more on curved ones. Lengths have the unit of the coordinates.

use super::{
    Mesh,
    index::{CellId, FacetRef},
};
use crate::{
    cell::CellKind,
    element::Table,
    quadrature::{self, Rule},
    vector::{cross, determinant, distance, dot, norm},
};

/// Extremes over all cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualitySummary {
    /// Smallest cell volume.
    pub min_volume: f64,
    /// Largest cell volume.
    pub max_volume: f64,
    /// Smallest cell diameter.
    pub min_size: f64,
    /// Largest cell diameter.
    pub max_size: f64,
    /// Largest ratio of longest to shortest edge in one cell.
    pub max_aspect: f64,
}

/// A rule and the geometry tabulated at its points.
struct Sampled {
    rule: Rule,
    table: Table,
}

fn sampled(mesh: &Mesh, kind: CellKind, degree: usize) -> Sampled {
    let rule = quadrature::rule(kind, degree).expect("rules of low degree exist on every cell");
    let table = mesh.geometry_element(kind).tabulate(&rule.points, 1);
    Sampled { rule, table }
}

/// Volume (length, area) of each of `cells`: the integral of the jacobian determinant.
#[must_use]
pub fn cell_volumes(mesh: &Mesh, cells: &[CellId]) -> Vec<f64> {
    let order = mesh.order();
    let tables = CellKind::ALL.map(|kind| sampled(mesh, kind, kind.determinant_degree(order)));
    let volume = |cell: &CellId| -> f64 {
        let sampled = &tables[mesh.kind(*cell).index()];
        let weights = sampled.rule.weights.iter().enumerate();
        weights
            .map(|(point, weight)| {
                let jacobian = mesh.jacobian_at(*cell, &sampled.table, point);
                weight * determinant(&jacobian, mesh.dim())
            })
            .sum()
    };
    cells.iter().map(volume).collect()
}

/// Area (length; 1 for points) of each of `facets`.
#[must_use]
pub fn facet_measures(mesh: &Mesh, facets: &[FacetRef]) -> Vec<f64> {
    over_facets(mesh, facets, &|_, tangents, kind| match kind.dim() {
        0 => [1.0, 0.0, 0.0],
        1 => [norm(tangents[0]), 0.0, 0.0],
        _ => [norm(cross(tangents[0], tangents[1])), 0.0, 0.0],
    })
    .into_iter()
    .map(|[measure, ..]| measure)
    .collect()
}

/// Integral of the outward unit normal over each of `facets`: on a plane facet the normal times the area.
#[must_use]
pub(crate) fn facet_vectors(mesh: &Mesh, facets: &[FacetRef]) -> Vec<[f64; 3]> {
    over_facets(mesh, facets, &|facet, tangents, kind| {
        let vector = match kind.dim() {
            0 => [1.0, 0.0, 0.0],
            1 => [tangents[0][1], -tangents[0][0], 0.0],
            _ => cross(tangents[0], tangents[1]),
        };
        if turns_left(mesh, *facet) { vector } else { vector.map(|c| -c) }
    })
}

/// True if the vertices of a facet turn to the left when it is seen from outside its cell (in two dimensions: the cell
/// is on the left of the way from the first vertex to the second). Every cell of a mesh is oriented like its reference
/// cell.
pub(crate) fn turns_left(mesh: &Mesh, facet: FacetRef) -> bool {
    let kind = mesh.kind(facet.cell);
    let local = usize::from(facet.local);
    let (normal, [s, r]) = (kind.facet_normal(local), kind.facet_map(local).tangents);
    match mesh.dim() {
        1 => normal[0] > 0.0,
        2 => normal[0] * s[1] - normal[1] * s[0] > 0.0,
        _ => dot(normal, cross(s, r)) > 0.0,
    }
}

/// What is integrated over a facet: of the facet, the tangents of its map and its kind.
type Density<'a> = dyn Fn(&FacetRef, [[f64; 3]; 2], CellKind) -> [f64; 3] + 'a;

/// Integral over each facet of what `density` makes of the tangents of its map from the facet parameters.
fn over_facets(mesh: &Mesh, facets: &[FacetRef], density: &Density<'_>) -> Vec<[f64; 3]> {
    let tables = CellKind::ALL.map(|kind| {
        let degree = match (kind.straight_is_affine(), mesh.order()) {
            (true, 1) => 1,
            _ => 5,
        };
        sampled(mesh, kind, degree)
    });
    let integral = |facet: &FacetRef| {
        let kind = mesh.facet_kind(*facet);
        let sampled = &tables[kind.index()];
        let closure = mesh.geometry_element(mesh.kind(facet.cell)).facet_closure(facet.local as usize);
        let nodes = mesh.cell_nodes(facet.cell);
        let x = |dof: usize| mesh.node(nodes[closure[dof]]);
        let mut sum = [0.0; 3];
        for (point, weight) in sampled.rule.weights.iter().enumerate() {
            let value = density(facet, tangents(&sampled.table, point, &x), kind);
            for (total, part) in sum.iter_mut().zip(value) {
                *total += weight * part;
            }
        }
        sum
    };
    facets.iter().map(integral).collect()
}

/// Derivatives of the position by the facet parameters.
fn tangents(table: &Table, point: usize, x: &dyn Fn(usize) -> [f64; 3]) -> [[f64; 3]; 2] {
    let mut tangents = [[0.0; 3]; 2];
    for dof in 0..table.n_dofs {
        let position = x(dof);
        for (d, tangent) in tangents.iter_mut().take(table.dim).enumerate() {
            let slope = table.gradients[(point * table.n_dofs + dof) * table.dim + d];
            for i in 0..3 {
                tangent[i] += slope * position[i];
            }
        }
    }
    tangents
}

/// Height of the cell of each facet over that facet, the `h` of penalty terms: `c V / A` with the
/// cell volume `V`, the facet area `A` and `c` of [`CellKind::height_factor`]. For a
/// brick it is the edge normal to the facet, for a simplex the distance of the opposite vertex
/// (1 for a unit right simplex on an axis facet), for a wedge or a pyramid that of the opposite face, edge or vertex.
#[must_use]
pub fn facet_heights(mesh: &Mesh, facets: &[FacetRef]) -> Vec<f64> {
    let cells: Vec<CellId> = facets.iter().map(|facet| facet.cell).collect();
    let volumes = cell_volumes(mesh, &cells);
    let areas = facet_measures(mesh, facets);
    let factor = |facet: &FacetRef| mesh.kind(facet.cell).height_factor(usize::from(facet.local));
    let triples = facets.iter().zip(volumes).zip(areas);
    triples.map(|((facet, v), a)| factor(facet) * v / a).collect()
}

/// Diameter of each cell: the largest distance between two vertices (not what the language calls `element_size`).
#[must_use]
pub fn element_sizes(mesh: &Mesh, cells: &[CellId]) -> Vec<f64> {
    cells.iter().map(|cell| mesh.cell_diameter(*cell)).collect()
}

/// Extremes over all cells.
#[must_use]
pub fn summary(mesh: &Mesh) -> QualitySummary {
    let cells: Vec<CellId> = mesh.cells().collect();
    let bounds = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        (low, values.iter().copied().fold(0.0, f64::max))
    };
    let (min_volume, max_volume) = bounds(&cell_volumes(mesh, &cells));
    let (min_size, max_size) = bounds(&element_sizes(mesh, &cells));
    let aspect = |cell: &CellId| {
        let vertices = mesh.cell_vertices(*cell);
        let edges = mesh.kind(*cell).edges().iter();
        let lengths: Vec<f64> =
            edges.map(|[a, b]| distance(mesh.node(vertices[*a]), mesh.node(vertices[*b]))).collect();
        let (shortest, longest) = bounds(&lengths);
        longest / shortest
    };
    QualitySummary {
        min_volume,
        max_volume,
        min_size,
        max_size,
        max_aspect: cells.iter().map(aspect).fold(1.0, f64::max),
    }
}
