//! Derivatives to one side where points are between two branches, against closed forms.

use std::path::Path;

use wfl_gradient::{Gradients, Request, gradients};
use wfl_tests::{driven::DRIVEN_BLOCKS, ran};

/// The driven blocks in coarser cells; they stick up to `d = 3 fric p/mu` and slip by the rest beyond. At the onset itself,
/// `d = 1.2e-3`, every point of the interface is between stick and slip.
fn blocks(form: &str) -> String {
    let text = DRIVEN_BLOCKS.replace("cells [6,2]", "cells [3,1]");
    text.replace("param d = 3e-3", "param d = 1.2e-3\nparam gamma = 2e5") + form
}

/// Nitsche's method with the whole drive at once.
const NITSCHE: &str = "def overlap = 0
def drive = d
def pressed = gamma*(apart.Normal) - traction(uL).Normal
def sheared = gamma*tangential(apart) - tangential(traction(uL))
term contact on joint : (pos_part(pressed)*Normal + Ball_projection(sheared, fric*pos_part(pressed))).test_apart
";

/// Friction by increments, forward by d and back to d/4.
const INCREMENTS: &str = "def overlap = 0
def drive = d*(1 - abs(1 - t))
def past = tangential(Previous_uL - Interpolate(Previous_uR, neighbor_element))
def pressed = gamma*(apart.Normal) - traction(uL).Normal
def sheared = gamma*(tangential(apart) - past) - tangential(traction(uL))
term contact on joint : (pos_part(pressed)*Normal + Ball_projection(sheared, fric*pos_part(pressed))).test_apart
steps t = 0 to 1.75 by 0.25
";

/// A penalty with the slip as a state, forward and back.
const PENALTY: &str = "def overlap = p/gamma
def drive = d*(1 - abs(1 - t))
def pressed = gamma*(apart.Normal)
def sheared = gamma*(tangential(apart) - Previous_slipped)
def resisting = Ball_projection(sheared, fric*pos_part(pressed))
state slipped : vector on joint := tangential(apart) - resisting/gamma
term contact on joint : (pos_part(pressed)*Normal + resisting).test_apart
steps t = 0 to 1.75 by 0.25
";

fn found(text: &str, params: &[(&str, f64)], results: &str, with: &str) -> Result<Gradients, String> {
    let mut request = Request::read(results, with).expect("lists of names");
    request.read_sides(with).expect("sides");
    ran((Path::new("."), text.to_owned()), &[], params, |of| gradients(of, &request)).map(|(_, found)| found)
}

fn of(text: &str, params: &[(&str, f64)], results: &str, with: &str) -> Gradients {
    found(text, params, results, with).unwrap_or_else(|told| panic!("{told}"))
}

/// The derivatives to larger and to smaller values.
fn sides(of: &Gradients, result: &str, parameter: &str) -> [f64; 2] {
    let result = of.results.iter().find(|r| r.name == result).expect("a result");
    let sides = result.sides.iter().find(|s| s.parameter == parameter).expect("a parameter");
    [sides.larger[0], sides.smaller[0]]
}

fn check(of: &Gradients, result: &str, parameter: &str, closed: [f64; 2], size: f64) {
    let have = sides(of, result, parameter);
    for (have, closed) in have.iter().zip(closed) {
        assert!((have - closed).abs() < 1e-9 * size, "{result} by {parameter}: {have} and not {closed}");
    }
}

#[test]
fn at_the_onset_of_slip_both_sides_are_those_of_the_closed_form() {
    // slip = max(0, d - 3 F p/mu), shear = min(F p, mu d/3)
    let found = of(&blocks(NITSCHE), &[], "slip, shear", "fric, d, p, E");
    assert!(found.near.iter().any(|near| near.kind == "are between stick and slip"), "{:?}", found.near);
    check(&found, "slip", "fric", [0.0, -3e-3], 3e-3);
    check(&found, "slip", "d", [1.0, 0.0], 1.0);
    check(&found, "slip", "p", [0.0, -1.2e-4], 1.2e-4);
    check(&found, "slip", "E", [4.8e-8, 0.0], 4.8e-8);
    check(&found, "shear", "fric", [0.0, 10.0], 10.0);
    check(&found, "shear", "d", [0.0, 1e4 / 3.0], 1e4);
    check(&found, "shear", "p", [0.0, 0.4], 0.4);
}

#[test]
fn away_from_kinks_both_sides_are_the_derivative() {
    for (d, form) in [(3e-3, NITSCHE), (1e-3, NITSCHE), (3e-3, INCREMENTS), (3e-3, PENALTY)] {
        let found = of(&blocks(form), &[("d", d)], "slip, shear", "fric, d, E");
        for result in &found.results {
            for (parameter, entries) in &result.parameters {
                // a derivative that is zero, against the value over the parameter
                let size = entries[0].abs().max(1e-6);
                check(&found, &result.name, parameter, [entries[0]; 2], size);
            }
        }
    }
}

