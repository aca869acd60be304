//! Derivatives in parameters that move the mesh: against closed forms, an independent program, differences of whole runs on
//! displaced meshes, and the derivatives along directions against those of the adjoint.

use std::path::Path;

use wfl_gradient::{Direction, Gradients, tangents};
use wfl_tests::{MeshFolder, differentiated, driven::write_path, ran, reference, solve, solved};

fn of(text: &str, results: &str, with: &str) -> Gradients {
    let found = differentiated((Path::new("."), text.to_owned()), &[], &[], results, with);
    found.unwrap_or_else(|told| panic!("{told}")).1
}

fn refused(text: &str, results: &str, with: &str) -> String {
    let found = differentiated((Path::new("."), text.to_owned()), &[], &[], results, with);
    found.map(|(_, found)| format!("{found:?}")).expect_err("no derivative")
}

fn near(found: &Gradients, of: (&str, &str), expected: f64, within: f64) {
    let derivative = found.number(of.0, of.1).expect("a derivative");
    assert!((derivative - expected).abs() <= within * expected.abs().max(1e-12), "{of:?}: {derivative:e} {expected:e}");
}

/// The text with another value of a parameter.
fn with_value(text: &str, name: &str, value: f64) -> String {
    let line = text.lines().find(|l| l.starts_with(&format!("param {name} = "))).expect("a param");
    text.replace(line, &format!("param {name} = {value:?}"))
}

fn value(text: &str, name: &str) -> f64 {
    let line = text.lines().find(|l| l.starts_with(&format!("param {name} = "))).expect("a param");
    line.rsplit(' ').next().and_then(|v| v.parse().ok()).expect("a number")
}

/// Compares the derivatives of measures at the last step with those along directions, to 1e-12, and with central differences of
/// whole runs of fourth order, whose meshes are displaced.
fn compared(text: &str, measures: &[&str], parameters: &[&str], within: f64) -> Gradients {
    compared_in(Path::new("."), text, (measures, parameters), within)
}

fn compared_in(folder: &Path, text: &str, of: (&[&str], &[&str]), within: f64) -> Gradients {
    let (measures, parameters) = of;
    let tight = format!("{text}solver newton with tol=1e-13\n");
    let found = differentiated((folder, tight.clone()), &[], &[], &measures.join(", "), &parameters.join(", "));
    let found = found.unwrap_or_else(|told| panic!("{told}")).1;
    for name in parameters {
        let (x, h) = (value(text, name), 2e-4 * value(text, name).abs());
        let runs = [-2.0, -1.0, 1.0, 2.0].map(|k| {
            solve(folder, with_value(&tight, name, x + k * h), &[], &[]).unwrap_or_else(|told| panic!("{told}"))
        });
        let names: Vec<String> = measures.iter().map(|m| (*m).to_owned()).collect();
        let direction = Direction { parameters: vec![((*name).to_owned(), vec![1.0])], fields: Vec::new() };
        let along = ran((folder, tight.clone()), &[], &[], |of| tangents(of, &names, &[direction]));
        let along = along.unwrap_or_else(|told| panic!("{told}")).1;
        for (k, measure) in measures.iter().enumerate() {
            let last = runs[0].outcome.steps.len() - 1;
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| runs[k].measure(last, measure));
            let difference = (8.0 * (c - b) - (d - a)) / (12.0 * h);
            let derivative = found.number(measure, name).expect("a derivative");
            let size = derivative.abs().max(difference.abs()).max(1e-3 * found.results[k].value.abs() / x.abs());
            assert!(
                (derivative - difference).abs() < within * size,
                "{measure} in {name}: {derivative:e}, differences {difference:e}"
            );
            let tangent = along.moved[0][k][last];
            assert!(
                (derivative - tangent).abs()
                    < 1e-12 * size.max(tangent.abs()).max(found.results[k].value.abs() / x.abs()),
                "{measure} in {name}: {derivative:e}, along it {tangent:e}"
            );
        }
    }
    found
}

