//! Features of the language on variations of the example scenes: other searches for images, first values from files,
//! histories, tears with multipliers, and the messages of what cannot be done.

use std::path::{Path, PathBuf};

use wfl_tests::{Solved, attempt, examples, solve};

fn text(scene: &str) -> String {
    std::fs::read_to_string(examples().join(scene)).expect("examples can be read")
}

fn folder(scene: &str) -> PathBuf {
    examples().join(scene).parent().expect("a folder").to_path_buf()
}

/// The scene with parts of its text replaced; every part must occur.
fn changed(scene: &str, parts: &[(&str, &str)]) -> String {
    let mut text = text(scene);
    for (old, new) in parts {
        assert!(text.contains(old), "{scene} has no {old}");
        text = text.replace(old, new);
    }
    text
}

fn run(folder: &Path, text: String) -> Result<Solved, String> {
    solve(folder, text, &[], &[])
}

/// Solves, and every expectation must hold.
fn holds(scene: &str, parts: &[(&str, &str)]) {
    let outcome = run(&folder(scene), changed(scene, parts)).unwrap_or_else(|e| panic!("{scene}: {e}")).outcome;
    assert!(outcome.converged(), "{scene}");
    for (expect, holds) in &outcome.expectations {
        assert_eq!(*holds, Some(true), "{scene}: {}", expect.text);
    }
}

fn measure(solved: &Solved, name: &str) -> f64 {
    let last = solved.outcome.steps.last().expect("a step");
    last.measures.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("no measure {name}")).1
}

fn message(scene: &str, parts: &[(&str, &str)]) -> String {
    match run(&folder(scene), changed(scene, parts)) {
        Ok(_) => panic!("{scene} should be refused"),
        Err(e) => e,
    }
}

#[test]
fn rays_find_the_same_images_as_projection() {
    holds("mapping/pressed.wfl", &[("project from", "raytrace from")]);
}

/// From the coarse side three faces lie behind each face: what is missed falls as the rule gets finer.
#[test]
fn a_finer_rule_brings_the_pressure_of_meshes_that_do_not_nest_near() {
    let from_below = [
        ("project from upper_face onto lower_face", "project from lower_face onto upper_face"),
        ("uU - Interpolate(uL, below)", "uL - Interpolate(uU, below)"),
        ("(stress(uU)*Normal).Normal", "(stress(uL)*Normal).Normal"),
        ("Test_uU - Interpolate(Test_uL, below)", "Test_uL - Interpolate(Test_uU, below)"),
        ("on upper_face", "on lower_face"),
    ];
    let error = |degree: &str| {
        let mut text = changed("mapping/pressed.wfl", &from_below);
        text.push_str(&format!("quadrature on lower_face degree {degree}\n"));
        let solved = run(&folder("mapping/pressed.wfl"), text).expect("a solution");
        measure(&solved, "uneven") / 10.0
    };
    let (coarse, fine) = (error("5"), error("59"));
    assert!(coarse > 1e-3, "a rule of three points cannot see nine pieces: {coarse}");
    assert!(fine < 0.1 * coarse, "{coarse} {fine}");
}

#[test]
fn points_without_images_are_told() {
    let scene = "mapping/pressed.wfl";
    // the projection of half of the face finds nothing nearer than its own length
    let far = message(
        scene,
        &[("project from upper_face onto lower_face within 0.01", "project from upper_face onto base within 0.01")],
    );
    assert!(far.contains("E419") && far.contains("no point has an image under `below`"), "{far}");
    let two = message(
        scene,
        &[
            ("within 0.01", "within 0.01\nmapping other = raytrace from upper_face onto lower_face"),
            ("uU - Interpolate(uL, below)", "uU - Interpolate(uL, other)"),
        ],
    );
    assert!(two.contains("E215"), "{two}");
    let moving = message("mapping/periodic.wfl", &[("point x - 1", "point x - u")]);
    assert!(moving.contains("E407") && moving.contains("small sliding"), "{moving}");
    let normal = message(
        "mapping/periodic.wfl",
        &[("jump  = max(abs(u - Interpolate(u, back)))", "jump = max(Norm(Interpolate(Normal, back)))")],
    );
    assert!(normal.contains("E204"), "{normal}");
}

/// The first values of the heat scene, read from a file.
#[test]
fn a_run_starts_from_a_file() {
    let place = std::env::temp_dir().join(format!("wfl-start-{}", std::process::id()));
    std::fs::create_dir_all(&place).expect("a temporary folder");
    let mut table = "s,x,u\n".to_owned();
    for k in 0..=8 {
        let x = f64::from(k) / 8.0;
        table.push_str(&format!("{x},{x:?},{:?}\n", (std::f64::consts::PI * x).sin()));
    }
    std::fs::write(place.join("first.csv"), &table).expect("a temporary file");
    let scene = changed("heat/heat.wfl", &[("start u = sin(pi*x)", "start from \"first.csv\"")]);
    let good = run(&place, scene.clone());
    // one node less: the file does not fit
    std::fs::write(place.join("first.csv"), table.replace("0.5,0.5,", "0.5,0.501,")).expect("a temporary file");
    let bad = run(&place, scene);
    std::fs::remove_dir_all(&place).expect("our own folder");
    let outcome = good.expect("a solution").outcome;
    assert!(outcome.expectations.iter().all(|(_, holds)| *holds == Some(true)));
    let told = bad.err().expect("a node without a line");
    assert!(
        told.contains("E418") && told.contains("1 of 9 nodes have no line") && told.contains("1.0e-3 away"),
        "{told}"
    );
}

