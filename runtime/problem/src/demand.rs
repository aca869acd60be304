//! Which accuracies a scene may demand: of what, and how small the relative error. Does not know how they are reached.

/// The quantity where nothing is said: the unknowns themselves, in the mean over the bodies.
pub const DEFAULT_QUANTITY: &str = "L2";
/// The smallest relative error that can be demanded: below it rounding dominates the differences.
pub const SMALLEST: f64 = 1e-8;
/// The largest relative error: beyond half of the quantity nothing is known of it, and its estimate means nothing.
pub const LARGEST: f64 = 0.5;

/// Whether a number is an error that can be demanded.
#[must_use]
pub fn is_accuracy(error: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&error)
}
