//! A demanded accuracy: the cheapest setting of a scene whose estimated error is below the demand.
//!
//! The error is estimated from a mesh sequence for each degree that the scene may have. Intermediate runs compute only
//! what their solution needs, and they stop halfway to the mesh that their errors require. The differences between
//! neighbouring levels give the order of convergence and the error of the finest level (Richardson 1911; with a safety
//! factor and a bounded order, as in Roache's grid convergence index, J. Fluids Eng. 116, 1994). The effects of the
//! Newton tolerance and of a penalty parameter are measured once on a coarse mesh against a tighter and a stiffer one,
//! and both are set so that they add little. The last run becomes a level of the sequence, and its error is estimated
//! again with it; if that does not confirm the demand, the next level is finer.
//!
//! `ways` knows what can be changed in a scene, `estimate` has the formulas, `seek` goes through the runs of an
//! `outcome::Trials`, `ending` reports the result, `record` is kept in the report. Promises: a demand counts as reached
//! only if the run itself was part of the estimate; choices depend on numbers of the runs and never on the clock; a
//! demand that exceeds its time budget is refused before that time is spent. Does not control time steps, nor the
//! geometry of a mesh file.

mod ending;
mod estimate;
mod outcome;
mod record;
mod seek;
#[cfg(test)]
mod tests;
mod ways;

pub use outcome::{Cost, Found, Notice, Out, Trials};
pub use record::{AccuracyRecord, Other, TrialRun};
pub use seek::seek;
pub use ways::{Role, Ways, lean, work};

/// The demand.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// Largest relative error, from [`SMALLEST`] to [`LARGEST`].
    pub error: f64,
    /// The quantity: `L2` or `H1` of all unknowns on cells, an output on contact faces, or a measure, by name.
    pub quantity: String,
    /// Seconds that one run may be expected to take.
    pub budget: f64,
}

/// The quantity where nothing is said: the unknowns themselves, in the mean over the bodies.
pub const DEFAULT_QUANTITY: &str = "L2";
/// The budget where nothing is said, in seconds.
pub const DEFAULT_BUDGET: f64 = 600.0;
/// The smallest error that can be demanded: below it rounding dominates the differences.
pub const SMALLEST: f64 = 1e-8;
/// The largest: beyond half of the quantity nothing is known of it, and its estimate means nothing.
pub const LARGEST: f64 = 0.5;

/// Whether a number is an error that can be demanded.
#[must_use]
pub fn is_accuracy(error: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&error)
}
