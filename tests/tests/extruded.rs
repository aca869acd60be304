//! A scene in the plane is one in space, drawn along the third axis, where nothing moves along it: forces, strains, states
//! and what flows along faces are the same. Lines become faces, ends of faults become edges, and friction has a second
//! direction in which nothing happens.

use std::{fmt::Write as _, fs, path::Path};

use wfl_mesh::mesh::{BoxShape, Mesh, generate_box};
use wfl_tests::{
    blocks::{LAWS, measures, scene},
    solve,
};

/// The mesh as a Gmsh file, bent in the plane; in space it is one layer of cells of thickness 1.
fn file(mesh: &Mesh, in_space: bool) -> String {
    let layers: &[f64] = if in_space { &[0.0, 1.0] } else { &[0.0] };
    let n = mesh.n_nodes();
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", n * layers.len());
    for (k, z) in layers.iter().enumerate() {
        for (node, [x, y, _]) in mesh.nodes().iter().enumerate() {
            let bent = [x + 0.06 * (3.0 * y).sin(), y + 0.08 * (2.5 * x).sin() * y];
            // writing to a string cannot fail
            let _ = writeln!(text, "{} {:e} {:e} {z}", k * n + node + 1, bent[0], bent[1]);
        }
    }
    let _ = write!(text, "$EndNodes\n$Elements\n{}\n", mesh.n_cells());
    for (k, cell) in mesh.cells().enumerate() {
        let nodes: Vec<usize> = mesh.cell_nodes(cell).iter().map(|node| node.index()).collect();
        // Gmsh goes around faces; its numbers of a triangle, a quadrilateral, a wedge and a hexahedron
        let around: &[usize] = if nodes.len() == 3 { &[0, 1, 2] } else { &[0, 1, 3, 2] };
        let of_gmsh = [[2, 3], [6, 5]][usize::from(in_space)][nodes.len() - 3];
        let vertices = (0..layers.len()).flat_map(|layer| around.iter().map(move |v| (layer, *v)));
        let list: Vec<String> = vertices.map(|(layer, v)| (layer * n + nodes[v] + 1).to_string()).collect();
        let _ = writeln!(text, "{} {of_gmsh} 2 0 1 {}", k + 1, list.join(" "));
    }
    text + "$EndElements\n"
}

/// The measures of the scenes in the plane and in space, relative to the larger of both.
fn compare(shape: BoxShape, degrees: &[usize]) {
    let mesh = generate_box([0.0; 3], [2.0, 1.0, 1.0], [4, 3, 1], 2, shape).expect("a mesh");
    let folder = std::env::temp_dir().join(format!("wfl-extruded-{}-{shape:?}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    let family = if shape == BoxShape::Quadrilateral { 'Q' } else { 'P' };
    for degree in degrees {
        for (name, law) in LAWS {
            let run = |in_space: bool| {
                let pull = ["[-0.05 + 0.02*y*t, 0.02*t]", "[-0.05 + 0.02*y*t, 0.02*t, 0]"][usize::from(in_space)];
                // faces of a wedge that were lines are quadrilaterals
                let mut text = scene(law, &format!("{family}{degree}"), if in_space { 'Q' } else { family }, pull);
                // the same rules in both: laws with a kink are no polynomials, and what is left of their integrals is seen
                text += "quadrature on left, right, other degree 5\n";
                if !law.contains("quadrature on fault") {
                    text += "quadrature on fault degree 5\n";
                }
                if in_space {
                    text += "fix a(3) = 0 on left\nfix b(3) = 0 on right\n";
                }
                fs::write(folder.join("blocks.msh"), file(&mesh, in_space)).expect("a file");
                let solved = solve(&folder as &Path, text, &[], &[]);
                measures(
                    &solved.unwrap_or_else(|e| panic!("{name}, {shape:?}, degree {degree}, in space {in_space}: {e}")),
                )
            };
            for (plane, space) in run(false).iter().zip(run(true)) {
                let size = plane.1.abs().max(space.1.abs());
                assert!(
                    (plane.1 - space.1).abs() <= 1e-9 * size,
                    "{name}, {shape:?}, degree {degree}: {plane:?} is {} in space",
                    space.1
                );
            }
        }
    }
    fs::remove_dir_all(&folder).expect("our folder");
}

#[test]
fn quadrilaterals_are_hexahedra_of_one_layer() {
    compare(BoxShape::Quadrilateral, &[1, 2]);
}

#[test]
fn triangles_are_wedges_of_one_layer() {
    compare(BoxShape::Triangle, &[1, 2]);
}
