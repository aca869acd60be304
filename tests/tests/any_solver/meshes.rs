//! Meshes at random: boxes of each kind of cell, and Gmsh files of several kinds in first and second order, which a map then
//! shears, twists, bends and turns. All of them fill 0..2 times 0..1 (times 0..1) before the map.

use std::{collections::BTreeMap, fmt::Write as _};

use super::Draw;

/// A mesh as a statement of a scene.
pub(super) struct Body {
    pub(super) dim: usize,
    /// Families of elements that its cells have.
    pub(super) family: char,
    /// The statement, with the definitions of `px` and `py`, the coordinates before everything was turned.
    pub(super) text: String,
    /// What is in `body.msh`.
    pub(super) file: Option<String>,
    /// Whether the map keeps ends that face each other equal, so that the one is mapped onto the other along x.
    pub(super) has_equal_ends: bool,
    /// Cells along y.
    pub(super) rows: usize,
    /// So many cells in space that a scene is best of a low degree.
    pub(super) is_rich: bool,
    /// All cells have affine maps.
    pub(super) is_affine: bool,
    /// So many faces between both halves that their forces are no small matrix.
    pub(super) is_long: bool,
}

/// Maps of the plane and of space that keep the ends x = 0 and x = 2, and what they do.
const PLANE: [[&str; 2]; 7] = [
    ["x", "y"],
    ["x", "y + 0.3*x"],
    ["x", "y*(1 + 0.2*x)"],
    ["x + 0.15*x*(2 - x)*(y - 0.5)", "y + 0.1*x*y"],
    ["x", "y + 0.15*sin(3*x)"],
    ["x*(0.6 + 0.2*x)", "y*y*0.4 + 0.6*y"],
    ["x + 0.1*x*(2 - x)*sin(3*y)", "y + 0.12*x*x*(1 + y)"],
];
const SPACE: [[&str; 3]; 8] = [
    ["x", "y", "z"],
    ["x", "y + 0.3*x", "z - 0.2*x + 0.1*y"],
    ["x", "y*(1 + 0.2*x)", "z*(1 - 0.15*x)"],
    ["x", "y + 0.2*x*z", "z - 0.15*x*y"],
    ["x + 0.15*x*(2 - x)*(y - 0.5)*z", "y + 0.1*x*y", "z + 0.1*y*z"],
    ["x", "y + 0.1*sin(3*x)", "z + 0.1*sin(2*x + y)"],
    ["x*(0.6 + 0.2*x)", "y*y*0.4 + 0.6*y", "z*(1 + 0.3*z)"],
    ["x + 0.1*x*(2 - x)*sin(3*y + z)", "y + 0.1*x*x*(1 + z)", "z + 0.08*sin(3*y)"],
];

pub(super) fn body(draw: &mut Draw) -> Body {
    let dim = if draw.chance(0.5) { 2 } else { 3 };
    let from_file = draw.chance(0.45);
    let is_long = dim == 2 && !from_file && draw.chance(0.03);
    let Made { mesh, file, family, rows } = match (is_long, from_file) {
        (true, _) => {
            Made { mesh: "mesh box [0,0] to [2,1] cells [2,40] quad".to_owned(), file: None, family: 'Q', rows: 40 }
        }
        (_, true) => of_file(draw, dim),
        _ => of_box(draw, dim),
    };
    // without a map ends are periodic images of each other
    let is_mapped = from_file || draw.chance(0.8);
    let which = if is_mapped { draw.below(if dim == 2 { PLANE.len() } else { SPACE.len() }) } else { 0 };
    let mapped: Vec<&str> = if dim == 2 { PLANE[which].to_vec() } else { SPACE[which].to_vec() };
    let angle = if !is_mapped || draw.chance(0.5) { 0.0 } else { 0.4 };
    let map = match (which, angle == 0.0) {
        (0, true) => String::new(),
        (_, true) => format!(" map [{}]", mapped.join(", ")),
        _ => {
            let [x, y] = [mapped[0], mapped[1]];
            let rest = mapped.get(2).map_or(String::new(), |z| format!(", {z}"));
            format!(" map [({x})*cos({angle}) - ({y})*sin({angle}), ({x})*sin({angle}) + ({y})*cos({angle}){rest}]")
        }
    };
    // simplices are bisected, other cells are refined in whole layers
    let refined = if dim == 2 && !is_long && draw.chance(0.2) { "refine where px < 0.6\n" } else { "" };
    let text = format!(
        "{mesh}{map} with idle_cells=allowed\n{refined}def px = x*cos({angle}) + y*sin({angle})\n\
         def py = y*cos({angle}) - x*sin({angle})\n"
    );
    Body {
        dim,
        family,
        text,
        file,
        rows,
        has_equal_ends: which == 0 && angle == 0.0 && !from_file && refined.is_empty(),
        is_rich: dim == 3 && (from_file || rows > 1),
        is_affine: !from_file && (family == 'P' || which < 2),
        is_long,
    }
}

