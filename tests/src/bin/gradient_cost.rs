//! What derivatives cost beside their run: the time of a run with the gradient of a measure in several parameters, over that
//! of the run alone, as medians of runs in turn; and the memory that its steps take.
//!
//! `cargo run --release -p wfl-tests --bin gradient_cost [-- NAME]`

use std::{io::Write as _, time::Instant};

use wfl_jit::JitBackend;
use wfl_runtime::{
    Passed, Quiet, RunOptions, Trajectory,
    gradient::{Differentiated, Request, gradients},
    prepare, run,
};
use wfl_tests::{examples, script_and_messages};

/// Runs of each kind, in turn.
const ROUNDS: usize = 3;
/// Threads of each.
const THREADS: usize = 2;

/// A scene with replacements in its text, a result, and what it is differentiated in.
struct Case {
    name: &'static str,
    scene: &'static str,
    edits: &'static [(&'static str, &'static str)],
    result: &'static str,
    with: &'static str,
}

const CASES: [Case; 4] = [
    Case { name: "fault 8", scene: "fault/nitsche.wfl", edits: &[], result: "max_slip", with: "E, nu, fric, gamma" },
    Case {
        name: "fault 16",
        scene: "fault/nitsche.wfl",
        edits: &[("cells [8, 8, 8]", "cells [16, 16, 16]")],
        result: "max_slip",
        with: "E, nu, fric, gamma",
    },
    Case {
        name: "hyperelastic 16",
        scene: "hyperelastic/contact.wfl",
        edits: &[("cells [3,3,3]", "cells [16,16,16]")],
        result: "spread",
        with: "mu, lambda, gamma",
    },
    Case {
        name: "bp1, 50 years",
        scene: "friction/bp1.wfl",
        edits: &[("param years = 200", "param years = 50")],
        result: "surface",
        with: "sigma, b, f0, Dc",
    },
];

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Bytes of what is kept of the steps.
fn bytes(of: &Trajectory) -> usize {
    let of_step = |step: &wfl_runtime::PassedStep| {
        let states: usize = step.states.iter().map(Vec::len).sum();
        let rates =
            step.rates.as_ref().map_or(0, |r| r.fields().iter().flat_map(|of| &of.kept).map(Vec::len).sum::<usize>());
        step.u.len() + states + rates
    };
    8 * of.steps.iter().map(of_step).sum::<usize>()
}

fn main() {
    let only = std::env::args().nth(1);
    let mut out = std::io::stderr().lock();
    for case in CASES.iter().filter(|c| only.as_ref().is_none_or(|name| c.name.contains(name.as_str()))) {
        let file = examples().join(case.scene);
        let folder = file.parent().expect("a folder");
        let text = std::fs::read_to_string(&file).expect("an example");
        let edits: Vec<(&str, String)> = case.edits.iter().map(|(a, b)| (*a, (*b).to_owned())).collect();
        let (script, _, messages) = script_and_messages(folder, text, &edits, &[]);
        let script = script.unwrap_or_else(|| panic!("{messages}"));
        let backend = JitBackend::new().expect("machine code");
        let scene = prepare(&script, folder, &backend).scene.expect("a scene that can be solved");
        let request = Request::read(case.result, case.with).expect("names");
        let (mut alone, mut both, mut kept) = (Vec::new(), Vec::new(), (0, 0, 0, 0));
        for round in 0..2 * ROUNDS {
            let with = round % 2 == 1;
            let begin = Instant::now();
            let options = RunOptions { keep_trajectory: with, ..RunOptions::without_files(THREADS, begin) };
            let outcome = run(&scene, &options, &mut Quiet).expect("a run");
            if with {
                let of = Differentiated {
                    scene: &scene,
                    script: &script,
                    outcome: &outcome,
                    backend: &backend,
                    threads: THREADS,
                };
                let found = gradients(of, &request).unwrap_or_else(|d| panic!("{}", d.message));
                let trajectory = outcome.trajectory.as_ref().expect("its steps");
                let solved = trajectory.steps.iter().filter(|s| s.kind != Passed::Given).count();
                kept = (bytes(trajectory), solved, found.solutions, found.factorisations);
            }
            if with { &mut both } else { &mut alone }.push(begin.elapsed().as_secs_f64());
        }
        let (alone, both) = (median(alone), median(both));
        let (bytes, steps, solutions, factors) = kept;
        let _ = writeln!(
            out,
            "{}: run {alone:.2} s, with the gradient of {} in {} {both:.2} s, ratio {:.2}; {steps} steps in {:.1} MB, \
             {solutions} solutions, {factors} factors",
            case.name,
            case.result,
            case.with,
            both / alone,
            bytes as f64 / 1e6,
        );
    }
}
