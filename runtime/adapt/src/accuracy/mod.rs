//! A demanded accuracy: the cheapest setting of a scene whose estimated error is below the demand.
//!
//! Each mesh is solved with elements of a degree and of the next one. Their distance is the estimated error of the first,
//! in any quantity; dual-weighted residuals say which cells it comes from (`adjoint`), and the fewest cells that hold a
//! part of it are refined (`marking`). A finer mesh checks the estimate of the one before. The degree is the one that
//! should need the least work from the errors on the first mesh. The effects of the Newton tolerance and of a penalty
//! parameter are measured once on that mesh against a tighter and a stiffer one, and both are set so that they add little.
//! The last run has everything that the scene asks for.
//!
//! `ways` knows what can be changed in a scene, `search` goes through the runs of an `outcome::Trials`, `record` is kept
//! in the report. Promises: a demand counts as reached only if the run itself was estimated; the clock decides nothing but
//! when the budget is used up; what was reached by then is the result. Does not estimate the error of time steps.

mod adjoint;
mod data;
mod marking;
mod outcome;
mod picture;
mod search;
#[cfg(test)]
mod tests;
mod ways;

pub use adjoint::{Indicator, Pair};
pub use data::{Probed, curvature, probe};
pub use outcome::{Cost, Extent, Found, Guide, OfData, Out, Short, Trials};
pub use picture::mesh_piece;
pub use search::seek;
pub use ways::{Role, Wanted, Ways, lean, method_word, work};

/// The demand.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// Largest relative error, from [`SMALLEST`](wfl_problem::demand::SMALLEST) to [`LARGEST`](wfl_problem::demand::LARGEST).
    pub error: f64,
    /// The quantity: `L2` or `H1` of all unknowns on cells, an output on contact faces, or a measure, by name.
    pub quantity: String,
    /// Seconds that the search may take.
    pub budget: f64,
    /// Begin with the coarsest mesh that has the regions of the scene, not with the scene's own.
    pub from_coarsest: bool,
}

/// The budget where nothing is said, in seconds: ten minutes, as long as one waits at a desk.
pub const DEFAULT_BUDGET: f64 = 600.0;
