//! Bodies that slide far, through mappings whose images follow them: forces of another program, invariance, momentum, shifts
//! of images, and what is refused.

mod campaign;
mod closest;
mod dynamics;
mod judged;
mod lanes;
mod pattern;
mod scenes;
mod turning;

use std::path::Path;

use wfl_compiler::InterpreterBackend;
use wfl_discrete::system::System;
use wfl_tests::{Attempt, Solved, attempt, doubts, examples, prepared, reference, solve};

/// Two blocks in contact along y = 1.
const BLOCKS: &str = "wfl 1
mesh box [0,0] to [LENGTH,2] cells [LENGTH,2] quad with idle_cells=allowed
region lower = cells where y < 1
region upper = cells where y > 1 and x < 3
region sole  = faces of upper where y == 1
region floor = faces of lower where y == 1
region lid   = faces of upper where y == 2
region base  = faces of lower where y == 0
region left  = cells where y < 1 and x < 4
unknown a : vector Q2 on upper
unknown b : vector Q2 on lower
def P(g) = 0.4*((Id(2) + g) - Inv(Id(2) + g)') + 0.5*log(Det(Id(2) + g))*Inv(Id(2) + g)'
term upper on upper : P(Grad_a):Grad_Test_a
term lower on lower : P(Grad_b):Grad_Test_b
mapping m = raytrace from sole onto floor moving with a, b within 0.3
def n    = Transformed_unit_vector(Grad_a, Normal)
def gap  = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
def slip = a - Previous_a - Interpolate(b, m) + Interpolate(Previous_b, m) + gap*(n - Transformed_unit_vector(Grad_Previous_a, Normal))
def tang(w) = w - (w.n)*n
def pressure = pos_part(-20*gap)
param fric = 0.2
def shear = Ball_projection(20*tang((Id(2) + Grad_a)*Previous_elastic + slip), fric*pressure)
state elastic : vector on sole := Inv(Id(2) + Grad_a)*shear/20
def force = pressure*n + shear
term contact on sole : force.(Test_a - Interpolate(Test_b, m))
measure N = integral(Norm(force)) on sole
measure left_behind = max(Norm(P(Grad_b))) on left
";

fn blocks(length: usize, rest: &str) -> String {
    BLOCKS.replace("LENGTH", &length.to_string()) + rest
}

/// Two layers of some kind of cells in space that meet at z = 1 on faces that are not plane, with a law of contact.
fn twisted(cells: &str, element: &str, law: &str) -> String {
    format!(
        "wfl 1
mesh box [0,0,0] to [3,3,2] cells [3,3,2] {cells} map [x + 0.06*sin(3*y), y + 0.05*x*z, z + 0.05*sin(x*y)]
region lower = cells where z < 1
region upper = cells where z > 1
region sole  = interface from upper to lower
region floor = interface from lower to upper
unknown a : vector {element} on upper
unknown b : vector {element} on lower
term upper on upper : Grad_a:Grad_Test_a
term lower on lower : Grad_b:Grad_Test_b
{law}"
    )
}

fn solved(text: String, params: &[(&str, f64)]) -> Solved {
    solve(Path::new("."), text, &[], params).unwrap_or_else(|e| panic!("{e}"))
}

fn measure(solved: &Solved, name: &str) -> Vec<f64> {
    (0..solved.outcome.steps.len()).map(|step| solved.measure(step, name)).collect()
}

/// Self-contact: the wall of a slot is mapped onto itself; forces are those of GetFEM for the same form.
#[test]
fn a_slot_that_closes_on_itself_has_the_forces_of_getfem() {
    let text = std::fs::read_to_string(examples().join("sliding/slot.wfl")).expect("an example");
    let found = solve(&examples().join("sliding"), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged() && found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    let of_getfem = reference("sliding_slot.json");
    for name in ["Fx", "Fy", "contact"] {
        let own = measure(&found, name);
        for (k, number) in of_getfem[name].as_array().expect("a list").iter().enumerate() {
            let number = number.as_f64().expect("a number");
            assert!((own[k + 1] - number).abs() < 1e-9, "{name} at step {}: {}, {number}", k + 1, own[k + 1]);
        }
    }
}

/// The macros of the library are the formulas that a scene would write; the force on the grip is that of contact.
#[test]
fn the_library_is_the_form_that_is_written_out() {
    let drive = "steps s = 0 to 4 by 1\nfix a = [0.3*max(0, s - 1), -0.02*min(s, 1)] on lid\nfix b = [0, 0] on base\n\
                 measure drag = reaction(a(1)) on lid\nmeasure shear_force = integral(force.[1,0]) on sole\n";
    // the slip of the library is carried along with the body of the point
    let form = blocks(4, drive)
        .replacen("def slip = ", "def slip = (Id(2) + Grad_a)*Inv(Id(2) + Grad_Previous_a)*(", 1)
        .replacen(
            "Transformed_unit_vector(Grad_Previous_a, Normal))",
            "Transformed_unit_vector(Grad_Previous_a, Normal)))",
            1,
        );
    let written = solved(form.clone(), &[]);
    let text = form
        .replacen("wfl 1\n", "wfl 1\nuse \"sliding\"\n", 1)
        .replace("Inv(Id(2) + Grad_a)*shear/20", "sliding_elastic(a, b, m, elastic, 20, fric)")
        .replace("force.(Test_a - Interpolate(Test_b, m))", "sliding_friction(a, b, m, elastic, 20, fric)");
    let library = solved(text, &[]);
    for name in ["N", "drag", "shear_force"] {
        let (a, b) = (measure(&written, name), measure(&library, name));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + a.abs())), "{name}: {a:?} {b:?}");
    }
    let (drag, shear) = (measure(&written, "drag"), measure(&written, "shear_force"));
    assert!(shear[4].abs() > 1e-3 && drag.iter().zip(&shear).all(|(d, s)| (d + s).abs() < 1e-9), "{drag:?} {shear:?}");
}

