//! When: a step of the step variable, or a part of one.
//!
//! One type from what a run is asked for to what point laws are told. Does not know which steps there are, and what rates are
//! made of.

use crate::rates::RateFactors;

/// A step, or a part of one: the step variable goes from [`Self::start`] to `end`.
///
/// The increment is kept beside the end and never computed as a difference: equal steps have one increment to the last bit,
/// which differences of their rounded ends have not, and matrices are made with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// The step variable at its end.
    pub end: f64,
    /// What the step variable grows by.
    pub increment: f64,
    /// The step variable where the equations stand, which is what formulas read: at the end, for most schemes.
    pub stage: f64,
    /// What laws multiply changes of fields by in their rates: zero before equations stand there, and for laws that read
    /// none.
    pub rates: RateFactors,
}

impl Window {
    /// A window whose equations stand at its end.
    #[must_use]
    pub const fn new(end: f64, increment: f64) -> Self {
        let none = RateFactors { rate: 0.0, velocity: 0.0, acceleration: 0.0 };
        Self { end, increment, stage: end, rates: none }
    }

    /// A value of the step variable that no step leads to.
    #[must_use]
    pub const fn instant(time: f64) -> Self {
        Self::new(time, 0.0)
    }

    /// The step variable at its start.
    #[must_use]
    pub fn start(&self) -> f64 {
        self.end - self.increment
    }

    /// The same with equations that stand before its end, by so large a part of it.
    #[must_use]
    pub fn with_offset(self, offset: f64) -> Self {
        Self { stage: self.end - offset * self.increment, ..self }
    }

    /// The same with equations that stand at its end.
    #[must_use]
    pub fn at_end(self) -> Self {
        Self { stage: self.end, ..self }
    }

    /// The same with these scalars of rates.
    #[must_use]
    pub fn with_rates(self, rates: RateFactors) -> Self {
        Self { rates, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_stand_at_the_end_or_before_it_by_a_part_of_the_increment() {
        let window = Window::new(3.0, 0.5);
        assert_eq!([window.start(), window.stage], [2.5, 3.0]);
        let within = window.with_offset(0.5);
        assert_eq!([within.stage, within.end, within.increment], [2.75, 3.0, 0.5]);
        assert_eq!(within.at_end(), window);
        let instant = Window::instant(3.0);
        assert_eq!([instant.start(), instant.stage, instant.end], [3.0; 3]);
    }
}
