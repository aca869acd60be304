//! A wanted accuracy: the cheapest setting of a scene whose estimated error is below what was asked for.
//!
//! The error of a solution is told from solutions that are known to be worse: a ladder of meshes for each degree that
//! the scene can have. Runs on the way are made of what their solution needs, and they stop halfway to the mesh that
//! their errors ask for. The distances between neighbours give the order of convergence and the error of the finest
//! (Richardson 1911; with a safety factor and a bounded order, as in Roache's grid convergence index, J. Fluids Eng.
//! 116, 1994). The tolerance of Newton and the parameter of a penalty method are measured once on a coarse mesh against
//! a tighter and a stiffer one, and set so that they add little. The last run joins the ladder, and its error is
//! estimated again with it: where that does not support the demand, the next one is finer.
//!
//! `ways` says what can be changed in a scene, `estimate` has the formulas, `seek` climbs over the runs of an
//! `outcome::Trials`, `ending` tells what was found, `record` is what the report keeps. Promises that an error is only
//! called reached when the run it belongs to was part of the estimate, that choices depend on numbers of the runs and
//! never on the clock, and that a demand that would take longer than its budget is refused before that time is spent.
//! Does not control the steps of time, nor the geometry of a mesh file.

mod ending;
mod estimate;
mod outcome;
mod record;
mod seek;
#[cfg(test)]
mod tests;
mod ways;

pub use outcome::{Cost, Found, Notice, Out, Trials};
pub use record::{AccuracyRecord, Other, Rung};
pub use seek::seek;
pub use ways::{Role, Ways, lean, work};

/// What is asked for.
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
/// The smallest error that can be asked for: estimates by differences drown in rounding below.
pub const SMALLEST: f64 = 1e-8;
/// The largest: beyond half of the quantity nothing is known of it, and its estimate means nothing.
pub const LARGEST: f64 = 0.5;

/// Whether a number is an error that can be asked for.
#[must_use]
pub fn is_accuracy(error: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&error)
}
