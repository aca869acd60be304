//! Scenes on refined meshes, built again round by round as an adaptive loop does.

use std::path::Path;

use wfl::{Override, SourceMap, Unloaded, resolve};
use wfl_compiler::InterpreterBackend;
use wfl_mesh::{
    mesh::{CellId, Mesh, RegionSet, facet_measures},
    refine::{Axes, Mark},
};
use wfl_problem::{Prepared, Scene, prepare_refined};
use wfl_run::{Quiet, RunOptions, run};
use wfl_tests::{examples, solve};

/// No file beside the scene.
struct Alone;

impl wfl::Loader for Alone {
    fn load(&mut self, path: &str, _from: wfl::SourceId) -> Result<(String, String), Unloaded> {
        panic!("`{path}` is not there")
    }
}

fn prepared(folder: &Path, text: &str, rounds: &[Vec<Mark>]) -> Prepared {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text.to_owned());
    let none: [Override; 0] = [];
    let script = resolve(&mut sources, main, &mut Alone, &none).value.expect("a script");
    prepare_refined(&script, folder, &InterpreterBackend, &[], rounds)
}

fn scene(folder: &Path, text: &str, rounds: &[Vec<Mark>]) -> Scene {
    let made = prepared(folder, text, rounds);
    made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics))
}

/// Builds the scene `n` times, each time refined at the cells with a vertex near `x`.
fn refined(folder: &Path, text: &str, n: usize, x: [f64; 3], radius: f64) -> (Scene, Vec<Vec<Mark>>) {
    let mut rounds: Vec<Vec<Mark>> = Vec::new();
    for _ in 0..n {
        let made = scene(folder, text, &rounds);
        rounds.push(near(&made.system.mesh, x, radius));
    }
    (scene(folder, text, &rounds), rounds)
}

fn near(mesh: &Mesh, x: [f64; 3], radius: f64) -> Vec<Mark> {
    let away = |n| (0..3).map(|i| f64::powi(mesh.node(n)[i] - x[i], 2)).sum::<f64>();
    let is_near = |cell: &CellId| mesh.cell_vertices(*cell).iter().any(|n| away(*n) <= radius * radius);
    mesh.cells().filter(is_near).map(Mark::all).collect()
}

fn measure(scene: &mut Scene, name: &str) -> f64 {
    let outcome = run(scene, &RunOptions::without_files(1, std::time::Instant::now()), &mut Quiet).expect("a run");
    assert!(outcome.converged());
    let list = &outcome.steps.last().expect("a step").measures;
    list.iter().find(|m| m.0 == name).unwrap_or_else(|| panic!("no measure {name}")).1
}

#[test]
fn a_linear_solution_passes_on_refined_meshes_of_every_kind() {
    let boxes = [
        ("[0] to [1] cells 3 segment", "2*x"),
        ("[0,0] to [1,1] cells 3 tri", "2*x - y"),
        ("[0,0] to [1,1] cells 3 quad", "2*x - y"),
        ("[0,0,0] to [1,1,1] cells 2 tet", "2*x - y + 3*z"),
        ("[0,0,0] to [1,1,1] cells 2 hex", "2*x - y + 3*z"),
    ];
    for (mesh, solution) in boxes {
        for map in ["", "map"] {
            let dim = mesh.split(']').next().unwrap_or("").split(',').count();
            let moved = [
                "",
                " map [x + 0.2*x^2]",
                " map [x + 0.2*x*y, y - 0.1*x^2]",
                " map [x + 0.2*x*y, y - 0.1*x^2, z + 0.1*x*z]",
            ];
            let map = if map.is_empty() { "" } else { moved[dim] };
            let text = format!(
                "mesh box {mesh}{map}\nunknown u : scalar\nterm on all : Grad_u.Grad_Test_u\nfix u = {solution} on boundary\n\
                 measure e = max(abs(u - ({solution}))) on all\nmeasure v = integral(1) on all\n"
            );
            let (mut made, rounds) =
                refined(Path::new(""), &text, 3, [0, 1, 2].map(|d| if d < dim { 0.4 } else { 0.0 }), 0.3);
            assert!(rounds.iter().all(|marks| !marks.is_empty()));
            let e = measure(&mut made, "e");
            assert!(e <= 1e-12, "{mesh}{map}: {e}");
        }
    }
}

#[test]
fn new_nodes_of_a_mapped_box_lie_where_the_map_has_them() {
    // a quarter of a ring: the boundary is met exactly
    let text = "mesh box [1,0] to [2,1] cells 2 tri map [x*cos(pi/2*y), x*sin(pi/2*y)]\nunknown u : scalar\n\
                region outer = nodes where x^2 + y^2 == 4\nterm on all : Grad_u.Grad_Test_u - Test_u\n\
                fix u = 0 on outer\n";
    let count = |rounds: &[Vec<Mark>]| {
        let made = scene(Path::new(""), text, rounds);
        let RegionSet::Nodes(nodes) = &made.regions["outer"].set else { panic!("nodes") };
        nodes.len()
    };
    assert_eq!(count(&[]), 3);
    let all = |n: usize| (0..n).map(|c| Mark::all(CellId::new(c))).collect::<Vec<_>>();
    assert_eq!(count(&[all(8), all(32), all(128)]), 17);
}

