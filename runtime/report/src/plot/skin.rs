//! What is seen of bodies: plane cells, or the faces of solid cells that no neighbour covers, with their edges.
//!
//! Cells with nodes on edges and faces are drawn in parts between these nodes. Bodies share no nodes, so both sides of an
//! interface have faces.

use std::collections::BTreeMap;

use wfl_charts::Edge;

use crate::grid::{Whole, WholeCell};

/// Faces meet in an edge of the body if the angle between their normals is above this: degrees.
const SHARP: f64 = 30.0;

/// A face between nodes, with the kind of the edge from each node to the next.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SkinFace {
    pub(crate) nodes: Vec<usize>,
    pub(crate) edges: Vec<Edge>,
    /// The cell that it belongs to.
    pub(crate) cell: usize,
}

/// A face of a cell: its corners around it, the nodes on its edges, and one in its middle.
#[derive(Clone, Debug)]
struct Side {
    corners: Vec<usize>,
    middles: Vec<usize>,
    centre: Option<usize>,
    cell: usize,
}

/// What is drawn where cells meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MeshLines {
    Drawn,
    Hidden,
}

impl MeshLines {
    /// The kind of the edges between cells.
    pub(crate) fn edge(self) -> Edge {
        match self {
            MeshLines::Drawn => Edge::Mesh,
            MeshLines::Hidden => Edge::None,
        }
    }
}

/// The faces that are seen.
pub(crate) fn skin(whole: &Whole, cells: &[usize], lines: MeshLines) -> Vec<SkinFace> {
    let sides = outer(whole, cells);
    let mut around: BTreeMap<[usize; 2], Vec<[f64; 3]>> = BTreeMap::new();
    for side in &sides {
        let normal = normal(whole, &side.corners);
        for k in 0..side.corners.len() {
            around.entry(edge_key(side, k)).or_default().push(normal);
        }
    }
    let plane = cells.iter().all(|k| matches!(whole.cells[*k].kind, 5 | 9 | 22 | 28));
    let smooth = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > SHARP.to_radians().cos();
    let kind = |side: &Side, k: usize| match around.get(&edge_key(side, k)).map(Vec::as_slice) {
        // cells of a plane mesh may be numbered either way round
        Some([a, b]) if plane || smooth(a, b) => lines.edge(),
        _ => Edge::Rim,
    };
    sides
        .iter()
        .flat_map(|side| parts(side, &(0..side.corners.len()).map(|k| kind(side, k)).collect::<Vec<_>>()))
        .collect()
}

fn edge_key(side: &Side, k: usize) -> [usize; 2] {
    let (a, b) = (side.corners[k], side.corners[(k + 1) % side.corners.len()]);
    [a.min(b), a.max(b)]
}

/// Plane cells themselves, or the sides of solid cells that occur once.
fn outer(whole: &Whole, cells: &[usize]) -> Vec<Side> {
    // sorted corners say which sides are the same; sides that have three are filled up with a number that no node has
    let key = |side: &Side| {
        let mut key = [usize::MAX; 4];
        key.iter_mut().zip(&side.corners).for_each(|(k, c)| *k = *c);
        key.sort_unstable();
        key
    };
    let all: Vec<Side> = cells.iter().flat_map(|k| sides(&whole.cells[*k], *k)).collect();
    let mut keys: Vec<([usize; 4], usize)> = all.iter().enumerate().map(|(k, side)| (key(side), k)).collect();
    keys.sort_unstable();
    let mut once = vec![false; all.len()];
    for same in keys.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, only)] = same {
            once[*only] = true;
        }
    }
    all.into_iter().zip(once).filter(|(_, once)| *once).map(|(side, _)| side).collect()
}

/// The sides of a cell: corners, edges in the order of the corners, and the middle, as `vtkCellType.h` numbers them.
fn sides(cell: &WholeCell, number: usize) -> Vec<Side> {
    let side = |corners: &[usize], middles: &[usize], centre: Option<usize>| Side {
        corners: corners.iter().map(|k| cell.nodes[*k]).collect(),
        middles: middles.iter().filter_map(|k| cell.nodes.get(*k).copied()).collect(),
        centre: centre.and_then(|k| cell.nodes.get(k).copied()),
        cell: number,
    };
    match cell.kind {
        5 | 22 => vec![side(&[0, 1, 2], &[3, 4, 5], None)],
        9 | 28 => vec![side(&[0, 1, 2, 3], &[4, 5, 6, 7], Some(8))],
        10 | 24 => vec![
            side(&[0, 1, 3], &[4, 8, 7], None),
            side(&[1, 2, 3], &[5, 9, 8], None),
            side(&[2, 0, 3], &[6, 7, 9], None),
            side(&[0, 2, 1], &[6, 5, 4], None),
        ],
        12 | 29 => vec![
            side(&[0, 4, 7, 3], &[16, 15, 19, 11], Some(20)),
            side(&[1, 2, 6, 5], &[9, 18, 13, 17], Some(21)),
            side(&[0, 1, 5, 4], &[8, 17, 12, 16], Some(22)),
            side(&[3, 7, 6, 2], &[19, 14, 18, 10], Some(23)),
            side(&[0, 3, 2, 1], &[11, 10, 9, 8], Some(24)),
            side(&[4, 5, 6, 7], &[12, 13, 14, 15], Some(25)),
        ],
        13 | 32 => vec![
            side(&[0, 1, 2], &[6, 7, 8], None),
            side(&[3, 5, 4], &[11, 10, 9], None),
            side(&[0, 3, 4, 1], &[12, 9, 13, 6], Some(15)),
            side(&[1, 4, 5, 2], &[13, 10, 14, 7], Some(16)),
            side(&[2, 5, 3, 0], &[14, 11, 12, 8], Some(17)),
        ],
        14 | 27 => vec![
            side(&[0, 3, 2, 1], &[8, 7, 6, 5], None),
            side(&[0, 1, 4], &[5, 10, 9], None),
            side(&[1, 2, 4], &[6, 11, 10], None),
            side(&[2, 3, 4], &[7, 12, 11], None),
            side(&[3, 0, 4], &[8, 9, 12], None),
        ],
        _ => Vec::new(),
    }
}