/// The forces on the block at 30 steps are those of GetFEM for the same form, and no step needs many iterations.
#[test]
fn ironing_has_the_forces_of_getfem() {
    irons_like_getfem(&examples().join("sliding"), "sliding_ironing.json", &[]);
}

/// The same on cells half as large.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn ironing_on_a_finer_mesh_has_the_forces_of_getfem() {
    let edits = [("ironing.msh", "sliding_ironing_2.msh"), ("gamma = 40", "gamma = 80"), ("\nexpect", "\n# expect")];
    irons_like_getfem(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference"), "sliding_ironing_2.json", &edits);
}

/// The forces of the scene with another mesh of `folder` are these numbers.
fn irons_like_getfem(folder: &Path, numbers: &str, edits: &[(&str, &str)]) {
    let text = std::fs::read_to_string(examples().join("sliding/ironing.wfl")).expect("an example");
    let text = edits.iter().fold(text, |text, (from, to)| text.replace(from, to));
    let found = solve(folder, text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged());
    assert!(found.outcome.warnings.is_empty(), "{:?}", found.outcome.warnings);
    let of_getfem = reference(numbers);
    for name in ["Fx", "Fy"] {
        let expected: Vec<f64> =
            of_getfem[name].as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect();
        let forces = measure(&found, name);
        assert_eq!(forces.len(), expected.len() + 1, "the first state is that without a load");
        for (step, (force, expected)) in forces[1..].iter().zip(&expected).enumerate() {
            assert!((force - expected).abs() < 1e-9, "{name} at step {}: {force} {expected}", step + 1);
        }
    }
}

/// A block that was pushed by 13 cells presses where it is, and on nothing that it left.
#[test]
fn a_block_presses_where_it_has_gone() {
    let drive = "steps s = 0 to 27 by 1\nfix a = [max(0, s - 1)/2, -0.02*min(s, 1)] on lid\nfix b = [0, 0] on base\n";
    let found = solved(blocks(20, drive), &[("fric", 0.0)]);
    assert!(found.outcome.converged());
    let (normal, left) = (measure(&found, "N"), measure(&found, "left_behind"));
    assert!(normal[27] > 0.5 * normal[1], "{normal:?}");
    assert!(left[27] < 1e-4 * left[1], "{left:?}");
    assert!(found.outcome.warnings.iter().all(|d| d.code != "W631"), "{:?}", doubts(&found.outcome));
}

