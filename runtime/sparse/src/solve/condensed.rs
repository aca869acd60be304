//! Systems `(K + C) x = b` with a constant symmetric bulk K and a part C that changes and touches few dofs.
//!
//! K is factored once wherever C cannot reach. Only the rest is factored again when C changes, in one of three ways:
//!
//! - Woodbury ([`woodbury`]): K stands alone, C is `J M` with few columns in J, and the capacitance matrix `1 + M K⁻¹ J`
//!   is factored, or a matrix of the size of the rows of M that have changed since it last was;
//! - dense: with I the dofs that C does not touch and G those that it does, `S0 = K_GG - K_GI K_II⁻¹ K_IG` is kept as a
//!   dense matrix and `S = S0 + C` is factored by LU with partial pivoting (Cholesky when C is symmetric and that
//!   succeeds);
//! - fronts: G is dissected like every other dof, and the fronts that see a dof of G, and those above them, are
//!   factored by LU. In three dimensions this is far cheaper for large G.
//!
//! When C changes a little, the old factor M of `K + C_old` still serves. With `D = C - C_old` and P the part of M⁻¹ on
//! G, `x = M⁻¹ (b + w)` where w lives on G and solves `(1 + D P) w = -D M⁻¹ b`: a few GMRES iterations, each of which
//! costs one pass over the changing part of the factor. They stop early, and M is factored again, once that is
//! cheaper. All decisions follow from operation counts and iterates, never from a clock.
//!
//! Promises: as `checked`, with the residual of `K + C` itself.
//! Does not find out what changes: the caller says so.

mod at_points;
mod capacitance;
mod engine;
mod flexibility;
mod points;
mod rows;
mod solver;
#[cfg(test)]
mod tests;
mod update;
mod woodbury;

use std::sync::Arc;

use super::SolverMemory;
use super::backward_error::BackwardErrorCheck;
use super::checked::{explain_bulk, explain_singular};
use super::dense::Kind;
use super::krylov::{Gmres, Limits};
use super::on_pattern::OnPattern;
use super::singularity::Found;
use super::symmetry::check_symmetry;
use super::triangular_solve::Transpose;
use super::{Precision, SolveError, SolveReport, SolverOptions};
use crate::csr::{Csr, Pattern};
pub use at_points::CheckedAtPoints;
pub use capacitance::Reference;
use engine::{Engine, EngineContext, MAX_ITERATIONS, Method};
use woodbury::Woodbury;

/// Up to this many changing dofs their matrix is dense.
pub const DENSE_LIMIT: usize = 600;
/// Largest dense matrix that stands in when pivots from within fronts do not suffice.
const DENSE_RESCUE_LIMIT: usize = 12_000;
/// Up to this many forces their capacitance matrix is cheaper than fronts.
const WOODBURY_LIMIT: usize = 7_000;
/// Iterations that a fresh factor of single precision may need for one solution before it is given up.
const SINGLE_ITERATIONS: usize = 40;
/// Iterations before their rate is looked at.
const TRIAL_ITERATIONS: usize = 10;
/// Iterations aim at this part of the tolerance, because their norm is not quite that of the backward-error check.
const WITHIN: f64 = 0.3;
/// Relative asymmetry up to which the changing part counts as symmetric, as [`Csr::is_symmetric`] takes it.
const ASYMMETRY: f64 = 1e-14;

/// How the changing part is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elimination {
    /// The capacitance matrix of the forces that change (Woodbury).
    Woodbury {
        /// Number of changing dofs.
        n_changing: usize,
        /// Number of forces: facing dofs share one.
        n_forces: usize,
        /// Whether the factors of that matrix and of the bulk are of single precision.
        single: bool,
    },
    /// One dense matrix of the changing dofs.
    Dense {
        /// Number of changing dofs.
        n_changing: usize,
    },
    /// Sparse LU of the fronts that see a changing dof.
    Fronts {
        /// Number of changing dofs.
        n_changing: usize,
    },
}

