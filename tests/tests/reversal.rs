//! Loads that turn back: faces that slip as a whole stick, and slip the other way. Each step is a few iterations for every
//! method and parameter, and the forces are those of one law. And loads that end: the state is that of rest, and what follows
//! is what follows a start.

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
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
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

/// The fault by a method, on four cells a side, under loads that are `scale` times the given ones.
fn unloaded(method: &str, gamma: f64, shear: &str, scale: &str) -> wfl_tests::Solved {
    let folder = examples().join("fault");
    let text = std::fs::read_to_string(folder.join("fault.wfl")).expect("an example");
    let edits = [
        ("[-3,0,0] on east", format!("[-3*{scale},0,0] on east")),
        ("[0,0,-t] on top", format!("[0,0,-{shear}*{scale}] on top")),
        ("steps t = 0 to 9.5 by 0.5", "steps t = 0 to 4 by 1".to_owned()),
        ("cells [8, 8, 8]", "cells [4, 4, 4]".to_owned()),
    ];
    let common = edits.iter().fold(text, |text, (from, to)| text.replace(from, to));
    let own = std::fs::read_to_string(folder.join(format!("{method}.wfl"))).expect("an example");
    let own = own.replace("wfl 1\n", "").replace("use \"fault.wfl\"\n", &common);
    solve(&folder, own, &[], &[("gamma", gamma)]).unwrap_or_else(|e| panic!("{method} {gamma:e} {shear} {scale}: {e}"))
}

#[test]
fn a_load_that_ends_leaves_rest() {
    for method in ["penalty", "nitsche", "augmented_lagrangian"] {
        for (gamma, shear) in [(1e5, "0"), (1e5, "0.4"), (5e8, "0.4"), (1e2, "0.4")] {
            let solved = unloaded(method, gamma, shear, "abs(t - 2)");
            let steps = &solved.outcome.steps;
            let what = format!("{method} {gamma:e} {shear}");
            assert!(solved.outcome.converged() && steps.len() == 5, "{what}");
            let most = steps.iter().map(|step| step.history.n_iterations()).max().unwrap_or(0);
            assert!(most <= 12, "{what}: {most} iterations in a step");
            let (force, energy) = (solved.measure(1, "Fn").abs(), solved.measure(1, "energy_right"));
            // of 16 square metres and bodies of 25 GPa
            let motion = force / 16.0 / 25e3;
            let sizes =
                [("Fn", force), ("Ftz", force), ("opening", motion), ("max_slip", motion), ("energy_left", energy)];
            for (name, size) in sizes {
                let [loaded, rest, again] = [1, 2, 3].map(|k| solved.measure(k, name));
                assert!(rest == 0.0, "{what}: {name} is {rest:e} at rest");
                assert!((again - loaded).abs() <= 1e-8 * size, "{what}: {name} {loaded:e} before and {again:e} after");
            }
        }
    }
}

#[test]
fn loads_that_are_small_are_no_rest() {
    // beside the step before they are rounding, and known exactly
    for method in ["penalty", "nitsche", "augmented_lagrangian"] {
        let [small, whole] = ["(if t == 2 then 1e-18 else 1)", "1"].map(|scale| unloaded(method, 1e5, "0.4", scale));
        let [small, whole] = [small, whole].map(|solved| solved.measure(2, "Fn"));
        assert!((small / whole / 1e-18 - 1.0).abs() < 1e-6, "{method}: {small:e} and {whole:e}");
    }
}

#[test]
fn bodies_of_finite_strain_come_to_rest() {
    let text = "use \"elasticity\"\nparam gamma = 1e6\nmesh box [0,0,0] to [1,1,1] cells [2,2,3] hex\n\
        region floor = faces where z == 0\nregion top = faces where z == 1\nunknown u : vector\n\
        energy body on all : Compressible_Neo_Hookean_Ciarlet_potential(Grad_u, [60; 40])\n\
        term contact on floor : -gamma*pos_part(-u(3))*Test_u(3)\n\
        fix u(1) = 0 on top\nfix u(2) = 0 on top\nfix u(3) = -0.1*abs(t - 2) on top\nsteps t = 0 to 4 by 1\n\
        measure F = reaction(u(3)) on top\nmeasure m = max(Norm(u)) on all\n";
    let solved = solve(&examples(), text.to_owned(), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert!(solved.outcome.converged());
    let [force, motion] = ["F", "m"].map(|name| solved.measure(2, name));
    assert!(force.abs() < 1e-10 && motion < 1e-12, "{force:e} {motion:e}");
    assert!((solved.measure(3, "F") / solved.measure(1, "F") - 1.0).abs() < 1e-8);
}
