//! The methods of an iteration, by name.

/// A method to get from one state to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The state that a step begins with.
    Start,
    /// The linearised response to the prescribed increment.
    Predictor,
    /// Semismooth Newton with a frozen active set ([`wfl_contact`]), damped by the complementarity defect.
    ActiveSet,
    /// The same with a compliant layer between the sides: a few steps that find another active set to go on with.
    Compliance,
    /// The same from a start where all points stick, with traction that may exceed its bound (`homotopy`).
    Overstress,
    /// The same while friction grows from nothing to what is written.
    LessFriction,
    /// The same while friction shrinks from a multiple to what is written: what only friction holds stays held.
    MoreFriction,
    /// Piecewise linear path following from where the step stands.
    Path,
    /// The same from the start of the step.
    PathFromStart,
    /// Newton on the scene as it is written, damped by the norm of the residual.
    Residual,
    /// The same, damped by the norm of the simplified Newton correction.
    Natural,
    /// Corrections where the residual is rounding already.
    Refinement,
    /// Downhill from an equilibrium that is not stable (`branch`).
    Branch,
    /// Downhill in the energy, with a tangent that is made positive definite (`downhill`).
    Downhill,
    /// As the active set, while a layer between the sides grows from the stiffness of the bodies to none.
    Stiffening,
}

impl Method {
    /// The name in histories and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Predictor => "predictor",
            Self::ActiveSet => "active set",
            Self::Compliance => "compliance",
            Self::Overstress => "overstress",
            Self::LessFriction => "friction from below",
            Self::MoreFriction => "friction from above",
            Self::Stiffening => "stiffness from below",
            Self::Path => "path",
            Self::PathFromStart => "path from start",
            Self::Residual => "residual",
            Self::Natural => "natural test",
            Self::Refinement => "refinement",
            Self::Branch => "branch",
            Self::Downhill => "downhill",
        }
    }

    /// Its number in files.
    #[must_use]
    pub fn number(self) -> usize {
        self as usize
    }

    /// The method with a number.
    #[must_use]
    pub fn from_number(number: usize) -> Option<Self> {
        Self::ALL.get(number).copied()
    }

    const ALL: [Self; 15] = [
        Self::Start,
        Self::Predictor,
        Self::ActiveSet,
        Self::Compliance,
        Self::Overstress,
        Self::LessFriction,
        Self::MoreFriction,
        Self::Path,
        Self::PathFromStart,
        Self::Residual,
        Self::Natural,
        Self::Refinement,
        Self::Branch,
        Self::Downhill,
        Self::Stiffening,
    ];

    /// True if a piecewise linear path is followed.
    pub(super) fn is_path(self) -> bool {
        matches!(self, Self::Path | Self::PathFromStart)
    }

    /// True if the active set is frozen.
    pub(super) fn freezes(self) -> bool {
        !matches!(
            self,
            Self::Residual
                | Self::Natural
                | Self::Start
                | Self::Predictor
                | Self::Refinement
                | Self::Branch
                | Self::Downhill
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_comes_back_from_its_number_in_files() {
        for (number, method) in Method::ALL.into_iter().enumerate() {
            assert_eq!((method.number(), Method::from_number(number)), (number, Some(method)));
        }
        assert_eq!(Method::from_number(Method::ALL.len()), None);
    }

    #[test]
    fn no_two_methods_have_one_name() {
        let names: std::collections::BTreeSet<&str> = Method::ALL.iter().map(|m| m.name()).collect();
        assert_eq!(names.len(), Method::ALL.len());
    }

    #[test]
    fn a_path_goes_on_a_frozen_active_set() {
        assert!(Method::ALL.iter().filter(|m| m.is_path()).all(|m| m.freezes()));
        assert!(!Method::Residual.freezes() && !Method::Natural.freezes(), "they damp the equations as written");
    }
}