impl std::fmt::Display for Elimination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Elimination::Woodbury { n_changing, n_forces, single } => {
                let precision = if *single { ", factors of single precision" } else { "" };
                write!(
                    f,
                    "constant bulk factored once, capacitance matrix of {n_forces} forces on {n_changing} changing \
                     dofs{precision}"
                )
            }
            Elimination::Dense { n_changing } => {
                write!(f, "constant bulk factored once, dense matrix of {n_changing} changing dofs")
            }
            Elimination::Fronts { n_changing } => {
                write!(f, "constant bulk factored once, sparse LU of the fronts with {n_changing} changing dofs")
            }
        }
    }
}

/// The one place where the elimination is chosen; Woodbury gives way to fronts where the bulk cannot stand alone.
fn choose(n_changing: usize, n_forces: usize) -> Elimination {
    if n_changing <= DENSE_LIMIT {
        Elimination::Dense { n_changing }
    } else if n_forces <= WOODBURY_LIMIT {
        Elimination::Woodbury { n_changing, n_forces, single: false }
    } else {
        Elimination::Fronts { n_changing }
    }
}

/// Solver for a constant symmetric bulk and a part that changes.
///
/// The bulk without its changing dofs must be positive definite; bulk and changing part together may be anything
/// regular.
pub struct CheckedCondensed {
    bulk: Csr,
    changing: OnPattern,
    /// Dofs that the changing part touches, increasing.
    dofs: Vec<u32>,
    coordinates: Option<Vec<[f64; 3]>>,
    engine: Engine,
    /// Iterations made with the factor at hand.
    spent: usize,
    /// Factors made and not yet reported.
    factorisations: usize,
    check: BackwardErrorCheck,
    /// For each entry of the changing part the entry across the diagonal.
    mirror: Option<Vec<usize>>,
    /// The changing part, less the one in the factor, on the changing dofs.
    difference: Csr,
    /// Values of the changing part in the factor.
    factored: Vec<f64>,
    gmres: Gmres,
    state: State,
    /// Whether the fresh factor has been searched for a null vector.
    null_space_is_clear: bool,
}

/// What is known about the factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// No matrix, or one that was refused.
    Empty,
    /// The factor is that of the matrix.
    Fresh,
    /// The factor is that of an earlier matrix, to be tried first.
    Stale,
}

impl CheckedCondensed {
    /// Analyses and factors the constant part. `changing` (n x n) is the pattern in which the changing part may have
    /// entries; `coordinates`, one point (any length unit) a dof, make the ordering good. `pairs` are dofs that face
    /// each other across an interface: where their rows of the changing part turn out to be opposite they share a
    /// force.
    ///
    /// # Errors
    /// [`SolveError::Shape`] for sizes that do not fit, [`SolveError::NonFiniteMatrix`], [`SolveError::NotSymmetric`],
    /// and [`SolveError::NotPositiveDefinite`] or [`SolveError::Singular`] when the bulk is not positive definite with
    /// the changing dofs held fixed (a body that nothing holds); [`SolveError::TooMuchMemory`].
    pub fn new(
        bulk: &Csr,
        changing: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        pairs: &[(u32, u32)],
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        Self::with_choice(bulk, changing, coordinates, pairs, options, choose)
    }