const BAR: &str = "wfl 1
param E = 3
param L = 1.6
param d = 0.2
mesh box [0] to [L] cells [4]
region left = faces where x == 0
region right = faces where x == L
unknown u : scalar
term stress on all : E*Grad_u.Grad_Test_u
fix u = 0 on left
fix u = d on right
measure F = reaction(u) on left
measure stored = integral(E/2*Norm_sqr(Grad_u)) on all
measure middle = mean(u) on all
measure stays = value(u) at [0.5]
measure goes = value(u) at [0.3*L]
measure length = integral(1) on all
measure most = max(u*x) at nodes of all
";

/// A bar of length L that is pulled by d: the force is EA d/L, and u at a place s that stays is d s/L.
#[test]
fn a_bar_of_another_length() {
    let found = compared(BAR, &["F", "stored", "middle", "stays", "goes", "length", "most"], &["L", "E", "d"], 1e-8);
    let (e, l, d) = (3.0, 1.6, 0.2);
    near(&found, ("F", "L"), -e * d / (l * l), 1e-12);
    near(&found, ("stored", "L"), -0.5 * e * d * d / (l * l), 1e-12);
    assert!(found.number("middle", "L").expect("a derivative").abs() < 1e-14);
    near(&found, ("stays", "L"), -d * 0.5 / (l * l), 1e-12);
    assert!(found.number("goes", "L").expect("a derivative").abs() < 1e-14);
    near(&found, ("length", "L"), 1.0, 1e-13);
    near(&found, ("most", "L"), d, 1e-13);
    assert!(found.notes.is_empty(), "{:?}", found.notes);
}

/// Volumes, surfaces, rims and moments of boxes of all shapes of cells.
#[test]
fn volumes_and_surfaces_of_boxes() {
    for (cells, dim) in [("tri", 2), ("quad", 2), ("tet", 3), ("hex", 3)] {
        let [corners, counts, volume] = match dim {
            2 => ["[p,0] to [a,b]", "[2,3]", "(a-p)*b"],
            _ => ["[p,0,0] to [a,b,2*a]", "[2,1,2]", "(a-p)*b*2*a"],
        };
        let text = format!(
            "wfl 1
param a = 1.3
param b = 0.7
param p = 0.2
mesh box {corners} cells {counts} {cells}
region right = faces where x == a
region top = faces where y == b
unknown u : scalar
term identity on all : (u - 1)*Test_u
measure volume = integral(u^2) on all
measure moment = integral(x^2*y) on all
measure side = integral(1) on right
measure flux = integral([x^2, y{z}].Normal) on top, right
measure error = volume/({volume})
",
            z = if dim == 3 { ", z*x" } else { "" }
        );
        let found = compared(&text, &["volume", "moment", "side", "flux", "error"], &["a", "b", "p"], 1e-8);
        let (a, b, p) = (1.3, 0.7, 0.2);
        let expected =
            if dim == 2 { [b, a - p, -b] } else { [b * (4.0 * a - 2.0 * p), 2.0 * a * (a - p), -2.0 * a * b] };
        for (name, expected) in ["a", "b", "p"].iter().zip(expected) {
            near(&found, ("volume", name), expected, 1e-12);
            assert!(found.number("error", name).expect("a derivative").abs() < 1e-12);
        }
    }
}

