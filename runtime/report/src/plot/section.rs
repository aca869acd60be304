//! Cuts: a plane through solid cells, a line through plane or solid cells. Values are linear between the corners.

use std::collections::BTreeMap;

use wfl_charts::Edge;

use super::skin::MeshLines;
use crate::grid::{Whole, WholeCell};

/// Distances below this part of the extent of the body count as zero.
const ROUNDING: f64 = 1e-9;

/// A point of a cut: between two nodes, at `share` from the first; a node itself has itself twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Between {
    pub(crate) nodes: [usize; 2],
    share: f64,
}

impl Between {
    /// A number there.
    pub(crate) fn of(&self, at: impl Fn(usize) -> f64) -> f64 {
        let [a, b] = self.nodes;
        if a == b { at(a) } else { at(a) + self.share * (at(b) - at(a)) }
    }
}

/// A convex piece of a plane inside a cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cut {
    pub(crate) points: Vec<Between>,
    pub(crate) edges: Vec<Edge>,
}

/// The pieces of the plane where a coordinate has this value, in solid cells. Where it lies between cells, those below
/// are cut, or those above if there are none below. Empty if it meets no cell.
pub(crate) fn plane(whole: &Whole, cells: &[usize], axis: usize, value: f64, lines: MeshLines) -> Vec<Cut> {
    let numbers = || cells.iter().flat_map(|k| whole.cells[*k].corners()).map(|n| whole.points[*n][axis]);
    let extent = numbers().fold(0.0f64, |m, x| m.max((x - value).abs()));
    let distance = |node: usize| {
        let d = whole.points[node][axis] - value;
        if d.abs() <= ROUNDING * extent { 0.0 } else { d }
    };
    let meets = |k: &&usize, below: bool| {
        let ds = || whole.cells[**k].corners().iter().map(|n| distance(*n));
        let (low, high) = (ds().fold(f64::INFINITY, f64::min), ds().fold(f64::NEG_INFINITY, f64::max));
        (low < 0.0 && high > 0.0) || (low < high && if below { high == 0.0 } else { low == 0.0 })
    };
    let mut cuts: Vec<Cut> = Vec::new();
    for below in [true, false] {
        if cuts.is_empty() {
            let met = cells.iter().filter(|k| meets(k, below));
            cuts = met.filter_map(|k| piece(whole, &whole.cells[*k], axis, &distance)).collect();
        }
    }
    let mut seen: BTreeMap<[[usize; 2]; 2], usize> = BTreeMap::new();
    for cut in &cuts {
        for k in 0..cut.points.len() {
            *seen.entry(side_key(cut, k)).or_default() += 1;
        }
    }
    for cut in &mut cuts {
        let kinds = (0..cut.points.len()).map(|k| match seen.get(&side_key(cut, k)) {
            Some(1) => Edge::Rim,
            _ => lines.edge(),
        });
        cut.edges = kinds.collect();
    }
    cuts
}

fn side_key(cut: &Cut, k: usize) -> [[usize; 2]; 2] {
    let (a, b) = (cut.points[k].nodes, cut.points[(k + 1) % cut.points.len()].nodes);
    [a.min(b), a.max(b)]
}

/// Edges between the corners of a solid cell.
fn edges(cell: &WholeCell) -> &'static [[usize; 2]] {
    match cell.kind {
        10 | 24 => &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
        12 | 29 => &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
        13 | 32 => &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
        14 | 27 => &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]],
        _ => &[],
    }
}

fn piece(whole: &Whole, cell: &WholeCell, axis: usize, distance: &impl Fn(usize) -> f64) -> Option<Cut> {
    let mut points: Vec<Between> = Vec::new();
    let on = cell.corners().iter().filter(|n| distance(**n) == 0.0);
    points.extend(on.map(|n| Between { nodes: [*n, *n], share: 0.0 }));
    for [i, j] in edges(cell) {
        let (a, b) = (cell.nodes[*i].min(cell.nodes[*j]), cell.nodes[*i].max(cell.nodes[*j]));
        let (da, db) = (distance(a), distance(b));
        if da * db < 0.0 {
            points.push(Between { nodes: [a, b], share: da / (da - db) });
        }
    }
    if points.len() < 3 {
        return None;
    }
    let [u, v] = other_axes(axis);
    let place = |p: &Between| [u, v].map(|d| p.of(|n| whole.points[n][d]));
    #[expect(clippy::cast_precision_loss, reason = "a few corners")]
    let n = points.len() as f64;
    let centre = points.iter().map(place).fold([0.0; 2], |s, p| [s[0] + p[0] / n, s[1] + p[1] / n]);
    let angle = |p: &Between| {
        let [x, y] = place(p);
        (y - centre[1]).atan2(x - centre[0])
    };
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    Some(Cut { points, edges: Vec::new() })
}

