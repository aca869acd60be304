//! Whole tangents by conjugate gradients with multigrid, and the factors that take their place.
//!
//! The matrix of the iteration is always the tangent at hand; its levels may be those of an earlier one, so that no solution
//! depends on them but for what it may leave. Promises: where the iteration does not get to its end (a tangent that is not
//! positive definite has directions of negative energy, and conjugate gradients find them), a factor takes its place for the
//! rest of the attempt at the step, or the error of the iteration comes back where no factor fits into the memory.

use std::sync::Arc;

use wfl_discrete::system::{System, Tangent};
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{LinearMethod, Operator, SolveError, SolveReport, Source};

use super::{Kind, LinearSolver};
use crate::iterative::{self, Iterative, is_of_iteration};
use crate::library::on_contact_by_nodes;
use crate::plan::ITERATION;
use crate::saddle;
use crate::without_matrix;

/// Attempts at steps in which a factor may take the place of the iteration, before it does so for good: levels that are made for
/// nothing cost less than a factor, but not nothing.
const MOST_SET_ASIDE: usize = 3;

impl LinearSolver {
    /// Whether an iteration solves, of one matrix or of tangents.
    #[must_use]
    pub fn iterates(&self) -> bool {
        self.iterative.as_ref().is_some_and(Iterative::is_at_work)
    }

    /// The same of tangents alone: what conjugate gradients have not met with one right-hand side may still be there.
    pub(super) fn iterates_on_tangents(&self) -> bool {
        self.iterative.as_ref().is_some_and(|iterative| iterative.is_at_work() && iterative.is_of_tangents())
    }

    /// Whether GMRES solves whole tangents. Its levels, of bodies without contact or of a motion without its pressure, have been positive
    /// definite; where they are not, a factor takes its place.
    #[must_use]
    pub fn iterates_by_gmres(&self) -> bool {
        self.iterative.as_ref().is_some_and(|iterative| iterative.is_at_work() && iterative.has_levels_of_a_part())
    }

    /// Prepares for the iteration on tangents.
    pub(super) fn iterate_on_tangents(&mut self, system: &System) -> Result<(), SolveError> {
        let layout = iterative::layout(system).map_err(|_| SolveError::NotFactored)?;
        self.iterative = Some(Iterative::of_tangents(layout, self.options));
        if system.applies_tangents() {
            self.kind = Kind::Full(None);
            return Ok(());
        }
        self.sum_on(system.bulk(), system.changing_pattern())
    }

    /// Prepares for GMRES on tangents of bodies with contact.
    pub(super) fn iterate_on_bodies_with_contact(&mut self, system: &System) -> Result<(), SolveError> {
        let of = on_contact_by_nodes(system).map_err(|_| SolveError::NotFactored)?;
        self.iterative = Some(Iterative::of_contact(of, self.options));
        self.sum_on(system.bulk(), system.changing_pattern())
    }

    /// Prepares for GMRES on tangents of a motion and a pressure.
    pub(super) fn iterate_on_flow(&mut self, system: &System) -> Result<(), SolveError> {
        let layout = saddle::layout(system).map_err(|_| SolveError::NotFactored)?;
        self.iterative = Some(Iterative::of_saddles(layout, self.options));
        self.sum_on(system.bulk(), system.changing_pattern())
    }

    /// Takes a tangent that is applied; where the iteration is not at work its matrix is assembled for a factor.
    pub(super) fn take_applied(
        &mut self,
        system: &System,
        tangent: &Tangent,
        operator: Arc<dyn Operator>,
    ) -> Result<(), SolveError> {
        if self.iterates() {
            return self.take_for_iteration(Source::Applied(operator));
        }
        let matrix = without_matrix::assembled_with(system, tangent)?;
        self.take_for_factor(&matrix, true)
    }

    /// Takes a whole tangent: for the iteration where that is at work, else for a factor. Where no factor fits into the memory
    /// the iteration begins.
    pub(super) fn take_tangent(
        &mut self,
        system: &System,
        sum: Csr,
        on_faces: Option<&Arc<Csr>>,
        keeps: bool,
    ) -> Result<(), SolveError> {
        if self.iterates() {
            let sum = Arc::new(sum);
            return self.take_for_iteration(match on_faces {
                Some(part) => Source::Parted(sum, Arc::clone(part)),
                None => Source::Stored(sum),
            });
        }
        match self.take_for_factor(&sum, keeps) {
            Err(need @ SolveError::TooMuchMemory(_))
                if self.options.method == LinearMethod::Auto && self.iterative.is_none() && self.given_way == 0 =>
            {
                let Ok(layout) = iterative::layout(system) else { return Err(need) };
                self.solver = None;
                self.notes.push(format!("no factor fits into the memory: {ITERATION}"));
                self.iterative = Some(Iterative::of_tangents(layout, self.options));
                self.take_for_iteration(Source::Stored(Arc::new(sum))).map_err(|_| need)
            }
            other => other,
        }
    }

