//! What derivatives cost beside their run: the time of a run with the gradient of a measure in several parameters, over that
//! of the run alone, as medians of runs in turn; and the memory that its steps take.

use std::time::Instant;

use wfl_gradient::{Differentiated, Request, gradients};
use wfl_jit::JitBackend;
use wfl_problem::prepare;
use wfl_run::{Passed, PassedStep, Quiet, RunOptions, run};

use crate::{examples, script_and_messages};

/// Pairs of runs, in turn, at least; and seconds that all of them take at least: what another program takes of a machine
/// comes and goes in less.
const ROUNDS: usize = 3;
const SECONDS: f64 = 8.0;
/// Threads of each.
const THREADS: usize = 2;

/// A scene with replacements in its text, a result, and what it is differentiated in.
pub struct Case {
    /// Its name.
    pub name: &'static str,
    scene: &'static str,
    edits: &'static [(&'static str, &'static str)],
    /// The measure.
    pub result: &'static str,
    /// The parameters.
    pub with: &'static str,
}

/// The scenes that are timed.
pub const CASES: [Case; 4] = [
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

/// What was measured of a case: medians of seconds and of their ratios, and what the last gradient took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Seconds of the run alone.
    pub alone: f64,
    /// Seconds of the run with the gradient.
    pub both: f64,
    /// Seconds of a run with the gradient over those of the run before it.
    pub ratio: f64,
    /// Bytes of the steps that are kept.
    pub bytes: u64,
    /// Steps that were solved.
    pub steps: usize,
    /// Solutions with the transposed tangent.
    pub solutions: usize,
    /// Factors of it.
    pub factors: usize,
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Times a case.
///
/// # Panics
/// If it does not run.
#[must_use]
pub fn cost(case: &Case) -> Cost {
    let file = examples().join(case.scene);
    let folder = file.parent().expect("a folder");
    let text = std::fs::read_to_string(&file).expect("an example");
    let edits: Vec<(&str, String)> = case.edits.iter().map(|(a, b)| (*a, (*b).to_owned())).collect();
    let (script, _, messages) = script_and_messages(folder, text, &edits, &[]);
    let script = script.unwrap_or_else(|| panic!("{messages}"));
    let backend = JitBackend::new().expect("machine code");
    let scene = prepare(&script, folder, &backend).scene.expect("a scene that can be solved");
    let request = Request::read(case.result, case.with).expect("names");
    let (mut alone, mut both, mut made) = (Vec::new(), Vec::new(), Cost::default());
    let start = Instant::now();
    let mut with = false;
    while with || both.len() < ROUNDS || start.elapsed().as_secs_f64() < SECONDS {
        let begin = Instant::now();
        let options = RunOptions { keep_trajectory: with, ..RunOptions::without_files(THREADS, begin) };
        let outcome = run(&scene, &options, &mut Quiet).expect("a run");
        if with {
            let (script, outcome, backend) = (&script, &outcome, &backend);
            let of = Differentiated { scene: &scene, script, outcome, backend, threads: THREADS };
            let found = gradients(of, &request).unwrap_or_else(|d| panic!("{}", d.message));
            let steps = || outcome.trajectory.iter().flat_map(|t| &t.steps).map(AsRef::<PassedStep>::as_ref);
            made.bytes = steps().map(PassedStep::bytes).sum();
            made.steps = steps().filter(|s| s.kind != Passed::Given).count();
            (made.solutions, made.factors) = (found.solutions, found.factorisations);
        }
        if with { &mut both } else { &mut alone }.push(begin.elapsed().as_secs_f64());
        with = !with;
    }
    let ratios = both.iter().zip(&alone).map(|(both, alone)| both / alone).collect();
    Cost { alone: median(alone), both: median(both), ratio: median(ratios), ..made }
}
