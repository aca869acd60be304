//! Points with images are evaluated eight at a time, whatever faces they are on: the same bits on any number of threads, images
//! in cells of several kinds, and of images that stay the forces of the points one by one.

use std::path::Path;

use wfl_compiler::{
    InterpreterBackend,
    types::{FieldOp, Side},
};
use wfl_discrete::system::{Branches, System};
use wfl_tests::{Sequence, prepared};

use super::{blocks, pattern::differences};

/// Points that stay on images in cells that are not those of their faces, in space.
fn fixed(cells: &str, element: &str) -> String {
    format!(
        "wfl 1
mesh box [0,0,0] to [3,3,2] cells [3,3,2] {cells} map [x + 0.06*sin(3*y), y + 0.05*x*z, z + 0.05*sin(x*y)]
region lower = cells where z < 1
region upper = cells where z > 1
region sole  = interface from upper to lower
unknown a : vector {element} on upper
unknown b : vector {element} on lower
term upper on upper : (1 + a.a)*Grad_a:Grad_Test_a
term lower on lower : (1 + b.b)*Grad_b:Grad_Test_b
mapping m = point 0.8*X + [0.4, 0.3, 0.05]
def jump = a - Interpolate(b, m)
term contact on sole : (1 + jump.jump)*jump.(Test_a - Interpolate(Test_b, m))
steps s = 0 to 1 by 1
"
    )
}

fn with_state(text: String, folder: &Path, examine: impl Fn(&System, &[f64])) {
    let scene = prepared(folder, text, &[], &[], &InterpreterBackend).unwrap_or_else(|e| panic!("{e}"));
    let equations = scene.at_first_step().expect("equations");
    let system: &System = &equations.system;
    let (upper, dim) = (system.range(0).expect("an unknown"), system.mesh.dim());
    let mut random = Sequence(5);
    let moved = |d: usize| if upper.contains(&d) && (d - upper.start) % dim == dim - 1 { -0.03 } else { 0.0 };
    let u: Vec<f64> = (0..system.numbering.n_dofs).map(|d| moved(d) + 1e-3 * random.number()).collect();
    examine(system, &u);
}

#[test]
fn sums_are_the_same_on_any_number_of_threads() {
    let here = Path::new(".");
    let moving = blocks(40, "steps s = 0 to 1 by 1\n").replace("x < 3", "x < 39");
    for text in [moving.clone(), moving.replace("raytrace", "project"), fixed("hex", "Q1"), fixed("tet", "P2")] {
        let by = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let found = std::sync::Mutex::new(Vec::new());
            with_state(text.clone(), here, |system, u| {
                let numbers = pool.install(|| {
                    let mut tangent = system.new_tangent();
                    system.tangent(u, Branches::AsWritten, &mut tangent).expect("a tangent");
                    let forces = system.residual_at_points(u).expect("a residual").0;
                    forces.iter().chain(tangent.changing.values()).map(|x| x.to_bits()).collect::<Vec<u64>>()
                });
                *found.lock().expect("one thread") = numbers;
            });
            found.into_inner().expect("one thread")
        };
        let one = by(1);
        assert!(one.len() > 100);
        for threads in [2, 3, 7] {
            assert!(by(threads) == one, "{threads} threads");
        }
    }
}

