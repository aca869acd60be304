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
            Self::Path => "path",
            Self::PathFromStart => "path from start",
            Self::Residual => "residual",
            Self::Natural => "natural test",
            Self::Refinement => "refinement",
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

    const ALL: [Self; 12] = [
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
    ];

    /// True if a piecewise linear path is followed.
    pub(super) fn is_path(self) -> bool {
        matches!(self, Self::Path | Self::PathFromStart)
    }

    /// True if the active set is frozen.
    pub(super) fn freezes(self) -> bool {
        !matches!(self, Self::Residual | Self::Natural | Self::Start | Self::Predictor | Self::Refinement)
    }
}
