//! Input and result of a search for a demanded accuracy.

use thiserror::Error;
use wfl_mesh::{mesh::Mesh, refine::Mark};
use wfl_output::record::{AccuracyRecord, Rounds};

use super::Indicator;
use crate::knobs::Setting;

/// What a run makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// What its solution needs.
    Solution,
    /// Everything that the scene asks for.
    WholeScene,
}

/// What the marks of cells follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guide {
    /// The quantity asked about.
    Quantity,
    /// The gradients of all unknowns, whatever quantity is asked about.
    Gradients,
}

/// The runs of a scene, as the search needs them.
pub trait Trials {
    /// A run that came to its end.
    type Run;

    /// Runs a setting of a fineness on its refined mesh.
    ///
    /// # Errors
    /// Why it has no solution, or none that can be compared with the scene's own mesh.
    fn run(&mut self, setting: &Setting, fineness: usize, rounds: &Rounds, extent: Extent)
    -> Result<Self::Run, String>;

    /// The run of the next degree on the mesh of a run, which sees of loads and coefficients what the rules of that one may
    /// miss.
    ///
    /// # Errors
    /// Why it has no solution.
    fn rich(
        &mut self,
        run: &mut Self::Run,
        setting: &Setting,
        fineness: usize,
        rounds: &Rounds,
    ) -> Result<Self::Run, String>;

    /// What such a run does not resolve of loads and coefficients.
    fn data(&self, rich: &Self::Run) -> OfData;

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
    fn indicator(&mut self, run: &Self::Run, rich: &Self::Run, guide: Guide) -> Result<Indicator, String>;

    /// The relative distance of a run from the same with a smaller tolerance.
    ///
    /// # Errors
    /// Why there is none.
    fn tighter(&mut self, run: &mut Self::Run, setting: &Setting, fineness: usize) -> Result<f64, String>;

    /// What the boundary of the mesh adds where it is not that of the body, relative; the setting is that of the run.
    fn geometry(&mut self, run: &Self::Run, setting: &Setting, fineness: usize) -> f64;

    /// Whether bodies lock with the elements of a run of degree 1.
    fn locks(&self, run: &Self::Run) -> bool;

    /// The relative distance of a run from a better one in every other quantity, by name.
    fn distances(&mut self, run: &Self::Run, from: &Self::Run) -> Vec<(String, f64)>;

    /// Seconds since the search began.
    fn elapsed(&self) -> f64;
}

/// What is not resolved of loads and coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OfData {
    /// The relative error in the quantity asked about.
    pub error: f64,
    /// Where it comes from, by cell, all not negative; empty where there is none.
    pub parts: Vec<f64>,
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
    /// Loads or coefficients change within a part of a cell.
    #[error(
        "loads, coefficients or prescribed values change within less than the distance of the points where they are \
         looked at: that leaves an error of about {0:.1e}"
    )]
    Data(f64),
    /// The mesh has another boundary than the body.
    #[error(
        "the boundary of the mesh is a polygon where that of the body seems to be curved, and refinement keeps it: that \
         leaves an error of about {0:.1e}"
    )]
    Geometry(f64),
    /// The steps are too long.
    #[error("the length of the steps alone adds an error of about {0:.1e}")]
    Time(f64),
    /// The exact solution of the scene says so.
    #[error("the exact solution of the scene says that the true error is {0:.1e}: the estimate is wrong")]
    Truth(f64),
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
