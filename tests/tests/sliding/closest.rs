//! Closest points that follow the bodies: forces and tangents of another program, images on faces, edges and corners, momentum,
//! and what Newton's method makes of them.

use std::path::Path;

use wfl_compiler::InterpreterBackend;
use wfl_discrete::{
    assemble::{Follows, MovingPoints},
    space::Space,
    system::{Branches, System},
};
use wfl_mesh::mesh::{CellKind, FacetRef, Mesh};
use wfl_problem::Scene;
use wfl_sparse::csr::Csr;
use wfl_tests::{Attempt, Sequence, attempt, doubts, examples, prepared, reference, solve};

use super::{blocks, measure, solved, twisted};

/// Contact along the normal of the other body, of two bodies that a mesh names.
const CONTACT: &str = "wfl 1
mesh file \"MESH\"
unknown a : vector ELEMENT on lower
unknown b : vector ELEMENT on upper
term lower on lower : Grad_a:Grad_Test_a
term upper on upper : Grad_b:Grad_Test_b
mapping m = project from sole onto floor moving with a, b within 2
def n   = -Transformed_unit_vector(Interpolate(Grad_b, m), Interpolate(Normal, m))
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
term contact on sole : pos_part(-7*gap)*(n.(Test_a - Interpolate(Test_b, m)))
quadrature on sole degree 5
steps s = 0 to 1 by 1
";

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn scene(folder: &Path, text: String) -> Scene {
    prepared(folder, text, &[], &[], &InterpreterBackend).unwrap_or_else(|e| panic!("{e}"))
}

/// The changing part of the tangent at a state.
fn contact_tangent(system: &mut System, u: &[f64]) -> Csr {
    let mut tangent = system.new_tangent();
    system.tangent(u, Branches::AsWritten, &mut tangent).expect("a tangent");
    tangent.changing
}

/// The residual of the term of contact.
fn contact_forces(system: &System, u: &[f64]) -> Vec<f64> {
    let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
    let mut forces = vec![0.0; u.len()];
    term.add_residual(&system.mesh, system.values(u).view(), &mut forces).expect("finite forces");
    forces
}

fn largest(of: &[f64]) -> f64 {
    of.iter().fold(0.0f64, |m, x| m.max(x.abs()))
}

/// Curved faces in the plane and twisted ones in space, with images on faces, edges and corners: forces and tangents are those
/// of a program that works them out by complex steps through the closest points.
#[test]
fn forces_and_tangents_are_those_of_complex_steps() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference");
    let cases = reference("sliding_closest.json");
    let mut ranks = [0; 3];
    for case in cases["cases"].as_array().expect("a list") {
        let mesh = case["mesh"].as_str().expect("a name");
        let dim = usize::try_from(case["dim"].as_u64().expect("a number")).expect("2 or 3");
        let text = CONTACT.replace("MESH", mesh).replace("ELEMENT", if dim == 2 { "Q2" } else { "Q1" });
        let scene = scene(&folder, text);
        let mut equations = scene.at_first_step().expect("equations");
        let system: &mut System = &mut equations.system;
        let places = places(system, &numbers(&case["nodes"]), dim);
        let spread = |values: &[f64]| {
            let mut u = vec![0.0; system.numbering.n_dofs];
            places.iter().zip(values).for_each(|(dof, value)| u[*dof] = *value);
            u
        };
        let u = spread(&numbers(&case["u"]));
        let points = system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
        let domain = points.at(&system.mesh, &system.slices(&u));
        for rank in domain.entities().filter_map(|(group, k)| rank(group.motion(k)?.shift, dim)) {
            ranks[rank] += 1;
        }
        let (forces, expected) = (contact_forces(system, &u), spread(&numbers(&case["forces"])));
        let size = largest(&expected);
        for (own, expected) in forces.iter().zip(&expected) {
            assert!((own - expected).abs() < 1e-12 * size, "{mesh}: {own} {expected} of {size}");
        }
        let directions: Vec<Vec<f64>> =
            case["directions"].as_array().expect("a list").iter().map(|d| spread(&numbers(d))).collect();
        let products: Vec<Vec<f64>> =
            case["products"].as_array().expect("a list").iter().map(|d| spread(&numbers(d))).collect();
        let tangent = contact_tangent(system, &u);
        assert_eq!(tangent.n_rows(), u.len(), "nothing is prescribed");
        for (direction, expected) in directions.iter().zip(&products) {
            let mut product = vec![0.0; u.len()];
            tangent.multiply(&free(system, direction), &mut product, 1);
            let expected = free(system, expected);
            let size = largest(&expected);
            for (own, expected) in product.iter().zip(&expected) {
                assert!((own - expected).abs() < 1e-12 * size, "{mesh}: {own} {expected} of {size}");
            }
        }
    }
    assert!(ranks.iter().all(|n| *n > 1), "images on corners, edges and faces: {ranks:?}");
}

