//! Conjugate gradients with the multigrid preconditioner, wrapped as every solver is: with the true residual.
//!
//! Promises: what comes back as a solution has a backward error below the limit, measured with the matrix itself. A
//! matrix that is singular is told apart from one that is not positive definite.

use std::sync::Arc;

use super::super::backward_error::{BackwardErrorCheck, inverse_norm_estimate};
use super::super::symmetry::check_symmetry;
use super::super::{LinearSolver, SolveError, SolveReport, SolverOptions};
use super::conjugate_gradients::{ConjugateGradients, Ending, Goal, Outcome, scaled_norm};
use super::cycle::Cycle;
use super::level::dot;
use super::nodes::NodeLayout;
use super::operator::Operator;
use super::wear::Wear;
use crate::csr::Csr;

/// Energy norm of the error that is left, relative to the solution: a hundredth of the relative residual at which
/// Newton's iteration ends by default, so that measures agree with those of a factor to 1e-10.
const ERROR: f64 = 1e-12;
/// Most iterations of one solution. A factor is worth more than several hundred cycles wherever it fits.
const MOST: usize = 600;
/// Most iterations with the levels of an earlier matrix: new ones, which cost some ten iterations, do better then.
const MOST_OF_KEPT: usize = 80;
/// Error of the solution that looks for a direction of negative energy. A negative eigenvalue lies apart from those that the
/// levels bring near one, and Lanczos' method, of which this is a form, has found it in as many iterations.
const PROBED: f64 = 1e-8;
/// Times that a solution is continued from its true residual.
const RESTARTS: usize = 3;
/// A true residual that differs by this part from that of the recursion is a new start.
const DRIFT: f64 = 0.5;
/// Error of a solution for what is left of another one, and of those that estimate a condition number.
const ROUGH: f64 = 1e-2;

/// Solver for large sparse symmetric positive definite matrices whose unknowns belong to nodes.
pub struct CheckedMultigrid {
    layout: NodeLayout,
    check: BackwardErrorCheck,
    loaded: Option<Loaded>,
    iteration: ConjugateGradients,
    wear: Wear,
}

/// What is solved with.
#[derive(Clone)]
pub enum Source {
    /// A matrix.
    Stored(Arc<Csr>),
    /// A matrix and the part of it that terms on faces have, which need not be symmetric.
    Parted(Arc<Csr>, Arc<Csr>),
    /// An operator in its place.
    Applied(Arc<dyn Operator>),
}

impl Source {
    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        match self {
            Self::Stored(matrix) | Self::Parted(matrix, _) => matrix.n_rows(),
            Self::Applied(operator) => operator.n_rows(),
        }
    }

    /// The matrix, assembled now where there is none; `None` where it cannot be made.
    #[must_use]
    pub fn matrix(&self) -> Option<Arc<Csr>> {
        match self {
            Self::Stored(matrix) | Self::Parted(matrix, _) => Some(Arc::clone(matrix)),
            Self::Applied(operator) => operator.matrix(),
        }
    }

    fn multiply(&self, x: &[f64], y: &mut [f64], threads: usize) {
        match self {
            Self::Stored(matrix) | Self::Parted(matrix, _) => matrix.multiply(x, y, threads),
            Self::Applied(operator) => operator.apply(x, y),
        }
    }
}

/// A matrix with its levels.
struct Loaded {
    /// `None` once it was forgotten.
    source: Option<Source>,
    is_applied: bool,
    threads: usize,
    cycle: Cycle,
    /// The levels are those of an earlier matrix.
    is_kept: bool,
}

impl Loaded {
    fn new(source: Source, threads: usize, cycle: Cycle) -> Self {
        let is_applied = matches!(source, Source::Applied(_));
        Self { source: Some(source), is_applied, threads, cycle, is_kept: false }
    }
}