/// A ring of cells of second order, with forces along its normals, a multiplier on a face, data, prescribed values and first
/// values by position, second gradients, sizes of cells, and measures of all kinds.
const RING: &str = "wfl 1
param R = 2
param thick = 0.5
param angle = 1.2
param push = 0.3
def radius(s) = R + thick*s
mesh box [0,0] to [1,1] cells [2,3] quad map [radius(x)*cos(angle*y), radius(x)*sin(angle*y)]
region inner = faces where sqr(x) + sqr(y) < sqr(R + 0.1*thick)
region low = faces where y == 0
region high = faces where abs(x*sin(angle) - y*cos(angle)) < 1e-6
unknown u : vector Q2
multiplier m : scalar Q1 on high
data k : scalar Q2 = 2 + x*y
term body on all : k*(Sym(Grad_u):Sym(Grad_Test_u) + 0.5*Div_u*Div_Test_u)*(1 + 0.1*Norm_sqr(u))
term bent on all : 0.01*element_size^2*(Hess_u(1,1,2)*Hess_Test_u(1,1,2) + Hess_u(2,1,1)*Hess_Test_u(2,1,1))
term held on high : m*(Test_u.Normal) + (u.Normal - 0.02*x)*Test_m
load u = -push*(1 + x)*Normal on inner
fix u = [0.05*x, 0.02*x^2] on low
start u = [0.01*x, 0]
measure work = integral(k*Norm_sqr(Sym(Grad_u)) + x*u(1)) on all
measure mean_load = mean(u.Normal + 0.1*Norm_sqr(Grad_u)) on inner
measure pressed = mean(m*x) on high
measure most = max(Norm(u)) at nodes of inner
measure point = value(u(1) + Grad_u(1,2)*x) at [1.9, 0.9]
";

#[test]
fn a_ring_of_curved_cells() {
    let measures = ["work", "mean_load", "pressed", "most", "point"];
    let found = compared(RING, &measures, &["R", "thick", "angle", "push"], 1e-7);
    assert!(found.near.is_empty() && found.notes.is_empty(), "{:?} {:?}", found.near, found.notes);
}

/// A body in space with faces that bend: a field on faces with its gradient along them, forces along the normal, an interface
/// by Nitsche's method, a law of friction with a memory, edges of a surface.
const SPACE: &str = "wfl 1
param bend = 0.2
param high = 1.1
param fric = 0.3
mesh box [-1,0,0] to [1,1,high] cells [2,1,2] tet map [x + bend*z^2, y*(1 + bend*x*z), z + bend*y^2*x]
region left = cells where x < bend*z^2
region right = cells where x > bend*z^2
region joint = interface from left to right
region west = faces where x < bend*z^2 - 0.9
region east = faces where x > bend*z^2 + 0.9
unknown u : vector P1
unknown p : scalar P2 on joint
split u across joint
def jump(v) = v - Interpolate(v, neighbor_element)
def traction(v) = 4*Sym(Grad_v)*Normal
def pressed = 20/element_size*(jump(u).Normal) - traction(u).Normal
def slid = jump(u) - jump(Previous_u)
def sheared = 20/element_size*(slid - (slid.Normal)*Normal)
term body on all : 4*Sym(Grad_u):Sym(Grad_Test_u)
term ground on right : 0.5*u.Test_u
term contact on joint : (pos_part(pressed)*Normal + Ball_projection(sheared, fric*pos_part(pressed))).jump(Test_u)
term flow on joint : (1 + p^2)*Grad_p.Grad_Test_p + (p - pos_part(pressed))*Test_p
load u = [0,0.1*z,-0.1]*t on east
fix u = [0,0,0] on west
fix u(1) = -0.05*(1 + 0.3*y) on east
steps t = 1 to 3 by 1
measure pull = mean(Norm_sqr(Grad_p) + p) on joint
measure force = reaction(u(3)) on west
measure shift = integral(u(2)*x + u(3)*Normal(1)) on east
";

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn friction_on_a_bent_interface_in_space() {
    compared(SPACE, &["pull", "force", "shift"], &["bend", "high", "fric"], 2e-7);
}

/// A field on a bent face with its rim: conormals, fluxes out of it, lengths of edges.
#[test]
fn rims_of_bent_faces() {
    let text = "wfl 1
param bend = 0.3
mesh box [0,0,0] to [1,1,1] cells [2,2,1] tet map [x, y, z + bend*(x*y + 0.4*x^2)]
region top = faces where z > 0.9 + bend*(x*y + 0.4*x^2)
region edge = rim of top
unknown u : scalar P2
unknown s : scalar P2 on top
term body on all : Grad_u.Grad_Test_u + (u - x*z)*Test_u
term film on top : Grad_s.Grad_Test_s + (s - u)*Test_s
term out on edge : 0.5*(s - y*Conormal(1))*Test_s
measure flux = integral(Grad_s.Conormal + s*Conormal(3)) on edge
measure length = integral(1) on edge
measure area = integral(1) on top
";
    compared(text, &["flux", "length", "area"], &["bend"], 1e-7);
}