    /// Forgets a tangent that is applied, where the next one is about to be made: two of them are most of the memory of a run. Until that
    /// is taken nothing can be solved.
    pub fn forget_applied(&mut self) {
        if let (Some(Source::Applied(_)), Some(iterative)) = (&self.source, &mut self.iterative)
            && iterative.is_of_tangents()
        {
            self.source = None;
            iterative.forget_operator();
        }
    }

    fn take_for_iteration(&mut self, source: Source) -> Result<(), SolveError> {
        let Some(iterative) = &mut self.iterative else { return Err(SolveError::NotFactored) };
        let outcome = iterative.take(&source);
        self.source = Some(source);
        match outcome {
            Err(error) if is_of_iteration(&error) => self.set_aside(error),
            other => other,
        }
    }

    /// Lets a factor take the place of the iteration, with the matrix at hand; its error where none fits into the memory.
    fn set_aside(&mut self, error: SolveError) -> Result<(), SolveError> {
        let Some(iterative) = &mut self.iterative else { return Err(error) };
        let Some(matrix) = self.source.take().and_then(|source| source.matrix()) else { return Err(error) };
        iterative.set_aside(true);
        let name = iterative.name();
        match self.factor(&matrix) {
            Err(SolveError::TooMuchMemory(_)) => {
                self.solver = None;
                self.iterative.iter_mut().for_each(|iterative| iterative.set_aside(false));
                return Err(error);
            }
            outcome => outcome?,
        }
        self.given_way += 1;
        if self.given_way == 1 {
            self.note_factor(name, &error);
        }
        if self.given_way >= MOST_SET_ASIDE {
            self.iterative = None;
        }
        Ok(())
    }

    /// A new attempt begins: the iteration is tried again, with levels of its own.
    pub(super) fn expire_levels(&mut self) {
        if !matches!(self.kind, Kind::Full(_)) {
            return;
        }
        if let Some(iterative) = &mut self.iterative {
            iterative.set_aside(false);
            self.solver = None;
        }
    }

    /// Remembers how often factors have taken the place of the iteration.
    pub(super) fn recall_given_way(&mut self, given_way: usize) {
        self.given_way = given_way;
        if given_way >= MOST_SET_ASIDE && matches!(self.kind, Kind::Full(_)) {
            self.iterative = None;
        }
    }

    /// Conjugate gradients; a factor where they do not get to their end.
    pub(super) fn solve_by_iteration(
        &mut self,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<SolveReport, SolveError> {
        let Some(iterative) = &mut self.iterative else { return Err(SolveError::NotFactored) };
        let error = match iterative.solve(rhs, x, tolerance, self.source.as_ref()) {
            Err(error) if is_of_iteration(&error) => error,
            other => return other,
        };
        if iterative.is_of_tangents() {
            self.set_aside(error)?;
        } else {
            let Some(matrix) = self.source.take().and_then(|source| source.matrix()) else { return Err(error) };
            let name = iterative.name();
            self.note_factor(name, &error);
            self.iterative = None;
            self.factor(&matrix)?;
        }
        let report = self.solver.as_mut().ok_or(SolveError::NotFactored)?.solve(rhs, x)?;
        Ok(SolveReport { refactored: true, ..report })
    }

    /// Whether a symmetric matrix is positive definite by the levels of the iteration; `None` where it is not at work, or where a
    /// factor must tell.
    pub(super) fn looks_definite(&mut self, source: &Source) -> Option<bool> {
        if !self.iterates_on_tangents() {
            return None;
        }
        self.iterative.as_mut()?.looks_definite(source)
    }

    /// Whether a tangent that is applied is positive definite by the levels of the iteration; false where that is not known.
    pub fn finds_definite(&mut self, tangent: &Tangent) -> bool {
        let operator = tangent.operator();
        operator.is_some_and(|operator| self.looks_definite(&Source::Applied(operator)) == Some(true))
    }
}