/// What a mesh is before its map.
pub(super) struct Made {
    pub(super) mesh: String,
    pub(super) file: Option<String>,
    pub(super) family: char,
    pub(super) rows: usize,
}

impl Body {
    /// A mesh whose statement is given, and of which no more is known.
    pub(super) fn of(made: Made, dim: usize, text: String) -> Self {
        let Made { file, family, rows, .. } = made;
        let is_rich = dim == 3;
        Self { dim, family, text, file, has_equal_ends: false, rows, is_rich, is_affine: false, is_long: false }
    }
}

fn of_box(draw: &mut Draw, dim: usize) -> Made {
    let kind = if dim == 2 { draw.of(&["tri", "quad"]) } else { draw.of(&["tet", "hex"]) };
    let (cells, rows) = match (dim, draw.below(4)) {
        (2, 0) => ("[4,3]", 3),
        (2, 1) => ("[6,2]", 2),
        (2, _) => ("[4,4]", 4),
        (_, 0) => ("[2,1,2]", 1),
        (_, 1) => ("[4,2,2]", 2),
        (_, 2) => ("[4,1,1]", 1),
        _ => ("[2,2,2]", 2),
    };
    let ends = if dim == 2 { "[0,0] to [2,1]" } else { "[0,0,0] to [2,1,1]" };
    let family = if matches!(kind, "tri" | "tet") { 'P' } else { 'Q' };
    Made { mesh: format!("mesh box {ends} cells {cells} {kind}"), file: None, family, rows }
}

/// Corners of edges and of faces with a node in their middle, in the order of Gmsh's nodes of second order, and the numbers that
/// Gmsh has for a kind of first and second order.
struct Kind {
    numbers: [u32; 2],
    middles: &'static [&'static [usize]],
}

const TRIANGLE: Kind = Kind { numbers: [2, 9], middles: &[&[0, 1], &[1, 2], &[2, 0]] };
const QUADRILATERAL: Kind = Kind { numbers: [3, 10], middles: &[&[0, 1], &[1, 2], &[2, 3], &[3, 0], &[0, 1, 2, 3]] };
const TETRAHEDRON: Kind = Kind { numbers: [4, 11], middles: &[&[0, 1], &[1, 2], &[2, 0], &[3, 0], &[2, 3], &[1, 3]] };
const HEXAHEDRON: Kind = Kind {
    numbers: [5, 12],
    middles: &[
        &[0, 1],
        &[0, 3],
        &[0, 4],
        &[1, 2],
        &[1, 5],
        &[2, 3],
        &[2, 6],
        &[3, 7],
        &[4, 5],
        &[4, 7],
        &[5, 6],
        &[6, 7],
        &[0, 3, 2, 1],
        &[0, 1, 5, 4],
        &[0, 4, 7, 3],
        &[1, 2, 6, 5],
        &[2, 3, 7, 6],
        &[4, 5, 6, 7],
        &[0, 1, 2, 3, 4, 5, 6, 7],
    ],
};
const WEDGE: Kind = Kind {
    numbers: [6, 13],
    middles: &[
        &[0, 1],
        &[0, 2],
        &[0, 3],
        &[1, 2],
        &[1, 4],
        &[2, 5],
        &[3, 4],
        &[3, 5],
        &[4, 5],
        &[0, 1, 4, 3],
        &[0, 3, 5, 2],
        &[1, 2, 5, 4],
    ],
};
const PYRAMID: Kind = Kind {
    numbers: [7, 14],
    middles: &[&[0, 1], &[0, 3], &[0, 4], &[1, 2], &[1, 4], &[2, 3], &[2, 4], &[3, 4], &[0, 1, 2, 3]],
};

/// Nodes and cells that are put together.
#[derive(Default)]
struct Grid {
    nodes: Vec<[f64; 3]>,
    /// Nodes by the corners between which they lie; of a corner of the grid its own place.
    middles: BTreeMap<Vec<usize>, usize>,
    cells: Vec<(u32, Vec<usize>)>,
}

impl Grid {
    fn add(&mut self, kind: &Kind, corners: &[usize], order: usize) {
        let mut nodes = corners.to_vec();
        if order == 2 {
            for middle in kind.middles {
                let mut of: Vec<usize> = middle.iter().map(|k| corners[*k]).collect();
                of.sort_unstable();
                nodes.push(self.between(of));
            }
        }
        self.cells.push((kind.numbers[order - 1], nodes));
    }

    /// The node in the middle of others.
    fn between(&mut self, of: Vec<usize>) -> usize {
        let n = of.len() as f64;
        let middle = std::array::from_fn(|c| of.iter().map(|node| self.nodes[*node][c]).sum::<f64>() / n);
        let next = self.nodes.len();
        let at = *self.middles.entry(of).or_insert(next);
        if at == next {
            self.nodes.push(middle);
        }
        at
    }