    /// As [`CheckedCondensed::new`], the elimination chosen by the caller.
    pub(super) fn with_choice(
        bulk: &Csr,
        changing: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        pairs: &[(u32, u32)],
        options: SolverOptions,
        choose: impl Fn(usize, usize) -> Elimination,
    ) -> Result<Self, SolveError> {
        let n = bulk.n_rows();
        let sizes = [("columns of the bulk", bulk.n_cols()), ("rows of the changing part", changing.n_rows())];
        for (what, found) in sizes.into_iter().chain([("columns of the changing part", changing.n_cols())]) {
            if found != n {
                return Err(SolveError::Shape { what, expected: n, found });
            }
        }
        if let Some((row, column)) = bulk.first_non_finite() {
            return Err(SolveError::NonFiniteMatrix { row, column });
        }
        check_symmetry(bulk)?;
        let dofs = touched(changing);
        let (threads, precision) = (options.threads, options.precision);
        let context = EngineContext { bulk, changing, dofs: &dofs, coordinates, pairs, threads, precision };
        let engine = match choose(dofs.len(), Woodbury::count(changing, pairs)) {
            Elimination::Woodbury { .. } => match context.woodbury() {
                Err(SolveError::NotPositiveDefinite { .. }) => context.fronts(),
                other => other,
            },
            Elimination::Dense { .. } => context.dense(),
            Elimination::Fronts { .. } => context.fronts(),
        };
        let engine = match engine {
            Ok(engine) => engine,
            Err(error @ SolveError::NotPositiveDefinite { .. }) => {
                return Err(explain_bulk(bulk, &dofs, coordinates, options, error));
            }
            Err(error) => return Err(error),
        };
        let (transposed, sources) = changing.transpose();
        let mut check = BackwardErrorCheck::new(n, options);
        check.set_constant_part(bulk);
        Ok(Self {
            mirror: (transposed == **changing).then_some(sources),
            difference: Csr::zeros(Arc::new(on_dofs(changing, &dofs)?)),
            factored: Vec::new(),
            bulk: bulk.clone(),
            changing: OnPattern::new(changing),
            coordinates: coordinates.map(<[_]>::to_vec),
            dofs,
            engine,
            spent: 0,
            factorisations: 0,
            check,
            gmres: Gmres::new(MAX_ITERATIONS),
            state: State::Empty,
            null_space_is_clear: false,
        })
    }

    /// How the changing part is solved.
    pub fn elimination(&self) -> Elimination {
        let n_changing = self.dofs.len();
        match &self.engine.method {
            Method::Woodbury(woodbury) => {
                Elimination::Woodbury { n_changing, n_forces: woodbury.n_forces(), single: woodbury.is_single() }
            }
            Method::Dense { .. } => Elimination::Dense { n_changing },
            Method::Fronts { .. } => Elimination::Fronts { n_changing },
        }
    }

    /// Sets the changing part (n x n). The first call factors; later ones may leave that to the next solve, which then
    /// reports what went wrong.
    ///
    /// # Errors
    /// [`SolveError::OutsidePattern`] for an entry outside the pattern given at the start,
    /// [`SolveError::NonFiniteMatrix`], [`SolveError::Singular`], [`SolveError::TooMuchMemory`]; the solver then holds
    /// no matrix.
    pub fn update(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let before = self.state;
        self.state = State::Empty;
        self.changing.take(changing)?;
        self.check.set_matrix(&[&self.bulk, &self.changing.matrix])?;
        let is_useless = self.engine.take(&self.changing.matrix)? || before == State::Empty;
        if !is_useless && self.factored == self.changing.matrix.values() {
            self.state = State::Fresh;
            return Ok(());
        }
        // A change that an older factor serves badly shows in the iterations that it costs.
        if is_useless || self.spent >= self.engine.worthwhile_iterations() {
            return self.refactor();
        }
        for ((value, new), old) in
            self.difference.values_mut().iter_mut().zip(self.changing.matrix.values()).zip(&self.factored)
        {
            *value = new - old;
        }
        self.state = State::Stale;
        Ok(())
    }

    /// How often the changing part has been factored since this was last asked.
    pub fn take_factorisations(&mut self) -> usize {
        std::mem::take(&mut self.factorisations)
    }

    /// What later solutions depend on beside the matrices that are still to come.
    pub fn memory(&self) -> SolverMemory {
        let mut memory = SolverMemory { spent: self.spent, ..SolverMemory::default() };
        if self.state != State::Empty {
            memory.factored.clone_from(&self.factored);
        }
        match &self.engine.method {
            Method::Woodbury(woodbury) => {
                memory.apart = woodbury.apart().to_vec();
                memory.single = woodbury.is_single();
                memory.reference = woodbury.reference();
            }
            Method::Dense { .. } => memory.dense = true,
            Method::Fronts { .. } => {}
        }
        memory
    }