#[test]
fn an_interface_and_a_split_are_those_of_the_refined_mesh() {
    let text = "mesh box [0,0] to [2,1] cells [4,2] tri\nregion left = cells where x < 1\nregion right = cells where x > 1\n\
                region f = interface from left to right\nunknown u : scalar\nsplit u across f\n\
                def jump(a) = a - Interpolate(a, neighbor_element)\n\
                term on all : Grad_u.Grad_Test_u\nterm on f : 1e3*jump(u)*jump(Test_u)\n\
                fix u = x on boundary\nmeasure length = integral(1) on f\nmeasure e = max(abs(jump(u))) on f\n";
    let (mut made, _) = refined(Path::new(""), text, 4, [1.0, 0.5, 0.0], 0.2);
    let RegionSet::Interface(pairs) = &made.regions["f"].set else { panic!("an interface") };
    assert!(pairs.len() > 8, "{}", pairs.len());
    let mesh = &made.system.mesh;
    for side in [pairs.iter().map(|p| p.here).collect::<Vec<_>>(), pairs.iter().map(|p| p.there).collect()] {
        let length: f64 = facet_measures(mesh, &side).iter().sum();
        assert!((length - 1.0).abs() < 1e-14);
    }
    assert!((measure(&mut made, "length") - 1.0).abs() < 1e-13);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn groups_of_a_mesh_from_gmsh_are_refined_with_it() {
    let text = std::fs::read_to_string(examples().join("surfaces/penny.wfl"));
    let folder = examples().join("surfaces");
    let Ok(text) = text else { panic!("the example of a penny-shaped crack") };
    let before = scene(&folder, &text, &[]);
    let sizes = |made: &Scene| {
        let of = |name: &str| match &made.regions[name].set {
            RegionSet::Facets(f) => Some(facet_measures(&made.system.mesh, f).iter().sum::<f64>()),
            RegionSet::Interface(p) => {
                let here: Vec<_> = p.iter().map(|p| p.here).collect();
                Some(facet_measures(&made.system.mesh, &here).iter().sum())
            }
            _ => None,
        };
        made.regions.keys().filter_map(|name| Some((name.clone(), of(name)?))).collect::<Vec<_>>()
    };
    let (after, _) = refined(&folder, &text, 2, [1.0, 0.0, 0.0], 0.2);
    assert!(after.system.mesh.n_cells() > before.system.mesh.n_cells());
    for ((name, a), (_, b)) in sizes(&before).iter().zip(&sizes(&after)) {
        assert!((a - b).abs() < 1e-9 * a, "{name}: {a} {b}");
    }
}

#[test]
fn the_way_back_of_a_scene_has_one_part_for_each_round() {
    let text = "mesh box [0,0] to [1,1] cells 2 quad\nunknown u : scalar\nterm on all : Grad_u.Grad_Test_u - Test_u\n\
                fix u = 0 on boundary\n";
    assert!(scene(Path::new(""), text, &[]).refined.is_none());
    let one = vec![Mark { cell: CellId::new(0), axes: Axes::of(&[0]) }];
    let made = scene(Path::new(""), text, &[one.clone(), Vec::new(), one]);
    let refined = made.refined.expect("it was refined");
    assert_eq!((refined.cells_before, refined.rounds.len()), (4, 3));
    assert_eq!(refined.rounds.iter().map(|r| r.n_cells()).collect::<Vec<_>>(), [6, 6, 8]);
}

#[test]
fn contact_on_a_refined_fault_has_matching_faces_and_converges() {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("nitsche.wfl")).expect("the example");
    let text = text.lines().filter(|l| !l.starts_with("output")).collect::<Vec<_>>().join("\n");
    for (cells, refine) in [
        ("cells [2, 4, 4] tet", "refine on fault where z > 2"),
        ("cells [2, 4, 4] tet", "refine where abs(x) < 0.1 and z < 1 times 2"),
        ("cells [4, 4, 4] hex", "refine where abs(x) < 0.1 times 2 along x"),
    ] {
        let edits = [
            ("cells [8, 8, 8] hex", cells.to_owned()),
            ("region left ", format!("{refine}\nregion left ")),
            ("0 to 9.5 by 0.5", "0 to 8 by 4".to_owned()),
        ];
        let solved = solve(&folder, text.clone(), &edits, &[]).unwrap_or_else(|e| panic!("{refine}: {e}"));
        assert!(solved.outcome.converged(), "{refine}");
        let refined = solved.scene.refined.as_ref().expect("it was refined");
        assert!(refined.statements[0].1 > refined.cells_before, "{refine}");
        let mesh = &solved.scene.system.mesh;
        let RegionSet::Interface(pairs) = &solved.scene.regions["fault"].set else { panic!("an interface") };
        let sides = [pairs.iter().map(|p| p.here).collect::<Vec<_>>(), pairs.iter().map(|p| p.there).collect()];
        for side in &sides {
            let area: f64 = facet_measures(mesh, side).iter().sum();
            assert!((area - 16.0).abs() < 1e-12, "{refine}: {area}");
        }
        for pair in pairs {
            let vertices = [pair.here, pair.there].map(|f| {
                let mut nodes = mesh.facet_vertices(f).vertices().to_vec();
                nodes.sort_unstable();
                nodes
            });
            assert_eq!(vertices[0], vertices[1], "{refine}");
        }
    }
}
