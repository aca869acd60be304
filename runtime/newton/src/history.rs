//! What Newton did: every number that led to a decision.

use super::Method;
use wfl_sparse::solve::SolveReport;

/// Why an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The relative residual is below the tolerance.
    Tolerance,
    /// The residual is rounding error: no smaller one can be had.
    Floor,
    /// The most iterations allowed were not enough.
    MaxIterations,
    /// Nothing was solved: the state that a run with rates starts from.
    Given,
}

impl Stop {
    /// The word in reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Stop::Tolerance => "tolerance",
            Stop::Floor => "floor",
            Stop::MaxIterations => "maxit",
            Stop::Given => "given",
        }
    }
}

/// One iteration.
#[derive(Clone, Debug, PartialEq)]
pub struct Iteration {
    /// Its number; 0 is the start.
    pub number: usize,
    /// Relative residual after it.
    pub residual: f64,
    /// The rounding floor there.
    pub floor: f64,
    /// Part of the Newton step taken.
    pub step: f64,
    /// What led to it.
    pub method: Method,
    /// The merit function there: the weighted norm of the residual of the equations that the method solves.
    pub merit: f64,
    /// Points whose branch in the active set is another one now.
    pub changed: usize,
    /// Points open, slipping, sticking; `None` without contact.
    pub contact: Option<[usize; 3]>,
    /// A number that changes when a point changes its branch in the terms as written.
    pub fingerprint: u64,
}

/// One load step.
#[derive(Clone, Debug, Default)]
pub struct StepHistory {
    /// The start, where it can be measured, and each iteration.
    pub iterations: Vec<Iteration>,
    /// Reports of the linear solver.
    pub solves: Vec<SolveReport>,
    /// Why it ended.
    pub stop: Option<Stop>,
    /// The equations are singular where all unknowns are zero, so the step began from a state displaced a little.
    pub displaced: bool,
    /// How often the path that led to the state turned round ([`super`]): between kinks the load went down, so that there
    /// are several states for loads on the way.
    pub turns: usize,
    /// How many of the iterations went on from a residual that is rounding, and the size of the smallest correction of
    /// those, relative to the unknowns.
    pub refined: usize,
    /// See [`Self::refined`].
    pub correction: Option<f64>,
}

impl StepHistory {
    /// The history of a state that is given.
    #[must_use]
    pub fn given() -> Self {
        Self { stop: Some(Stop::Given), ..Self::default() }
    }

    /// True if the step is a solution.
    #[must_use]
    pub fn converged(&self) -> bool {
        matches!(self.stop, Some(Stop::Tolerance | Stop::Floor | Stop::Given))
    }

    /// Iterations of the attempt that this history is of; what a step took is listed with its attempts.
    #[must_use]
    pub fn n_iterations(&self) -> usize {
        self.iterations.last().map_or(0, |last| last.number)
    }

    /// Iterations after which the branches were those of two iterations before, with no smaller residual: a cycle.
    #[must_use]
    pub fn cycles(&self) -> usize {
        let cycle = |w: &[Iteration]| {
            w[0].fingerprint == w[2].fingerprint
                && w[1].fingerprint != w[2].fingerprint
                && w[2].residual > 0.5 * w[0].residual
        };
        self.iterations.windows(3).filter(|w| cycle(w)).count()
    }
}
