//! The part of the report about a demanded accuracy.

use serde::{Deserialize, Serialize};
use wfl_mesh::{
    mesh::CellId,
    refine::{Axes, Mark},
};

use super::Real;

/// The file of the mesh in the folder of a run with a demanded accuracy.
pub const MESH_FILE: &str = "accuracy_mesh.vtu";
/// Its array of the rounds of refinement that divided a cell.
pub const REFINED: &str = "refined";
/// Its array of the parts of the error.
pub const SHARE: &str = "share_of_error";

/// How a mesh is refined: the marked cells, round by round.
pub type Rounds = Vec<Vec<Mark>>;

/// The demand, the selected setting with its reasons, and its estimated error. Errors are relative.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AccuracyRecord {
    /// The demanded error.
    pub asked: f64,
    /// The quantity whose error it is.
    pub quantity: String,
    /// Knobs with their values, as for `wfl sweep`.
    pub picked: Vec<(String, String)>,
    /// Rounds of local refinement that the mesh went through, and its cells after them.
    #[serde(default)]
    pub rounds: u64,
    /// Cells of the mesh.
    #[serde(default)]
    pub cells: u64,
    /// Why, a sentence each.
    pub why: Vec<String>,
    /// Estimated error of the mesh, safety included.
    pub mesh: Real,
    /// The order by which the estimate fell, in the number of unknowns to the power of one over the dimension.
    pub order: Real,
    /// Error of the tolerance, measured on the first mesh.
    pub tolerance: Real,
    /// Error of the method's parameter, measured on the first mesh; 0 for a method that needs none.
    pub method: Real,
    /// What is not resolved of loads, coefficients and prescribed values; in the error of the mesh.
    #[serde(default)]
    pub data: Real,
    /// Error of the length of the steps, measured on the first mesh; 0 where the solution does not depend on it.
    #[serde(default)]
    pub time: Real,
    /// Error of a boundary that is a polygon where the body is curved; 0 where refinement follows the body.
    #[serde(default)]
    pub geometry: Real,
    /// Estimated error of the run: the sum.
    pub estimate: Real,
    /// Whether the estimate is at most the demanded error.
    pub reached: bool,
    /// The relative error against the exact solution, where the scene defines one (`def exact`) of this quantity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<Real>,
    /// Every run that was made, in order.
    pub trial_runs: Vec<TrialRun>,
    /// Estimates of the other quantities of the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Other>,
}

impl AccuracyRecord {
    /// The estimated error over the true one; `None` where there is no true error, or one that is zero or not finite.
    #[must_use]
    pub fn over_truth(&self) -> Option<f64> {
        let truth = self.truth.map(|t| t.0).filter(|t| *t > 0.0 && t.is_finite())?;
        Some(self.estimate.0 / truth).filter(|x| x.is_finite())
    }
}

/// A refinement as reports keep it, round by round: cells with the axes along which they are halved, as bits.
pub type Marks = Vec<Vec<[u32; 2]>>;

/// A refinement for a report.
#[must_use]
pub fn marks_of(rounds: &Rounds) -> Marks {
    let mark = |m: &Mark| [u32::try_from(m.cell.index()).unwrap_or(u32::MAX), u32::from(m.axes.bits())];
    rounds.iter().map(|round| round.iter().map(mark).collect()).collect()
}

/// The refinement that a report keeps.
#[must_use]
pub fn rounds_of(marks: &Marks) -> Rounds {
    let mark = |[cell, bits]: &[u32; 2]| Mark {
        cell: CellId::new(*cell as usize),
        axes: Axes::from_bits(u8::try_from(*bits).unwrap_or(u8::MAX)),
    };
    marks.iter().map(|round| round.iter().map(mark).collect()).collect()
}

/// One run on the way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrialRun {
    /// Knobs with their values.
    pub setting: Vec<(String, String)>,
    /// Rounds of local refinement of its mesh.
    #[serde(default)]
    pub rounds: u64,
    /// Cells of its mesh.
    #[serde(default)]
    pub cells: u64,
    /// Unknowns of the system.
    pub dofs: u64,
    /// Wall time, seconds, text to last step.
    pub seconds: f64,
    /// Estimated error of the mesh, safety included, as known when it was made; `null` where none was estimated.
    pub error: Real,
}

/// The estimate for another quantity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Other {
    /// `L2`, `H1`, an output on contact faces or a measure.
    pub quantity: String,
    /// Estimated error of the mesh, safety included.
    pub error: Real,
}
