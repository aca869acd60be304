//! Switches that turn an optimisation off.
//!
//! A switch changes how a solution is found, not the solution: it exists so that the effect can be measured and the
//! results compared. Does not decide anything: assembly, linear solver selection and quadrature ask.

/// Something that is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pruning {
    /// Loads and other terms without unknowns are summed once per step.
    Constant,
    /// Linear terms are assembled once for all iterations and steps; a scene of nothing else has no Newton iterations.
    Linear,
    /// The linear part is factored once and the dofs of the other terms are condensed.
    Condense,
    /// Dofs that face each other with opposite forces share one unknown of the condensed matrix.
    Forces,
    /// Symmetric tangents are factored as L L^T in place of L U.
    Symmetric,
    /// Linear terms are integrated with the degree of their own integrands, not with the highest of the scene.
    Quadrature,
    /// In scenes of many steps what terms and integrals are linear in is a matrix or a vector, made once.
    Past,
}

impl Pruning {
    /// All of them.
    pub const ALL: [Pruning; 7] = [
        Pruning::Constant,
        Pruning::Linear,
        Pruning::Condense,
        Pruning::Forces,
        Pruning::Symmetric,
        Pruning::Quadrature,
        Pruning::Past,
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Pruning::Constant => "constant",
            Pruning::Linear => "linear",
            Pruning::Condense => "condense",
            Pruning::Forces => "forces",
            Pruning::Symmetric => "symmetric",
            Pruning::Quadrature => "quadrature",
            Pruning::Past => "past",
        }
    }

    /// The one of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }
}

/// What one of the prunings of a scene saves.
#[derive(Clone, Debug, PartialEq)]
pub struct Saving {
    /// Which.
    pub pruning: Pruning,
    /// Time of preparing and solving without it, in parts of the time with it.
    pub times: f64,
    /// The largest change of a measure without it, in parts of the largest value of that measure (of the largest of all
    /// where it is rounding beside it); 0 without measures, infinite where a step does not converge without it.
    pub moved: f64,
}
