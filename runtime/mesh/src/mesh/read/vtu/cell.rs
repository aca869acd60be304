//! Cells of VTK as Gmsh lists them.

use super::{ReadError, wrong};

/// A cell with Gmsh's number of its type and its nodes in Gmsh's order.
pub(super) struct Listed {
    pub(super) code: i64,
    pub(super) nodes: Vec<u64>,
}

const LINE: &[usize] = &[0, 1, 2];
const HEXAHEDRON: &[usize] =
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26];
const TETRAHEDRON: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 7, 9, 8];
const WEDGE: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 8, 12, 7, 13, 14, 9, 11, 10, 15, 17, 16];
/// A wedge seen from its other triangle.
const TURNED: [usize; 18] = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13, 17, 16, 15];
const PYRAMID: &[usize] = &[0, 1, 2, 3, 4, 5, 8, 9, 6, 10, 7, 11, 12];
const AROUND: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 7, 8];

/// Gmsh's number and order of a type of cells with so many nodes.
fn row(kind: usize, n: usize) -> Option<(i64, &'static [usize])> {
    Some(match (kind, n) {
        (1, 1) => (15, LINE),
        (3 | 4 | 68, 2) => (1, LINE),
        (21 | 68, 3) => (8, LINE),
        (5 | 69, 3) => (2, AROUND),
        (22 | 69, 6) => (9, AROUND),
        (9 | 70, 4) => (3, AROUND),
        (8, 4) => (3, &[0, 1, 3, 2]),
        (23, 8) => (16, AROUND),
        (28 | 70, 9) => (10, AROUND),
        (10 | 71, 4) => (4, TETRAHEDRON),
        (24 | 71, 10) => (11, TETRAHEDRON),
        (12 | 72, 8) => (5, HEXAHEDRON),
        (11, 8) => (5, &[0, 1, 3, 2, 4, 5, 7, 6]),
        (25, 20) => (17, HEXAHEDRON),
        (29, 27) => (12, HEXAHEDRON),
        (13 | 73, 6) => (6, WEDGE),
        (26, 15) => (18, WEDGE),
        (32, 18) => (13, WEDGE),
        (14, 5) => (7, PYRAMID),
        (27, 13) => (19, PYRAMID),
        _ => return None,
    })
}

/// A cell of this type. `nodes` of the file, at `points`; both orders of the triangles of a wedge are in use.
pub(super) fn listed(
    kind: usize,
    nodes: Vec<u64>,
    points: &[[f64; 3]],
    cell: usize,
    at: usize,
) -> Result<Listed, ReadError> {
    let n = nodes.len();
    let Some((code, order)) = row(kind, n) else {
        let what = match kind {
            2 | 4 => "points or lines in one cell",
            6 => "triangles in a strip",
            7 => "a polygon",
            41 | 42 => "a polyhedron",
            68..=74 => "a Lagrange cell of another order or of second order on a quadrilateral base",
            _ => "no cell that is read",
        };
        let help =
            "write triangles, quadrilaterals, tetrahedra, hexahedra, wedges and pyramids of first or second order";
        return Err(wrong(at, format!("cell {cell} (VTK type {kind}, {n} nodes) is {what}; {help}")));
    };
    let place = |k: usize| usize::try_from(nodes[k]).ok().and_then(|node| points.get(node)).copied();
    let turned = matches!(kind, 13 | 26 | 32 | 73) && corners(place).is_some_and(is_turned);
    let nodes: Vec<u64> = if turned { TURNED[..n].iter().map(|k| nodes[*k]).collect() } else { nodes };
    Ok(Listed { code, nodes: order[..n].iter().map(|k| nodes[*k]).collect() })
}

fn corners(place: impl Fn(usize) -> Option<[f64; 3]>) -> Option<[[f64; 3]; 4]> {
    Some([place(0)?, place(1)?, place(2)?, place(3)?])
}

/// Whether the first triangle of a wedge runs clockwise seen from the second one.
fn is_turned([a, b, c, d]: [[f64; 3]; 4]) -> bool {
    let arm = |p: [f64; 3]| [0, 1, 2].map(|k| p[k] - a[k]);
    let (u, v, w) = (arm(b), arm(c), arm(d));
    let volume: f64 = (0..3).map(|k| w[k] * (u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3])).sum();
    volume < 0.0
}