/// A finite rotation of everything changes no force, and nothing slips.
#[test]
fn a_rotation_of_the_whole_scene_changes_nothing() {
    let turn = "def w = max(0, s - 1)*0.4
def turned(v) = [cos(w)*v(1) - sin(w)*v(2), sin(w)*v(1) + cos(w)*v(2)]
steps s = 0 to 5 by 1
fix a = turned(X + [0.05*min(s, 1), -0.03*min(s, 1)]) - X on lid
fix b = turned(X) - X on base
solver newton with tol=1e-14
";
    for fric in [0.0, 0.2] {
        let found = solved(blocks(3, turn), &[("fric", fric)]);
        assert!(found.outcome.converged());
        let normal = measure(&found, "N");
        assert!(normal[1] > 1e-3, "{normal:?}");
        for (step, force) in normal.iter().enumerate().skip(2) {
            assert!((force - normal[1]).abs() < 1e-12 * normal[1], "step {step}: {force} after {}", normal[1]);
        }
    }
}

/// Two rings that are pressed into each other keep the pressure of Lamé when they are turned by 90 degrees.
#[test]
fn a_shrink_fit_that_is_turned_keeps_the_pressure_of_lame() {
    let text = std::fs::read_to_string(examples().join("sliding/shrink_fit.wfl")).expect("an example");
    let found = solve(&examples().join("sliding"), text, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged() && found.outcome.warnings.is_empty(), "{:?}", doubts(&found.outcome));
    // each ring is held on its other side: its pressure is its stiffness times what its face moves
    let (e, nu, delta, gamma) = (1000.0, 0.3, 1e-4, 2e4);
    let (a, b, c) = (0.5f64, 1.0f64, 1.5f64);
    let (la, mu) = (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)));
    let gives = |r: f64| (r * r - b * b).abs() / b / (2.0 * (la + mu) + 2.0 * mu * r * r / (b * b));
    let lame = delta / (gives(a) + gives(c) + 1.0 / gamma);
    for name in ["p", "least", "most"] {
        let pressure = measure(&found, name);
        for p in &pressure {
            assert!((p - lame).abs() < 2e-4 * lame, "{name}: {p} in place of {lame}");
            assert!((p - pressure[0]).abs() < 1e-9 * lame, "{name}: {p} after {}", pressure[0]);
        }
    }
}

/// The forces of a term on both bodies add up to nothing at any state.
#[test]
fn contact_conserves_linear_momentum() {
    let drive = "steps s = 0 to 2 by 1\nfix a = [0.37*s, -0.02*s] on lid\nfix b = [0, 0] on base\n";
    let found = solved(blocks(4, drive), &[]);
    let equations = &found.outcome.equations;
    let system: &System = &equations.system;
    let u = &found.outcome.steps.last().expect("states are kept").state;
    let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
    let mut forces = vec![0.0; u.len()];
    term.add_residual(&system.mesh, system.values(u).view(), &mut forces).expect("finite forces");
    let size = forces.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    for c in 0..2 {
        let sum: f64 = forces.iter().skip(c).step_by(2).sum();
        assert!(size > 1e-4 && sum.abs() < 1e-13 * size, "{sum} of {size}");
    }
}

/// Images that are found again after a small motion have shifted as the formula says: straight edges, and faces of hexahedra
/// that are not plane.
#[test]
fn images_shift_as_their_formula_says() {
    let law = "mapping m = raytrace from sole onto floor moving with a, b within 0.5
def gap  = (Interpolate(X, m) + Interpolate(b, m) - X - a).Transformed_unit_vector(Grad_a, Normal)
term contact on sole : pos_part(-gap)*(Interpolate(Normal, m).(Interpolate(Test_b, m) - Test_a))
";
    let space = |element: &str| twisted("hex", element, law);
    let scenes = [blocks(4, ""), space("Q1"), space("Q2")];
    for text in scenes {
        let text = text + "steps s = 0 to 1 by 1\n";
        let scene = prepared(Path::new("."), text, &[], &[], &InterpreterBackend).unwrap_or_else(|e| panic!("{e}"));
        let points = scene.system.terms.iter().find_map(|t| t.integrator.domain.moving.clone()).expect("a map");
        let found = points.check_shifts(&scene.system.mesh);
        assert!(found.points > found.all / 2, "{found:?}");
        assert!(found.error < 1e-7, "{found:?}");
    }
}

