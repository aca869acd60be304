//! The fault scenes of the examples on meshes of any size, and runs of them that are timed iteration by iteration.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use wfl::{Loader, SourceId};
use wfl_discrete::system::{Branches, Tangent};
use wfl_linear::LinearSolver;
use wfl_newton::Iteration;
use wfl_output::peak_memory_bytes;
use wfl_problem::Scene;
use wfl_run::{Outcome, Progress, RunOptions, run};
use wfl_sparse::solve::{SolveReport, SolverOptions};

use crate::{clock, common};

/// Cells of the mesh in the files of the examples.
const CELLS: &str = "cells [8, 8, 8]";

/// Reads the files of the fault with other cells.
struct Fault {
    folder: PathBuf,
    cells: [usize; 3],
}

impl Fault {
    fn read(&self, path: &str) -> Result<String, String> {
        let file = self.folder.join(path);
        let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        Ok(text.replace(CELLS, &format!("cells {:?}", self.cells)))
    }
}

impl Loader for Fault {
    fn load(&mut self, path: &str, _from: SourceId) -> Result<(String, String), wfl::Unloaded> {
        Ok((path.to_owned(), self.read(path)?))
    }
}

/// The fault with one of its methods, a file of the examples without its ending.
pub(crate) fn scene(method: &str, cells: [usize; 3]) -> Result<Scene, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/fault");
    let mut fault = Fault { folder, cells };
    let text = fault.read(&format!("{method}.wfl"))?;
    common::scene(method, text, &mut fault)
}

/// Processor time at each iteration of a run.
struct Clock {
    at: Vec<(usize, Duration)>,
}

impl Progress for Clock {
    fn iteration(&mut self, iteration: &Iteration) {
        self.at.push((iteration.number, clock::processor_time().unwrap_or_default()));
    }
}

/// What a run on one thread costs.
#[derive(Clone, Copy)]
pub(crate) struct Cost {
    pub(crate) unknowns: f64,
    /// Seconds of processor time up to the end of the first iteration, without an ordinary iteration.
    pub(crate) set_up: f64,
    /// Seconds of processor time of an iteration after the first, the mean of all.
    pub(crate) iteration: f64,
    pub(crate) iterations: f64,
    /// Krylov iterations within them.
    pub(crate) krylov: f64,
    pub(crate) factorisations: f64,
    pub(crate) seconds: f64,
    /// Largest memory of the process, bytes.
    pub(crate) memory: f64,
}

impl Cost {
    /// Runs all steps on one thread.
    pub(crate) fn measure(method: &str, cells: [usize; 3]) -> Result<Self, String> {
        let begin = clock::processor_time().unwrap_or_default();
        let scene = scene(method, cells)?;
        let mut clock = Clock { at: Vec::new() };
        let outcome =
            run(&scene, &RunOptions::without_files(1, Instant::now()), &mut clock).map_err(|e| e.to_string())?;
        let end = clock::processor_time().unwrap_or_default();
        // Between neighbouring calls within a step lies one iteration; the very first one also sets up.
        let spans: Vec<f64> =
            clock.at.windows(2).filter(|w| w[1].0 > 0).map(|w| (w[1].1 - w[0].1).as_secs_f64()).collect();
        let (_, later) = spans.split_first().ok_or("no iteration")?;
        let iteration = later.iter().sum::<f64>() / later.len().max(1) as f64;
        let solves = || outcome.steps.iter().flat_map(|step| &step.history.solves);
        Ok(Self {
            unknowns: outcome.report.dofs as f64,
            set_up: (clock.at[1].1 - begin).as_secs_f64() - iteration,
            iteration,
            iterations: spans.len() as f64,
            krylov: solves().map(|report| report.krylov_iterations).sum::<usize>() as f64,
            factorisations: outcome.report.factorisations as f64,
            seconds: (end - begin).as_secs_f64(),
            memory: peak_memory_bytes().unwrap_or_default() as f64,
        })
    }

    /// The numbers, for another process.
    pub(crate) fn to_line(self) -> String {
        let Self { unknowns, set_up, iteration, iterations, krylov, factorisations, seconds, memory } = self;
        [unknowns, set_up, iteration, iterations, krylov, factorisations, seconds, memory]
            .map(|x| x.to_string())
            .join(" ")
    }

    /// What [`Cost::to_line`] wrote.
    pub(crate) fn from_line(line: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = line.split_whitespace().map_while(|word| word.parse().ok()).collect();
        let [unknowns, set_up, iteration, iterations, krylov, factorisations, seconds, memory] = numbers[..] else {
            return Err(format!("not the numbers of a run: {line}"));
        };
        Ok(Self { unknowns, set_up, iteration, iterations, krylov, factorisations, seconds, memory })
    }
}

/// A solver, and two states whose tangents it is given in turn.
pub(crate) struct Alternating {
    scene: Scene,
    solver: LinearSolver,
    tangent: Tangent,
    states: [Vec<f64>; 2],
    rhs: Vec<f64>,
    threads: usize,
    turn: usize,
}

fn options(threads: usize) -> SolverOptions {
    SolverOptions { threads, ..SolverOptions::default() }
}

impl Alternating {
    /// Solves the scene for its states, then prepares a solver with factored bulk.
    pub(crate) fn new(method: &str, cells: [usize; 3], threads: usize) -> Result<Self, String> {
        let scene = scene(method, cells)?;
        let run_options = RunOptions { keep_states: true, ..RunOptions::without_files(threads, Instant::now()) };
        let Outcome { steps, .. } = run(&scene, &run_options, &mut wfl_run::Quiet).map_err(|e| e.to_string())?;
        let [.., before, last] = steps.as_slice() else { return Err("two steps are needed".to_owned()) };
        let states = [before.state.clone(), last.state.clone()];
        let solver = LinearSolver::new(&scene.system, options(threads)).map_err(|e| e.to_string())?;
        let tangent = scene.system.new_tangent();
        let n = scene.system.numbering.n_free();
        let rhs = (0..n).map(|dof| ((dof % 7) as f64 - 3.0) * 1e-3).collect();
        Ok(Self { scene, solver, tangent, states, rhs, threads, turn: 0 })
    }

    /// Sets the solver up and solves once: bulk factored, what is found once for the contact, first factor.
    pub(crate) fn set_up(&mut self) -> Result<SolveReport, String> {
        self.solver = LinearSolver::new(&self.scene.system, options(self.threads)).map_err(|e| e.to_string())?;
        self.next(0.0)
    }

    /// The tangent at the other state, and a solution with it that leaves at most `tolerance` of the right-hand side.
    pub(crate) fn next(&mut self, tolerance: f64) -> Result<SolveReport, String> {
        self.turn = 1 - self.turn;
        let (system, state) = (&self.scene.system, &self.states[self.turn]);
        system.tangent(state, Branches::AsWritten, &mut self.tangent).map_err(|e| e.to_string())?;
        self.solver.update(system, &self.tangent, true).map_err(|e| e.to_string())?;
        let mut x = Vec::new();
        self.solver.solve(&self.rhs, &mut x, tolerance).map_err(|e| e.to_string())
    }

    /// The matrix of the linear terms, free dofs only.
    pub(crate) fn bulk(&self) -> &wfl_sparse::csr::Csr {
        self.scene.system.bulk()
    }
}