/// States, rates and a body that creeps while its mesh is another one.
const CREEPING: &str = "wfl 1
param L = 1.2
param skew = 0.2
param eta = 2
mesh box [0,0] to [L,1] cells [3,2] quad map [x + skew*y^2*x, y*(1 + skew*x)]
region left = faces where x == 0
region right = faces where x > 0.999*L + skew*sqr(y/(1 + skew*L))*L
unknown u : vector
state creep : matrix(2,2) := creep + timestep/eta*(Sym(Grad_u) - creep)
term stress on all : 3*(Sym(Grad_u) - creep):Grad_Test_u + 0.3*eta*Dot_u.Test_u
fix u = [0,0] on left
load u = [0.1*t^2, 0.02*x*t] on right
start u = [0.01*x^2, 0]
scheme backward_euler
steps t = 0 to 1 by 0.25
measure end = mean(u(1)) on right
measure crept = integral(Norm_sqr(creep)) on all
";

#[test]
fn states_and_rates_on_a_mesh_that_moves() {
    compared(CREEPING, &["end", "crept"], &["L", "skew", "eta"], 1e-7);
    let struck = CREEPING.replace("scheme backward_euler", "scheme newmark beta=1/4 gamma=1/2");
    let struck = struck.replace("0.3*eta*Dot_u.Test_u", "0.3*eta*Dot_u.Test_u + (1 + x)*Dot2_u.Test_u");
    compared(&struck, &["end", "crept"], &["L", "skew"], 1e-7);
    let explicit = struck.replace("scheme newmark beta=1/4 gamma=1/2", "scheme explicit").replace("by 0.25", "by 0.05");
    compared(&explicit, &["end", "crept"], &["L", "skew"], 1e-7);
}

/// A support along the normal of a face that parameters move but do not turn; one that they turn is refused.
#[test]
fn supports_along_normals() {
    let text = "wfl 1
param a = 1.2
param slope = 0.4
param tilt = 0
mesh box [0,0] to [a,1] cells [3,3] quad map [x + (slope + tilt)*y, y]
region side = faces where abs(x - (slope + tilt)*y) < 1e-6
region top = faces where y == 1
region low = faces where y == 0
unknown u : vector
term body on all : 2*Sym(Grad_u):Sym(Grad_Test_u)
fix u.Normal = 0.1*y on side
fix u(2) = 0 on low
load u = [0.02*x, 0.1] on top
measure high = mean(u(1) + 2*u(2)) on top
";
    compared(text, &["high"], &["a"], 1e-8);
    let told = refused(text, "high", "slope");
    assert!(
        told.contains("E470") && told.contains("`slope` turns the normals") && told.contains("scene.wfl:11:"),
        "{told}"
    );
}