/// The two axes across one, in their order.
pub(crate) fn other_axes(axis: usize) -> [usize; 2] {
    match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}

/// Values along the line between two points: the distance from the first, as a part of the whole, and the value, in
/// pairs that bound the part in one simplex. Empty if it meets no cell.
pub(crate) fn line(whole: &Whole, cells: &[usize], dim: usize, ends: [[f64; 3]; 2], numbers: &[f64]) -> Vec<[f64; 2]> {
    let mut parts: Vec<[[f64; 2]; 2]> = Vec::new();
    for k in cells {
        let cell = &whole.cells[*k];
        for simplex in simplices(cell) {
            let nodes: Vec<usize> = simplex.iter().map(|i| cell.nodes[*i]).collect();
            let corners: Vec<[f64; 3]> = nodes.iter().map(|n| whole.points[*n]).collect();
            let (Some(at0), Some(at1)) = (barycentric(&corners, dim, ends[0]), barycentric(&corners, dim, ends[1]))
            else {
                continue;
            };
            let Some([low, high]) = inside(&at0, &at1) else { continue };
            let value = |s: f64| {
                let weight = |i: usize| at0[i] + s * (at1[i] - at0[i]);
                nodes.iter().enumerate().map(|(i, n)| weight(i) * numbers[*n]).sum::<f64>()
            };
            parts.push([[low, value(low)], [high, value(high)]]);
        }
    }
    parts.sort_by(|a, b| (a[0][0] + a[1][0]).total_cmp(&(b[0][0] + b[1][0])));
    // where the line runs along a face, both its cells have it
    let same = |a: f64, b: f64| (a - b).abs() <= ROUNDING;
    parts.dedup_by(|b, a| same(a[0][0], b[0][0]) && same(a[1][0], b[1][0]));
    parts.into_iter().flatten().collect()
}

/// The part of the line, from 0 to 1, where all weights are positive.
fn inside(at0: &[f64], at1: &[f64]) -> Option<[f64; 2]> {
    let (mut low, mut high) = (0.0f64, 1.0f64);
    for (a, b) in at0.iter().zip(at1) {
        let slope = b - a;
        if slope.abs() <= ROUNDING * ROUNDING {
            if *a < -ROUNDING {
                return None;
            }
        } else if slope > 0.0 {
            low = low.max(-a / slope);
        } else {
            high = high.min(-a / slope);
        }
    }
    (high - low > ROUNDING).then_some([low, high])
}

/// Weights of the corners of a simplex at a point; `None` if it has no volume.
fn barycentric(corners: &[[f64; 3]], dim: usize, point: [f64; 3]) -> Option<Vec<f64>> {
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], if dim == 3 { a[2] - b[2] } else { 0.0 }];
    let p = sub(point, corners[0]);
    let e: Vec<[f64; 3]> = corners[1..].iter().map(|c| sub(*c, corners[0])).collect();
    let third = e.get(2).copied().unwrap_or([0.0, 0.0, 1.0]);
    let det = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    let volume = det(e[0], e[1], third);
    if volume == 0.0 || !volume.is_finite() {
        return None;
    }
    let mut weights = vec![0.0, det(p, e[1], third) / volume, det(e[0], p, third) / volume];
    if e.len() == 3 {
        weights.push(det(e[0], e[1], p) / volume);
    }
    weights[0] = 1.0 - weights[1..].iter().sum::<f64>();
    Some(weights)
}