/// The bar of Perzyna with other rules, cells and increments: the closed form does not change with the first two.
#[test]
fn states_follow_rules_and_cells() {
    let scene = "plasticity/perzyna.wfl";
    holds(scene, &[("cells [2,1,1] hex", "cells [2,1,1] tet")]);
    holds(scene, &[("unknown u : vector", "quadrature on all degree 5\nunknown u : vector")]);
    holds(scene, &[("unknown u : vector", "quadrature on all vertex\nunknown u : vector")]);
}

/// In measures a state is new and its past is not: their difference is what the last step added.
#[test]
fn measures_see_both_ends_of_a_step() {
    let text = changed(
        "plasticity/perzyna.wfl",
        &[("measure volume", "measure gained = mean(axial(ep - Previous_ep)) on all\nmeasure volume")],
    );
    let solved = run(&folder("plasticity/perzyna.wfl"), text).expect("a solution");
    // steady flow: all of the strain of a step is plastic, up to what the stress still gains
    let gained = measure(&solved, "gained");
    assert!((gained / (1e-3 * 0.5) - 1.0).abs() < 1e-6, "{gained}");
}

#[test]
fn what_states_cannot_do_is_told() {
    let scene = "plasticity/perzyna.wfl";
    let element = message(scene, &[("state ep : matrix on all", "state ep : matrix Q1 on all")]);
    assert!(element.contains("E406") && element.contains("a state has no element"), "{element}");
    let gradient = message(scene, &[("Trace(ep)", "Norm(Grad_ep)")]);
    assert!(gradient.contains("E208"), "{gradient}");
    let size = message(scene, &[(":= Previous_ep + flow(u)", ":= gain(u)")]);
    assert!(size.contains("E108"), "{size}");
    let one = message("heat/heat.wfl", &[("steps t = 0 to 10*dt by dt", "steps t = 0 to 0 by dt")]);
    assert!(one.contains("E413") && one.contains("rates"), "{one}");
}

/// A multiplier on a crack: at its ends, where the body is whole, it has nothing to hold and follows the next node without a
/// word; what is left out says so.
#[test]
fn a_multiplier_ends_where_a_tear_ends() {
    let text = "mesh box [-1,-1] to [1,1] cells [4,4] quad
region here  = cells where y < 0
region there = cells where y > 0
region crack = interface from here to there & faces of here where y == 0 and abs(x) < 0.6
unknown u : vector
split u across crack
multiplier l : vector on crack
def jump(v) = v - Interpolate(v, neighbor_element)
def stress(v) = Div_v*Id(2) + 2*Sym(Grad_v)
term elastic on all : stress(u):Grad_Test_u
term tie on crack : l.jump(Test_u) + Test_l.jump(u)
region bottom = faces where y == -1
region top = faces where y == 1
fix u = [0,0] on bottom
fix u = [0.1,0.2] on top
measure open = max(Norm(jump(u))) on crack
measure mean_u = integral(u(1) + 3*u(2)) on all
";
    let tied = attempt(&examples(), text.to_owned(), &[], &[]);
    assert!(!tied.messages.contains("W404"), "{}", tied.messages);
    let tied = tied.solved.expect("a solution");
    let ends = tied.scene.left_out().into_iter().find(|l| l.name == "`l` at 2 nodes").expect("the ends of the tear");
    assert!(ends.why.contains("both sides share one node there"), "{}", ends.why);
    assert!(measure(&tied, "open") < 1e-14);
    // tied all along, the body is the one without a tear
    let whole = text.replace("split u across crack\n", "").replace("multiplier l : vector on crack\n", "");
    let whole = whole.replace("term tie on crack : l.jump(Test_u) + Test_l.jump(u)\n", "");
    let whole = run(&examples(), whole).expect("a solution");
    assert!((measure(&tied, "mean_u") - measure(&whole, "mean_u")).abs() < 1e-13);
}

/// The turned block with other cells, another degree, and along the axes, where no frame is needed.
#[test]
fn rollers_do_not_depend_on_cells_or_axes() {
    let scene = "elasticity/rollers.wfl";
    holds(scene, &[("cells [3,2,2] hex", "cells [3,2,2] tet")]);
    holds(scene, &[("unknown u : vector", "unknown u : vector Q2")]);
    holds(scene, &[("param a  = 0.5", "param a  = 0"), ("param b  = 0.3", "param b  = 0")]);
    let odd = message(scene, &[("fix u.Normal = -0.01 on west", "fix u.Normal = -0.01 on all")]);
    assert!(odd.contains("E204"), "{odd}");
}

/// What acts on the faces of a mapping is in the files: means over the points of each face, and the state of contact.
#[test]
fn files_have_the_pressure_on_the_faces_of_a_mapping() {
    let more = "\noutput vtk \"faces\" : pos_part(Pn) as pressure, Interpolate(uL, below) as under\n";
    let text = format!("{}{more}", text("mapping/pressed.wfl"));
    let solved = run(&folder("mapping/pressed.wfl"), text).expect("a run");
    let Solved { scene, outcome } = &solved;
    let output = scene.vtk.iter().find(|o| o.file == "faces").expect("an output");
    let values = scene.system.values(&outcome.steps[0].state);
    let pieces: Vec<_> = output
        .pieces
        .iter()
        .map(|p| p.sample(&scene.system.mesh, wfl_discrete::window::Window::new(1.0, 1.0), values.view()))
        .collect();
    let [piece] = pieces.as_slice() else { panic!("one region of faces has both") };
    let array = |name: &str| piece.cell_data.iter().find(|a| a.name == name).expect("an array");
    assert!(array("pressure").values.iter().all(|p| (p - 10.0).abs() < 1e-8), "{:?}", array("pressure").values);
    assert!(array("under").components == 2 && array("under").values.iter().all(|u| u.is_finite()));
}
