//! Backward-error checks, iterative refinement, condition numbers.
//!
//! Promises: residuals are those of the matrix itself, in double-double where they are used for corrections; solutions
//! with a matrix that is known to be ill-conditioned are refined until that gives no more. What is singular is defined in
//! `singularity`. Does not know how systems are solved: a solver is a function that overwrites a vector, of several ranks
//! one of equations ([`RowOwners`]) by one of unknowns.

use wfl_host::team::{Alone, Team};

use super::multigrid::Operator;
use super::row_owners::RowOwners;
use super::scaling::symmetric_scale;
use super::triangular_solve::Transpose;
use super::{NullVector, SolveError, SolveReport, SolverOptions};
use crate::csr::{Csr, residual_and_size, residual_compensated};
use crate::norm::largest;

/// Growth `‖A‖ ‖x‖ / ‖b‖` above which the null space is examined.
const SUSPICIOUS_GROWTH: f64 = 1e12;
/// Refinement starts above these backward errors: of the scaled matrix, and of single rows.
const GOOD_RESIDUAL: f64 = 1e-13;
const GOOD_COMPONENT: f64 = 1e-10;
/// Steps of refinement with an ill-conditioned matrix: each halves the error at least, or is the last.
const MOST_OF_WEAK: usize = 50;

/// Row sums of magnitudes.
fn absolute_sums(part: &Csr) -> Vec<f64> {
    (0..part.n_rows()).map(|row| part.row(row).1.iter().map(|value| value.abs()).sum()).collect()
}

/// Measures solutions of `(A + B + ...) x = b`.
pub(super) struct BackwardErrorCheck {
    options: SolverOptions,
    residual: Vec<f64>,
    magnitude: Vec<f64>,
    /// Row sums of magnitudes, and their largest.
    row_sums: Vec<f64>,
    norm: f64,
    /// Scale to a unit diagonal.
    scale: Vec<f64>,
    /// Row sums of magnitudes and diagonal of a first part that never changes.
    constant: Option<(Vec<f64>, Vec<f64>)>,
    /// Where matrices have the rows of one of several ranks.
    owners: Option<RowOwners>,
    /// Of the solution checked last.
    last: Measure,
    /// The matrix is known to be ill-conditioned: a small residual says little of a solution.
    is_weak: bool,
}

/// Backward errors of one solution.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Measure {
    relative: f64,
    componentwise: f64,
    /// 2-norm of the scaled residual relative to that of the right-hand side.
    left: f64,
}

