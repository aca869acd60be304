//! Conjugate gradients with multigrid on the tangents of nonlinear bodies against factors: the same iterations of Newton, the
//! same measures, the same bits for any number of threads; and what takes its place where it does not serve.

use std::time::Instant;

use wfl_run::{Outcome, RunOptions};
use wfl_tests::{attempt_with, examples};

/// What a body is made of, and how it is held.
struct Body<'a> {
    /// Corner of the box, and its cells.
    size: &'a str,
    cells: &'a str,
    space: &'a str,
    nu: f64,
    /// Loads and prescribed values.
    held: &'a str,
    steps: &'a str,
}

/// A neo-Hookean body between the faces `low` and `high`.
fn text(body: &Body<'_>, linear: &str) -> String {
    let Body { size, cells, space, nu, held, steps } = body;
    format!(
        "wfl 1\nparam E = 10\nparam nu = {nu} in 0..0.4999\ndef mu = E/(2*(1 + nu))\n\
         def lambda = E*nu/((1 + nu)*(1 - 2*nu))\nmesh box [0,0,0] to {size} cells {cells}\n\
         region low = faces where z == 0\nregion high = faces where z == 1\nunknown u : vector {space}\n\
         steps t = {steps}\ndef F = Id(3) + Grad_u\n\
         def P = mu*(F - Inv(F)') + lambda*log(Det(F))*Inv(F)'\nterm elastic on all : P:Grad_Test_u\n{held}\
         measure stored = integral(mu/2*(F:F - 3 - 2*log(Det(F))) + lambda/2*log(Det(F))^2) on all\n\
         measure far = max(Norm(u)) on all\nmeasure mean = mean(u.u) on all\nsolver linear with {linear}\n"
    )
}

/// One end comes nearer and is sheared.
const MOVED: &str = "fix u = [0,0,0] on low\nfix u = [t,0,-0.5*t] on high\n";
/// Forces on one end.
const PULLED: &str = "fix u = [0,0,0] on low\nload u = [2*t,t,6*t] on high\n";

const BLOCK: Body<'_> =
    Body { size: "[1,1,1]", cells: "[9,9,9] hex", space: "Q1", nu: 0.3, held: MOVED, steps: "0.1 to 0.2 by 0.1" };

fn outcome(text: &str, threads: usize) -> Outcome {
    let options = RunOptions::without_files(threads, Instant::now());
    let tried = attempt_with(&options, &examples(), text.to_owned(), &[], &[]);
    let outcome = tried.solved.unwrap_or_else(|| panic!("{}", tried.messages)).outcome;
    assert!(outcome.converged(), "{:?}", outcome.report.solver);
    outcome
}

/// The solver in words, Newton's iterations by step, and measures by step.
fn told(outcome: &Outcome) -> (String, Vec<usize>, Vec<Vec<f64>>) {
    let iterations = |step: &wfl_run::StepResult| step.history.iterations.last().map_or(0, |last| last.number);
    let values = |step: &wfl_run::StepResult| step.measures.iter().map(|(_, value)| *value).collect();
    (
        outcome.report.solver.clone().unwrap_or_default(),
        outcome.steps.iter().map(iterations).collect(),
        outcome.steps.iter().map(values).collect(),
    )
}

/// Iterations of conjugate gradients for a solution, on average.
fn for_a_solution(outcome: &Outcome) -> f64 {
    let solves: Vec<usize> =
        outcome.steps.iter().flat_map(|step| &step.history.solves).map(|solve| solve.krylov_iterations).collect();
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let mean = solves.iter().sum::<usize>() as f64 / solves.len().max(1) as f64;
    mean
}