/// A face that is bent so far that a ray meets it twice, beside its top, has the image where the ray comes from the front: a
/// wall looks at a hill of height 1/2, and sees what is below its top. From the middle of the hill no ray is found at all.
#[test]
fn a_hill_is_seen_from_its_side() {
    for (space, zero) in [(false, ""), (true, ", 0")] {
        let mesh = if space {
            "mesh box [-1,-1,0] to [1,1,1] cells [2,2,1] hex with idle_cells=allowed"
        } else {
            "mesh box [-1,-1] to [1,1] cells [2,2] quad with idle_cells=allowed"
        };
        let text = format!(
            "wfl 1
{mesh}
region left  = cells where x < 0 and y > 0
region right = cells where x > 0 and y < 0
region wall  = faces of left where x == 0
region hill  = faces of right where y == 0
region far   = faces of left where x == -1
unknown a : vector Q2 on left
unknown b : vector Q2 on right
term left  on left  : Grad_a:Grad_Test_a
term right on right : Grad_b:Grad_Test_b
fix a = [-0.2, 0{zero}] on far
fix b = [0, 2*x*(1 - x){zero}] on right
mapping m = raytrace from wall onto hill moving with a, b within 1
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a)(1)
term touch on wall : 0*gap*Test_a(1)
measure seen  = integral(Interpolate_filter(m, 1, 1)) on wall
measure worst = max(abs(gap - 0.2 - (1 - sqrt(1 - 2*(y + a(2))))/2)) on wall
quadrature on wall degree 7
"
        );
        let found = solved(text, &[]);
        assert!((found.measure(0, "seen") - 0.5).abs() < 1e-12, "in space {space}: {}", found.measure(0, "seen"));
        assert!(found.measure(0, "worst") < 1e-12, "in space {space}: {}", found.measure(0, "worst"));
    }
}

/// A body that is pushed over the edge of the other loses images under pressure, and that is told.
#[test]
fn images_lost_under_pressure_are_told() {
    let drive = "steps s = 0 to 5 by 1\nfix a = [max(0, s - 1)*0.8, -0.02*min(s, 1)] on lid\nfix b = [0, 0] on base\n";
    let Attempt { solved, messages } = attempt(Path::new("."), blocks(4, drive), &[], &[("fric", 0.0)]);
    let found = solved.unwrap_or_else(|| panic!("{messages}"));
    let lost: Vec<_> = found.outcome.warnings.iter().filter(|d| d.code == "W632").collect();
    assert!(lost.len() == 1 && lost[0].message.contains("lost their image"), "{lost:?}");
}

/// What is not there is refused with its place, and not solved some other way.
#[test]
fn what_is_not_available_is_refused() {
    let drive = "steps s = 0 to 1 by 1\n";
    let m = "mapping m = raytrace from sole onto floor moving with a, b within 0.3";
    let term = "term contact on sole : force.(Test_a - Interpolate(Test_b, m))";
    let cases = [
        (m, "mapping m = raytrace from floor onto floor moving with b", "E419"),
        (m, "mapping m = raytrace from sole onto floor moving with a, b within 0", "E419"),
        (m, "mapping m = raytrace from sole onto floor moving with b within 0.3", "E202"),
        (term, "energy contact on sole : sqr(gap)", "E111"),
        (term, "term contact on sole : gap*Diff(gap, a)", "E111"),
        (term, "term contact on sole : Interpolate(element_size, m)*gap*Test_a.n", "E111"),
        (term, "term contact on sole : Interpolate_filter(m, gap, 0)*Test_a.n", "E106"),
        (term, "load a = Interpolate(b, m) on sole", "E111"),
    ];
    for (from, to, code) in cases {
        let edits = [(from, to.to_owned())];
        let made = prepared(Path::new("."), blocks(4, drive), &edits, &[], &InterpreterBackend);
        let messages = made.err().unwrap_or_else(|| panic!("`{to}` is taken"));
        assert!(messages.contains(code) && messages.contains("scene.wfl:"), "{to}: {messages}");
    }
}