    /// Goes back to what an earlier solver of the same bulk remembered of a changing part with this pattern, so that
    /// what follows is the same bit by bit; false if that does not fit.
    ///
    /// # Errors
    /// As [`CheckedCondensed::update`].
    pub fn recall(&mut self, pattern: &Arc<Pattern>, memory: &SolverMemory) -> Result<bool, SolveError> {
        let mut changing = Csr::zeros(Arc::clone(pattern));
        if memory.factored.len() != changing.values().len() {
            return Ok(false);
        }
        changing.values_mut().copy_from_slice(&memory.factored);
        if memory.dense {
            self.rescue()?;
        }
        if let Method::Woodbury(woodbury) = &mut self.engine.method {
            woodbury.part(&memory.apart);
            woodbury.remember(memory.reference.clone());
        }
        self.engine.set_single(memory.single && self.check.options().precision != Precision::Double, &self.bulk)?;
        self.state = State::Empty;
        self.update(&changing)?;
        self.spent = memory.spent;
        Ok(true)
    }

    /// Makes the factor that of the matrix.
    fn refactor(&mut self) -> Result<(), SolveError> {
        self.state = State::Empty;
        self.spent = 0;
        self.factorisations += 1;
        self.null_space_is_clear = false;
        self.check.set_weak(false);
        let kind = if self.is_symmetric() { Kind::Symmetric } else { Kind::General };
        let mut outcome = self.engine.factor(&self.bulk, &self.changing.matrix, kind);
        if matches!(outcome, Err(SolveError::VanishingPivot { .. })) && self.rescue()? {
            outcome = self.engine.factor(&self.bulk, &self.changing.matrix, kind);
        }
        let pivot = match outcome {
            Ok(pivot) => pivot,
            Err(error @ SolveError::VanishingPivot { .. }) => {
                let sum = self.bulk.plus(&self.changing.matrix)?;
                let coordinates = self.coordinates.as_deref();
                return Err(explain_singular(&mut self.check, &sum, coordinates, error));
            }
            Err(error) => return Err(error),
        };
        if pivot.is_suspicious() {
            self.check_null_space()?;
        }
        self.factored.clear();
        self.factored.extend_from_slice(self.changing.matrix.values());
        self.state = State::Fresh;
        Ok(())
    }

    fn is_symmetric(&self) -> bool {
        let Some(mirror) = &self.mirror else { return false };
        let matrix = &self.changing.matrix;
        let (sizes, values, starts) = (matrix.row_sizes(), matrix.values(), matrix.pattern().row_starts());
        (0..matrix.n_rows()).all(|row| {
            let own = starts[row]..starts[row + 1];
            own.zip(matrix.row(row).0).all(|(k, column)| {
                (values[k] - values[mirror[k]]).abs() <= ASYMMETRY * sizes[row] * sizes[*column as usize]
            })
        })
    }

    /// Turns from fronts to the dense matrix, whose pivots come from all changing dofs; false when it is in use, or
    /// would be too large.
    fn rescue(&mut self) -> Result<bool, SolveError> {
        if matches!(self.engine.method, Method::Dense { .. }) || self.dofs.len() > DENSE_RESCUE_LIMIT {
            return Ok(false);
        }
        let context = EngineContext {
            bulk: &self.bulk,
            changing: self.changing.matrix.pattern(),
            dofs: &self.dofs,
            coordinates: self.coordinates.as_deref(),
            pairs: &[],
            threads: self.check.options().threads,
            precision: self.check.options().precision,
        };
        self.engine = context.dense()?;
        Ok(true)
    }