impl BackwardErrorCheck {
    pub(super) fn new(n: usize, options: SolverOptions) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            options,
            residual: zeros(),
            magnitude: zeros(),
            row_sums: zeros(),
            norm: 0.0,
            scale: vec![1.0; n],
            constant: None,
            owners: None,
            last: Measure::default(),
            is_weak: false,
        }
    }

    /// Says whether the matrix to solve with is known to be ill-conditioned.
    pub(super) fn set_weak(&mut self, is_weak: bool) {
        self.is_weak = is_weak;
    }

    /// Whether it is.
    pub(super) fn is_weak(&self) -> bool {
        self.is_weak
    }

    /// For matrices with the rows of this rank alone; all ranks then check together.
    pub(super) fn on(self, owners: Option<RowOwners>) -> Self {
        Self { owners, ..self }
    }

    /// A matrix with the rows of all ranks; `None` where there is one rank, or no memory.
    pub(super) fn whole(&self, matrix: &Csr) -> Option<Csr> {
        self.owners.as_ref().and_then(|owners| matrix.of_all(&*owners.team).ok())
    }

    /// The ranks.
    pub(super) fn team(&self) -> &dyn Team {
        self.owners.as_ref().map_or(&Alone, |owners| &*owners.team)
    }

    /// The largest size of numbers by row, of all ranks.
    pub(super) fn largest(&self, values: impl IntoIterator<Item = f64>) -> f64 {
        self.team().largest(largest(values))
    }

    /// Which rank has which rows, where there are several.
    pub(super) fn owners(&self) -> Option<&RowOwners> {
        self.owners.as_ref()
    }

    /// Largest row sum of magnitudes of the matrix set last.
    pub(super) fn norm(&self) -> f64 {
        self.norm
    }

    /// `r = b - A x` in double-double, kept in `self.residual`.
    fn residual_of(&mut self, parts: &[&Csr], b: &[f64], x: &[f64]) {
        residual_compensated(parts, b, x, &mut self.residual, self.options.threads);
    }

    pub(super) fn options(&self) -> &SolverOptions {
        &self.options
    }

    /// Scale of each unknown to a unit diagonal of the matrix set last.
    pub(super) fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// Says that the first part of every matrix set from now on is this one.
    pub(super) fn set_constant_part(&mut self, part: &Csr) {
        self.constant = Some((absolute_sums(part), (0..part.n_rows()).map(|dof| part.get(dof, dof)).collect()));
    }

    /// Takes norms and scales of the matrix that is solved next.
    ///
    /// # Errors
    /// [`SolveError::NonFiniteMatrix`]; [`SolveError::Singular`] for a row without entries.
    pub(super) fn set_matrix(&mut self, parts: &[&Csr]) -> Result<(), SolveError> {
        self.row_sums.fill(0.0);
        let mut diagonal = vec![0.0; self.row_sums.len()];
        let mut add = |sums: &[f64], entries: &mut dyn Iterator<Item = f64>| {
            self.row_sums.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum);
            diagonal.iter_mut().zip(entries).for_each(|(total, entry)| *total += entry);
        };
        let mut new = parts;
        if let Some((sums, entries)) = &self.constant {
            add(sums, &mut entries.iter().copied());
            new = &parts[1..];
        }
        for part in new {
            add(&absolute_sums(part), &mut (0..part.n_rows()).map(|dof| part.get(dof, dof)));
        }
        if let Some(owners) = &self.owners {
            owners.update(&mut diagonal);
        }
        self.take_sums(parts, &diagonal)
    }

    /// Takes norms and scales of an operator that is solved with next.
    ///
    /// # Errors
    /// As [`Self::set_matrix`].
    pub(super) fn set_operator(&mut self, operator: &dyn Operator) -> Result<(), SolveError> {
        self.row_sums.copy_from_slice(operator.row_sums());
        self.take_sums(&[], operator.diagonal())
    }

    /// Looks at the row sums and takes the scale.
    fn take_sums(&mut self, parts: &[&Csr], diagonal: &[f64]) -> Result<(), SolveError> {
        let infinite = self.row_sums.iter().position(|sum| !sum.is_finite());
        if self.team().any(infinite.is_some()) {
            let mut places = parts.iter().filter_map(|part| part.first_non_finite());
            let (row, column) = places.next().unwrap_or_else(|| infinite.map_or((0, 0), |row| (row, row)));
            return Err(SolveError::NonFiniteMatrix { row, column });
        }
        self.norm = self.largest(self.row_sums.iter().copied());
        let is_own = |row: usize| self.owners.as_ref().is_none_or(|owners| owners.owns(row));
        let empty = (0..self.row_sums.len()).find(|row| self.row_sums[*row] == 0.0 && is_own(*row));
        if let Some(rank) = self.team().first(empty.is_some()) {
            let mut values = vec![0.0; self.row_sums.len()];
            if let Some(row) = empty.filter(|_| rank == self.team().rank()) {
                values[row] = 1.0;
            }
            if let Some(owners) = &self.owners {
                owners.update(&mut values);
            }
            let mode = NullVector::new(values);
            return Err(SolveError::Singular { dof: mode.largest().unwrap_or(0), ratio: 0.0, mode });
        }
        self.scale = symmetric_scale(parts, diagonal, self.owners.as_ref());
        Ok(())
    }

    /// Checks the sizes and the numbers of a right-hand side.
    pub(super) fn check_rhs(&self, rhs: &[f64], x: &[f64]) -> Result<(), SolveError> {
        let n = self.residual.len();
        for (what, found) in [("right-hand side", rhs.len()), ("solution", x.len())] {
            if found != n {
                return Err(SolveError::Shape { what, expected: n, found });
            }
        }
        let bad = rhs.iter().position(|value| !value.is_finite());
        match self.team().any(bad.is_some()) {
            true => Err(SolveError::NonFiniteRightHandSide { dof: bad.unwrap_or(0) }),
            false => Ok(()),
        }
    }

    /// Solves, measures and refines; the caller has checked the right-hand side. A solution that leaves no more than
    /// `tolerance` of the right-hand side is good enough (2-norms of scaled equations).
    ///
    /// # Errors
    /// [`SolveError::ResidualTooLarge`], with an infinite residual when the solution is not finite.
    pub(super) fn solve(
        &mut self,
        parts: &[&Csr],
        solver: &mut dyn FnMut(&mut [f64]),
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<SolveReport, SolveError> {
        x.copy_from_slice(rhs);
        if self.team().all(rhs.iter().all(|&value| value == 0.0)) {
            return Ok(SolveReport::default());
        }
        solver(x);
        let limit = self.options.residual_limit;
        let mut measure = self.measure(parts, rhs, x);
        let mut refinements = 0;
        let mut last_step = f64::INFINITY;
        let most = if self.is_weak { MOST_OF_WEAK } else { self.options.max_refinements };
        while refinements < most && self.should_refine(measure, tolerance) {
            self.residual_of(parts, rhs, x);
            let mut step = std::mem::take(&mut self.residual);
            solver(&mut step);
            let size = self.scaled_size(&step);
            // A step that does not shrink has nothing more to give.
            if size.is_nan() || size > 0.5 * last_step {
                self.residual = step;
                break;
            }
            last_step = size;
            x.iter_mut().zip(&step).for_each(|(value, step)| *value += step);
            self.residual = step;
            refinements += 1;
            let before = measure;
            measure = self.measure(parts, rhs, x);
            let is_done = size <= f64::EPSILON * self.scaled_size(x);
            if is_done || (!self.refines_to_the_end() && measure.relative > 0.5 * before.relative) {
                break;
            }
        }
        self.last = measure;
        if measure.relative.is_nan() || measure.relative > limit && measure.left > tolerance {
            return Err(SolveError::ResidualTooLarge { relative: measure.relative, limit });
        }
        Ok(SolveReport {
            relative_residual: measure.relative,
            componentwise_residual: measure.componentwise,
            refinements,
            ..SolveReport::default()
        })
    }

    /// Measures a solution that came from elsewhere; as [`Self::solve`] without refinement.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub(super) fn judge(
        &mut self,
        parts: &[&Csr],
        rhs: &[f64],
        x: &[f64],
        tolerance: f64,
    ) -> Result<SolveReport, SolveError> {
        let measure = self.measure(parts, rhs, x);
        self.accept(measure, tolerance)
    }

    /// The same with an operator, whose product with the solution is at hand.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub(super) fn judge_product(
        &mut self,
        operator: &dyn Operator,
        of: (&[f64], &[f64]),
        product: &[f64],
        tolerance: f64,
    ) -> Result<SolveReport, SolveError> {
        let (rhs, x) = of;
        let mut measure = Measure { relative: f64::INFINITY, componentwise: f64::INFINITY, left: f64::INFINITY };
        if x.iter().chain(product).all(|value| value.is_finite()) {
            operator.sizes(x, &mut self.magnitude);
            let residuals = self.residual.iter_mut().zip(&mut self.magnitude);
            for (((residual, size), b), product) in residuals.zip(rhs).zip(product) {
                *residual = b - product;
                *size += b.abs();
            }
            measure = self.measure_residual(rhs, x);
        }
        self.accept(measure, tolerance)
    }

    /// The report of a measure that is small enough.
    fn accept(&mut self, measure: Measure, tolerance: f64) -> Result<SolveReport, SolveError> {
        let limit = self.options.residual_limit;
        self.last = measure;
        if measure.relative.is_nan() || measure.relative > limit && measure.left > tolerance {
            return Err(SolveError::ResidualTooLarge { relative: measure.relative, limit });
        }
        Ok(SolveReport {
            relative_residual: measure.relative,
            componentwise_residual: measure.componentwise,
            ..SolveReport::default()
        })
    }

    /// Whether the solution checked last leaves no more than `tolerance` of its right-hand side, or as little as a
    /// factor of double precision does.
    pub(super) fn is_satisfied(&self, tolerance: f64) -> bool {
        self.last.left <= tolerance || self.last.relative <= GOOD_RESIDUAL
    }

    fn should_refine(&self, measure: Measure, tolerance: f64) -> bool {
        let is_exact = measure.relative <= GOOD_RESIDUAL && measure.componentwise <= GOOD_COMPONENT;
        let is_good = is_exact || measure.left <= tolerance;
        measure.relative.is_finite() && (self.refines_to_the_end() || !is_good)
    }

    /// Whether a small residual is no reason to stop.
    fn refines_to_the_end(&self) -> bool {
        self.options.extended_residual || self.is_weak
    }

    /// Backward errors; infinite for a solution that is not finite. Leaves the residual in `self.residual`.
    fn measure(&mut self, parts: &[&Csr], rhs: &[f64], x: &[f64]) -> Measure {
        if self.team().any(x.iter().any(|value| !value.is_finite())) {
            return Measure { relative: f64::INFINITY, componentwise: f64::INFINITY, left: f64::INFINITY };
        }
        let threads = self.options.threads;
        residual_and_size(parts, rhs, x, &mut self.residual, &mut self.magnitude, threads);
        self.measure_residual(rhs, x)
    }

    /// Backward errors of a solution whose residual and magnitudes are at hand.
    fn measure_residual(&self, rhs: &[f64], x: &[f64]) -> Measure {
        let quotient = |residual: f64, size: f64| if residual == 0.0 { 0.0 } else { residual / size };
        // a product that is no number is no small residual
        let mut sizes = [
            largest(self.residual.iter().zip(&self.scale).map(|(r, s)| r * s)),
            largest(self.magnitude.iter().zip(&self.scale).map(|(m, s)| m * s)),
            largest(self.residual.iter().copied()),
            largest(x.iter().copied()),
            largest(rhs.iter().copied()),
            largest(self.residual.iter().zip(&self.magnitude).map(|(r, m)| quotient(r.abs(), *m))),
        ];
        self.team().max(&mut sizes);
        let [scaled_residual, scaled_size, plain_residual, of_x, of_rhs, componentwise] = sizes;
        let plain_size = self.norm * of_x + of_rhs;
        Measure {
            relative: largest([quotient(scaled_residual, scaled_size), quotient(plain_residual, plain_size)]),
            left: quotient(self.scaled_norm(&self.residual), self.scaled_norm(rhs)),
            componentwise,
        }
    }

    /// 2-norm of a vector of equations in units of their scale.
    pub(super) fn scaled_norm(&self, b: &[f64]) -> f64 {
        let own = b.iter().zip(&self.scale).map(|(value, scale)| (value * scale) * (value * scale)).sum::<f64>();
        self.team().total(own).sqrt()
    }

    /// Largest component of a vector of unknowns in units of their scale.
    pub(super) fn scaled_size(&self, x: &[f64]) -> f64 {
        self.largest(x.iter().zip(&self.scale).map(|(value, scale)| value / scale))
    }

    /// Whether a solution is so large that the null space must be looked at.
    pub(super) fn has_grown(&self, rhs: &[f64], x: &[f64]) -> bool {
        let loads = self.largest(rhs.iter().zip(&self.scale).map(|(value, scale)| value * scale));
        let size = self.scaled_size(x);
        size.is_nan() || size > SUSPICIOUS_GROWTH * loads
    }
}