/// In the order of the free dofs.
fn free(system: &System, values: &[f64]) -> Vec<f64> {
    let mut out = Vec::new();
    system.numbering.gather(values, &mut out);
    out
}

/// The rank of the matrix of a shift; `None` where there is no image.
fn rank(shift: [f64; 6], dim: usize) -> Option<usize> {
    let at = |i: usize, j: usize| shift[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
    let trace: f64 = (0..dim).map(|i| at(i, i)).sum();
    let minors: f64 =
        (0..dim).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| at(i, i) * at(j, j) - at(i, j).powi(2)).sum();
    Some(if trace == 0.0 { 0 } else { 1 + usize::from(minors > 1e-10 * trace * trace) })
}

/// The dofs of points of the mesh, those of the first body before those of the second.
fn places(system: &System, nodes: &[f64], dim: usize) -> Vec<usize> {
    let n = nodes.len() / dim;
    let points = system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
    let [here, there]: [&Follows; 2] = points.follows();
    (0..n)
        .flat_map(|k| {
            let follows = if 2 * k < n { here } else { there };
            let x = &nodes[k * dim..][..dim];
            let distance = |y: &[f64; 3]| x.iter().zip(y).fold(0.0f64, |m, (x, y)| m.max((x - y).abs()));
            let all = follows.space.node_coordinates();
            let node = all.iter().position(|y| distance(y) < 1e-12).expect("a node of the mesh");
            let start = system.range(follows.field).expect("an unknown").start;
            (0..dim).map(move |c| start + node * dim + c)
        })
        .collect()
}

/// The bodies of `twisted` with contact along the normal of the other one, at closest points.
fn in_space(cells: &str, element: &str) -> String {
    let law = "mapping m = project from sole onto floor moving with a, b within 0.5
def n   = -Transformed_unit_vector(Interpolate(Grad_b, m), Interpolate(Normal, m))
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
term contact on sole : pos_part(-gap)*(n.(Test_a - Interpolate(Test_b, m)))
steps s = 0 to 1 by 1
";
    twisted(cells, element, law)
}

/// Images that are found again after a small motion have shifted as the formula says, on faces, edges and corners.
#[test]
fn closest_points_shift_as_their_formula_says() {
    let plane = blocks(4, "steps s = 0 to 1 by 1\n").replace("raytrace", "project");
    // images on a part of the faces below: beside it they are on its edges and its corner
    let part = "region west = cells where z < 1 and x < 1.5 and y < 1.5\nregion floor = interface from west to upper";
    let on_part = |cells: &str, element: &str| {
        in_space(cells, element).replace("region floor = interface from lower to upper", part)
    };
    let scenes = [(plane, 0), (on_part("hex", "Q1"), 1), (on_part("hex", "Q2"), 1), (on_part("tet", "P2"), 1)];
    for (text, least) in scenes {
        let scene = scene(Path::new("."), text);
        let points = scene.system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
        let found = points.check_shifts(&scene.system.mesh);
        assert!(found.points > found.all / 5, "{found:?}");
        assert!(found.error < 1e-7, "{found:?}");
        assert!(found.ranks.iter().all(|n| *n >= least), "{found:?}");
    }
}

/// A state of two bodies drawn at random, the upper one shifted.
fn state(system: &System, shift: [f64; 3], amplitude: f64, seed: u64) -> Vec<f64> {
    let upper = system.range(0).expect("an unknown");
    let dim = system.mesh.dim();
    let mut random = Sequence(seed);
    let moved = |d: usize| if upper.contains(&d) { shift[(d - upper.start) % dim] } else { 0.0 };
    (0..system.numbering.n_dofs).map(|d| moved(d) + amplitude * random.number()).collect()
}

