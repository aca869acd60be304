//! Input and result of a search for a demanded accuracy.

use thiserror::Error;

use super::AccuracyRecord;
use crate::knobs::Setting;

/// The runs of a scene, as the search needs them.
pub trait Trials {
    /// A run that came to its end.
    type Run;

    /// Runs a setting of a fineness; `last` with everything the scene asks for, else what its solution needs.
    ///
    /// # Errors
    /// Why it has no solution, or none that can be compared with the scene's own mesh.
    fn run(&mut self, setting: &Setting, fineness: usize, last: bool) -> Result<Self::Run, String>;

    /// What a run took.
    fn cost(&self, run: &Self::Run) -> Cost;

    /// The relative distance of a run from a finer one, in the quantity asked about.
    ///
    /// # Errors
    /// Why there is none.
    fn distance(&mut self, run: &Self::Run, from: &Self::Run) -> Result<f64, String>;

    /// The relative distance of a run from the same with a smaller tolerance.
    ///
    /// # Errors
    /// Why there is none.
    fn tighter(&mut self, run: &mut Self::Run, setting: &Setting, fineness: usize) -> Result<f64, String>;

    /// The relative distance of a run from a finer one in every other quantity, by name.
    fn distances(&mut self, run: &Self::Run, from: &Self::Run) -> Vec<(String, f64)>;
}

/// What a run took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Unknowns of the system.
    pub dofs: u64,
    /// Its wall time in seconds.
    pub seconds: f64,
    /// About the time of the same setting with everything that the scene asks for, in seconds.
    pub whole: f64,
}

/// What the search found.
#[derive(Debug)]
pub struct Found<R> {
    /// The last run, made with everything the scene asks for.
    pub run: R,
    /// What the report keeps.
    pub record: AccuracyRecord,
    /// What the demand does not cover.
    pub notice: Option<Notice>,
}

/// Why a demand is not met by a run that was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notice {
    /// The mesh comes from a file: its error is not known.
    MeshOfFile,
}

/// Why there is no run.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Out {
    /// A run failed where it should not.
    #[error("{0}")]
    Failed(String),
    /// It would take longer than allowed.
    #[error(
        "an error of {asked:.1e} of {quantity} needs about {needed}, which takes about {seconds:.1} s: more than the \
         budget of {budget} s\n  = note: the best of {runs} runs is {best}, with an estimated error of {error:.1e}\n  \
         = help: about {within:.1e} can be reached within the budget; --budget SECONDS allows more"
    )]
    OutOfReach {
        /// The demand.
        asked: f64,
        /// Its quantity.
        quantity: String,
        /// The setting that would meet it.
        needed: String,
        /// Its time.
        seconds: f64,
        /// What is allowed.
        budget: f64,
        /// Runs that were made.
        runs: usize,
        /// The most accurate of them.
        best: String,
        /// Its estimated error.
        error: f64,
        /// What the budget allows, about.
        within: f64,
    },
    /// The estimates do not fall as they should.
    #[error(
        "no run with an error of {asked:.1e} of {quantity} was found in {runs} runs: the best is {best}, with an \
         estimated error of {error:.1e}\n  = note: the estimates do not decrease as the mesh is refined\n  = help: wfl \
         sweep shows how errors depend on each setting"
    )]
    Lost {
        /// The demand.
        asked: f64,
        /// Its quantity.
        quantity: String,
        /// Runs that were made.
        runs: usize,
        /// The most accurate of them.
        best: String,
        /// Its estimated error.
        error: f64,
    },
}