impl CheckedMultigrid {
    /// Prepares for matrices with this layout; the levels are made with the matrix.
    pub fn new(layout: NodeLayout, options: SolverOptions) -> Self {
        let check = BackwardErrorCheck::new(layout.places.len(), options);
        Self { layout, check, loaded: None, iteration: ConjugateGradients::default(), wear: Wear::default() }
    }

    /// Whether an operator is solved with.
    #[must_use]
    pub fn is_applied(&self) -> bool {
        self.loaded.as_ref().is_some_and(|loaded| loaded.is_applied)
    }

    /// Number of unknowns by level, the finest first; empty without a matrix.
    pub fn level_sizes(&self) -> &[usize] {
        self.loaded.as_ref().map_or(&[], |loaded| loaded.cycle.sizes())
    }

    /// Bytes of all levels.
    pub fn bytes(&self) -> usize {
        self.loaded.as_ref().map_or(0, |loaded| loaded.cycle.bytes())
    }

    /// As [`LinearSolver::factor`], without a copy of the matrix.
    ///
    /// # Errors
    /// As [`LinearSolver::factor`].
    pub fn take(&mut self, matrix: Arc<Csr>) -> Result<(), SolveError> {
        (self.loaded, self.wear) = (None, Wear::default());
        self.layout.check(&matrix)?;
        self.check.set_matrix(&[&matrix])?;
        check_symmetry(&matrix)?;
        let mut cycle = Cycle::new(&[&matrix], &self.layout)?;
        self.look_for_null_vector(&matrix, &mut cycle)?;
        self.loaded = Some(Loaded::new(Source::Stored(matrix), self.check.options().threads, cycle));
        Ok(())
    }

    /// Takes a matrix, or an operator, and keeps the levels of an earlier one, as long as new ones would cost more than is lost with
    /// these; false where it needs levels of its own.
    ///
    /// # Errors
    /// As [`LinearSolver::factor`].
    pub fn keep_levels(&mut self, source: &Source) -> Result<bool, SolveError> {
        if self.wear.is_over() {
            return Ok(false);
        }
        let Some(loaded) = &mut self.loaded else { return Ok(false) };
        match source {
            Source::Stored(matrix) | Source::Parted(matrix, _) => {
                self.check.set_matrix(&[matrix])?;
                check_symmetry(matrix)?;
            }
            Source::Applied(operator) => self.check.set_operator(&**operator)?,
        }
        loaded.is_applied = matches!(source, Source::Applied(_));
        (loaded.source, loaded.is_kept) = (Some(source.clone()), true);
        Ok(true)
    }

    /// Forgets the matrix, or the operator, and keeps the levels: the next one is about to be made.
    pub fn forget_source(&mut self) {
        self.loaded.iter_mut().for_each(|loaded| loaded.source = None);
    }

    /// The next matrix gets levels of its own.
    pub fn expire(&mut self) {
        self.wear.expire();
    }

    /// Whether the levels in use are those of an earlier matrix.
    #[must_use]
    pub fn has_kept_levels(&self) -> bool {
        self.loaded.as_ref().is_some_and(|loaded| loaded.is_kept)
    }

    /// Whether a matrix, or an operator, is positive definite, as far as a solution from a start that is orthogonal to no direction in particular
    /// tells; the levels at hand serve, and have as many negative directions as they should: none. `None` where there are no
    /// levels, or the iteration does not get to its end.
    ///
    /// # Errors
    /// As [`LinearSolver::factor`].
    pub fn looks_definite(&mut self, source: &Source) -> Result<Option<bool>, SolveError> {
        let Some(loaded) = &mut self.loaded else { return Ok(None) };
        let n = source.n_rows();
        self.layout.check_rows(n)?;
        let rhs: Vec<f64> = (1..=n).map(|i| (i as f64 * 0.618_033_988_749_894_9).fract() - 0.5).collect();
        let (threads, places, cycle) = (loaded.threads, &self.layout.places, &mut loaded.cycle);
        let mut multiply = |x: &[f64], y: &mut [f64]| source.multiply(x, y, threads);
        let mut precondition = |r: &[f64], z: &mut [f64]| cycle.apply(places, r, z);
        let goal = Goal { error: PROBED, left: 0.0, scale: &[], most: MOST };
        let mut x = vec![0.0; n];
        Ok(match self.iteration.solve(&mut multiply, &mut precondition, &rhs, &mut x, goal).ending {
            Ending::Converged => Some(true),
            Ending::NotPositiveDefinite => Some(false),
            Ending::TooSlow => None,
        })
    }

