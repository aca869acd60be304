//! Contact by our iteration, and the factors that take its place where it does not get to its end.

use std::sync::Arc;

use super::{Kind, LinearSolver, Sum, at_points, facing};
use crate::condensation::condenses;
use crate::plan::GMRES;
use wfl_discrete::{pruning::Pruning, system::System};
use wfl_sparse::csr::{Csr, Pattern};
use wfl_sparse::solve::{CheckedAtPoints, FilteredMultigrid, Kept, Linked, SolveError, SolveReport, SolverMemory};

/// What factors for contact are made of.
pub(super) struct Factors {
    bulk: Arc<Csr>,
    pattern: Arc<Pattern>,
    /// The changing part is condensed onto the dofs that it touches.
    condenses: bool,
    /// Unknowns at points.
    at_points: Vec<u32>,
    /// Dofs that face each other.
    facing: Vec<(u32, u32)>,
    /// The changing part of the matrix that the iteration solves with.
    changing: Option<Csr>,
}

impl Factors {
    pub(super) fn of(system: &System) -> Self {
        let condenses = condenses(system);
        let shares = condenses && system.uses(Pruning::Forces);
        Self {
            bulk: system.shared_bulk(),
            pattern: Arc::clone(system.changing_pattern()),
            condenses,
            at_points: if condenses { at_points(system) } else { Vec::new() },
            facing: if shares { facing(system) } else { Vec::new() },
            changing: None,
        }
    }
}

impl LinearSolver {
    /// Prepares for factors: of the bulk, with the changing part condensed, or of the sum.
    pub(super) fn choose_factors(&mut self, of: &Factors) -> Result<(), SolveError> {
        if of.condenses {
            let points = Some(self.coordinates.as_slice());
            match CheckedAtPoints::new(&of.bulk, &of.pattern, points, &of.at_points, &of.facing, self.options) {
                Ok(mut condensed) => {
                    self.factorisations += condensed.take_factorisations();
                    self.kind = Kind::Condensed(Box::new(condensed));
                    return Ok(());
                }
                Err(SolveError::NotPositiveDefinite { .. } | SolveError::Singular { .. }) => {
                    self.notes.push("the linear part without the contact dofs is not positive definite: the whole tangent is factored where an older factor does not serve".to_owned());
                }
                Err(e) => return Err(e),
            }
        }
        self.sum_on(&of.bulk, &of.pattern)
    }

    /// Prepares for the sum of the linear part and a part on another pattern.
    pub(super) fn sum_on(&mut self, bulk: &Csr, changing: &Arc<Pattern>) -> Result<(), SolveError> {
        let (bulk, changing) = (bulk.pattern(), Arc::clone(changing));
        let (pattern, bulk_positions, changing_positions) = match bulk.positions_in(&changing) {
            Some(of_bulk) => (Arc::clone(&changing), of_bulk, None),
            None => {
                let union = Arc::new(bulk.union(&changing)?);
                let positions = |part: &Pattern| part.positions_in(&union).expect("a part of the union");
                let (of_bulk, of_changing) = (positions(bulk), positions(&changing));
                (union, of_bulk, Some(of_changing))
            }
        };
        self.kind = Kind::Full(Some(Sum { pattern, changing, bulk_positions, changing_positions }));
        Ok(())
    }

    /// Prepares for our iteration.
    pub(super) fn iterate_on_contact(&mut self, system: &System) {
        self.library = Some(Linked(&FilteredMultigrid));
        self.tell_library(system);
        self.kind = Kind::Linked;
    }

    /// Takes the changing part of a tangent that a library, or our iteration, solves with.
    pub(super) fn take_linked(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let outcome = self.factor(changing);
        let Some(spare) = &mut self.spare else { return outcome };
        spare.changing = Some(changing.clone());
        match outcome {
            Err(error) if gives_way(&error) => self.give_way(Some(&error)),
            other => other,
        }
    }

    /// Our iteration; a factor where it does not get to its end.
    pub(super) fn solve_on_contact(
        &mut self,
        rhs: &[f64],
        x: &mut Vec<f64>,
        tolerance: f64,
    ) -> Result<SolveReport, SolveError> {
        let solver = self.solver.as_mut().ok_or(SolveError::NotFactored)?;
        let error = match solver.solve_with_kept(rhs, x, tolerance) {
            Ok(Kept::Solved(report)) => return Ok(report),
            Ok(_) => SolveError::NotFactored,
            Err(error) => error,
        };
        if !gives_way(&error) {
            return Err(error);
        }
        self.give_way(Some(&error))?;
        let report = self.solve(rhs, x, tolerance)?;
        Ok(SolveReport { refactored: true, ..report })
    }

    /// Turns from the iteration to factors, for the rest of the run.
    fn give_way(&mut self, error: Option<&SolveError>) -> Result<(), SolveError> {
        let Some(factors) = self.spare.take() else { return Err(SolveError::NotFactored) };
        if let Some(error) = error {
            self.notes.push(format!("a factor in place of {GMRES}: {error}"));
        }
        (self.library, self.equations, self.solver) = (None, None, None);
        self.choose_factors(&factors)?;
        let Some(changing) = &factors.changing else { return Ok(()) };
        match &mut self.kind {
            Kind::Condensed(c) => {
                let outcome = c.update(changing);
                self.factorisations += c.take_factorisations();
                outcome
            }
            _ => {
                let sum = self.sum([&factors.bulk, changing])?;
                self.factor(&sum)
            }
        }
    }

    /// Goes back to what was remembered where it, or this solver, is the iteration.
    pub(super) fn recall_iteration(&mut self, memory: &SolverMemory) -> Result<bool, SolveError> {
        if !memory.iterative {
            self.give_way(None)?;
            return self.recall(memory);
        }
        Ok(true)
    }
}

/// Whether a factor may do better.
fn gives_way(error: &SolveError) -> bool {
    matches!(
        error,
        SolveError::Library { .. }
            | SolveError::ResidualTooLarge { .. }
            | SolveError::VanishingPivot { .. }
            | SolveError::NotPositiveDefinite { .. }
            | SolveError::NotFactored
    )
}
