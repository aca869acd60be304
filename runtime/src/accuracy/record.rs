//! The part of the report about a demanded accuracy.

use serde::{Deserialize, Serialize};

use crate::output::Real;

/// The demand, the selected setting with its reasons, and its estimated error. Errors are relative.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AccuracyRecord {
    /// The demanded error.
    pub asked: f64,
    /// The quantity whose error it is.
    pub quantity: String,
    /// Knobs with their values, as for `wfl sweep`.
    pub picked: Vec<(String, String)>,
    /// Why, a sentence each.
    pub why: Vec<String>,
    /// Estimated error of the mesh, safety included; `null` where the mesh cannot be refined.
    pub mesh: Real,
    /// The order of convergence that the estimate uses.
    pub order: Real,
    /// Error of the tolerance, measured on a coarse mesh.
    pub tolerance: Real,
    /// Error of the method's parameter, measured on a coarse mesh; 0 for a method that needs none.
    pub method: Real,
    /// Estimated error of the run: the sum.
    pub estimate: Real,
    /// Whether the estimate is at most the demanded error.
    pub reached: bool,
    /// Every run that was made, in order.
    pub trial_runs: Vec<TrialRun>,
    /// Estimates of the other quantities of the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Other>,
}

/// One run on the way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrialRun {
    /// Knobs with their values.
    pub setting: Vec<(String, String)>,
    /// Unknowns of the system.
    pub dofs: u64,
    /// Wall time, seconds, text to last step.
    pub seconds: f64,
    /// Estimated error of the mesh, safety included, as known at the end.
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
