//! Bodies that collide and slide with inertia: momentum, the balance of energy, steps that the run chooses.

use super::{measure, solved};
use wfl_tests::doubts;

/// A block that flies slantwise onto a longer one, which is free, too. Closest points, a penalty along the normal of the image:
/// its force is the gradient of an energy.
const COLLISION: &str = "wfl 1
mesh box [0,0] to [4,2] cells [8,4] quad with idle_cells=allowed
region lower = cells where y < 1
region upper = cells where y > 1 and x < 2
region sole  = faces of upper where y == 1
region floor = faces of lower where y == 1
unknown a : vector Q1 on upper
unknown b : vector Q1 on lower
def P(g) = (Id(2) + g)*(0.5*((Id(2) + g)'*(Id(2) + g) - Id(2)))*200
term inertia_a on upper : Dot2_a.Test_a
term inertia_b on lower : Dot2_b.Test_b
term upper on upper : P(Grad_a):Grad_Test_a
term lower on lower : P(Grad_b):Grad_Test_b
mapping m = project from sole onto floor moving with a, b within 0.5
def n   = -Transformed_unit_vector(Interpolate(Grad_b, m), Interpolate(Normal, m))
def gap = (Interpolate(X, m) + Interpolate(b, m) - X - a).n
term contact on sole : 100*pos_part(-gap)*(n.(Test_a - Interpolate(Test_b, m)))
start a = [0, 0.05]
start Dot_a = [0.8, -0.5]
measure px = integral(Dot_a(1)) on upper
measure qx = integral(Dot_b(1)) on lower
measure py = integral(Dot_a(2)) on upper
measure qy = integral(Dot_b(2)) on lower
measure slid = mean(a(1)) on sole
";

/// Momentum stays to the tolerance of Newton's method, the balance of energy closes, and what contact stored it gives back.
#[test]
fn a_collision_keeps_momentum_and_energy() {
    let text = COLLISION.to_owned() + "scheme newmark energy=1e-3\nsteps t = 0 to 1.2 by 0.01\n";
    let found = solved(text, &[]);
    assert!(found.outcome.converged(), "{:?}", doubts(&found.outcome));
    assert!(doubts(&found.outcome).iter().all(|w| w.0 != "W620"), "{:?}", doubts(&found.outcome));
    let [px, qx, py, qy] = ["px", "qx", "py", "qy"].map(|name| measure(&found, name));
    for (name, p, q, whole) in [("x", &px, &qx, 1.6), ("y", &py, &qy, -1.0)] {
        for (k, (p, q)) in p.iter().zip(q).enumerate() {
            assert!((p + q - whole).abs() < 1e-9, "{name} at step {k}: {p} and {q}");
        }
    }
    let last = px.len() - 1;
    assert!(py[last] > 0.0 && measure(&found, "slid")[last] > 0.5, "it bounced, and slid by a cell: {}", py[last]);
    let contact = measure(&found, "energy_contact");
    let most = contact.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    assert!(most > 0.01 && contact[last].abs() < 0.02 * most, "{} of {most}", contact[last]);
}

/// Steps that the run chooses come to the same state.
#[test]
fn steps_by_auto_find_the_same_collision() {
    let with = |steps: &str| {
        let found = solved(COLLISION.to_owned() + steps, &[]);
        assert!(found.outcome.converged(), "{:?}", doubts(&found.outcome));
        ["px", "py", "qy", "slid"].map(|name| *measure(&found, name).last().expect("a step"))
    };
    let fine = with("scheme newmark\nsteps t = 0 to 1.2 by 0.0025\n");
    let auto = with("scheme newmark\nsteps t = 0 to 1.2 by auto with error=1e-4\n");
    for (fine, auto) in fine.iter().zip(&auto) {
        assert!((fine - auto).abs() < 0.02, "{fine:?} {auto:?}");
    }
}