/// The 1-norm of the inverse, estimated (Hager 1984, Higham 1988, algorithm 4.1).
pub(super) fn inverse_norm_estimate(n: usize, solver: &mut dyn FnMut(Transpose, &mut [f64])) -> f64 {
    if n == 0 {
        return 0.0;
    }
    let norm_1 = |x: &[f64]| x.iter().map(|value| value.abs()).sum::<f64>();
    let mut x = vec![1.0 / n as f64; n];
    let mut best = 0.0;
    let mut place = usize::MAX;
    for _ in 0..5 {
        let mut y = x.clone();
        solver(Transpose::No, &mut y);
        let size = norm_1(&y);
        if size <= best {
            break;
        }
        best = size;
        let mut z: Vec<f64> = y.iter().map(|&value| if value < 0.0 { -1.0 } else { 1.0 }).collect();
        solver(Transpose::Yes, &mut z);
        let largest = (0..n).fold(0, |at, i| if z[i].abs() > z[at].abs() { i } else { at });
        if largest == place || z[largest].abs() <= z.iter().zip(&x).map(|(z, x)| z * x).sum::<f64>() {
            break;
        }
        place = largest;
        x.fill(0.0);
        x[place] = 1.0;
    }
    // A second start that no cancellation is likely to fool.
    let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut y: Vec<f64> = (0..n).map(|i| sign(i) * (1.0 + i as f64 / (n.max(2) - 1) as f64)).collect();
    solver(Transpose::No, &mut y);
    best.max(2.0 * norm_1(&y) / (3.0 * n as f64))
}