/// Half the square of the distance to the closest point is an energy: its force along `x - y` is a gradient, so the tangent is
/// symmetric, wherever images lie; and it keeps both momenta.
#[test]
fn a_spring_to_the_closest_point_has_a_symmetric_tangent_and_keeps_both_momenta() {
    for (text, shift) in [
        (in_space("hex", "Q1"), [0.31, 0.17, 0.05]),
        (in_space("hex", "Q2"), [0.4, -0.2, -0.05]),
        (in_space("tet", "P1"), [-0.3, 0.1, 0.02]),
    ] {
        let law = "term contact on sole : 5*(X + a - Interpolate(X, m) - Interpolate(b, m)).(Test_a - Interpolate(Test_b, m))";
        let old = "term contact on sole : pos_part(-gap)*(n.(Test_a - Interpolate(Test_b, m)))";
        let scene = scene(Path::new("."), text.replace(old, law));
        let mut equations = scene.at_first_step().expect("equations");
        let system: &mut System = &mut equations.system;
        let u = state(system, shift, 0.03, 5);
        keeps_momenta(system, &u, 1e-12);
        let tangent = contact_tangent(system, &u);
        let size = largest(tangent.values());
        assert!(size > 1e-3, "{size}");
        for row in 0..tangent.n_rows() {
            let (columns, values) = tangent.row(row);
            for (column, value) in columns.iter().zip(values) {
                let other = tangent.get(*column as usize, row);
                assert!((value - other).abs() < 1e-13 * size, "{row}, {column}: {value} {other} of {size}");
            }
        }
    }
}

/// The forces of the term of contact add up to nothing, and so do their moments.
fn keeps_momenta(system: &System, u: &[f64], tolerance: f64) {
    let forces = contact_forces(system, u);
    let size = largest(&forces);
    assert!(size > 1e-5, "some force: {size}");
    let points = system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
    let (mut sum, mut moment) = ([0.0; 3], [0.0; 3]);
    for follows in points.follows() {
        let start = system.range(follows.field).expect("an unknown").start;
        for (node, x) in follows.space.node_coordinates().iter().enumerate() {
            let (mut y, mut f) = (*x, [0.0; 3]);
            for c in 0..system.mesh.dim() {
                y[c] += u[start + node * system.mesh.dim() + c];
                f[c] = forces[start + node * system.mesh.dim() + c];
                sum[c] += f[c];
            }
            for c in 0..3 {
                moment[c] += y[(c + 1) % 3] * f[(c + 2) % 3] - y[(c + 2) % 3] * f[(c + 1) % 3];
            }
        }
    }
    assert!(largest(&sum) < tolerance * size, "{sum:?} of {size}");
    assert!(largest(&moment) < tolerance * size, "{moment:?} of {size}");
}

/// A force along the normal of the image keeps both momenta where images lie on faces.
#[test]
fn a_force_along_the_normal_of_the_image_keeps_both_momenta() {
    let map = "[x + 0.06*sin(3*y), y + 0.05*x*z, z + 0.05*sin(x*y)]";
    let bulge = "[x, y, z - 0.03*(x - 1.5)^2 - 0.02*(y - 1.5)^2]";
    for (cells, element) in [("hex", "Q1"), ("hex", "Q2"), ("tet", "P2")] {
        let scene = scene(Path::new("."), in_space(cells, element).replace(map, bulge));
        let system: &System = &scene.system;
        let mut u = state(system, [0.0, 0.0, -0.05], 0.0, 1);
        let points = system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
        let [above, below] = points.follows().map(|follows| follows.space.node_coordinates());
        let starts = [0, 1].map(|field| system.range(field).expect("an unknown").start);
        above.iter().enumerate().for_each(|(node, x)| u[starts[0] + 3 * node] += 0.1 * (x[2] - 1.0));
        // the face below goes on bulging, so that no image is on an edge of it
        let bends = |x: &[f64; 3]| -0.02 * (x[0] - 1.5).powi(2);
        below.iter().enumerate().for_each(|(node, x)| u[starts[1] + 3 * node + 2] += bends(x));
        let domain = points.at(&system.mesh, &system.slices(&u));
        let is_on_a_face = |shift| rank(shift, 3) == Some(2);
        let on_faces = domain.entities().filter(|(g, k)| g.motion(*k).is_some_and(|m| is_on_a_face(m.shift))).count();
        assert_eq!(on_faces, points.n_points(), "{cells}, {element}");
        keeps_momenta(system, &u, 1e-12);
    }
}

