//! How a scene is run: what is said of a run before it begins.

use std::{path::PathBuf, time::Instant};

use wfl_discrete::pruning::Saving;
use wfl_output::{About, Hash, OrderedMap};
use wfl_problem::Scene;
use wfl_sparse::solve::{Linked, Precision, SolverOptions};

/// How a scene is run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The scene's name: its file without folder and ending.
    pub name: String,
    /// Where results go; `None` writes nothing.
    pub out: Option<PathBuf>,
    /// Go on from the checkpoint in `out`, if there is one.
    pub resume: bool,
    /// The texts of the scene by name: results are only good for their own.
    pub texts: OrderedMap<Hash>,
    /// What else was given that changes numbers, by name: knobs, prunings that are put back.
    pub settings: OrderedMap<String>,
    /// Threads of assembly and solver.
    pub threads: usize,
    /// Precision of the factor of the matrix of the contact forces.
    pub precision: Precision,
    /// A library that solves linear systems in place of our own solvers.
    pub library: Option<Linked>,
    /// Version of the program.
    pub version: String,
    /// Seconds spent on parsing before.
    pub parse_seconds: f64,
    /// Seconds spent on looking at the scene before.
    pub check_seconds: f64,
    /// Start of the process.
    pub started: Instant,
    /// Warnings to keep in the report.
    pub warnings: Vec<String>,
    /// What the report says about the scene.
    pub about: About,
    /// What the report says about savings, measured before.
    pub savings: Vec<Saving>,
    /// The unknowns of every step stay in memory, not only those of the last one.
    pub keep_states: bool,
    /// Every step stays in memory with all that derivatives of results need: [`super::Outcome::trajectory`].
    pub keep_trajectory: bool,
    /// What these steps may take in memory: beyond it the first ones are computed again when they are needed.
    pub trajectory_bytes: Option<u64>,
    /// Numbers of the steps whose outputs stay in memory, see [`super::Outcome::kept`].
    pub keep_outputs: Vec<usize>,
    /// Converged states are judged: digits, equilibrium, conditions of contact. Runs on the way to another one need none.
    pub judge: bool,
}

impl RunOptions {
    /// A run that writes no files and keeps the unknowns of its last step only.
    #[must_use]
    pub fn without_files(threads: usize, started: Instant) -> Self {
        Self {
            name: String::new(),
            out: None,
            resume: false,
            texts: OrderedMap::new(),
            settings: OrderedMap::new(),
            threads,
            precision: Precision::Auto,
            library: None,
            version: String::new(),
            parse_seconds: 0.0,
            check_seconds: 0.0,
            started,
            warnings: Vec::new(),
            about: About::default(),
            savings: Vec::new(),
            keep_states: false,
            keep_trajectory: false,
            trajectory_bytes: None,
            keep_outputs: Vec::new(),
            judge: true,
        }
    }

    /// What the linear solver of a scene is told.
    pub(super) fn of_solver(&self, scene: &Scene) -> SolverOptions {
        SolverOptions {
            threads: self.threads,
            precision: self.precision,
            method: scene.newton.linear,
            solutions: scene.steps.expected(),
            library: self.library,
            ..SolverOptions::default()
        }
    }
}