/// The path of friction of an independent program, whose shape parameter stretches the block along x.
#[test]
fn friction_with_a_memory_in_a_block_of_another_length() {
    let known = reference("physics_gradients.json")["path"].clone();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("shape");
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    write_path(&folder, &known);
    let text = "wfl 1
param f0 = 0.1
param L = 1
mesh box [0,-2] to [4*L,0] cells [16,16] quad
region fault = faces where x == 0 and y >= -1
region below = faces where x == 0 and y <= -1
region far = faces where x == 4*L
unknown u : scalar Q1
multiplier tau : scalar Q1 on fault
def bound = f0 - 0.15*y + 0.08*y^2
term elastic on all : Grad_u.Grad_Test_u
term shear on fault : tau*Test_u
term law on fault : -1/8*(tau - Ball_projection(tau + 8*(u - Previous_u), bound))*Test_tau
quadrature on fault vertex
fix u = 0 on below
fix u = table(\"drive.csv\", t) on far
steps t = 1 to 12 by 1
measure J1 = value(u) at [0,0]
measure J2 = value(u) at [1.5*L,0]
measure misfit = value((u - table(\"seen.csv\", t))^2) at [0.5*L,0]
";
    let scene = (folder.as_path(), text.to_owned());
    let found =
        differentiated(scene, &[], &[], "J1, J2, sum(misfit)", "L, f0").unwrap_or_else(|told| panic!("{told}")).1;
    for (k, result) in found.results.iter().enumerate() {
        for (j, name) in [(0, "f0"), (4, "L")] {
            let expected = known["gradient_adjoint"][k][j].as_f64().expect("a number");
            near(&found, (&result.name, name), expected, 1e-9);
        }
    }
}

/// A crack of half length a in a wide plate under antiplane shear s, modulus 1: the stress intensity K = s sqrt(pi a) grows by
/// K/(2 a), and half the plate releases the energy K^2/4 = pi s^2 a/4 (Irwin). A quarter of the plate is solved for; K follows
/// from the displacement a hundredth of a behind the tip, u = 2 K sqrt(r/(2 pi)).
#[test]
fn a_crack_that_grows() {
    let text = "wfl 1
param a = 1
param W = 30
param s = 0.7
def spread(q) = if q <= 1 then a*(1 - (1 - q)^4) else a + (W - a)*((q - 1)/1.5)^4
mesh box [0,0] to [2.5,1.5] cells [40,24] quad map [spread(x), W*(y/1.5)^4]
region ahead = faces where y == 0 and x > 0.999999*a
region top = faces where y == W
unknown u : scalar Q2
term body on all : Grad_u.Grad_Test_u
fix u = 0 on ahead
load u = s on top
measure work = integral(s*u) on top
measure K = value(u) at [0.99*a, 0]*1
";
    let text = text.replace(" at [0.99*a, 0]*1", " at [0.99*a, 0]");
    let found = of(&text, "work, K", "a, s");
    let (a, s) = (1.0, 0.7f64);
    let pi = std::f64::consts::PI;
    // half of the work of a load that grows is stored, and as much is released by a crack that grows under it
    let released = 0.5 * found.number("work", "a").expect("a derivative");
    assert!((released / (pi * s * s * a / 4.0) - 1.0).abs() < 0.01, "{released}");
    let behind = (2.0 * pi / 0.01f64).sqrt() / 2.0;
    let intensity = behind * found.results[1].value;
    assert!((intensity / (s * (pi * a).sqrt()) - 1.0).abs() < 0.01, "{intensity}");
    // r is a hundredth of a: u grows with a, K with its root
    let grows = behind * found.number("K", "a").expect("a derivative") - intensity / (2.0 * a);
    assert!((grows / (intensity / (2.0 * a)) - 1.0).abs() < 0.01, "{grows}");
}

/// The force of a bar whose stiffness has the size of squares: 2 runs say that it has a kink, and the derivative is one of both.
fn near_both_sides(text: &str) {
    let force = |x: f64| solved(with_value(text, "L", x)).measure(0, "F");
    let sides = [(force(2.0) - force(1.9999)) / 1e-4, (force(2.0001) - force(2.0)) / 1e-4];
    let derivative = of(text, "F", "L").number("F", "L").expect("a derivative");
    assert!((sides[0] - sides[1]).abs() > 0.1, "{sides:?}");
    let within = 1e-3 * sides[0].abs().max(sides[1].abs());
    assert!(sides.iter().any(|side| (side - derivative).abs() < within), "{sides:?} {derivative}");
}

/// A mesh from a file that is scaled, turned and moved by parameters, with a flow that has directions of its own.
#[test]
fn the_place_of_a_mesh_file() {
    let mesh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n1 0 0 0\n2 1 0 0\n3 2 0.1 0\n4 0 1 0\n5 1.1 1.2 0\n6 2 1 0\n\
                $EndNodes\n$Elements\n2\n1 3 2 1 1 1 2 5 4\n2 3 2 1 1 2 3 6 5\n$EndElements\n";
    let folder = MeshFolder::new("shape-file", mesh);
    let text = "wfl 1
param s = 1.3
param angle = 35
param shift = 0.4
mesh file \"body.msh\" scaled by s turned by angle moved by [shift, 2*shift] scaled by 1 + 0.1*shift
unknown u : scalar Q2
term flow on all : ([2,0.3;0.3,1]*Grad_u).Grad_Test_u + (u - x*y)*Test_u
load u = x*Normal(1) on boundary
measure work = integral(u*x + Grad_u(2)^2) on all
measure out = integral(u*Normal(2) + x*y) on boundary
measure place = value(u + Grad_u(1)) at [0.5, 2.1]
";
    compared_in(folder.path(), text, (&["work", "out", "place"], &["s", "angle", "shift"]), 1e-7);
}

/// A cylinder on a block in plane strain (Hertz): a = sqrt(4 P R/(pi E*)), so that da/dP = a/(2 P); the pressure is an ellipse,
/// whose mean of x^2 is a^2/4. The edge of the contact lies elsewhere in its cell at each load, and the derivative on a mesh goes
/// up and down with that: the closed form is that of its sum over loads. Lengths of all kinds times a factor, with the force that
/// a length has, leave strains as they are: R a_R + P a_P + S a_S = a + gamma a_gamma, and without the a for a pressure, exactly,
/// of the equations on a mesh whose corners are S.
#[test]
fn hertz_contact_scales_with_its_lengths() {
    let text = "wfl 1
param R = 50
param P = 1000
param S = 5
param gamma = 1e9
mesh box [0,-1] to [1,0] cells [40,40] quad map [S*x^2, -S*y^2]
region contact = faces where y == 0
region base = faces where y == -S
region symmetry = faces where x == 0
unknown u : vector
unknown d : scalar global
start d = 0.01
def E = 200e3
def clambda = E*0.3/(1.3*0.4)
def cmu = E/2.6
def sigma(v) = clambda*Div_v*Id(2) + 2*cmu*Sym(Grad_v)
def Pn = gamma*(u.Normal - x^2/(2*R) + d) - (sigma(u)*Normal).Normal
term elastic on all : sigma(u):Grad_Test_u
term contact on contact : pos_part(Pn)*(Test_u.Normal + Test_d)
term weight on global : -P*t/2*Test_d
fix u = [0,0] on base
fix u(1) = 0 on symmetry
measure p = max(pos_part(Pn)) on contact
measure pressed = integral(pos_part(Pn)) on contact
measure moment = integral(pos_part(Pn)*x^2) on contact
measure a = 2*sqrt(moment/pressed)
steps t = 0.5 to 1.5 by 0.04
solver newton with tol=1e-12
";
    let found = of(text, "p, a, sum(a)", "R, P, S, gamma");
    for (k, name, power) in [(0, "p", 0.0), (1, "a", 1.0)] {
        let by = |of: &str| found.number(name, of).expect("a derivative") * value(text, of);
        let (scaled, size) = (by("R") + by("P") + by("S") - by("gamma"), found.results[k].value);
        assert!((scaled - power * size).abs() < 1e-8 * size, "{name}: {scaled} {size}");
    }
    // the block is ten times as large as the contact, and its mesh is what it is
    let slope = found.number("sum(a)", "P").expect("a derivative") * 1000.0 / found.results[2].value;
    assert!((slope / 0.5 - 1.0).abs() < 0.03, "{slope}");
    let closed = (4.0 * 1.5 * 1000.0 * 50.0 * (1.0 - 0.09) / (std::f64::consts::PI * 200e3f64)).sqrt();
    assert!((found.results[1].value / closed - 1.0).abs() < 0.05, "{closed}");
}

/// A plate whose right side is found by a number.
const PLATE: &str = "wfl 1
param L = 1.6
param n = 4
mesh box [0,0] to [L,1] cells [n,2] quad
region left = faces where x == 0
region right = faces where x == 1.6
unknown u : scalar
term stress on all : Grad_u.Grad_Test_u
fix u = 0 on left
fix u = 1 on right
measure F = -reaction(u) on left
";

#[test]
fn regions_and_sizes_that_change_with_the_mesh_are_told() {
    let text = PLATE;
    let told = refused(text, "F", "n");
    assert!(told.contains("E470") && told.contains("the division of the mesh"), "{told}");
    let near: Vec<_> = of(text, "F", "L").near.iter().map(|n| n.finding()).collect();
    assert!(near.len() == 1 && near[0].message.contains("`right` takes other cells"), "{near:?}");
    assert_eq!(near[0].labels.len(), 1);
    let moving = text.replace("x == 1.6", "x == L");
    let found = of(&moving, "F", "L");
    assert!(found.near.is_empty() && found.notes.is_empty());
    // squares have two smallest extents
    let sized = moving.replace("Grad_u.Grad_Test_u", "element_size*Grad_u.Grad_Test_u").replace("L = 1.6", "L = 2");
    let near: Vec<_> = of(&sized, "F", "L").near.iter().map(|n| n.finding()).collect();
    assert!(near.len() == 1 && near[0].message.contains("8 of 8 cells of `element_size`"), "{near:?}");
    near_both_sides(&sized);
    let sized = moving.replace("cells [n,2]", "size 0.4");
    assert!(of(&sized, "F", "L").notes.iter().any(|n| n.contains("the number of cells")));
}

#[test]
fn what_does_not_follow_a_mesh_is_refused() {
    let mapped = "wfl 1
param L = 1
mesh box [0] to [L] cells [8] segment
region east = faces where x == L
mapping back = point x - 1
unknown u : scalar
multiplier flux : scalar on east
term bar on all : Grad_u.Grad_Test_u + (u - x)*Test_u
term tie on east : flux*(Test_u - Interpolate(Test_u, back)) + Test_flux*(u - Interpolate(u, back))
measure F = mean(u^2) on all
";
    let told = refused(mapped, "F", "L");
    assert!(
        told.contains("E470") && told.contains("`L` moves the mesh, and images") && told.contains("scene.wfl:5:"),
        "{told}"
    );
    // a region that does not move with the mesh has no derivative
    let picked =
        PLATE.replace("param n = 4", "param n = 4\nparam high = 0.7").replace("x == 1.6", "x == L and y < high");
    assert!(refused(&picked, "F", "high").contains("stands in a region"));
    let hexes = "wfl 1
param b = 0.1
mesh box [0,0,0] to [1,1,1] cells [2,1,1] hex map [x + b*y*z, y, z]
region right = faces where x > 0.9
unknown u : scalar
term body on all : Grad_u.Grad_Test_u + u*Test_u
load u = x on right
quadrature on right vertex
measure F = mean(u) on right
";
    let told = refused(hexes, "F", "b");
    assert!(told.contains("E470") && told.contains("`b` moves the faces of") && told.contains("which bend"), "{told}");
    compared(&hexes.replace("quadrature on right vertex\n", ""), &["F"], &["b"], 1e-8);
}

/// The lever of a moment moves with the nodes; a force has none.
#[test]
fn a_lever_that_moves_is_refused() {
    let bar = &(BAR.to_owned() + "measure M = reaction(x*u) on right\n");
    let told = refused(bar, "M", "L");
    assert!(told.contains("E470") && told.contains("`x` multiplies what a reaction adds up"), "{told}");
    compared(bar, &["F"], &["L"], 1e-8);
    compared(bar, &["M", "F"], &["E"], 1e-8);
}

/// Formulas of the map reach a parameter through macros and other parameters.
#[test]
fn a_map_follows_what_its_words_are_made_of() {
    let text = "wfl 1
param bend = 0.2
param twice = 2*bend
def rise(a) = a*twice/2
mesh box [0,0] to [1.5,1] cells [6,4] quad map [x, y*(1 + rise(x))]
region left = faces where x == 0
unknown u : scalar
term flow on all : Grad_u.Grad_Test_u - Test_u
fix u = 0 on left
measure area = integral(1) on all
measure mean_ = mean(u) on all
";
    let found = compared(text, &["area", "mean_"], &["bend"], 1e-7);
    near(&found, ("area", "bend"), 1.5 * 1.5 / 2.0, 1e-12);
}