/// Each image is as near as any point of any face that is looked at, whatever the state.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn no_point_of_a_face_is_nearer_than_the_image() {
    let plane = blocks(5, "steps s = 0 to 1 by 1\n").replace("raytrace", "project");
    for (text, shift) in [
        (plane, [0.7, -0.04, 0.0]),
        (in_space("hex", "Q2"), [0.6, 0.3, -0.05]),
        (in_space("tet", "P1"), [0.2, -0.5, 0.05]),
    ] {
        let scene = scene(Path::new("."), text);
        let system: &System = &scene.system;
        let points = system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
        let all: usize = (0..4)
            .map(|seed| {
                let u = state(system, shift, 0.03, seed);
                nearest_of_all(system, &u, &points)
            })
            .sum();
        assert!(all > 20, "{all}");
    }
}

/// How many images were compared with all points of a lattice on all faces.
fn nearest_of_all(system: &System, u: &[f64], points: &std::sync::Arc<MovingPoints>) -> usize {
    let (mesh, values) = (&system.mesh, system.slices(u));
    let domain = points.at(mesh, &values);
    let [here, there]: [&Follows; 2] = points.follows();
    let lattice: Vec<(FacetRef, [f64; 3])> = points
        .targets()
        .flat_map(|facet| {
            let inside = parameters(mesh.facet_kind(facet));
            inside.into_iter().map(move |p| (facet, p))
        })
        .collect();
    let mut compared = 0;
    for (group, k) in domain.entities().filter(|(group, k)| !group.has_lost_its_image(*k)) {
        let r = group.here.points[group.here.row(k, 0)];
        let x = position(mesh, &here.space, group.here.cells[k], r, values[here.field]);
        let side = group.there.as_ref().expect("an image");
        let y = position(mesh, &there.space, side.cells[k], side.points[side.row(k, 0)], values[there.field]);
        let own = distance(x, y);
        for (facet, p) in &lattice {
            let kind = mesh.kind(facet.cell);
            let local = usize::from(facet.local);
            let r = kind.facet_point(local, kind.facet_map(local).apply(*p));
            let other = distance(x, position(mesh, &there.space, facet.cell, r, values[there.field]));
            assert!(own <= other + 1e-12, "{own} on {:?}, {other} on {facet:?}", side.facets);
        }
        compared += 1;
    }
    compared
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.hypot(a - b))
}

/// Points of a facet, its sides and corners among them.
fn parameters(kind: CellKind) -> Vec<[f64; 3]> {
    let part = |k: u32| f64::from(k) / 12.0;
    let ends = if kind == CellKind::Segment { 0 } else { 12 };
    let all = (0..=12).flat_map(|i| (0..=ends).map(move |j| [part(i), part(j), 0.0]));
    all.filter(|p| kind != CellKind::Triangle || p[0] + p[1] <= 1.0).collect()
}

/// Where a point of a cell is in the current placement.
fn position(mesh: &Mesh, space: &Space, cell: wfl_mesh::mesh::CellId, r: [f64; 3], u: &[f64]) -> [f64; 3] {
    let mut y = mesh.point_at(cell, &mesh.geometry_element(mesh.kind(cell)).tabulate(&[r], 0), 0);
    let place = space.position_of_cell(cell).expect("the displacement lives here");
    let table = space.element_at(place).tabulate(&[r], 0);
    for (k, node) in space.entity_nodes(place).iter().enumerate() {
        for c in 0..mesh.dim() {
            y[c] += table.values[k] * u[*node as usize * mesh.dim() + c];
        }
    }
    y
}