    /// As [`Self::take`] with an operator. False where its coarsest level looks singular: whether the matrix is, only the
    /// matrix tells.
    ///
    /// # Errors
    /// As [`LinearSolver::factor`].
    pub fn take_operator(&mut self, operator: Arc<dyn Operator>) -> Result<bool, SolveError> {
        (self.loaded, self.wear) = (None, Wear::default());
        self.layout.check_rows(operator.n_rows())?;
        self.check.set_operator(&*operator)?;
        let mut cycle = Cycle::of_operator(operator.levels().ok_or(SolveError::NotFactored)?, &self.layout)?;
        if cycle.take_softest_motion(&self.layout.places).is_some() {
            return Ok(false);
        }
        self.loaded = Some(Loaded::new(Source::Applied(operator), self.check.options().threads, cycle));
        Ok(true)
    }

    /// The error for a matrix whose coarsest level looks singular, if it is singular itself.
    fn look_for_null_vector(&mut self, matrix: &Csr, cycle: &mut Cycle) -> Result<(), SolveError> {
        let Some(motion) = cycle.take_softest_motion(&self.layout.places) else { return Ok(()) };
        match self.check.as_singular(&[matrix], motion) {
            Some(error) => Err(error),
            None => cycle.trust(),
        }
    }

    /// Solves until the error, or the scaled residual, is no more than this part of what it is at the start (zero for a residual
    /// that is not asked about).
    fn iterate(
        &mut self,
        source: &Source,
        loaded: &mut Loaded,
        rhs: &[f64],
        x: &mut [f64],
        [error, left]: [f64; 2],
    ) -> Outcome {
        let (places, scale) = (&self.layout.places, self.check.scale());
        let most = if loaded.is_kept { MOST_OF_KEPT } else { MOST };
        let left = if left > 0.0 { left * scaled_norm(rhs, scale) } else { 0.0 };
        let (threads, cycle) = (loaded.threads, &mut loaded.cycle);
        let mut multiply = |x: &[f64], y: &mut [f64]| source.multiply(x, y, threads);
        let mut precondition = |r: &[f64], z: &mut [f64]| cycle.apply(places, r, z);
        self.iteration.solve(&mut multiply, &mut precondition, rhs, x, Goal { error, left, scale, most })
    }