/// The iteration has the iterations of Newton that a factor has, and its measures to `within` of their size; the solver in words.
fn agrees(body: &Body<'_>, within: f64) -> String {
    let [factor, iteration] = ["direct", "cg, amg"].map(|linear| told(&outcome(&text(body, linear), 2)));
    assert!(!factor.0.contains("multigrid") && iteration.0.contains("multigrid"), "{} / {}", factor.0, iteration.0);
    assert_eq!(factor.1, iteration.1, "{}", iteration.0);
    for (a, b) in factor.2.iter().flatten().zip(iteration.2.iter().flatten()) {
        assert!((a - b).abs() <= within * a.abs(), "{a:e} with a factor, {b:e} by iteration ({})", iteration.0);
    }
    iteration.0
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn hexahedra_and_quadratic_tetrahedra_have_the_measures_of_factors() {
    for (cells, space) in [("[9,9,9] hex", "Q1"), ("[5,4,4] tet", "P2"), ("[4,4,4] hex", "Q2")] {
        for held in [MOVED, PULLED] {
            let solver = agrees(&Body { cells, space, held, ..BLOCK }, 1e-9);
            assert_eq!(solver.contains("without a matrix"), space != "Q1", "{solver}");
            assert!(solver.contains("unknowns by level: ") && solver.contains(", "), "{solver}");
            assert!(!solver.contains("in place of"), "{solver}");
        }
    }
}

#[test]
fn contact_without_friction_has_symmetric_tangents_too() {
    let held = "fix u = [0,0,0] on low\nload u = [0,0,6*t] on high\n\
                term wall on high : 1000*pos_part(u(3) - 0.03)*Test_u(3)\n";
    let solver = agrees(&Body { held, ..BLOCK }, 1e-9);
    assert!(!solver.contains("in place of"), "{solver}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn the_bits_are_those_of_any_number_of_threads() {
    let text = text(&Body { cells: "[5,4,4] tet", space: "P2", held: PULLED, ..BLOCK }, "cg, amg");
    let [one, others @ ..] = [1, 2, 3, 7].map(|threads| told(&outcome(&text, threads)));
    assert!(one.0.contains("without a matrix"), "{}", one.0);
    others.iter().for_each(|other| assert_eq!(&one, other));
}

/// Two bodies, of which one is linear, on a bed; a wall that pushes; a body that gives way as it is strained, and remembers how far
/// it was.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn tangents_without_a_matrix_have_the_measures_of_factors() {
    let two = "region near = cells where z < 0.5\nregion far = all - near\n\
               term more on far : (3*Div_u*Id(3) + 4*Sym(Grad_u)):Grad_Test_u\nterm bed on near : (1 + u.u)*u.Test_u\n";
    let wall = "term wall on high : 1000*pos_part(u(3) - 0.03)*Test_u(3)\n";
    let gives_way = "def e = Norm(Sym(Grad_u))\nstate most : scalar on all := max(most, e)\n\
                     term more on all : (1 + 3*exp(0 - 4*e) + 2*most)*Sym(Grad_u):Sym(Grad_Test_u)\n";
    for more in [two, wall, gives_way] {
        let held = format!("{PULLED}{more}");
        let solver = agrees(&Body { cells: "[5,4,4] tet", space: "P2", held: &held, ..BLOCK }, 1e-9);
        assert!(solver.contains("without a matrix") && !solver.contains("in place of"), "{more}: {solver}");
    }
}

/// A column under several times the load at which it buckles: the straight state has directions of negative energy.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_factor_takes_over_where_tangents_are_not_positive_definite() {
    let held = "fix u = [0,0,0] on low\nfix u = [0,0,-0.2*t] on high\n";
    for (cells, space) in [("[3,3,60] hex", "Q1"), ("[2,2,20] hex", "Q2")] {
        let body = Body { size: "[0.06,0.06,1]", cells, space, held, steps: "0.5 to 1 by 0.5", ..BLOCK };
        let solver = agrees(&body, 1e-8);
        assert!(solver.contains("a factor in place of conjugate gradients with multigrid"), "{solver}");
    }
}

/// Bodies that are nearly incompressible, cells ten and a hundred times as long as wide: an answer, and a word where it is a
/// factor's.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn hard_bodies_converge_or_say_what_took_over() {
    let of = |size, cells, space, nu| Body { size, cells, space, nu, held: PULLED, ..BLOCK };
    for body in [
        of("[1,1,1]", "[5,4,4] tet", "P2", 0.49),
        of("[1,1,1]", "[9,9,9] hex", "Q1", 0.49),
        of("[10,10,1]", "[9,9,9] hex", "Q1", 0.3),
        of("[10,10,1]", "[5,5,5] tet", "P2", 0.3),
        of("[100,100,1]", "[9,9,9] hex", "Q1", 0.3),
    ] {
        agrees(&body, 1e-7);
    }
}

#[test]
fn a_plane_body_is_iterated_on_request() {
    let scene = |linear: &str| {
        format!(
            "wfl 1\nmesh box [0,0] to [2,1] cells [60,30] quad\nregion low = faces where x == 0\n\
             region high = faces where x == 2\nunknown u : vector\nsteps t = 0.1 to 0.2 by 0.1\ndef F = Id(2) + Grad_u\n\
             term elastic on all : (4*(F - Inv(F)') + 6*log(Det(F))*Inv(F)'):Grad_Test_u\nfix u = [0,0] on low\n\
             load u = [2*t,t] on high\nmeasure far = max(Norm(u)) on all\nmeasure mean = mean(u.u) on all\n\
             solver linear with {linear}\n"
        )
    };
    let [factor, iteration] = ["direct", "cg, amg"].map(|linear| told(&outcome(&scene(linear), 2)));
    assert!(iteration.0.contains("multigrid") && !iteration.0.contains("in place of"), "{}", iteration.0);
    assert_eq!(factor.1, iteration.1);
    for (a, b) in factor.2.iter().flatten().zip(iteration.2.iter().flatten()) {
        assert!((a - b).abs() <= 1e-9 * a.abs(), "{a:e} with a factor, {b:e} by iteration");
    }
}

/// Four times as many unknowns, and a level more, take hardly more iterations for a solution.
#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn iterations_hardly_grow_with_refinement() {
    for (kind, space, coarse, fine) in [("hex", "Q1", 10, 16), ("tet", "P2", 5, 8)] {
        let [few, many] = [coarse, fine].map(|n| {
            let cells = format!("[{n},{n},{n}] {kind}");
            let made = outcome(&text(&Body { cells: &cells, space, held: PULLED, ..BLOCK }, "cg, amg"), 2);
            let solver = made.report.solver.clone().unwrap_or_default();
            assert!(!solver.contains("in place of"), "{solver}");
            for_a_solution(&made)
        });
        assert!(few > 0.0 && many <= 1.3 * few, "{kind}: {few} iterations for a solution, then {many}");
    }
}
