//! The numbers of nodes and cells, and the vertex that a cell begins with, are no part of a scene: meshes whose cells are
//! turned in themselves and shuffled give the same measures. Interfaces, faces, rims, mappings, local frames and states go
//! from one cell to the next by such numbers.

use std::{fmt::Write as _, fs, path::Path};

use wfl_mesh::mesh::{BoxShape, CellKind, Mesh, generate_box};
use wfl_tests::{
    Sequence,
    blocks::{LAWS, measures, scene},
    solve,
};

/// The ways in which a cell can be turned onto itself: for each vertex the one that takes its place.
fn turns(kind: CellKind) -> Vec<Vec<usize>> {
    let vertices = kind.vertices();
    let (n, dim) = (vertices.len(), kind.dim());
    let mut found = Vec::new();
    for order in permutations(n) {
        let at = |k: usize| vertices[order[k]];
        // affine maps of the reference cell alone, by the images of the first vertex and its neighbours along the axes
        let axis = |d: usize| vertices.iter().position(|v| (0..3).all(|c| v[c] == f64::from(u8::from(c == d))));
        let image = |v: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|c| {
                let along = (0..dim).map(|d| v[d] * (at(axis(d).expect("a vertex on each axis"))[c] - at(0)[c]));
                at(0)[c] + along.sum::<f64>()
            })
        };
        let is_affine = (0..n).all(|k| image(vertices[k]) == at(k));
        let m: [[f64; 3]; 3] = std::array::from_fn(|d| {
            std::array::from_fn(|c| {
                if d < dim { at(axis(d).expect("one"))[c] - at(0)[c] } else { f64::from(u8::from(c == d)) }
            })
        });
        let minor = |i: usize, j: usize| m[1][i] * m[2][j] - m[1][j] * m[2][i];
        let volume = m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1);
        if is_affine && volume > 0.0 {
            found.push(order);
        }
    }
    found
}

fn permutations(n: usize) -> Vec<Vec<usize>> {
    let Some(last) = n.checked_sub(1) else { return vec![Vec::new()] };
    let shorter = permutations(last);
    let with = |list: &Vec<usize>| (0..n).map(|k| [&list[..k], &[last], &list[k..]].concat()).collect::<Vec<_>>();
    shorter.iter().flat_map(with).collect()
}

/// A list in random order.
fn shuffled(n: usize, random: &mut Sequence) -> Vec<usize> {
    let mut keyed: Vec<(f64, usize)> = (0..n).map(|k| (random.number(), k)).collect();
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
    keyed.into_iter().map(|(_, k)| k).collect()
}

/// The mesh as a Gmsh file, bent; with a seed its nodes, cells and the vertices of each cell are in another order.
fn file(mesh: &Mesh, seed: Option<u64>) -> String {
    let mut random = Sequence(0x2545_f491 + seed.unwrap_or(0));
    let mut order = |n: usize| if seed.is_some() { shuffled(n, &mut random) } else { (0..n).collect() };
    let (nodes, cells) = (order(mesh.n_nodes()), order(mesh.n_cells()));
    let mut number = vec![0; nodes.len()];
    nodes.iter().enumerate().for_each(|(new, old)| number[*old] = new + 1);
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", nodes.len());
    for (k, node) in nodes.iter().enumerate() {
        let [x, y, z] = mesh.nodes()[*node];
        let bent = [x + 0.06 * (3.0 * y).sin() * z.cos(), y + 0.08 * (2.5 * x).sin() * y, z + 0.05 * x * y * z];
        // writing to a string cannot fail
        let _ = writeln!(text, "{} {:e} {:e} {:e}", k + 1, bent[0], bent[1], bent[2]);
    }
    let _ = write!(text, "$EndNodes\n$Elements\n{}\n", cells.len());
    let all: Vec<_> = mesh.cells().collect();
    let turns = turns(mesh.kind(all[0]));
    for (k, cell) in cells.iter().enumerate() {
        let kind = mesh.kind(all[*cell]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let which = (0.5 * (1.0 + random.number()) * turns.len() as f64) as usize;
        let turn = &turns[if seed.is_some() { which.min(turns.len() - 1) } else { 0 }];
        // Gmsh goes around faces
        let (of_gmsh, around): (u8, &[usize]) = match kind {
            CellKind::Triangle => (2, &[0, 1, 2]),
            CellKind::Quadrilateral => (3, &[0, 1, 3, 2]),
            CellKind::Tetrahedron => (4, &[0, 1, 2, 3]),
            _ => (5, &[0, 1, 3, 2, 4, 5, 7, 6]),
        };
        let nodes = mesh.cell_nodes(all[*cell]);
        let list: Vec<String> = around.iter().map(|v| number[nodes[turn[*v]].index()].to_string()).collect();
        let _ = writeln!(text, "{} {of_gmsh} 2 0 1 {}", k + 1, list.join(" "));
    }
    text + "$EndElements\n"
}

/// The measures of the scenes of one shape on the mesh as it is and on others, relative to the larger of both.
fn compare(shape: BoxShape, degrees: &[usize]) {
    let (dim, cells) =
        if matches!(shape, BoxShape::Hexahedron | BoxShape::Tetrahedron) { (3, [4, 2, 2]) } else { (2, [4, 3, 1]) };
    let mesh = generate_box([0.0; 3], [2.0, 1.0, 1.0], cells, dim, shape).expect("a mesh");
    let folder = std::env::temp_dir().join(format!("wfl-relabelled-{}-{shape:?}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    for degree in degrees {
        let family = if matches!(shape, BoxShape::Hexahedron | BoxShape::Quadrilateral) { 'Q' } else { 'P' };
        let pull = if dim == 3 { "[-0.05 + 0.02*y*t, 0.02*t, 0.01*t*z]" } else { "[-0.05 + 0.02*y*t, 0.02*t]" };
        for (name, law) in LAWS {
            let text = scene(law, &format!("{family}{degree}"), family, pull);
            let run = |seed: Option<u64>| {
                fs::write(folder.join("blocks.msh"), file(&mesh, seed)).expect("a file");
                let solved = solve(&folder as &Path, text.clone(), &[], &[]);
                measures(&solved.unwrap_or_else(|e| panic!("{name}, {shape:?}, degree {degree}: {e}")))
            };
            let plain = run(None);
            for (known, other) in plain.iter().zip(run(Some(1))) {
                let size = known.1.abs().max(other.1.abs());
                assert!(
                    (known.1 - other.1).abs() <= 1e-9 * size,
                    "{name}, {shape:?}, degree {degree}: {known:?} is {} on a mesh with other numbers",
                    other.1
                );
            }
        }
    }
    fs::remove_dir_all(&folder).expect("our folder");
}

#[test]
fn numbers_of_quadrilaterals_change_nothing() {
    compare(BoxShape::Quadrilateral, &[1, 2]);
}

#[test]
fn numbers_of_triangles_change_nothing() {
    compare(BoxShape::Triangle, &[1, 2]);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn numbers_of_hexahedra_change_nothing() {
    compare(BoxShape::Hexahedron, &[1]);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn numbers_of_tetrahedra_change_nothing() {
    compare(BoxShape::Tetrahedron, &[1]);
}
