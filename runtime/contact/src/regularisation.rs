//! The law of contact between what is easy to solve and what is written: one homotopy with four parameters.

/// Factor on friction of a law as it is written: one, by definition.
pub(super) const AS_WRITTEN: f64 = 1.0;
/// The stiffness of the layer between the sides while contact is compliant, in units of that of the bodies: with a tenth,
/// three and ten there are more iterations (`docs/newton.md`).
const LAYER: f64 = 0.3;
/// After so many choices in a step the scaling grows by a factor each time, up to a bound: what is left then are
/// directions of slip, which converge faster near the arguments as written.
const SETTLED_CHOICES: usize = 2;
const SCALING_GROWTH: f64 = 3.0;
const LARGEST_GROWTH: f64 = 10.0;

/// How a law differs from what is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regularisation {
    /// The stiffness of a layer between the sides, in units of that of the bodies; infinite as written. The argument of
    /// a projection is that of the law less a part of the traction (compliance).
    pub layer: f64,
    /// Traction may exceed its bound by so much of the stiffness of the bodies times what passes between the sides
    /// (Duvaut and Lions 1976); 0 as written.
    pub overstress: f64,
    /// Factor on the radius of friction; 1 as written.
    pub friction: f64,
    /// Factor on the arguments of projections, behind the layer; 1 as written.
    pub softness: f64,
}

impl Default for Regularisation {
    fn default() -> Self {
        Self { layer: f64::INFINITY, overstress: 0.0, friction: AS_WRITTEN, softness: AS_WRITTEN }
    }
}

impl Regularisation {
    /// True for the law as written.
    #[must_use]
    pub fn is_as_written(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn set_compliant(&mut self, compliant: bool) {
        self.layer = if compliant { LAYER } else { f64::INFINITY };
    }
}

/// The complementarity equation `t = P(t + c (x - t))` that the active set is chosen by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Complementarity {
    /// The law.
    pub regularisation: Regularisation,
    /// Factor on `c` where it is below 1, and its inverse where it is above.
    pub growth: f64,
}

impl Default for Complementarity {
    fn default() -> Self {
        Self { regularisation: Regularisation::default(), growth: 1.0 }
    }
}

impl Complementarity {
    /// Tells how often the active set was chosen in this step.
    pub(super) fn set_choices(&mut self, times: usize) {
        let exponent = i32::try_from(times.saturating_sub(SETTLED_CHOICES)).unwrap_or(i32::MAX);
        self.growth = SCALING_GROWTH.powi(exponent).min(LARGEST_GROWTH);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn growth(choices: usize) -> f64 {
        let mut law = Complementarity::default();
        law.set_choices(choices);
        law.growth
    }

    #[test]
    fn the_scaling_grows_once_an_active_set_should_have_settled_and_not_without_bound() {
        assert_eq!([0, 1, 2].map(growth), [1.0; 3]);
        assert_eq!([3, 4].map(growth), [3.0, 9.0]);
        assert_eq!([5, 1000, usize::MAX].map(growth), [10.0; 3]);
    }

    #[test]
    fn each_of_the_parameters_makes_a_law_another_one() {
        let written = Regularisation::default();
        assert!(written.is_as_written());
        assert!(!Regularisation { overstress: 1e-300, ..written }.is_as_written());
        assert!(!Regularisation { friction: 0.999, ..written }.is_as_written());
        assert!(!Regularisation { softness: 0.999, ..written }.is_as_written());
        let mut compliant = written;
        compliant.set_compliant(true);
        assert!(!compliant.is_as_written());
        compliant.set_compliant(false);
        assert!(compliant.is_as_written(), "a layer of infinite stiffness is none");
    }
}
