//! Two blocks pressed together are in a state of constant stress, whatever their meshes.

use super::{
    blocks::{Blocks, Cells},
    messages, solved,
};
use Cells::{Hexahedra, Pyramids, Quadrilaterals, Tetrahedra, Triangles, Wedges};
use wfl_tests::Solved;

const PRESS: f64 = 0.02;
const GAMMA: f64 = 40.0;
/// Modulus of uniaxial strain.
const MODULUS: f64 = 0.9 + 2.0 * 0.4;

/// How the sides meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Law {
    Penalty,
    Nitsche(i32),
}

/// Blocks of small strain with images that stay.
fn fixed(blocks: &Blocks, word: &str, law: Law, rule: &str) -> String {
    let dim = blocks.dim;
    let up = blocks.place(if dim == 2 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] });
    let list = |by: f64| -> String {
        let entries: Vec<String> = up[..dim].iter().map(|x| format!("{:?}", by * x)).collect();
        format!("[{}]", entries.join(", "))
    };
    let law = match law {
        Law::Penalty => {
            "term contact on sole : gamma*pos_part(-gap)*(Normal.(Test_a - Interpolate(Test_b, m)))\n".to_owned()
        }
        Law::Nitsche(theta) => format!(
            "param theta = {theta}
def t = sigma(Grad_a)*Normal
def pressure = pos_part(-gamma*gap - t.Normal)
term stress on sole : -theta/gamma*(t.Normal)*(Diff(t, a).Normal)
term contact on sole : pressure*(Normal.(Test_a - Interpolate(Test_b, m)) - theta/gamma*(Diff(t, a).Normal))
"
        ),
    };
    format!(
        "wfl 1
mesh file \"body.msh\"
unknown a : vector on upper
unknown b : vector on lower
def sigma(g) = 0.9*Trace(g)*Id({dim}) + 0.4*(g + g')
term upper on upper : sigma(Grad_a):Grad_Test_a
term lower on lower : sigma(Grad_b):Grad_Test_b
param gamma = {GAMMA}
mapping m = {word} from sole onto floor within 0.3
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).Normal
{law}{rule}
steps k = 0 to 1 by 1
fix a = k*{} on lid
fix b = {} on base
fix a.Normal = 0 on sides
fix b.Normal = 0 on walls
",
        list(-PRESS),
        list(0.0)
    )
}

/// The largest deviation of a displacement from the exact one, over the largest displacement.
pub(crate) fn error(found: &Solved, blocks: &Blocks, slope: f64) -> f64 {
    let system = &found.outcome.equations.system;
    let u = &found.outcome.steps.last().expect("states are kept").state;
    let up = blocks.place(if blocks.dim == 2 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] });
    let mut error = 0.0f64;
    for (k, field) in system.fields.iter().enumerate() {
        let Some(range) = system.range(k) else { continue };
        for (node, own) in u[range].chunks(blocks.dim).enumerate() {
            let x = field.node_position(node);
            let height: f64 = (0..3).map(|d| x[d] * up[d]).sum();
            let exact = -slope * height - if field.name == "a" { PRESS - slope } else { 0.0 };
            error = own.iter().zip(up).fold(error, |m, (u, up)| m.max((u - exact * up).abs()));
        }
    }
    error / PRESS
}

/// The error of the patch test with images that stay.
fn patch(name: &str, blocks: &Blocks, word: &str, law: Law, rule: &str) -> f64 {
    let found = solved(name, blocks, &fixed(blocks, word, law, rule));
    // strain e in both, overlap p/gamma: PRESS = e + p/gamma with p = MODULUS e
    let slope = if law == Law::Penalty { PRESS / (1.0 + MODULUS / GAMMA) } else { PRESS };
    error(&found, blocks, slope)
}

/// Laws with the word that finds their images.
const CASES: [(Law, &str); 5] = [
    (Law::Penalty, "raytrace"),
    (Law::Penalty, "project"),
    (Law::Nitsche(1), "raytrace"),
    (Law::Nitsche(0), "raytrace"),
    (Law::Nitsche(-1), "raytrace"),
];

