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
    /// Nothing acts, and the state of rest solves the equations exactly.
    Rest,
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
            Stop::Rest => "rest",
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
    /// The part of the forces that rounding has hidden where the iteration ended, if it was much; 0 where it ended otherwise.
    pub hidden: f64,
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
        matches!(self.stop, Some(Stop::Tolerance | Stop::Floor | Stop::Given | Stop::Rest))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A history of iterations with these branches and residuals.
    fn history(list: &[(u64, f64)]) -> StepHistory {
        let iteration = |(number, (fingerprint, residual)): (usize, &(u64, f64))| Iteration {
            number,
            residual: *residual,
            floor: 0.0,
            step: 1.0,
            method: Method::ActiveSet,
            merit: *residual,
            changed: 0,
            contact: None,
            fingerprint: *fingerprint,
        };
        StepHistory { iterations: list.iter().enumerate().map(iteration).collect(), ..StepHistory::default() }
    }

    #[test]
    fn branches_that_come_back_every_second_iteration_are_a_cycle() {
        assert_eq!(history(&[(1, 0.5), (2, 0.4), (1, 0.5)]).cycles(), 1);
        assert_eq!(history(&[(1, 0.5), (2, 0.4), (1, 0.5), (2, 0.4), (1, 0.5)]).cycles(), 3);
    }

    #[test]
    fn branches_that_settle_or_come_back_with_a_smaller_residual_are_none() {
        assert_eq!(history(&[(1, 0.5), (1, 0.5), (1, 0.5)]).cycles(), 0);
        assert_eq!(history(&[(1, 0.5), (2, 0.4), (1, 0.25)]).cycles(), 0, "it has halved");
        assert_eq!(history(&[(1, 0.5), (2, 0.4), (3, 0.5)]).cycles(), 0);
        assert_eq!(history(&[(1, 0.5), (2, 0.4)]).cycles(), 0);
    }

    #[test]
    fn a_step_without_a_reason_to_stop_is_no_solution() {
        let with = |stop| StepHistory { stop, ..StepHistory::default() };
        assert!(!with(None).converged() && !with(Some(Stop::MaxIterations)).converged());
        assert!(with(Some(Stop::Tolerance)).converged() && with(Some(Stop::Floor)).converged());
        assert!(StepHistory::given().converged() && StepHistory::given().n_iterations() == 0);
    }

    #[test]
    fn iterations_are_counted_by_their_number_and_not_by_their_lines() {
        let mut of_predictor = history(&[(1, 0.5), (1, 0.4)]);
        of_predictor.iterations[1].number = 3;
        assert_eq!(of_predictor.n_iterations(), 3, "a predictor takes several");
    }
}