    /// As [`LinearSolver::solve`], but an error of `tolerance` (energy norm, relative) is good enough.
    ///
    /// # Errors
    /// As [`LinearSolver::solve`]; [`SolveError::NotPositiveDefinite`] or [`SolveError::TooManyIterations`] where the
    /// iteration showed that a factor is needed.
    pub fn solve_to(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<SolveReport, SolveError> {
        let Some(mut loaded) = self.loaded.take() else { return Err(SolveError::NotFactored) };
        let result = self.solve_with(&mut loaded, rhs, x, [tolerance.max(ERROR), 0.0]);
        self.loaded = Some(loaded);
        result
    }

    /// As [`LinearSolver::solve`], but a residual of `left` of the right-hand side is good enough (2-norms of scaled equations).
    ///
    /// # Errors
    /// As [`Self::solve_to`].
    pub fn solve_until(&mut self, rhs: &[f64], x: &mut [f64], left: f64) -> Result<SolveReport, SolveError> {
        let Some(mut loaded) = self.loaded.take() else { return Err(SolveError::NotFactored) };
        let result = self.solve_with(&mut loaded, rhs, x, [ERROR, left]);
        self.loaded = Some(loaded);
        result
    }

    fn solve_with(
        &mut self,
        loaded: &mut Loaded,
        rhs: &[f64],
        x: &mut [f64],
        [error, asked]: [f64; 2],
    ) -> Result<SolveReport, SolveError> {
        let source = loaded.source.clone().ok_or(SolveError::NotFactored)?;
        self.check.check_rhs(rhs, x)?;
        x.fill(0.0);
        if rhs.iter().all(|value| *value == 0.0) {
            return Ok(SolveReport::default());
        }
        let (mut iterations, mut wanted, mut left) = (0, error, rhs.to_vec());
        let tolerance = if asked > 0.0 { asked } else { error };
        let (mut part, mut product) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        let mut before = norm(rhs);
        for round in 0..=RESTARTS {
            let outcome = self.iterate(&source, loaded, &left, &mut part, [wanted, asked * norm(rhs) / norm(&left)]);
            iterations += outcome.iterations;
            match outcome.ending {
                Ending::Converged => {}
                Ending::TooSlow => {
                    return Err(SolveError::TooManyIterations { iterations, reached: outcome.error, wanted });
                }
                Ending::NotPositiveDefinite => {
                    return Err(SolveError::NotPositiveDefinite { dof: 0, pivot: f64::NAN });
                }
            }
            if round == 0 {
                self.wear.hear(iterations, outcome.error);
            }
            x.iter_mut().zip(&part).for_each(|(x, part)| *x += part);
            source.multiply(x, &mut product, loaded.threads);
            left.iter_mut().zip(rhs).zip(&product).for_each(|((left, b), product)| *left = b - product);
            let now = norm(&left);
            let has_drifted = now > (1.0 + DRIFT) * norm(self.iteration.residual()) && now <= DRIFT * before;
            let report = match &source {
                Source::Stored(matrix) | Source::Parted(matrix, _) => self.check.judge(&[&**matrix], rhs, x, tolerance),
                Source::Applied(operator) => self.check.judge_product(&**operator, (rhs, x), &product, tolerance),
            };
            // rounding in the recursion, or an error that the preconditioner hides: on from the true residual
            if round == RESTARTS || now == 0.0 || !has_drifted && report.is_ok() {
                return report.map(|report| SolveReport { krylov_iterations: iterations, ..report });
            }
            (before, wanted) = (now, ROUGH);
        }
        Err(SolveError::NotFactored)
    }
}

fn norm(r: &[f64]) -> f64 {
    dot(r, r).sqrt()
}

impl LinearSolver for CheckedMultigrid {
    fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        self.take(Arc::new(matrix.clone()))
    }

    fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
        self.solve_to(rhs, x, ERROR)
    }

    fn condition_estimate(&mut self) -> Result<f64, SolveError> {
        let Some(mut loaded) = self.loaded.take() else { return Err(SolveError::NotFactored) };
        let source = loaded.source.clone().ok_or(SolveError::NotFactored)?;
        let n = self.layout.places.len();
        let mut solver = |_, x: &mut [f64]| {
            let rhs = x.to_vec();
            self.iterate(&source, &mut loaded, &rhs, x, [ROUGH, 0.0]);
        };
        let inverse = inverse_norm_estimate(n, &mut solver);
        let norm = match &source {
            Source::Stored(matrix) | Source::Parted(matrix, _) => matrix.norm_1(),
            // of a symmetric matrix that of the rows is that of the columns
            Source::Applied(_) => self.check.norm(),
        };
        let estimate = inverse * norm;
        self.loaded = Some(loaded);
        Ok(estimate)
    }

    fn is_negative(&self) -> Option<bool> {
        self.loaded.as_ref().map(|_| false)
    }
}