/// A side in parts between its nodes.
fn parts(side: &Side, edges: &[Edge]) -> Vec<SkinFace> {
    let (c, m) = (&side.corners, &side.middles);
    let n = c.len();
    if m.len() != n || (n == 4 && side.centre.is_none()) {
        return vec![SkinFace { nodes: c.clone(), edges: edges.to_vec(), cell: side.cell }];
    }
    // a corner, the middle of its edge, what is inside, the middle of the edge before
    let mut parts: Vec<SkinFace> = (0..n)
        .map(|k| {
            let before = (k + n - 1) % n;
            match side.centre {
                Some(centre) => SkinFace {
                    nodes: vec![c[k], m[k], centre, m[before]],
                    edges: vec![edges[k], Edge::None, Edge::None, edges[before]],
                    cell: side.cell,
                },
                None => SkinFace {
                    nodes: vec![c[k], m[k], m[before]],
                    edges: vec![edges[k], Edge::None, edges[before]],
                    cell: side.cell,
                },
            }
        })
        .collect();
    if side.centre.is_none() {
        parts.push(SkinFace { nodes: m.clone(), edges: vec![Edge::None; n], cell: side.cell });
    }
    parts
}

/// The normal of a face by the cross product of its diagonals, of length 1.
fn normal(whole: &Whole, corners: &[usize]) -> [f64; 3] {
    let p = |k: usize| whole.points[corners[k % corners.len()]];
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let (u, v) =
        if corners.len() == 3 { (sub(p(1), p(0)), sub(p(2), p(0))) } else { (sub(p(2), p(0)), sub(p(3), p(1))) };
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let size = n[0].hypot(n[1]).hypot(n[2]);
    n.map(|x| if size > 0.0 { x / size } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two unit cubes side by side along x.
    fn cubes() -> Whole {
        let points = (0..12).map(|k| [f64::from(k % 3), f64::from(k / 3 % 2), f64::from(k / 6)]).collect();
        let cell = |at: usize| WholeCell { kind: 12, nodes: [0, 1, 4, 3, 6, 7, 10, 9].map(|k| k + at).to_vec() };
        Whole { points, cells: vec![cell(0), cell(1)], ..Whole::default() }
    }

    #[test]
    fn two_cubes_have_ten_faces_and_the_edges_of_one_box() {
        let faces = skin(&cubes(), &[0, 1], MeshLines::Drawn);
        assert_eq!(faces.len(), 10);
        let count = |kind: Edge| faces.iter().flat_map(|f| &f.edges).filter(|e| **e == kind).count();
        // each edge is seen from two faces: 12 edges of the box of which 4 are in two parts, and 4 between the cubes
        assert_eq!((count(Edge::Rim), count(Edge::Mesh)), (2 * 16, 2 * 4));
        assert!(skin(&cubes(), &[0, 1], MeshLines::Hidden).iter().flat_map(|f| &f.edges).all(|e| *e != Edge::Mesh));
    }

    #[test]
    fn normals_of_the_sides_point_outwards() {
        let whole = cubes();
        for side in sides(&whole.cells[0], 0) {
            let n = normal(&whole, &side.corners);
            let middle = side
                .corners
                .iter()
                .map(|k| whole.points[*k])
                .fold([0.0; 3], |s, p| [0, 1, 2].map(|i| s[i] + p[i] / 4.0));
            let out: f64 = (0..3).map(|i| n[i] * (middle[i] - 0.5)).sum();
            assert!((out - 0.5).abs() < 1e-12, "{side:?}");
        }
        let wedge = vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]];
        let pyramid = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (kind, points) in [(13, wedge), (14, pyramid)] {
            let n_points = points.len() as f64;
            let centre = points.iter().fold([0.0; 3], |s, p| [0, 1, 2].map(|i| s[i] + p[i] / n_points));
            let cell = WholeCell { kind, nodes: (0..points.len()).collect() };
            let whole = Whole { points, cells: vec![cell], ..Whole::default() };
            assert_eq!(skin(&whole, &[0], MeshLines::Drawn).len(), 5);
            for side in sides(&whole.cells[0], 0) {
                let (n, at) = (normal(&whole, &side.corners), whole.points[side.corners[0]]);
                assert!((0..3).map(|i| n[i] * (at[i] - centre[i])).sum::<f64>() > 0.1, "{kind} {side:?}");
            }
        }
    }

    #[test]
    fn a_quadratic_triangle_is_drawn_in_four_parts() {
        let points =
            vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let whole = Whole { points, cells: vec![WholeCell { kind: 22, nodes: (0..6).collect() }], ..Whole::default() };
        let faces = skin(&whole, &[0], MeshLines::Drawn);
        let nodes: Vec<&[usize]> = faces.iter().map(|f| f.nodes.as_slice()).collect();
        assert_eq!(nodes, [&[0, 3, 5][..], &[1, 4, 3], &[2, 5, 4], &[3, 4, 5]]);
        assert_eq!(faces.iter().flat_map(|f| &f.edges).filter(|e| **e == Edge::Rim).count(), 6);
    }
}
