//! Faces that are cut anew in each state: patch tests of finite strain, sliding blocks, what is counted and kept.

use std::time::Instant;

use wfl_discrete::domain::nearest_points;
use wfl_run::RunOptions;
use wfl_tests::{MeshFolder, Solved, attempt_with, reference, solve};

use super::{
    blocks::{Blocks, Cells, Grid, grids},
    folder, solved,
};
use Cells::{Hexahedra, Quadrilaterals, Tetrahedra, Triangles, Wedges};

const PRESS: f64 = 0.08;
const GAMMA: f64 = 1e3;
const MU: f64 = 0.4;
const LAMBDA: f64 = 0.5;

/// How the sides meet.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    Penalty,
    Nitsche(i32),
}

/// Laws with the word that finds their images.
const CASES: [(Law, &str); 5] = [
    (Law::Nitsche(0), "raytrace"),
    (Law::Penalty, "project"),
    (Law::Penalty, "raytrace"),
    (Law::Nitsche(1), "raytrace"),
    (Law::Nitsche(-1), "raytrace"),
];

/// Blocks of finite strain whose images follow them.
fn moving(blocks: &Blocks, word: &str, degree: usize, law: Law, rule: &str) -> String {
    let dim = blocks.dim;
    let zero = vec!["0"; dim - 1].join(", ");
    let element = |cells| format!("{}{degree}", if matches!(cells, Quadrilaterals | Hexahedra) { "Q" } else { "P" });
    let (upper, lower) = (element(blocks.upper.cells), element(blocks.lower.cells));
    let law = match law {
        Law::Penalty => {
            "term contact on sole : gamma*pos_part(-gap)*(n.(Test_a - Interpolate(Test_b, m)))\n".to_owned()
        }
        Law::Nitsche(theta) => format!(
            "param theta = {theta}
def t = P(Grad_a)*Normal
def pressure = pos_part(-gamma*gap - t.n)
term stress on sole : -theta/gamma*(t.n)*(Diff(t, a).n)
term contact on sole : pressure*(n.(Test_a - Interpolate(Test_b, m)) - theta/gamma*(Diff(t, a).n))
"
        ),
    };
    format!(
        "wfl 1
mesh file \"body.msh\"
unknown a : vector {upper} on upper
unknown b : vector {lower} on lower
def P(g) = {MU}*((Id({dim}) + g) - Inv(Id({dim}) + g)') + {LAMBDA}*log(Det(Id({dim}) + g))*Inv(Id({dim}) + g)'
term upper on upper : P(Grad_a):Grad_Test_a
term lower on lower : P(Grad_b):Grad_Test_b
param gamma = {GAMMA}
mapping m = {word} from sole onto floor moving with a, b within 0.3
def n = Transformed_unit_vector(Grad_a, Normal)
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
{law}{rule}
solver newton with tol=1e-13
steps k = 0 to 2 by 1
fix a = [{zero}, -{:?}*k] on lid
fix b = [{zero}, 0] on base
fix a.Normal = 0 on sides
fix b.Normal = 0 on walls
",
        PRESS / 2.0
    )
}

/// The stretch of the blocks, which are confined along the square, and their overlap.
fn stretch(law: Law) -> f64 {
    let pressure = |a: f64| -(MU * (a - 1.0 / a) + LAMBDA * a.ln() / a);
    let softness = if law == Law::Penalty { 1.0 / GAMMA } else { 0.0 };
    // the heights of both, less the overlap, are 1 - PRESS
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..100 {
        let a = f64::midpoint(low, high);
        if a - softness * pressure(a) > 1.0 - PRESS { high = a } else { low = a }
    }
    low
}

/// The largest deviation of a displacement from the exact one, over the largest displacement.
fn error(found: &Solved, dim: usize, law: Law) -> f64 {
    let system = &found.outcome.equations.system;
    let u = &found.outcome.steps.last().expect("states are kept").state;
    let (a, mut error) = (stretch(law), 0.0f64);
    for (k, field) in system.fields.iter().enumerate() {
        let Some(range) = system.range(k) else { continue };
        for (node, own) in u[range].chunks(dim).enumerate() {
            let height = field.node_position(node)[dim - 1];
            let exact = if field.name == "b" { (a - 1.0) * height } else { -PRESS + (1.0 - a) * (1.0 - height) };
            let beside = own[..dim - 1].iter().fold(0.0f64, |m, u| m.max(u.abs()));
            error = error.max(beside).max((own[dim - 1] - exact).abs());
        }
    }
    error / PRESS
}

fn segments(degree: usize) -> String {
    format!("quadrature on sole segments of m degree {degree}")
}

#[test]
fn a_constant_stress_passes_between_bodies_that_move() {
    let pairs = [
        (2, 1, (Quadrilaterals, 3), (Triangles, 4)),
        (2, 2, (Triangles, 3), (Quadrilaterals, 2)),
        (3, 1, (Hexahedra, 2), (Hexahedra, 3)),
        (3, 1, (Wedges, 2), (Tetrahedra, 3)),
    ];
    // without optimisation those in the plane
    let n = if cfg!(debug_assertions) { 2 } else { pairs.len() };
    for (k, (dim, degree, lower, upper)) in pairs.into_iter().take(n).enumerate() {
        let mut blocks = Blocks::of(dim, lower, upper);
        let amount = |cells| if cells == Hexahedra { 0.0 } else { 0.3 };
        (blocks.lower.amount, blocks.upper.amount) = (amount(lower.0), amount(upper.0));
        // without optimisation two of them
        let n = if cfg!(debug_assertions) { 2 } else { CASES.len() };
        for (law, word) in CASES[..n].iter().copied() {
            let text = moving(&blocks, word, degree, law, &segments(2 * degree));
            let found = error(&solved(&format!("moving{k}"), &blocks, &text), dim, law);
            assert!(found < 1e-12, "{dim} {degree} {lower:?} {upper:?} {law:?} {word}: {found:e}");
        }
        let plain = moving(&blocks, "raytrace", degree, Law::Penalty, "quadrature on sole degree 5");
        let plain = error(&solved(&format!("moving-plain{k}"), &blocks, &plain), dim, Law::Penalty);
        assert!(plain > 1e-6, "{dim} {lower:?} {upper:?}: {plain:e}");
    }
}

#[test]
fn a_constant_stress_passes_between_distorted_quadrilaterals_that_move() {
    let mut blocks = Blocks::of(3, (Hexahedra, 3), (Hexahedra, 2));
    (blocks.lower.amount, blocks.upper.amount) = (0.15, 0.1);
    let text = moving(&blocks, "raytrace", 1, Law::Penalty, &segments(4));
    let found = error(&solved("distorted-moving", &blocks, &text), 3, Law::Penalty);
    assert!(found < 1e-7, "{found:e}");
}

/// The upper block is pressed and pushed over the edge of the lower one, with friction by Nitsche's method, which keeps no state.
fn sliding(steps: usize) -> String {
    let mut text = moving(&Blocks::of(2, (Quadrilaterals, 1), (Quadrilaterals, 1)), "raytrace", 1, Law::Penalty, "");
    let begin = text.find("param gamma").expect("the law");
    text.truncate(begin);
    text + &format!(
        "param gamma = 20
param fric = 0.3
mapping m = raytrace from sole onto floor moving with a, b within 0.3
def n        = Transformed_unit_vector(Grad_a, Normal)
def n_before = Transformed_unit_vector(Grad_Previous_a, Normal)
def gap      = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
def slip     = a - Previous_a - Interpolate(b, m) + Interpolate(Previous_b, m) + gap*(n - n_before)
def t        = P(Grad_a)*Normal
def pressure = pos_part(-gamma*gap - t.n)
def trial    = gamma*slip - t
def shear    = Ball_projection(trial - (trial.n)*n, fric*pressure)
def force    = pressure*n + shear
term contact on sole : force.(Test_a - Interpolate(Test_b, m))
quadrature on sole segments of m degree 4
measure pressed = integral(pressure) on sole
measure sheared = integral(Norm(shear)) on sole
steps k = 0 to {steps} by 1
fix a = [0.03*max(0, k - 2), -0.01*min(k, 2)] on lid
fix b = [0, 0] on base
"
    )
}

fn half_beside() -> Blocks {
    let mut blocks = Blocks::of(2, (Quadrilaterals, 7), (Quadrilaterals, 5));
    // the right half of the upper one has nothing below
    blocks.shift = [0.45, 0.0];
    blocks
}

#[test]
fn points_that_come_and_go_find_their_branches_and_forces_add_up() {
    let blocks = half_beside();
    let found = solved("sliding", &blocks, &sliding(8));
    let system = &found.outcome.equations.system;
    let u = &found.outcome.steps.last().expect("states are kept").state;
    let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
    let values = system.values(u);
    let at = |u: &[f64]| term.integrator.at(&system.mesh, system.values(u).view().current).domain;
    let now = at(u);
    let first = at(&found.outcome.steps[2].state);
    let points = |d: &wfl_discrete::assemble::Domain| d.entities().filter(|(g, k)| !g.has_lost_its_image(*k)).count();
    assert!(points(&now) != points(&first), "the number of points changes: {} {}", points(&first), points(&now));
    // faces to the right of the lower block have one point without an image each
    assert!(now.entities().any(|(g, k)| g.has_lost_its_image(k)));
    let mut forces = vec![0.0; system.numbering.n_dofs];
    term.add_residual(&system.mesh, values.view(), &mut forces).expect("finite forces");
    let size = forces.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    for c in 0..2 {
        let sum: f64 = forces.iter().skip(c).step_by(2).sum();
        assert!(sum.abs() < 1e-13 * size, "{sum} of {size}");
    }
    // friction is fully used once everything slides
    let (pressed, sheared) = (found.measure(8, "pressed"), found.measure(8, "sheared"));
    assert!((sheared - 0.3 * pressed).abs() < 1e-3 * pressed && pressed > 1e-3, "{sheared} of {pressed}");
    let most = found.outcome.steps.iter().map(|s| s.history.n_iterations()).max();
    assert!(most <= Some(13), "{most:?} iterations");
}

#[test]
fn a_run_of_points_that_change_is_the_same_on_any_number_of_threads() {
    let blocks = half_beside();
    let states = [1, 3].map(|threads| {
        let folder = folder(&format!("threads{threads}"), &blocks);
        let options = RunOptions::without_files(threads, Instant::now());
        let made = attempt_with(&options, folder.path(), sliding(5), &[], &[]);
        let found = made.solved.unwrap_or_else(|| panic!("{}", made.messages));
        found.outcome.steps.iter().map(|s| s.state.clone()).collect::<Vec<_>>()
    });
    assert!(states[0] == states[1]);
}

#[test]
fn values_are_taken_from_the_nearest_point_of_a_face() {
    let from = [[0.0, 0.2, 0.0], [0.0, 0.8, 0.0], [3.0, 0.5, 0.5], [1.0, 0.5, 0.0]];
    let to = [[0.0, 0.45, 0.0], [0.0, 0.6, 0.1], [1.0, 0.0, 0.0], [3.0, 0.9, 0.9]];
    assert_eq!(nearest_points(&from, &to), [0, 1, 3, 2]);
    assert_eq!(nearest_points(&to, &to), [0, 1, 2, 3], "each is its own nearest");
}

/// A softer block is pressed on a wavy one and pushed over two of its faces, by a penalty with friction of the slip of each step.
const WAVY: &str = "wfl 1
mesh file \"body.msh\"
unknown a : vector Q1 on upper
unknown b : vector Q1 on lower
def P(g, e) = e/2.6*((Id(2) + g) - Inv(Id(2) + g)') + 0.3*e/0.52*log(Det(Id(2) + g))*Inv(Id(2) + g)'
term upper on upper : P(Grad_a, 400):Grad_Test_a
term lower on lower : P(Grad_b, 1000):Grad_Test_b
param gamma = 2e4
param fric = 0.3
mapping m = raytrace from sole onto floor moving with a, b within 0.3
def n        = Transformed_unit_vector(Grad_a, Normal)
def n_before = Transformed_unit_vector(Grad_Previous_a, Normal)
def gap      = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
def slip     = a - Previous_a - Interpolate(b, m) + Interpolate(Previous_b, m) + gap*(n - n_before)
def pressure = pos_part(-gamma*gap)
def force    = pressure*n + Ball_projection(gamma*(slip - (slip.n)*n), fric*pressure)
term contact on sole : force.(Test_a - Interpolate(Test_b, m))
quadrature on sole segments of m degree 3
quadrature on upper, lower degree 3
steps k = 0 to 8 by 1
fix a = [0.125*max(0, k - 4), -0.03*min(k, 4)] on lid
fix b = [0, 0] on base
measure Fx = reaction(a(1)) on lid
measure Fy = reaction(a(2)) on lid
";

#[test]
fn a_block_that_slides_over_faces_has_the_forces_of_the_prototype() {
    let bend = |[x, y]: [f64; 2]| [x, y * (1.0 + 0.06 * (1.7 * x).sin())];
    let lower = Grid { from: [0.0, 0.0], to: [4.0, 1.0], cells: [16, 4], map: &bend };
    let upper = Grid { from: [0.35, 1.065], to: [1.35, 1.9], cells: [5, 4], map: &|x| x };
    let folder = MeshFolder::new("segments-wavy", &grids(&lower, &upper));
    let found = solve(folder.path(), WAVY.to_owned(), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.outcome.converged());
    let known = reference("sliding_segments.json");
    for (k, row) in known["steps"].as_array().expect("steps").iter().enumerate() {
        let size = row["force"][1].as_f64().expect("a force").abs();
        for (c, name) in ["Fx", "Fy"].into_iter().enumerate() {
            // a reaction is what the body does to what holds it
            let (force, expected) = (-found.measure(k + 1, name), row["force"][c].as_f64().expect("a force"));
            assert!((force - expected).abs() < 1e-8 * size, "step {}: {name} = {force}, {expected}", k + 1);
        }
    }
    let iterations: Vec<usize> = found.outcome.steps.iter().map(|s| s.history.n_iterations()).collect();
    // the prototype takes 8 to 10 for a step of half a face
    assert!(iterations[5..].iter().all(|n| *n <= 13), "{iterations:?}");
}
