//! The error representation against differences that were computed without it.

use std::{path::Path, time::Instant};

use wfl::{NoFiles, SourceMap, resolve};
use wfl_compiler::InterpreterBackend;
use wfl_problem::prepare;
use wfl_run::{Quiet, RunOptions, run};

use super::*;

fn solved(text: &str) -> Solved {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", text.to_owned());
    let script = resolve(&mut sources, main, &mut NoFiles, &[]).value.expect("a script");
    let made = prepare(&script, Path::new("."), &InterpreterBackend);
    let scene = made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics));
    let outcome = run(&scene, &RunOptions::without_files(1, Instant::now()), &mut Quiet).expect("a run");
    let outputs = script.outputs.clone();
    Solved { script, outputs, scene, outcome }
}

/// Diffusion and transport, whose matrix is not symmetric: the transposed one solves the adjoint problem.
fn transport(cells: &str, element: &str, more: &str) -> Solved {
    solved(&format!(
        "mesh box [0,0] to [1,1] cells {cells}\nunknown u : scalar {element}\n\
         term law on all : Grad_u.Grad_Test_u + 8*Grad_u(1)*Test_u - (1 + x*y)*Test_u\n{more}"
    ))
}

const CLAMPED: &str = "fix u = 0 on boundary\nmeasure M = integral((x + 2*y)*u) on all\n";

#[test]
fn the_products_sum_up_to_the_difference_of_a_measure() {
    for (cells, elements) in [("[3,4] tri", ["P1", "P2"]), ("[3,4] quad", ["Q2", "Q3"])] {
        let [coarse, rich] = elements.map(|element| transport(cells, element, CLAMPED));
        let value = |run: &Solved| run.outcome.steps[0].measures[0].1;
        let difference = value(&rich) - value(&coarse);
        let pair = Pair { coarse: &coarse, rich: &rich };
        let state = &rich.outcome.steps[0].state;
        let embedded = pair.embedded(state).expect("the same mesh");
        let at = |unknowns| StateAt {
            system: &rich.outcome.equations.system,
            window: wfl_discrete::window::Window::default(),
            unknowns,
        };
        let goal = pair.goal("M", &InterpreterBackend, [&embedded, state], &at).expect("a derivative");
        let adjoint = adjoint(&rich.outcome.equations.system, state, goal, 1).expect("a solution");
        let sum: f64 = pair.products(&embedded, &adjoint).expect("products").iter().sum();
        assert!(difference.abs() > 1e-6 && (sum / difference - 1.0).abs() < 1e-8, "{cells}: {sum:e} {difference:e}");
        // as parts of cells they lose their signs, and nothing else
        let parts = pair.indicator("M", &InterpreterBackend, 1).expect("an indicator").parts;
        let all: f64 = parts.iter().flatten().sum();
        assert!(all >= difference.abs() * (1.0 - 1e-8) && all < 100.0 * difference.abs(), "{all:e} {difference:e}");
    }
}

#[test]
fn a_solution_of_one_direction_has_its_error_in_that_direction() {
    let more = "region ends = faces where x == 0 or x == 1\nfix u = 0 on ends\n";
    let one = |element| {
        solved(&format!(
            "mesh box [0,0] to [1,1] cells [3,4] quad\nunknown u : scalar {element}\n\
             term law on all : Grad_u.Grad_Test_u - x^2*Test_u\n{more}"
        ))
    };
    let [coarse, rich] = [one("Q1"), one("Q2")];
    for quantity in ["L2", "H1"] {
        let found = Pair { coarse: &coarse, rich: &rich }.indicator(quantity, &InterpreterBackend, 1);
        let parts = found.expect("an indicator").parts;
        let along = |d: usize| parts.iter().map(|p| p[d]).sum::<f64>();
        assert!(along(0) > 0.0 && along(1) < 1e-9 * along(0), "{quantity}: {:e} {:e}", along(0), along(1));
    }
}

#[test]
fn a_quantity_without_a_derivative_is_marked_by_gradients() {
    let more = "region ends = faces where x == 0 or x == 1\nfix u = 0 on ends\n\
                measure M = integral(if u >= 0.01 then 1 else 0) on all\n";
    let [coarse, rich] = ["P1", "P2"].map(|element| transport("[3,4] tri", element, more));
    let found = Pair { coarse: &coarse, rich: &rich }.indicator("M", &InterpreterBackend, 1);
    assert!(found.expect("an indicator").parts.iter().flatten().sum::<f64>() > 0.0);
}
