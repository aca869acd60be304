//! Meshes of two blocks on each other that share no node: a lower one and an upper one, each with its own cells.

use std::fmt::Write;

use wfl_tests::Sequence;

/// What a block is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cells {
    Quadrilaterals,
    Triangles,
    Hexahedra,
    Tetrahedra,
    /// With triangles on the contact.
    Wedges,
    Pyramids,
}

/// A block over a square (a segment in the plane).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) cells: Cells,
    /// Cells along each edge of the square.
    pub(crate) n: usize,
    /// Part of a cell by which inner nodes are moved along the square.
    pub(crate) amount: f64,
}

/// Two blocks of height 1/2 over unit squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blocks {
    pub(crate) dim: usize,
    pub(crate) lower: Block,
    pub(crate) upper: Block,
    /// By how much the upper one is moved along the square.
    pub(crate) shift: [f64; 2],
    /// The angle by which it is turned in it.
    pub(crate) turn: f64,
    /// Angles by which everything is turned about the first and the last axis.
    pub(crate) turned: [f64; 2],
    pub(crate) seed: u64,
}

/// Nodes, and elements with their kind and their group as Gmsh numbers them.
#[derive(Default)]
struct Made {
    nodes: Vec<[f64; 3]>,
    elements: Vec<(usize, usize, Vec<usize>)>,
}

/// Names of the groups, from 1.
const GROUPS: [&str; 8] = ["lower", "upper", "floor", "sole", "base", "lid", "walls", "sides"];

impl Made {
    /// A file for Gmsh 2.2, with the nodes at these places.
    fn written(&self, dim: usize, place: &dyn Fn([f64; 3]) -> [f64; 3]) -> String {
        let mut out = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n8\n".to_owned();
        for (k, name) in GROUPS.iter().enumerate() {
            let dim = if k < 2 { dim } else { dim - 1 };
            let _ = writeln!(out, "{dim} {} \"{name}\"", k + 1);
        }
        let _ = writeln!(out, "$EndPhysicalNames\n$Nodes\n{}", self.nodes.len());
        for (k, x) in self.nodes.iter().enumerate() {
            let [x, y, z] = place(*x);
            let _ = writeln!(out, "{} {x:?} {y:?} {z:?}", k + 1);
        }
        let _ = writeln!(out, "$EndNodes\n$Elements\n{}", self.elements.len());
        for (k, (kind, group, nodes)) in self.elements.iter().enumerate() {
            let list: Vec<String> = nodes.iter().map(|n| (n + 1).to_string()).collect();
            let _ = writeln!(out, "{} {kind} 2 {group} {group} {}", k + 1, list.join(" "));
        }
        out + "$EndElements\n"
    }
}

impl Blocks {
    /// Both with these cells, matching where `n` are equal.
    pub(crate) fn of(dim: usize, lower: (Cells, usize), upper: (Cells, usize)) -> Self {
        let block = |(cells, n)| Block { cells, n, amount: 0.0 };
        let (lower, upper) = (block(lower), block(upper));
        Self { dim, lower, upper, shift: [0.0; 2], turn: 0.0, turned: [0.0; 2], seed: 1 }
    }

    /// The position of a point of the blocks in the mesh.
    pub(crate) fn place(&self, x: [f64; 3]) -> [f64; 3] {
        let [a, b] = self.turned;
        let about_last = |[x, y, z]: [f64; 3]| [x * b.cos() - y * b.sin(), x * b.sin() + y * b.cos(), z];
        if self.dim == 2 {
            return about_last(x);
        }
        let [x, y, z] = about_last(x);
        [x, y * a.cos() - z * a.sin(), y * a.sin() + z * a.cos()]
    }

    /// A file for Gmsh 2.2.
    pub(crate) fn mesh(&self) -> String {
        let mut made = Made::default();
        self.add(&mut made, false);
        self.add(&mut made, true);
        made.written(self.dim, &|x| self.place(x))
    }

    fn add(&self, made: &mut Made, is_upper: bool) {
        let block = if is_upper { self.upper } else { self.lower };
        let n = block.n;
        let mut random = Sequence(self.seed * 7919 + u64::from(is_upper));
        (0..8).for_each(|_| {
            random.number();
        });
        // nodes along the square, each moved once for both layers
        let rows = if self.dim == 2 { 0 } else { n };
        let first = made.nodes.len();
        let mut square = Vec::new();
        for (j, i) in (0..=rows).flat_map(|j| (0..=n).map(move |i| (j, i))) {
            let mut x = [i, j].map(|k| k as f64 / n as f64);
            for (d, k) in [i, j].into_iter().enumerate().filter(|(_, k)| *k > 0 && *k < n) {
                let _ = k;
                x[d] += block.amount / n as f64 * random.number();
            }
            if is_upper {
                let [x0, y0] = if self.dim == 2 { [x[0], 0.0] } else { [x[0] - 0.5, x[1] - 0.5] };
                let (s, c) = self.turn.sin_cos();
                x = if self.dim == 2 { [x0, 0.0] } else { [0.5 + c * x0 - s * y0, 0.5 + s * x0 + c * y0] };
                x = [x[0] + self.shift[0], x[1] + self.shift[1]];
            }
            square.push(x);
        }
        let heights = if is_upper { [0.5, 1.0] } else { [0.0, 0.5] };
        for height in heights {
            let at = |x: &[f64; 2]| if self.dim == 2 { [x[0], height, 0.0] } else { [x[0], x[1], height] };
            made.nodes.extend(square.iter().map(at));
        }
        let node = |i: usize, j: usize, k: usize| first + (k * (rows + 1) + j) * (n + 1) + i;
        let groups = if is_upper { [2, 4, 6, 8] } else { [1, 5, 3, 7] };
        if self.dim == 2 {
            plane(made, block, groups, &|i, k| node(i, 0, k));
        } else {
            space(made, block, groups, &node);
        }
    }
}