    /// The letter of elements: of cells of this kind alone, or of simplices and of several kinds.
    fn family(&self, kind: &Kind) -> char {
        if self.cells.iter().all(|(number, _)| kind.numbers.contains(number)) { 'Q' } else { 'P' }
    }

    fn text(&self) -> String {
        let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", self.nodes.len());
        for (k, [x, y, z]) in self.nodes.iter().enumerate() {
            // writing to a string cannot fail
            let _ = writeln!(text, "{} {x:?} {y:?} {z:?}", k + 1);
        }
        let _ = writeln!(text, "$EndNodes\n$Elements\n{}", self.cells.len());
        for (k, (number, nodes)) in self.cells.iter().enumerate() {
            let nodes: Vec<String> = nodes.iter().map(|node| (node + 1).to_string()).collect();
            let _ = writeln!(text, "{} {number} 2 1 1 {}", k + 1, nodes.join(" "));
        }
        text + "$EndElements\n"
    }
}

pub(super) fn of_file(draw: &mut Draw, dim: usize) -> Made {
    let (order, rows) = (1 + draw.below(2), if dim == 2 { 2 + draw.below(2) } else { 1 + draw.below(2) });
    let (family, grid) = if dim == 2 { plane(draw, order, rows) } else { solid(draw, order, rows) };
    Made { mesh: "mesh file \"body.msh\"".to_owned(), file: Some(grid.text()), family, rows }
}

/// Squares of which each is one quadrilateral or two triangles; all are of one kind in a third of the meshes each.
fn plane(draw: &mut Draw, order: usize, rows: usize) -> (char, Grid) {
    let n = [4, rows];
    let mut grid = Grid::default();
    for (y, x) in (0..=n[1]).flat_map(|y| (0..=n[0]).map(move |x| (y, x))) {
        grid.nodes.push([2.0 * x as f64 / n[0] as f64, y as f64 / n[1] as f64, 0.0]);
    }
    let kinds = draw.of(&["tri", "quad", "both"]);
    for (y, x) in (0..n[1]).flat_map(|y| (0..n[0]).map(move |x| (y, x))) {
        let at = |i: usize, j: usize| (x + i) + (n[0] + 1) * (y + j);
        let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
        if kinds == "quad" || kinds == "both" && draw.chance(0.5) {
            grid.add(&QUADRILATERAL, &[a, b, c, d], order);
        } else {
            grid.add(&TRIANGLE, &[a, b, c], order);
            grid.add(&TRIANGLE, &[a, c, d], order);
        }
    }
    (grid.family(&QUADRILATERAL), grid)
}

/// Columns of cubes along z, each of hexahedra or of pairs of wedges; cubes of the first are six pyramids in some, and all cubes
/// six tetrahedra in other meshes.
fn solid(draw: &mut Draw, order: usize, rows: usize) -> (char, Grid) {
    let n = [2, rows, 1 + draw.below(2)];
    let mut grid = Grid::default();
    let number = |p: [usize; 3]| p[0] + (n[0] + 1) * (p[1] + (n[1] + 1) * p[2]);
    for (z, y, x) in (0..=n[2]).flat_map(|z| (0..=n[1]).flat_map(move |y| (0..=n[0]).map(move |x| (z, y, x)))) {
        grid.nodes.push([2.0 * x as f64 / n[0] as f64, y as f64 / n[1] as f64, z as f64 / n[2] as f64]);
    }
    let kinds = draw.of(&["tet", "hex", "wedges", "pyramids", "all"]);
    for (y, x) in (0..n[1]).flat_map(|y| (0..n[0]).map(move |x| (y, x))) {
        let has_wedges = kinds == "wedges" || kinds == "all" && draw.chance(0.5);
        for z in 0..n[2] {
            let c: [usize; 8] =
                [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
                    .map(|p: [usize; 3]| number([x + p[0], y + p[1], z + p[2]]));
            let has_pyramids = kinds == "pyramids" || kinds == "all" && draw.chance(0.5);
            match kinds {
                "tet" => {
                    for k in [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]] {
                        grid.add(&TETRAHEDRON, &k.map(|k| c[k]), order);
                    }
                }
                _ if has_wedges => {
                    grid.add(&WEDGE, &[0, 1, 2, 4, 5, 6].map(|k| c[k]), order);
                    grid.add(&WEDGE, &[0, 2, 3, 4, 6, 7].map(|k| c[k]), order);
                }
                _ if has_pyramids => {
                    let mut all = c.to_vec();
                    all.sort_unstable();
                    let top = grid.between(all);
                    for face in [[0, 1, 2, 3], [0, 4, 5, 1], [0, 3, 7, 4], [1, 5, 6, 2], [2, 6, 7, 3], [4, 7, 6, 5]] {
                        let [p, q, r, s] = face.map(|k| c[k]);
                        grid.add(&PYRAMID, &[p, q, r, s, top], order);
                    }
                }
                _ => grid.add(&HEXAHEDRON, &c, order),
            }
        }
    }
    (grid.family(&HEXAHEDRON), grid)
}