/// A block that slides over another by faces, and everything turned: no step needs many iterations, and a rotation changes no
/// force.
#[test]
fn a_block_slides_and_turns_on_closest_points() {
    let drive = "steps s = 0 to 7 by 1\nfix a = [max(0, s - 1)/2, -0.02*min(s, 1)] on lid\nfix b = [0, 0] on base\n";
    let found = solved(blocks(8, drive).replace("raytrace", "project"), &[]);
    assert!(found.outcome.converged(), "{:?}", doubts(&found.outcome));
    let normal = measure(&found, "N");
    assert!(normal[7] > 0.5 * normal[1] && normal[7] < 2.0 * normal[1], "{normal:?}");
    let most = found.outcome.steps.iter().map(|step| step.iterations()).max().expect("steps");
    assert!(most <= 13, "{most}");
    let turn = "def w = max(0, s - 1)*0.4
def turned(v) = [cos(w)*v(1) - sin(w)*v(2), sin(w)*v(1) + cos(w)*v(2)]
steps s = 0 to 5 by 1
fix a = turned(X + [0.05*min(s, 1), -0.03*min(s, 1)]) - X on lid
fix b = turned(X) - X on base
solver newton with tol=1e-14
";
    let text = blocks(3, turn)
        .replace("raytrace", "project")
        .replacen("wfl 1\n", "wfl 1\nuse \"sliding\"\n", 1)
        .replace("Inv(Id(2) + Grad_a)*shear/20", "closest_elastic(a, b, m, elastic, 20, fric)")
        .replace("force.(Test_a - Interpolate(Test_b, m))", "closest_friction(a, b, m, elastic, 20, fric)")
        .replace("integral(Norm(force))", "integral(Norm(closest_force(a, b, m, elastic, 20, fric)))");
    let found = solved(text, &[]);
    let normal = measure(&found, "N");
    assert!(found.outcome.converged() && normal[1] > 1e-3, "{normal:?}");
    for (step, force) in normal.iter().enumerate().skip(2) {
        assert!((force - normal[1]).abs() < 1e-12 * normal[1], "step {step}: {force} after {}", normal[1]);
    }
}

/// The pressure of a shrink fit is that of Lamé with closest points, too.
#[test]
fn a_shrink_fit_on_closest_points_has_the_pressure_of_lame() {
    let text = std::fs::read_to_string(examples().join("sliding/shrink_fit.wfl")).expect("an example");
    let text = text.replace("raytrace", "project").replace("steps s = 1 to 10 by 1", "steps s = 1 to 3 by 1");
    let found = solve(&examples().join("sliding"), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged() && found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    for name in ["p", "least", "most"] {
        for p in measure(&found, name) {
            assert!((p - 0.133931).abs() < 3e-5, "{name}: {p}");
        }
    }
}

/// A slot closes on itself with closest points, its ends at right angles too, with the force of GetFEM's rays but for the mesh.
#[test]
fn a_slot_closes_on_closest_points() {
    let text = std::fs::read_to_string(examples().join("sliding/slot.wfl")).expect("an example");
    let text = text
        .replace("raytrace", "project")
        .replace("steps k = 0 to 20", "steps k = 0 to 12")
        .replace("\nexpect", "\n# expect");
    let found = solve(&examples().join("sliding"), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged(), "{:?}", doubts(&found.outcome));
    let (own, of_getfem) = (measure(&found, "Fy"), numbers(&reference("sliding_slot.json")["Fy"]));
    for (k, force) in own[1..].iter().enumerate() {
        assert!((force / of_getfem[k] - 1.0).abs() < 0.01, "step {}: {force} {}", k + 1, of_getfem[k]);
    }
}

/// A body that is pushed over the edge of the other one: rays are lost there, and the message names what keeps images.
#[test]
fn a_block_over_the_edge_keeps_its_images() {
    let drive = "steps s = 0 to 5 by 1\nfix a = [max(0, s - 1)*0.3, -0.02*min(s, 1)] on lid\nfix b = [0, 0] on base\n";
    let told = |text: String| {
        let Attempt { solved, messages } = attempt(Path::new("."), text, &[], &[("fric", 0.0)]);
        solved.unwrap_or_else(|| panic!("{messages}")).outcome.warnings
    };
    let rays = told(blocks(4, drive));
    let lost = rays.iter().find(|d| d.code == "W632").expect("images are lost");
    assert!(lost.helps.iter().any(|help| help.contains("`project`")), "{lost:?}");
    let closest = told(blocks(4, drive).replace("raytrace", "project"));
    assert!(closest.iter().all(|d| d.code != "W632"), "{closest:?}");
}
