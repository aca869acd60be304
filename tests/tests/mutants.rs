//! Mutated examples under the oracle of `wfl_tests::mutants`, and that the oracle sees what is wrong.

use std::time::Instant;

use wfl_compiler::InterpreterBackend;
use wfl_discrete::pruning::Pruning;
use wfl_run::{Quiet, RunOptions, StepResult, run};
use wfl_tests::{
    examples,
    mutants::{Mutant, Verdict, audit, idle_statements, judge, mutant, ready, seeds},
    side_by_side,
};

/// Mutants of the release suite.
const MUTANTS: u64 = 1000;

#[cfg_attr(debug_assertions, ignore = "a thousand mutants take a minute in the release suite")]
#[test]
fn what_is_solved_without_a_warning_is_right() {
    let seeds = seeds();
    let numbers: Vec<u64> = (0..MUTANTS).collect();
    let judged = side_by_side(&numbers, |number| {
        let mutant = mutant(&seeds, *number);
        let Verdict::Disagrees(why) = judge(&mutant, None) else { return None };
        Some(format!("mutant {number} of {} {:?}: {}", mutant.seed, mutant.changes, why.join("; ")))
    });
    let wrong: Vec<String> = judged.into_iter().flatten().collect();
    assert!(wrong.is_empty(), "{}\n`cargo run --release -p wfl-tests --bin mutants -- show NUMBER`", wrong.join("\n"));
}

/// A plate that is pulled, with more statements.
fn plate(more: &[&str]) -> Mutant {
    let lines = [
        "mesh box [0,0] to [1,1] cells [2,2] quad",
        "region west = faces where x == 0",
        "region east = faces where x == 1",
        "unknown u : scalar",
        "term bulk on all : (1 + u^2)*(Grad_u.Grad_Test_u)",
        "fix u = 0 on west",
        "load u = 0.1 on east",
        "measure end = max(u) on east",
    ];
    let statements = lines.iter().chain(more).map(|l| (*l).to_owned()).collect();
    Mutant { seed: "plate".to_owned(), folder: examples(), statements, changes: Vec::new() }
}

/// Its steps, whatever is warned of.
fn steps(mutant: &Mutant) -> Vec<StepResult> {
    let scene = ready(mutant, &InterpreterBackend, &[]).scene.expect("a scene");
    let outcome = run(&scene, &RunOptions::without_files(1, Instant::now()), &mut Quiet).expect("a run");
    assert!(outcome.converged());
    outcome.steps
}

#[test]
fn a_state_that_is_no_solution_is_seen() {
    let plate = plate(&[]);
    let right = steps(&plate);
    let looked = |steps: &[StepResult]| {
        let mut scene = ready(&plate, &InterpreterBackend, &Pruning::ALL).scene.expect("a scene");
        audit(&mut scene, steps).expect("finite terms").expect("no past")
    };
    let found = looked(&right);
    assert!(found.residual < 1e-9 && found.prescribed == 0.0 && found.measures == 0.0, "{found:?}");
    let mut wrong = right.clone();
    wrong[0].state.iter_mut().for_each(|v| *v *= 1.001);
    wrong[0].state.iter_mut().filter(|v| **v == 0.0).for_each(|v| *v = 1e-4);
    wrong[0].measures[0].1 *= 1.1;
    let found = looked(&wrong);
    assert!(found.residual > 1e-4 && found.prescribed > 1e-4 && found.measures > 0.05, "{found:?}");
}

#[test]
fn statements_without_a_part_are_seen() {
    for (more, idle) in [
        (&[][..], None),
        (&["fix u = 0 on west"], None),
        (&["fix u = 1 on west"], Some("fix u = 0 on west")),
        (&["load u = 3 on west"], Some("load u = 3 on west")),
        (&["unknown v : scalar", "fix v = 7 on all"], Some("fix v = 7 on all")),
        (&["start u = 0.1"], None),
        (&["param k = 2"], Some("param k = 2")),
        (&["param k = 2", "load u = k on all"], None),
        (&["region half = cells where x < 0.5", "term zero on half : 0*u*Test_u"], None),
        (&["output vtk \"a\" : u"], None),
    ] {
        let mutant = plate(more);
        let prepared = ready(&mutant, &InterpreterBackend, &[]);
        if idle.is_some() && !prepared.diagnostics.is_empty() {
            // what the program refuses or tells of needs no oracle
            continue;
        }
        assert!(prepared.scene.is_some(), "{more:?}");
        let found = idle_statements(&mutant, &steps(&mutant));
        match idle {
            None => assert!(found.is_empty(), "{more:?}: {found:?}"),
            Some(part) => assert!(found.iter().any(|f| f.ends_with(part)), "{more:?}: {found:?}"),
        }
    }
}
