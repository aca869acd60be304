//! Faults in meshes from Gmsh: the same numbers as on the same cells made by `map`, equilibrium, and the patch test.

use wfl_tests::{Solved, examples, solve};

const LAWS: [&str; 3] = ["fault_30deg", "fault_30deg_penalty", "fault_30deg_augmented_lagrangian"];

fn scene(name: &str) -> String {
    let text = std::fs::read_to_string(examples().join("fault_gmsh").join(format!("{name}.wfl"))).expect("the scene");
    text.lines().filter(|l| !l.starts_with("output")).map(|l| format!("{l}\n")).collect()
}

fn solved(name: &str, edits: &[(&str, &str)], params: &[(&str, f64)]) -> Solved {
    let edits: Vec<(&str, String)> = edits.iter().map(|(a, b)| (*a, (*b).to_owned())).collect();
    let found = solve(&examples().join("fault_gmsh"), scene(name), &edits, params).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged(), "{name}: every step converges");
    found
}

/// Transfinite cells are those of a box whose nodes are moved: every number must agree.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_mesh_file_gives_what_the_same_cells_of_a_box_give() {
    let file = solved("fault_2deg", &[], &[]);
    let region = |sign: &str| format!("cells where x {sign} (z-2)*tan(2*pi/180)*(1-abs(x))");
    let regions = format!(
        "mesh box [-1,0,0] to [1,4,4] cells [8,8,8] hex map [x + (z-2)*tan(2*pi/180)*(1-abs(x)), y, z]\n\
         region left = {}\nregion right = {}\nregion bottom = faces where z == 0\nregion west = faces where x == -1\n\
         region east = faces where x == 1\nregion top = faces of right where z == 4",
        region("<"),
        region(">")
    );
    let made = solved("fault_2deg", &[("mesh file \"fault_2deg.msh\"", &regions), (" & fault_plane", "")], &[]);
    assert_eq!(file.outcome.steps.len(), 20);
    for step in 0..20 {
        for name in ["Fn", "Ft", "max_slip", "slipping"] {
            let (a, b) = (file.measure(step, name), made.measure(step, name));
            // coordinates in the file have 16 digits
            assert!((a - b).abs() <= 1e-9 * b.abs(), "{name} in step {step}: {a} against {b}");
        }
    }
}

/// The three methods differ by less than the mesh error, and loads and reactions balance.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn an_inclined_fault_of_thirty_degrees_is_in_equilibrium() {
    let mut forces = Vec::new();
    for name in LAWS {
        let mut found = solved(name, &[], &[]);
        for step in [0, 19] {
            let state = found.outcome.steps[step].state.clone();
            let time = found.outcome.steps[step].window.end;
            let system = &mut found.scene.system;
            system.begin_step(wfl_discrete::window::Window::new(time, 0.5)).expect("assembles");
            let residual = system.residual(&state, &wfl_discrete::system::Form::AS_WRITTEN).expect("assembles").values;
            // the residual at fixed dofs is what holds the blocks; loads: 3 on 16 square metres, t on the top of `right`
            let mut reaction = [0.0; 3];
            for k in (0..system.fields.len()).filter(|k| system.fields[*k].name.starts_with('u')) {
                for (i, d) in system.range(k).expect("an unknown").enumerate() {
                    reaction[i % 3] += residual[d];
                }
            }
            let top = 4.0 * (3.0 - 2.0 * (30.0f64).to_radians().tan());
            let applied = [-48.0, 0.0, -time * top];
            for c in 0..3 {
                let gap = (reaction[c] + applied[c]).abs();
                assert!(gap < 1e-9 * 48.0, "{name}: forces along axis {c} at t = {time} are out of balance by {gap:e}");
            }
        }
        forces.push((found.measure(19, "Fn"), found.measure(19, "Ft")));
    }
    let (normal, shear) = forces[2];
    for (n, s) in &forces {
        assert!((n - normal).abs() < 0.05 * normal.abs() && (s - shear).abs() < 0.05 * shear.abs(), "{forces:?}");
    }
}

/// verification.md B5: |sigma_n| and |sigma_t| of S = (-10, 1; 1, -3) on a plane inclined by 2 and by 30 degrees.
#[test]
fn an_inclined_interface_in_a_mesh_file_passes_the_patch_test() {
    let thirty = solved("patch", &[], &[]);
    assert!((thirty.measure(0, "normal_stress") + 9.116_025_403_8).abs() < 1e-9);
    assert!((thirty.measure(0, "shear") - 2.531_088_913_2).abs() < 1e-9);
    let a = 2f64.to_radians();
    let two = solved("patch", &[("fault_30deg.msh", "fault_2deg.msh")], &[("slope", a)]);
    let normal = -10.0 * a.cos().powi(2) - 2.0 * a.sin() * a.cos() - 3.0 * a.sin().powi(2);
    let shear = (-7.0 * a.sin() * a.cos() + a.cos().powi(2) - a.sin().powi(2)).abs();
    assert!((two.measure(0, "normal_stress") - normal).abs() < 1e-9);
    assert!((two.measure(0, "shear") - shear).abs() < 1e-9);
    assert!(thirty.measure(0, "error") < 1e-9 && two.measure(0, "error") < 1e-9);
}

/// A mesh of about 200,000 tetrahedra is read in less than a second (release builds; the time is printed).
#[test]
fn a_large_mesh_file_is_read_quickly() {
    let n = if cfg!(debug_assertions) { 8 } else { 32 };
    let mesh = wfl_mesh::mesh::generate_box([0.0; 3], [1.0; 3], [n, n, n], 3, wfl_mesh::mesh::BoxShape::Tetrahedron)
        .expect("a box");
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
    text += &format!("$Nodes\n{}\n", mesh.n_nodes());
    for (k, x) in mesh.nodes().iter().enumerate() {
        text += &format!("{} {:?} {:?} {:?}\n", k + 1, x[0], x[1], x[2]);
    }
    text += &format!("$EndNodes\n$Elements\n{}\n", mesh.n_cells());
    for (k, cell) in mesh.cells().enumerate() {
        let nodes: Vec<String> = mesh.cell_nodes(cell).iter().map(|n| (n.index() + 1).to_string()).collect();
        text += &format!("{} 4 2 1 1 {}\n", k + 1, nodes.join(" "));
    }
    text += "$EndElements\n";
    let path = std::env::temp_dir().join(format!("wfl-large-{}.msh", std::process::id()));
    std::fs::write(&path, text).expect("a temporary file");
    let begin = std::time::Instant::now();
    let read = wfl_mesh::mesh::read::mesh_of(&std::fs::read(&path).expect("the file"));
    let seconds = begin.elapsed().as_secs_f64();
    let _ = std::fs::remove_file(&path);
    let read = read.expect("a mesh");
    assert_eq!(read.n_cells(), mesh.n_cells());
    eprintln!("{} tetrahedra read in {seconds:.3} s", read.n_cells());
    assert!(cfg!(debug_assertions) || seconds < 1.0, "{seconds} s for {} tetrahedra", read.n_cells());
}