/// A floor of quadrilaterals and triangles, whose cells have four and three functions.
#[test]
fn images_may_lie_in_cells_of_several_kinds() {
    let folder = std::env::temp_dir().join(format!("wfl-kinds-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("kinds.msh"), kinds()).expect("a mesh");
    let text = blocks(4, "steps s = 0 to 1 by 1\n").replace("param fric = 0.2", "param fric = 0").replace("Q2", "Q1");
    let (_, rest) = text.split_once("quad with idle_cells=allowed\n").expect("the mesh");
    let text = format!("wfl 1\nmesh file \"kinds.msh\" with idle_cells=allowed\n{rest}");
    with_state(text, &folder, |system, u| {
        let points = system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
        let domain = points.at(&system.mesh, &system.slices(u));
        let images = domain.entities().filter(|(group, k)| !group.has_lost_its_image(*k));
        let mut kinds: Vec<_> =
            images.map(|(group, k)| system.mesh.kind(group.there.as_ref().expect("images").cells[k])).collect();
        kinds.sort_unstable();
        kinds.dedup();
        assert_eq!(kinds.len(), 2);
        let mut tangent = system.new_tangent();
        system.tangent(u, Branches::AsWritten, &mut tangent).expect("a tangent");
        let whole = system.bulk().plus(&tangent.changing).expect("one shape");
        differences(system, u, &whole);
        let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
        let mut forces = vec![0.0; u.len()];
        term.add_residual(&system.mesh, system.values(u).view(), &mut forces).expect("finite forces");
        let size = forces.iter().fold(0.0f64, |m, f| m.max(f.abs()));
        for c in 0..2 {
            let sum: f64 = forces.iter().skip(c).step_by(2).sum();
            assert!(size > 1e-4 && sum.abs() < 1e-13 * size, "{sum} of {size}");
        }
    });
    std::fs::remove_dir_all(&folder).expect("the folder");
}

/// Four cells in a row below y = 1, the second and the fourth cut into triangles, and three above.
fn kinds() -> String {
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n18\n");
    // the block above has nodes of its own
    let below = (0..10).map(|k| (f64::from(k % 5), f64::from(k / 5)));
    let above = (0..8).map(|k| (f64::from(k % 4) + 0.35, 1.0 + f64::from(k / 4)));
    for (k, (x, y)) in below.chain(above).enumerate() {
        text += &format!("{} {x} {y} 0\n", k + 1);
    }
    let mut cells: Vec<String> = Vec::new();
    for k in 1..5 {
        let (a, b, c, d) = (k, k + 1, k + 6, k + 5);
        if k % 2 == 1 {
            cells.push(format!("3 2 1 1 {a} {b} {c} {d}"));
        } else {
            cells.push(format!("2 2 1 1 {a} {b} {c}"));
            cells.push(format!("2 2 1 1 {a} {c} {d}"));
        }
    }
    cells.extend((11..14).map(|k| format!("3 2 1 1 {k} {} {} {}", k + 1, k + 5, k + 4)));
    text += &format!("$EndNodes\n$Elements\n{}\n", cells.len());
    (1..).zip(&cells).for_each(|(k, cell)| text += &format!("{k} {cell}\n"));
    text + "$EndElements\n"
}

/// Forces at nodes times positions of nodes are fluxes at points times positions of points, and the tangent is their difference.
#[test]
fn images_that_stay_have_the_moments_of_their_points() {
    for (cells, element) in [("hex", "Q1"), ("tet", "P1")] {
        with_state(fixed(cells, element), Path::new("."), |system, u| {
            let mut tangent = system.new_tangent();
            system.tangent(u, Branches::AsWritten, &mut tangent).expect("a tangent");
            let whole = system.bulk().plus(&tangent.changing).expect("one shape");
            differences(system, u, &whole);
            let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
            let (state, mesh) = (system.values(u), &system.mesh);
            let mut forces = vec![0.0; u.len()];
            term.add_residual(mesh, state.view(), &mut forces).expect("finite forces");
            let (mut at_points, mut point) = ([[0.0; 4]; 3], 0);
            term.for_each_flux(mesh, state.view(), |flux, weight| {
                let [x, y, z] = term.integrator.domain.position(mesh, point);
                point += 1;
                for (slot, flux) in term.law.tests.iter().zip(flux) {
                    if slot.side == Side::Here && slot.op == FieldOp::Value {
                        for (sum, factor) in at_points[usize::from(slot.entry)].iter_mut().zip([1.0, x, y, z]) {
                            *sum += weight * flux * factor;
                        }
                    }
                }
            });
            let first = system.range(0).expect("an unknown").start;
            let field = &system.fields[0];
            let mut at_nodes = [[0.0; 4]; 3];
            for node in 0..field.n_nodes() {
                let [x, y, z] = field.node_position(node);
                for (c, sums) in at_nodes.iter_mut().enumerate() {
                    for (sum, factor) in sums.iter_mut().zip([1.0, x, y, z]) {
                        *sum += forces[first + 3 * node + c] * factor;
                    }
                }
            }
            for (a, b) in at_points.as_flattened().iter().zip(at_nodes.as_flattened()) {
                assert!((a - b).abs() < 1e-13, "{a} {b} in {cells}");
            }
            assert!(at_points[2][0].abs() > 1e-3);
        });
    }
}
