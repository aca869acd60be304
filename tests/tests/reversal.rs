//! Loads that turn back: faces that slip as a whole stick, and slip the other way. Each step is a few iterations for every
//! method and parameter, and the forces are those of one law.

use wfl_tests::{examples, solve};

/// Unknowns of a method, the next slip, and the contact term.
const METHODS: [[&str; 3]; 3] = [
    ["", "penalty_slip(uL, uR, slid, gamma, 0.3)", "penalty_sliding(uL, uR, slid, gamma, 0.3)"],
    ["", "nitsche_slip(uL, uR, slid, gamma, 0.3)", "nitsche_sliding(uL, uR, slid, gamma, 0, 0.3)"],
    [
        "multiplier l : vector on fault\n",
        "augmented_slip(uL, uR, l, slid, gamma, 0.3)",
        "augmented_sliding(uL, uR, l, slid, gamma, 0.3)",
    ],
];

/// Displacements of the end of the right block: to and fro under a constant pressure, off the other side and back, and with
/// a pressure that changes its sign.
const LOADS: [[&str; 2]; 3] = [
    ["-0.01", "0.02*sin(2*pi*t)"],
    ["-0.01*(1 - 1.2*t*(2 - t))", "0.01*sin(2*pi*t)"],
    ["-0.01*cos(4*pi*t)", "0.02*sin(2*pi*t)"],
];

/// The most iterations of a step, and the shear force at the end of each.
fn ran([multiplier, slip, contact]: [&str; 3], [pressed, moved]: [&str; 2], gamma: f64) -> (usize, Vec<f64>) {
    let text = format!(
        "use \"elasticity\"\nuse \"contact\"\nparam gamma = 1\nmesh box [-1,0] to [1,2] cells [16,16] quad\n\
         region left = cells where x < 0\nregion right = cells where x > 0\nregion fault = interface from left to right\n\
         region west = faces where x == -1\nregion east = faces where x == 1\nunknown uL : vector on left\n\
         unknown uR : vector on right\n{multiplier}def sigma(v) = stress(v, lame_lambda(100, 0.3), lame_mu(100, 0.3))\n\
         term left on left : sigma(uL):Grad_Test_uL\nterm right on right : sigma(uR):Grad_Test_uR\n\
         state slid : vector on fault := {slip}\nterm contact on fault : {contact}\nfix uL = [0,0] on west\n\
         fix uR = [{pressed}, {moved}] on east\nsteps t = 0 to 2 by 0.05\nmeasure shear = reaction(uR(2)) on east\n"
    );
    let solved = solve(&examples(), text, &[], &[("gamma", gamma)]).unwrap_or_else(|e| panic!("{e}"));
    assert!(solved.outcome.converged(), "{contact} {gamma:e}");
    let steps = &solved.outcome.steps;
    let most = steps.iter().map(|step| step.history.n_iterations()).max().unwrap_or(0);
    (most, (0..steps.len()).map(|k| solved.measure(k, "shear")).collect())
}

#[test]
fn a_face_that_turns_back_takes_few_iterations_for_every_parameter() {
    for (method, load) in METHODS.into_iter().flat_map(|method| LOADS.map(|load| (method, load))) {
        for gamma in [1e3, 1e5, 1e7] {
            let (most, _) = ran(method, load, gamma);
            assert!(most <= 6, "{} {load:?} {gamma:e}: {most} iterations in a step", method[2]);
        }
    }
}

#[test]
fn methods_agree_on_the_forces_of_a_loop() {
    let of = |method: usize, gamma: f64| ran(METHODS[method], LOADS[0], gamma).1;
    // a penalty of 1e7 is 1e-4 of its overlap off a constraint
    let (penalty, multiplier) = (of(0, 1e7), of(2, 1e3));
    let largest = multiplier.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    for (step, (a, b)) in penalty.iter().zip(&multiplier).enumerate() {
        assert!((a - b).abs() < 1e-4 * largest, "step {step}: {a} and {b}");
    }
}