    fn check_null_space(&mut self) -> Result<(), SolveError> {
        if self.null_space_is_clear {
            return Ok(());
        }
        let (engine, check) = (&mut self.engine, &mut self.check);
        let solver = &mut |transpose, x: &mut [f64]| engine.solve(transpose, x);
        match check.find_null_vector(&[&self.bulk, &self.changing.matrix], solver) {
            Found::Singular(error) => {
                self.state = State::Empty;
                Err(error)
            }
            other => {
                self.null_space_is_clear = true;
                self.check.set_weak(matches!(other, Found::Weak));
                Ok(())
            }
        }
    }

    /// Looks for a null vector; true if the matrix turns out to be ill-conditioned, which was not known before.
    fn is_found_weak(&mut self) -> Result<bool, SolveError> {
        let was_weak = self.check.is_weak();
        self.check_null_space()?;
        Ok(self.check.is_weak() && !was_weak)
    }

    /// Solves `(bulk + changing) x = rhs`; vectors are by dof.
    ///
    /// # Errors
    /// Those of the solutions with the matrix itself.
    pub fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
        self.solve_to(rhs, x, 0.0)
    }

    /// As [`CheckedCondensed::solve`], but a true residual of no more than `tolerance` of the right-hand side is good
    /// enough (2-norms of the equations scaled to a unit diagonal; no unit).
    ///
    /// # Errors
    /// Those of the solutions with the matrix itself.
    pub fn solve_to(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<SolveReport, SolveError> {
        if self.state == State::Empty {
            return Err(SolveError::NotFactored);
        }
        self.check.check_rhs(rhs, x)?;
        let mut krylov_iterations = 0;
        let mut refactored = false;
        if self.state == State::Stale {
            let (iterations, report) = self.iterate(rhs, x, tolerance, self.engine.worthwhile_iterations());
            krylov_iterations += iterations;
            if let Some(report) = report {
                self.spent += iterations;
                return Ok(SolveReport { krylov_iterations, ..report });
            }
            self.refactor()?;
            refactored = true;
        }
        if self.engine.is_single() {
            loop {
                if let Some(report) = self.solve_single(rhs, x, tolerance) {
                    return Ok(SolveReport { krylov_iterations, refactored, ..report });
                }
                if !self.engine.forget() {
                    break;
                }
                self.refactor()?;
                refactored = true;
            }
            let (iterations, report) = self.iterate(rhs, x, tolerance, SINGLE_ITERATIONS);
            krylov_iterations += iterations;
            if let Some(report) = report {
                return Ok(SolveReport { krylov_iterations, refactored, ..report });
            }
            self.engine.set_single(false, &self.bulk)?;
            self.refactor()?;
            refactored = true;
        }
        let mut report = self.solve_fresh(rhs, x, tolerance);
        if matches!(report, Err(SolveError::ResidualTooLarge { .. })) && self.engine.forget() {
            self.refactor()?;
            refactored = true;
            report = self.solve_fresh(rhs, x, tolerance);
        }
        if matches!(report, Err(SolveError::ResidualTooLarge { .. })) {
            self.check_null_space()?;
            if self.rescue()? {
                self.refactor()?;
                refactored = true;
                report = self.solve_fresh(rhs, x, tolerance);
            }
        }
        let mut report = report?;
        if self.check.has_grown(rhs, x) && self.is_found_weak()? {
            report = self.solve_fresh(rhs, x, tolerance)?;
        }
        Ok(SolveReport { krylov_iterations, refactored, ..report })
    }

    /// Solves with a factor of single precision and true residuals; a report when that was good enough.
    fn solve_single(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Option<SolveReport> {
        let report = self.solve_fresh(rhs, x, tolerance).ok()?;
        (self.check.is_satisfied(tolerance) && !self.check.has_grown(rhs, x)).then_some(report)
    }

    fn solve_fresh(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<SolveReport, SolveError> {
        let engine = &mut self.engine;
        let parts = [&self.bulk, &self.changing.matrix];
        self.check.solve(&parts, &mut |x| engine.solve(Transpose::No, x), rhs, x, tolerance)
    }

    /// Solves with a stale factor, or one of single precision, in at most so many iterations; their number, and a
    /// report when that was good enough.
    fn iterate(&mut self, rhs: &[f64], x: &mut [f64], tolerance: f64, allowed: usize) -> (usize, Option<SolveReport>) {
        let (engine, gmres, difference, dofs) = (&mut self.engine, &mut self.gmres, &self.difference, &self.dofs);
        let smallest = self.check.options().iteration_tolerance;
        let wanted = WITHIN * tolerance * self.check.scaled_norm(rhs);
        let trial_iterations = TRIAL_ITERATIONS;
        let scale = self.check.scale().to_vec();
        let (mut iterations, mut converged) = (0, true);
        let mut on_dofs = vec![0.0; dofs.len()];
        let mut start = vec![0.0; dofs.len()];
        let mut solved = vec![0.0; dofs.len()];
        let mut solver = |b: &mut [f64]| {
            let max_iterations = allowed.saturating_sub(iterations);
            let size = b.iter().zip(&scale).map(|(b, s)| (b * s) * (b * s)).sum::<f64>().sqrt();
            let limits = Limits { target: wanted.max(smallest * size), max_iterations, trial_iterations };
            let target = (WITHIN * tolerance).max(smallest) * b.iter().map(|value| value * value).sum::<f64>().sqrt();
            let plain = Limits { target, ..limits };
            if let Some(outcome) = engine.solve_stale(b, gmres, limits, plain, &scale, difference) {
                iterations += outcome.iterations;
                converged &= outcome.converged;
                return;
            }
            let mut first = b.to_vec();
            engine.solve(Transpose::No, &mut first);
            on_dofs.iter_mut().zip(dofs).for_each(|(value, &dof)| *value = first[dof as usize]);
            difference.multiply(&on_dofs, &mut start, 1);
            start.iter_mut().for_each(|value| *value = -*value);
            let mut w = vec![0.0; dofs.len()];
            let mut multiply = |w: &[f64], out: &mut [f64]| {
                solved.copy_from_slice(w);
                engine.solve_changing(dofs, &mut solved);
                out.copy_from_slice(w);
                difference.multiply_add(&solved, out, 1);
            };
            let outcome = gmres.solve(&mut multiply, &start, &mut w, plain);
            iterations += outcome.iterations;
            converged &= outcome.converged;
            if outcome.converged {
                dofs.iter().zip(&w).for_each(|(&dof, w)| b[dof as usize] += w);
                engine.solve(Transpose::No, b);
            } else {
                b.fill(f64::NAN);
            }
        };
        let parts = [&self.bulk, &self.changing.matrix];
        let outcome = self.check.solve(&parts, &mut solver, rhs, x, tolerance);
        let has_grown = outcome.is_ok() && self.check.has_grown(rhs, x);
        (iterations, outcome.ok().filter(|_| converged && !has_grown))
    }
}

/// Dofs with an entry in their row or column, increasing.
fn touched(pattern: &Pattern) -> Vec<u32> {
    let mut is_touched = vec![false; pattern.n_rows()];
    for row in 0..pattern.n_rows() {
        is_touched[row] |= !pattern.row(row).is_empty();
        pattern.row(row).iter().for_each(|&column| is_touched[column as usize] = true);
    }
    (0..pattern.n_rows() as u32).filter(|&dof| is_touched[dof as usize]).collect()
}

/// The same entries, in the same order, numbered by their place in `dofs`.
fn on_dofs(pattern: &Pattern, dofs: &[u32]) -> Result<Pattern, SolveError> {
    let mut place = vec![0u32; pattern.n_rows()];
    dofs.iter().zip(0..).for_each(|(&dof, at)| place[dof as usize] = at);
    let mut row_starts = vec![0];
    row_starts.extend(dofs.iter().map(|&dof| pattern.row_starts()[dof as usize + 1]));
    let columns = pattern.columns().iter().map(|&column| place[column as usize]).collect();
    Ok(Pattern::new(dofs.len(), dofs.len(), row_starts, columns)?)
}