#[test]
fn what_goes_with_a_direction_in_one_step_is_followed_through_the_next_ones() {
    // kept = max(0, d - 3 F p/mu) at t = 1, shear = mu/3 (d/4 - kept) at the end
    let found = of(&blocks(INCREMENTS), &[], "shear, slip", "fric, d");
    check(&found, "shear", "d", [-2500.0, 1e4 / 12.0], 2500.0);
    check(&found, "shear", "fric", [0.0, 10.0], 10.0);
    check(&found, "slip", "d", [1.0, 0.0], 1.0);
    check(&found, "slip", "fric", [0.0, -3e-3], 3e-3);
    // of a penalty, with c = 3/mu + 1/gamma: onset at d = c F p, and shear = (d/4 - kept)/c
    let (gamma, p, fric) = (1e6, 10.0, 0.4);
    let c = 3.0 / 1e4 + 1.0 / gamma;
    let found = of(&blocks(PENALTY), &[("gamma", gamma), ("d", c * fric * p)], "shear", "fric, d");
    check(&found, "shear", "d", [-0.75 / c, 0.25 / c], 1.0 / c);
    check(&found, "shear", "fric", [0.0, p], p);
}

/// One number `u` for each node of a segment, without neighbours.
fn number(law: &str, p: f64) -> String {
    format!(
        "wfl 1\nparam p = {p}\nmesh box [0] to [1] cells [1] segment\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
         unknown u : scalar\n\
         term law on all : ({law})*Test_u\nquadrature on all vertex\nmeasure m = mean(u) on all\n"
    )
}

#[test]
fn a_gap_that_just_closes() {
    // u = p without contact for p < 0, u + 3 u = p with it
    let found = of(&number("u + 3*pos_part(u) - p", 0.0), &[], "m", "p");
    check(&found, "m", "p", [0.25, 1.0], 1.0);
}

#[test]
fn one_side_may_have_no_solution_and_the_other_two() {
    // u - 2 max(u, 0) = p: none for p > 0, u = p and u = -p for p < 0
    let text = number("u - 2*pos_part(u) - p", 0.0);
    let told = found(&text, &[], "m", "p").expect_err("none");
    assert!(told.contains("E470") && told.contains("no choice of them was found"), "{told}");
    let mut request = Request::read("m", "p").expect("names");
    request.read_sides("-p").expect("a side");
    let found = ran((Path::new("."), text), &[], &[], |of| gradients(of, &request)).expect("derivatives").1;
    assert!(found.notes.iter().any(|note| note.contains("more than one choice of branches")), "{:?}", found.notes);
}

#[test]
fn the_tip_of_the_cone_of_friction_is_a_branch_of_its_own() {
    // a point that nothing presses and nothing moves: both are cones, so that what it moves by is their projection
    let text = "wfl 1\nparam p = 0\nparam q = 0\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\n\
        unknown w : vector(2)\n\
        term press on all : (u - p)*Test_u\n\
        term slide on all : (w - [q, 0] + Ball_projection(w, 0.5*pos_part(u))).Test_w\n\
        quadrature on all vertex\nmeasure m = mean(w(1)) on all\nparam pull = 0\n";
    let text = text.replace("[q, 0]", "[q + 3*p, 0]").replace("param pull = 0\n", "");
    let found = of(&text, &[], "m", "p, q");
    // w + P(w, u/2) = 3 p with u = p: slips by 2.5 p; for less nothing presses
    check(&found, "m", "p", [2.5, 3.0], 1.0);
    // without a force there is no friction: w = q
    check(&found, "m", "q", [1.0, 1.0], 1.0);
}

#[test]
fn largest_values_absolute_values_and_norms_of_zero() {
    let text = number("u - p*x", 0.0).replace("mean(u) on all", "max(u) on all");
    let text = format!("{text}measure least = min(u) on all\nmeasure size = mean(abs(u)) on all\n");
    let text = format!("{text}measure norm = mean(Norm([u, 2*u])) on all\n");
    let found = of(&text, &[], "m, least, size, norm", "p");
    check(&found, "m", "p", [1.0, 0.0], 1.0);
    check(&found, "least", "p", [0.0, 1.0], 1.0);
    let mean = sides(&found, "size", "p");
    assert!((mean[0] - 0.5).abs() < 1e-12 && (mean[1] + 0.5).abs() < 1e-12, "{mean:?}");
    let norm = 5f64.sqrt() / 2.0;
    check(&found, "norm", "p", [norm, -norm], 1.0);
}

#[test]
fn a_number_between_two_branches_is_told() {
    let text = format!("{}measure twice = if m > 1 then 3*m else m + 2\n", number("u - p", 1.0));
    let told = found(&text, &[], "twice", "p").expect_err("refused");
    assert!(told.contains("E470") && told.contains("between two branches of its own"), "{told}");
}