/// Cells and faces of a block in the plane: groups of the cells, the faces below, those above and those beside.
fn plane(
    made: &mut Made,
    block: Block,
    [cells, below, above, walls]: [usize; 4],
    node: &dyn Fn(usize, usize) -> usize,
) {
    for i in 0..block.n {
        let [a, b, c, d] = [node(i, 0), node(i + 1, 0), node(i + 1, 1), node(i, 1)];
        if block.cells == Cells::Triangles {
            made.elements.extend([(2, cells, vec![a, b, c]), (2, cells, vec![a, c, d])]);
        } else {
            made.elements.push((3, cells, vec![a, b, c, d]));
        }
        made.elements.extend([(1, below, vec![a, b]), (1, above, vec![d, c])]);
    }
    for i in [0, block.n] {
        made.elements.push((1, walls, vec![node(i, 0), node(i, 1)]));
    }
}

/// The same in space.
fn space(
    made: &mut Made,
    block: Block,
    [cells, below, above, walls]: [usize; 4],
    node: &dyn Fn(usize, usize, usize) -> usize,
) {
    let n = block.n;
    // a face of four nodes around; triangles share the diagonal from the first to the third
    let face = |made: &mut Made, group: usize, nodes: [usize; 4], is_split: bool| {
        let [a, b, c, d] = nodes;
        if is_split {
            made.elements.extend([(2, group, vec![a, b, c]), (2, group, vec![a, c, d])]);
        } else {
            made.elements.push((3, group, nodes.to_vec()));
        }
    };
    let caps = matches!(block.cells, Cells::Tetrahedra | Cells::Wedges);
    let in_triangles = block.cells == Cells::Tetrahedra;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let at = |d: [usize; 3]| node(i + d[0], j + d[1], d[2]);
        let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]].map(at);
        cell(made, block.cells, cells, corners);
        let [a, b, c, d, e, f, g, h] = corners;
        face(made, below, [a, b, c, d], caps);
        face(made, above, [e, f, g, h], caps);
        // each wall from its lowest corner
        for (is_wall, nodes) in
            [(j == 0, [a, b, f, e]), (j + 1 == n, [d, c, g, h]), (i == 0, [a, d, h, e]), (i + 1 == n, [b, c, g, f])]
        {
            if is_wall {
                face(made, walls, nodes, in_triangles);
            }
        }
    }
}

/// A cube with these corners, as Gmsh orders them.
fn cell(made: &mut Made, cells: Cells, group: usize, corners: [usize; 8]) {
    let [a, b, c, d, e, f, g, h] = corners;
    match cells {
        Cells::Tetrahedra => {
            // along the ways from the lowest corner to the highest
            for [p, q] in [[b, c], [c, d], [d, h], [h, e], [e, f], [f, b]] {
                made.elements.push((4, group, vec![a, p, q, g]));
            }
        }
        Cells::Wedges => {
            made.elements.extend([(6, group, vec![a, b, c, e, f, g]), (6, group, vec![a, c, d, e, g, h])]);
        }
        Cells::Pyramids => {
            let middle = made.nodes.len();
            let mean = |d: usize| corners.iter().map(|k| made.nodes[*k][d]).sum::<f64>() / 8.0;
            let centre = [0, 1, 2].map(mean);
            made.nodes.push(centre);
            for base in [[a, b, c, d], [e, h, g, f], [a, e, f, b], [b, f, g, c], [c, g, h, d], [d, h, e, a]] {
                made.elements.push((7, group, base.into_iter().chain([middle]).collect()));
            }
        }
        _ => made.elements.push((5, group, corners.to_vec())),
    }
}

/// A grid of quadrilaterals over a rectangle whose corners are moved by a map.
pub(crate) struct Grid<'a> {
    pub(crate) from: [f64; 2],
    pub(crate) to: [f64; 2],
    pub(crate) cells: [usize; 2],
    pub(crate) map: &'a dyn Fn([f64; 2]) -> [f64; 2],
}

/// Two grids in the plane as the lower and the upper block; their sides have no group.
pub(crate) fn grids(lower: &Grid<'_>, upper: &Grid<'_>) -> String {
    let mut made = Made::default();
    for (grid, [cells, below, above]) in [(lower, [1, 5, 3]), (upper, [2, 4, 6])] {
        let [n, m] = grid.cells;
        let first = made.nodes.len();
        for (j, i) in (0..=m).flat_map(|j| (0..=n).map(move |i| (j, i))) {
            let part = [i as f64 / n as f64, j as f64 / m as f64];
            let [x, y] = (grid.map)([0, 1].map(|d| grid.from[d] + part[d] * (grid.to[d] - grid.from[d])));
            made.nodes.push([x, y, 0.0]);
        }
        let node = |i: usize, j: usize| first + j * (n + 1) + i;
        for (j, i) in (0..m).flat_map(|j| (0..n).map(move |i| (j, i))) {
            let corners = vec![node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
            made.elements.push((3, cells, corners));
        }
        made.elements.extend((0..n).map(|i| (1, below, vec![node(i, 0), node(i + 1, 0)])));
        made.elements.extend((0..n).map(|i| (1, above, vec![node(i + 1, m), node(i, m)])));
    }
    made.written(2, &|x| x)
}
