//! Input and result of a search for a demanded accuracy.

use thiserror::Error;

use super::{AccuracyRecord, Indicator, Rounds};
use crate::{knobs::Setting, mesh::Mesh, refine::Mark};

/// The runs of a scene, as the search needs them.
pub trait Trials {
    /// A run that came to its end.
    type Run;

    /// Runs a setting of a fineness on its refined mesh; `last` with everything the scene asks for, else what its solution
    /// needs.
    ///
    /// # Errors
    /// Why it has no solution, or none that can be compared with the scene's own mesh.
    fn run(&mut self, setting: &Setting, fineness: usize, rounds: &Rounds, last: bool) -> Result<Self::Run, String>;

    /// What a run took.
    fn cost(&self, run: &Self::Run) -> Cost;

    /// Its mesh.
    fn mesh<'r>(&self, run: &'r Self::Run) -> &'r Mesh;

    /// Whether marked cells touch the faces of terms with kinks: the parameter of a consistent method grows with them.
    fn at_contact(&self, run: &Self::Run, marks: &[Mark]) -> bool;

    /// The relative distance of a run from a better one, in the quantity asked about.
    ///
    /// # Errors
    /// Why there is none.
    fn distance(&mut self, run: &Self::Run, from: &Self::Run) -> Result<f64, String>;

    /// Where the error of a run comes from; `rich` is a run of a higher degree on the same mesh.
    ///
    /// # Errors
    /// Why that is not known.
    fn indicator(&mut self, run: &Self::Run, rich: &Self::Run) -> Result<Indicator, String>;

    /// The relative distance of a run from the same with a smaller tolerance.
    ///
    /// # Errors
    /// Why there is none.
    fn tighter(&mut self, run: &mut Self::Run, setting: &Setting, fineness: usize) -> Result<f64, String>;

    /// The relative distance of a run from a better one in every other quantity, by name.
    fn distances(&mut self, run: &Self::Run, from: &Self::Run) -> Vec<(String, f64)>;

    /// Seconds since the search began.
    fn elapsed(&self) -> f64;
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
    /// Why the demand is not met, where it is not.
    pub short: Option<Short>,
    /// The last known parts of the error by cell (all not negative), of the mesh after so many of the rounds.
    pub parts: Option<(usize, Vec<f64>)>,
}

/// Why the search ended before the demand was met.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Short {
    /// The next mesh would have taken longer than allowed.
    #[error("the next mesh would take about {next:.1} s: more than is left of the budget of {budget} s")]
    Budget {
        /// Its time.
        next: f64,
        /// What is allowed.
        budget: f64,
    },
    /// A finer mesh has no solution.
    #[error("a finer mesh has no solution: {0}")]
    Failed(String),
    /// No mesh has an estimate.
    #[error("no mesh has an estimate: {0}")]
    Blind(String),
    /// The tolerance and the parameter of the method cannot be set so that they add less than the demand.
    #[error("the tolerance and the parameter of the method alone add an error of {0:.1e}")]
    Method(f64),
    /// The estimates did not fall.
    #[error("the estimated error does not fall as the mesh is refined")]
    Stalled,
}

/// Why there is no run.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Out {
    /// A run failed where it should not.
    #[error("{0}")]
    Failed(String),
}
