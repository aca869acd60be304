//! A requested step: from one value of the step variable to the next, and the increment between them.

/// A requested step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// The value before; `None` for the first step.
    pub(super) from: Option<f64>,
    /// The value to reach.
    pub(super) to: f64,
    /// The increment of the first step.
    pub(super) first_increment: f64,
    /// The increment as the scene says it; without it, the difference of both values.
    pub(super) told: Option<f64>,
}

/// Rounding of a difference in parts of it, up to which increments that differ by it only are taken as one number.
const ONE_INCREMENT: f64 = 1e-9;

impl Leg {
    /// The increment from the value before. Values of equal steps differ by rounding from those of exact ones; their
    /// increments are the same number, so that matrices made with it stay. Where rounding is a larger part of them they
    /// stay what they are: their sum is then the time that passes.
    pub(super) fn increment(&self, from: f64) -> f64 {
        if let Some(told) = self.told {
            return told;
        }
        let rounding = 2.0 * f64::EPSILON * from.abs().max(self.to.abs());
        let increment = self.to - from;
        let is_one = (increment - self.first_increment).abs() <= rounding.min(ONE_INCREMENT * increment.abs());
        if is_one { self.first_increment } else { increment }
    }
}