/// Triangles or tetrahedra between the corners of a cell.
fn simplices(cell: &WholeCell) -> &'static [&'static [usize]] {
    match cell.kind {
        5 | 22 => &[&[0, 1, 2]],
        9 | 28 => &[&[0, 1, 2], &[0, 2, 3]],
        10 | 24 => &[&[0, 1, 2, 3]],
        // around the diagonal from 0 to 6
        12 | 29 => &[&[0, 1, 2, 6], &[0, 2, 3, 6], &[0, 3, 7, 6], &[0, 7, 4, 6], &[0, 4, 5, 6], &[0, 5, 1, 6]],
        13 | 32 => &[&[0, 1, 2, 5], &[0, 1, 5, 4], &[0, 4, 5, 3]],
        14 | 27 => &[&[0, 1, 2, 4], &[0, 2, 3, 4]],
        _ => &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube.
    fn cube() -> Whole {
        let points = (0..8).map(|k| [f64::from(k % 2), f64::from(k / 2 % 2), f64::from(k / 4)]).collect();
        let cell = WholeCell { kind: 12, nodes: vec![0, 1, 3, 2, 4, 5, 7, 6] };
        Whole { points, cells: vec![cell], ..Whole::default() }
    }

    /// A wedge and a pyramid in the order of VTK, each of its volume by the simplices that a line is cut with.
    #[test]
    fn simplices_and_edges_of_wedges_and_pyramids_fill_the_cell() {
        let wedge = vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]];
        let pyramid = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (kind, points, volume, corners_of_cut) in [(13, wedge, 0.5, 3), (14, pyramid, 1.0 / 3.0, 4)] {
            let cell = WholeCell { kind, nodes: (0..points.len()).collect() };
            let whole = Whole { points, cells: vec![cell], ..Whole::default() };
            let of = |s: &[usize]| {
                let p = |k: usize| difference(whole.points[s[k]], whole.points[s[0]]);
                let (a, b, c) = (p(1), p(2), p(3));
                (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                    + a[2] * (b[0] * c[1] - b[1] * c[0]))
                    .abs()
                    / 6.0
            };
            let sum: f64 = simplices(&whole.cells[0]).iter().map(|s| of(s)).sum();
            assert!((sum - volume).abs() < 1e-14, "{kind}: {sum}");
            assert_eq!(plane(&whole, &[0], 2, 0.5, MeshLines::Drawn)[0].points.len(), corners_of_cut);
        }
    }

    fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|d| a[d] - b[d])
    }

    fn corners(whole: &Whole, cut: &Cut) -> Vec<[f64; 3]> {
        cut.points.iter().map(|p| [0, 1, 2].map(|d| p.of(|n| whole.points[n][d]))).collect()
    }

    #[test]
    fn a_plane_cuts_a_cube_in_a_square() {
        let whole = cube();
        let cuts = plane(&whole, &[0], 0, 0.25, MeshLines::Drawn);
        assert_eq!(cuts.len(), 1);
        assert_eq!(corners(&whole, &cuts[0]), [[0.25, 0.0, 0.0], [0.25, 1.0, 0.0], [0.25, 1.0, 1.0], [0.25, 0.0, 1.0]]);
        assert_eq!(cuts[0].edges, [Edge::Rim; 4]);
        // its own sides belong to it, what lies beyond does not
        assert_eq!(plane(&whole, &[0], 2, 0.0, MeshLines::Drawn).len(), 1);
        assert_eq!(plane(&whole, &[0], 2, 1.0, MeshLines::Drawn).len(), 1);
        assert!(plane(&whole, &[0], 2, 1.5, MeshLines::Drawn).is_empty());
    }

    #[test]
    fn a_plane_cuts_a_tetrahedron_in_a_triangle_or_a_quadrilateral() {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let cell = WholeCell { kind: 10, nodes: vec![0, 1, 2, 3] };
        let whole = Whole { points, cells: vec![cell], ..Whole::default() };
        let cuts = plane(&whole, &[0], 2, 0.5, MeshLines::Drawn);
        assert_eq!(corners(&whole, &cuts[0]), [[0.0, 0.0, 0.5], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]]);
        let sum: Vec<f64> = whole.points.iter().map(|p| p[0] + p[1]).collect();
        let values: Vec<f64> = cuts[0].points.iter().map(|p| p.of(|n| sum[n])).collect();
        assert_eq!(values, [0.0, 0.5, 0.5]);
    }

    #[test]
    fn a_line_through_a_cube_has_the_linear_field_of_its_corners() {
        let whole = cube();
        let values: Vec<f64> = whole.points.iter().map(|p| 1.0 + 2.0 * p[0] - p[1] + 3.0 * p[2]).collect();
        let ends = [[-1.0, 0.3, 0.6], [3.0, 0.3, 0.6]];
        let found = line(&whole, &[0], 3, ends, &values);
        assert!((found[0][0] - 0.25).abs() < 1e-12 && (found.last().unwrap()[0] - 0.5).abs() < 1e-12, "{found:?}");
        for [s, v] in found {
            let x = -1.0 + 4.0 * s;
            assert!((v - (1.0 + 2.0 * x - 0.3 + 1.8)).abs() < 1e-12);
        }
        assert!(line(&whole, &[0], 3, [[-1.0, 2.0, 0.0], [3.0, 2.0, 0.0]], &values).is_empty());
    }
}
