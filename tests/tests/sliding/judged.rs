//! What is said of contact whose images move: the parameter of Nitsche's method, overlap, signs, points that go through.

use std::path::Path;

use wfl_compiler::InterpreterBackend;
use wfl_contact::{Coercivity, coercivity};
use wfl_tests::{Attempt, attempt, doubts, prepared};

use super::{blocks, measure, solved};

/// Nitsche's method on two linear bodies with a symmetric, an incomplete or a skew form.
const NITSCHE: &str = "wfl 1
mesh box [0,0] to [4,2] cells [8,4] quad with idle_cells=allowed
region lower = cells where y < 1
region upper = cells where y > 1 and x < 3
region sole  = faces of upper where y == 1
region floor = faces of lower where y == 1
region lid   = faces of upper where y == 2
region base  = faces of lower where y == 0
param theta = 0
param gamma = 40
unknown a : vector ELEMENT on upper
unknown b : vector ELEMENT on lower
def s(g) = 0.5*Trace(g)*Id(2) + 0.8*Sym(g)
term upper on upper : s(Grad_a):Grad_Test_a
term lower on lower : s(Grad_b):Grad_Test_b
mapping m = raytrace from sole onto floor MOVING within 0.3
def n   = NORMAL
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
def t   = s(Grad_a)*Normal
def dt  = s(Grad_Test_a)*Normal
def Pn  = -gamma*gap - t.n
term stress  on sole : -theta/gamma*(t.Normal)*(dt.Normal)
term contact on sole : pos_part(Pn)*(n.(Test_a - Interpolate(Test_b, m)) - theta/gamma*(dt.n))
steps k = 0 to 1 by 1
fix a = [0, -0.01*k] on lid
fix b = [0, 0] on base
";

fn bound(element: &str, moves: bool, theta: f64) -> Option<Coercivity> {
    let (moving, normal) =
        if moves { ("moving with a, b", "Transformed_unit_vector(Grad_a, Normal)") } else { ("", "Normal") };
    let text = NITSCHE.replace("ELEMENT", element).replace("MOVING", moving).replace("NORMAL", normal);
    let made = prepared(Path::new("."), text, &[], &[("theta", theta)], &InterpreterBackend);
    let scene = made.unwrap_or_else(|e| panic!("{e}"));
    let first = scene.at_first_step().expect("equations");
    coercivity(&first.system, &first.contact).into_iter().next()
}

/// The smallest safe parameter is that of the same faces with images that stay.
#[test]
fn the_safe_parameter_of_nitsche_is_that_of_images_that_stay() {
    for element in ["Q1", "Q2"] {
        for theta in [1.0, 0.0, -1.0] {
            let [moving, fixed] = [true, false].map(|moves| bound(element, moves, theta).expect("a Nitsche term"));
            for (a, b) in [
                (moving.gamma, fixed.gamma),
                (moving.theta, fixed.theta),
                (moving.trace, fixed.trace),
                (moving.bound, fixed.bound),
            ] {
                assert!((a - b).abs() <= 1e-7 * fixed.trace.max(1.0), "{element}, {theta}: {moving:?} {fixed:?}");
            }
        }
    }
}

const PRESSED: &str =
    "steps s = 0 to 2 by 1\nfix a = [0.05*max(0, s - 1), -0.02*min(s, 1)] on lid\nfix b = [0, 0] on base\n";

/// A soft penalty leaves an overlap, which is told; one that the law asks for is none.
#[test]
fn an_overlap_is_told_unless_the_law_means_it() {
    let overlaps = |text: String| {
        let found = solved(text, &[]);
        assert!(found.outcome.converged());
        doubts(&found.outcome).into_iter().any(|(code, line)| code == "W606" && line.contains("penetration"))
    };
    assert!(!overlaps(blocks(4, PRESSED)));
    let soft = blocks(4, PRESSED).replace("-20*gap", "-0.2*gap");
    assert!(overlaps(soft));
    // an overlap of the meshes that is taken for touching
    let meant = blocks(4, PRESSED).replace("-20*gap", "-20*(gap + 0.02)").replace("-0.02*min(s, 1)", "-0.04*min(s, 1)");
    assert!(!overlaps(meant));
}

/// A force with the wrong sign pulls the bodies into each other: no such state is taken for contact.
#[test]
fn a_force_with_the_wrong_sign_is_told() {
    let text = blocks(4, PRESSED).replace("def force = pressure*n + shear", "def force = -0.01*pressure*n");
    let Attempt { solved, messages } = attempt(Path::new("."), text, &[], &[]);
    let found = solved.unwrap_or_else(|| panic!("{messages}"));
    let told = doubts(&found.outcome);
    let pulls = told.iter().any(|(code, line)| *code == "W606" && line.contains("tensile"));
    assert!(pulls || !found.outcome.converged(), "{told:?}");
}

/// A step by many times `within`: the iteration does not go through the surface, and finds what it finds with a long one.
#[test]
fn a_long_step_does_not_go_through_the_surface() {
    let drive = "steps s = 0 to 1 by 1\nfix a = [0, -0.1*s] on lid\nfix b = [0, 0] on base\n";
    let [short, long] = ["0.02", "0.3"].map(|within| {
        let found = solved(blocks(4, drive).replace("within 0.3", &format!("within {within}")), &[]);
        assert!(found.outcome.converged(), "{:?}", doubts(&found.outcome));
        assert!(doubts(&found.outcome).iter().all(|(code, _)| *code != "W670" && *code != "W632"));
        measure(&found, "N")[1]
    });
    assert!(long > 1e-2 && (short - long).abs() < 1e-8 * long, "{short} {long}");
}

/// Where no state of contact is found the points inside the other body are told.
#[test]
fn points_inside_the_other_body_are_told() {
    // a penalty that lets the bodies overlap by more than `within`
    let drive = "steps s = 0 to 2 by 1\nfix a = [0, -0.1*s] on lid\nfix b = [0, 0] on base\n";
    let text = blocks(4, drive).replace("within 0.3", "within 0.02").replace("-20*gap", "-0.05*gap");
    let Attempt { solved, messages } = attempt(Path::new("."), text, &[], &[]);
    let Some(found) = solved else { panic!("{messages}") };
    let told = doubts(&found.outcome);
    assert!(!found.outcome.converged() || told.iter().any(|(code, _)| *code == "W670"), "{told:?}");
}