fn segments(degree: usize) -> String {
    format!("quadrature on sole segments of m degree {degree}")
}

#[test]
fn a_constant_stress_passes_through_faces_that_do_not_match() {
    let pairs = [
        (2, (Quadrilaterals, 3), (Triangles, 4)),
        (2, (Triangles, 5), (Quadrilaterals, 3)),
        (3, (Hexahedra, 3), (Hexahedra, 2)),
        (3, (Tetrahedra, 2), (Wedges, 3)),
        (3, (Hexahedra, 2), (Tetrahedra, 3)),
        (3, (Pyramids, 3), (Hexahedra, 2)),
    ];
    for (k, (dim, lower, upper)) in pairs.into_iter().enumerate() {
        let mut blocks = Blocks::of(dim, lower, upper);
        // triangles and parallelograms alone
        let has_parallelograms = |cells| matches!(cells, Hexahedra | Pyramids);
        blocks.lower.amount = if has_parallelograms(lower.0) { 0.0 } else { 0.3 };
        blocks.upper.amount = if has_parallelograms(upper.0) { 0.0 } else { 0.3 };
        // without optimisation three of them
        let n = if cfg!(debug_assertions) { 3 } else { CASES.len() };
        for (law, word) in CASES[..n].iter().copied() {
            let found = patch(&format!("patch{k}"), &blocks, word, law, &segments(2));
            assert!(found < 1e-12, "{dim} {lower:?} {upper:?} {law:?} {word}: {found:e}");
        }
        // what is cut makes the difference
        let plain = patch(&format!("plain{k}"), &blocks, "raytrace", Law::Penalty, "quadrature on sole degree 5");
        assert!(plain > 1e-5, "{dim} {lower:?} {upper:?}: {plain:e}");
    }
}

#[test]
fn a_constant_stress_passes_through_distorted_quadrilaterals() {
    // distorted as much as those of the reference: by 0.05
    let mut blocks = Blocks::of(3, (Hexahedra, 3), (Hexahedra, 2));
    (blocks.lower.amount, blocks.upper.amount) = (0.15, 0.1);
    let errors = [2, 4, 6].map(|n| patch("distorted", &blocks, "raytrace", Law::Penalty, &segments(n)));
    assert!(errors[1] < 1e-7, "{errors:?}");
    assert!(errors[0] > 10.0 * errors[1] && errors[1] > 3.0 * errors[2], "{errors:?}");
}

#[test]
fn a_rotation_of_everything_changes_nothing() {
    let mut blocks = Blocks::of(3, (Hexahedra, 3), (Tetrahedra, 2));
    blocks.upper.amount = 0.3;
    for turned in [[0.0, 0.0], [0.4, 0.0], [0.0, 0.9]] {
        blocks.turned = turned;
        let found = patch("turned", &blocks, "raytrace", Law::Penalty, &segments(2));
        assert!(found < 1e-12, "{turned:?}: {found:e}");
    }
}

#[test]
fn a_state_and_vertices_are_refused_on_segments() {
    let blocks = Blocks::of(2, (Quadrilaterals, 3), (Quadrilaterals, 2));
    let text = |rule: &str, more: &str| fixed(&blocks, "raytrace", Law::Penalty, rule) + more;
    let told = messages("vertex", &blocks, &text("quadrature on sole segments of m vertex", ""));
    assert!(told.contains("E411") && told.contains("no rule at vertices"), "{told}");
    let state = "state held : scalar on sole := gap\nterm more on sole : held*Test_a(1)\n";
    let told = messages("state", &blocks, &text(&segments(2), state));
    assert!(told.contains("E411") && told.contains("state `held`"), "{told}");
    let told = messages("unknown", &blocks, &text("quadrature on sole segments of n degree 2", ""));
    assert!(told.contains("E201") && told.contains("`n` is no mapping"), "{told}");
    let formula = "mapping p = point X - [0, 0.25]\nterm more on sole : Interpolate(b, p).Test_a\n";
    let told = messages("formula", &blocks, &text("quadrature on sole segments of p degree 2", formula));
    assert!(told.contains("E411") && told.contains("no segments of `p`"), "{told}");
}
