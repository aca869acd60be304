//! The wrapper around every solver: finite values, true residual, refinement, and the class of a failure.
//!
//! Promises: what is returned as a solution has a backward error below the limit, measured with the matrix itself and
//! not with its factor; a failure is one of the classes of [`SolveError`], with dofs in the caller's numbering.
//! A matrix counts as singular when a vector v is found with `‖S A v‖ < 64 ε ‖S⁻¹ v‖` (maximum norms), where S scales A
//! to a unit diagonal: no digit of that pivot is left in double precision.

use std::sync::Arc;

use super::dense::{Dense, Kind};
use super::llt::Llt;
use super::lu::SparseLu;
use super::scaling::symmetric_scale;
use super::sweep::Form;
use super::{LinearSolver, NullVector, SolveError, SolveReport, SolverOptions};
use crate::csr::{Csr, Pattern, residual, residual_compensated};

/// See the module documentation.
const SINGULAR: f64 = 64.0 * f64::EPSILON;
/// A relative pivot below this calls for a look at the null space.
const SUSPICIOUS_PIVOT: f64 = 1e-9;
/// Growth `‖A‖ ‖x‖ / ‖b‖` above which a solution calls for a look at the null space.
const SUSPICIOUS_GROWTH: f64 = 1e12;
/// Steps of inverse iteration.
const INVERSE_ITERATIONS: usize = 3;
/// Shift, relative to the diagonal, with which a matrix without a factor is looked at.
const SHIFT: f64 = 1e-9;
/// Refinement starts above these backward errors: of the scaled matrix, and of single rows.
const GOOD_RESIDUAL: f64 = 1e-13;
const GOOD_COMPONENT: f64 = 1e-10;
/// Relative asymmetry that rounding in assembly explains.
const ASYMMETRY: f64 = 1e-10;

/// What a factorisation says about its smallest pivot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pivot {
    ratio: f64,
}

impl Pivot {
    pub(super) const HEALTHY: Pivot = Pivot { ratio: 1.0 };
    pub(super) const UNKNOWN: Pivot = Pivot { ratio: 0.0 };

    /// Whether the null space must be looked at.
    pub(super) fn is_suspicious(self) -> bool {
        self.ratio.is_nan() || self.ratio < SUSPICIOUS_PIVOT
    }
}

impl From<(f64, u32)> for Pivot {
    fn from((ratio, _): (f64, u32)) -> Self {
        Pivot { ratio }
    }
}

/// A solver before its answers are looked at.
pub(super) trait Factorization {
    /// Whether half of the matrix is never read.
    const NEEDS_SYMMETRY: bool;

    /// The analysed pattern.
    fn pattern(&self) -> &Arc<Pattern>;

    /// Factors a matrix on exactly that pattern.
    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError>;

    /// Solves in place with the last factor.
    fn solve(&mut self, form: Form, x: &mut [f64]);

    /// Turns to a more robust method for the same matrix; false when there is none.
    fn retry(&mut self, _matrix: &Csr) -> Result<bool, SolveError> {
        Ok(false)
    }

    /// After a failed factorisation: the error with what can be added to it, and a candidate for a null vector.
    fn null_vector_at(&mut self, _matrix: &Csr, error: &SolveError) -> (SolveError, Option<Vec<f64>>) {
        (error.clone(), None)
    }
}

/// Measures solutions of `(A + B + ...) x = b`.
pub(super) struct Judge {
    options: SolverOptions,
    residual: Vec<f64>,
    magnitude: Vec<f64>,
    /// Row sums of magnitudes, and their largest.
    row_sums: Vec<f64>,
    norm: f64,
    /// Scale to a unit diagonal.
    scale: Vec<f64>,
}

/// Backward errors of one solution.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Measure {
    relative: f64,
    componentwise: f64,
}

impl Judge {
    pub(super) fn new(n: usize, options: SolverOptions) -> Self {
        let zeros = || vec![0.0; n];
        Self { options, residual: zeros(), magnitude: zeros(), row_sums: zeros(), norm: 0.0, scale: vec![1.0; n] }
    }

    pub(super) fn options(&self) -> &SolverOptions {
        &self.options
    }

    /// Takes norms and scales of the matrix that is solved next.
    ///
    /// # Errors
    /// [`SolveError::NonFiniteMatrix`]; [`SolveError::Singular`] for a row without entries.
    pub(super) fn look_at(&mut self, parts: &[&Csr]) -> Result<(), SolveError> {
        self.row_sums.fill(0.0);
        for part in parts {
            for (row, sum) in self.row_sums.iter_mut().enumerate() {
                *sum += part.row(row).1.iter().map(|value| value.abs()).sum::<f64>();
            }
        }
        if let Some(row) = self.row_sums.iter().position(|sum| !sum.is_finite()) {
            let mut places = parts.iter().filter_map(|part| part.first_non_finite());
            let (row, column) = places.next().unwrap_or((row, row));
            return Err(SolveError::NonFiniteMatrix { row, column });
        }
        self.norm = self.row_sums.iter().copied().fold(0.0, f64::max);
        if let Some(dof) = self.row_sums.iter().position(|&sum| sum == 0.0) {
            let mut values = vec![0.0; self.row_sums.len()];
            values[dof] = 1.0;
            return Err(SolveError::Singular { dof, ratio: 0.0, mode: NullVector::new(values) });
        }
        self.scale = symmetric_scale(parts);
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
        match rhs.iter().position(|value| !value.is_finite()) {
            Some(dof) => Err(SolveError::NonFiniteRightHandSide { dof }),
            None => Ok(()),
        }
    }

    /// Solves, measures and refines; the caller has checked the right-hand side.
    ///
    /// # Errors
    /// [`SolveError::ResidualTooLarge`], with an infinite residual when the solution is not finite.
    pub(super) fn solve(
        &mut self,
        parts: &[&Csr],
        solver: &mut dyn FnMut(&mut [f64]),
        rhs: &[f64],
        x: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        x.copy_from_slice(rhs);
        if rhs.iter().all(|&value| value == 0.0) {
            return Ok(SolveReport::default());
        }
        solver(x);
        self.refine(parts, solver, rhs, x)
    }

    /// Measures and refines a solution.
    ///
    /// # Errors
    /// As [`Judge::solve`].
    pub(super) fn refine(
        &mut self,
        parts: &[&Csr],
        solver: &mut dyn FnMut(&mut [f64]),
        rhs: &[f64],
        x: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        let limit = self.options.residual_limit;
        let mut measure = self.measure(parts, rhs, x);
        let mut refinements = 0;
        let mut last_step = f64::INFINITY;
        while refinements < self.options.max_refinements && self.should_refine(measure) {
            residual_compensated(parts, rhs, x, &mut self.residual, self.options.threads);
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
            if is_done || (!self.options.extended_residual && measure.relative > 0.5 * before.relative) {
                break;
            }
        }
        if measure.relative.is_nan() || measure.relative > limit {
            return Err(SolveError::ResidualTooLarge { relative: measure.relative, limit });
        }
        Ok(SolveReport {
            relative_residual: measure.relative,
            componentwise_residual: measure.componentwise,
            refinements,
            ..SolveReport::default()
        })
    }

    fn should_refine(&self, measure: Measure) -> bool {
        let is_good = measure.relative <= GOOD_RESIDUAL && measure.componentwise <= GOOD_COMPONENT;
        measure.relative.is_finite() && (self.options.extended_residual || !is_good)
    }

    /// Backward errors; infinite for a solution that is not finite. Leaves the residual in `self.residual`.
    fn measure(&mut self, parts: &[&Csr], rhs: &[f64], x: &[f64]) -> Measure {
        if x.iter().any(|value| !value.is_finite()) {
            return Measure { relative: f64::INFINITY, componentwise: f64::INFINITY };
        }
        residual(parts, rhs, x, &mut self.residual, self.options.threads);
        self.magnitude.iter_mut().zip(rhs).for_each(|(size, b)| *size = b.abs());
        for part in parts {
            part.multiply_absolute_add(x, &mut self.magnitude, self.options.threads);
        }
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let scaled_residual = largest(&mut self.residual.iter().zip(&self.scale).map(|(r, s)| (r * s).abs()));
        let scaled_size = largest(&mut self.magnitude.iter().zip(&self.scale).map(|(m, s)| m * s));
        let plain_residual = largest(&mut self.residual.iter().map(|r| r.abs()));
        let plain_size =
            self.norm * largest(&mut x.iter().map(|x| x.abs())) + largest(&mut rhs.iter().map(|b| b.abs()));
        let quotient = |residual: f64, size: f64| if residual == 0.0 { 0.0 } else { residual / size };
        Measure {
            relative: quotient(scaled_residual, scaled_size).max(quotient(plain_residual, plain_size)),
            componentwise: largest(
                &mut self.residual.iter().zip(&self.magnitude).map(|(r, m)| quotient(r.abs(), *m)),
            ),
        }
    }

    /// Largest component of a vector of unknowns in units of their scale.
    fn scaled_size(&self, x: &[f64]) -> f64 {
        let sizes = x.iter().zip(&self.scale).map(|(value, scale)| (value / scale).abs());
        sizes.fold(0.0, |largest, size| if size.is_nan() { f64::NAN } else { largest.max(size) })
    }

    /// Whether a solution is so large that the null space must be looked at.
    pub(super) fn has_grown(&self, rhs: &[f64], x: &[f64]) -> bool {
        let loads = rhs.iter().zip(&self.scale).map(|(value, scale)| (value * scale).abs()).fold(0.0, f64::max);
        let size = self.scaled_size(x);
        size.is_nan() || size > SUSPICIOUS_GROWTH * loads
    }

    /// `‖S A v‖ / ‖S⁻¹ v‖`, the product summed in double-double.
    pub(super) fn null_ratio(&mut self, parts: &[&Csr], v: &[f64]) -> f64 {
        let zeros = vec![0.0; v.len()];
        residual_compensated(parts, &zeros, v, &mut self.residual, self.options.threads);
        let product = self.residual.iter().zip(&self.scale).map(|(r, s)| (r * s).abs()).fold(0.0, f64::max);
        product / self.scaled_size(v)
    }

    /// Inverse iteration from a fixed start: the error that says that the matrix is singular, if it is.
    pub(super) fn find_null_vector(
        &mut self,
        parts: &[&Csr],
        solver: &mut dyn FnMut(&mut [f64]),
    ) -> Option<SolveError> {
        // Golden-ratio numbers: fixed, and orthogonal to no mode in particular.
        let start = |dof: usize| ((dof + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
        let mut v: Vec<f64> = (0..self.scale.len()).map(|dof| start(dof) * self.scale[dof]).collect();
        for _ in 0..INVERSE_ITERATIONS {
            // The right-hand side lives in scaled equations.
            v.iter_mut().zip(&self.scale).for_each(|(value, scale)| *value /= scale * scale);
            solver(&mut v);
            let size = self.scaled_size(&v);
            if !(size.is_finite() && size > 0.0) {
                return None;
            }
            v.iter_mut().for_each(|value| *value /= size);
        }
        self.as_singular(parts, v)
    }

    /// The error for a null vector, if it is one.
    pub(super) fn as_singular(&mut self, parts: &[&Csr], v: Vec<f64>) -> Option<SolveError> {
        let ratio = self.null_ratio(parts, &v);
        if ratio.is_nan() || ratio > SINGULAR {
            return None;
        }
        let mode = NullVector::new(v);
        Some(SolveError::Singular { dof: mode.largest().unwrap_or(0), ratio, mode })
    }
}

/// The 1-norm of the inverse, estimated (Hager 1984, Higham 1988, algorithm 4.1).
pub(super) fn inverse_norm_estimate(n: usize, solver: &mut dyn FnMut(Form, &mut [f64])) -> f64 {
    if n == 0 {
        return 0.0;
    }
    let norm_1 = |x: &[f64]| x.iter().map(|value| value.abs()).sum::<f64>();
    let mut x = vec![1.0 / n as f64; n];
    let mut best = 0.0;
    let mut place = usize::MAX;
    for _ in 0..5 {
        let mut y = x.clone();
        solver(Form::Plain, &mut y);
        let size = norm_1(&y);
        if size <= best {
            break;
        }
        best = size;
        let mut z: Vec<f64> = y.iter().map(|&value| if value < 0.0 { -1.0 } else { 1.0 }).collect();
        solver(Form::Transposed, &mut z);
        let largest = (0..n).fold(0, |at, i| if z[i].abs() > z[at].abs() { i } else { at });
        if largest == place || z[largest].abs() <= z.iter().zip(&x).map(|(z, x)| z * x).sum::<f64>() {
            break;
        }
        place = largest;
        x.fill(0.0);
        x[place] = 1.0;
    }
    // A second start that no cancellation is likely to fool.
    let sign = |i: usize| if i % 2 == 0 { 1.0 } else { -1.0 };
    let mut y: Vec<f64> = (0..n).map(|i| sign(i) * (1.0 + i as f64 / (n.max(2) - 1) as f64)).collect();
    solver(Form::Plain, &mut y);
    best.max(2.0 * norm_1(&y) / (3.0 * n as f64))
}

/// Any factorisation with its answers checked.
pub(super) struct Checked<F> {
    factorization: F,
    judge: Judge,
    /// The matrix last factored, on the analysed pattern.
    matrix: Csr,
    /// For a narrower pattern seen last: where its entries go.
    narrower: Option<(Arc<Pattern>, Vec<usize>)>,
    is_factored: bool,
    null_space_is_clear: bool,
}

impl<F: Factorization> Checked<F> {
    pub(super) fn new(factorization: F, options: SolverOptions) -> Self {
        let matrix = Csr::zeros(Arc::clone(factorization.pattern()));
        let judge = Judge::new(matrix.n_rows(), options);
        Self { factorization, judge, matrix, narrower: None, is_factored: false, null_space_is_clear: false }
    }

    /// Copies a matrix onto the analysed pattern.
    fn take(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        let wanted = self.matrix.pattern();
        if Arc::ptr_eq(wanted, matrix.pattern()) || **wanted == **matrix.pattern() {
            self.matrix.values_mut().copy_from_slice(matrix.values());
            return Ok(());
        }
        let n = self.matrix.n_rows();
        if (matrix.n_rows(), matrix.n_cols()) != (n, n) {
            let found = if matrix.n_rows() == n { matrix.n_cols() } else { matrix.n_rows() };
            return Err(SolveError::Shape { what: "rows and columns of the matrix", expected: n, found });
        }
        let is_known = matches!(&self.narrower, Some((pattern, _)) if Arc::ptr_eq(pattern, matrix.pattern()));
        if !is_known {
            let places = matrix.pattern().positions_in(wanted).ok_or_else(|| outside(matrix.pattern(), wanted))?;
            self.narrower = Some((Arc::clone(matrix.pattern()), places));
        }
        let (_, places) = self.narrower.as_ref().expect("it is known or has just been found");
        self.matrix.values_mut().fill(0.0);
        for (&place, value) in places.iter().zip(matrix.values()) {
            self.matrix.values_mut()[place] = *value;
        }
        Ok(())
    }

    /// The class of a failed factorisation.
    fn classify(&mut self, error: SolveError) -> SolveError {
        let (error, candidate) = self.factorization.null_vector_at(&self.matrix, &error);
        if let Some(vector) = candidate {
            return self.judge.as_singular(&[&self.matrix], vector).unwrap_or(error);
        }
        if !matches!(error, SolveError::VanishingPivot { .. }) {
            return error;
        }
        explain_singular(&mut self.judge, &self.matrix, None, error)
    }

    /// Inverse iteration with the factor, once for each factor.
    fn check_null_space(&mut self) -> Result<(), SolveError> {
        if self.null_space_is_clear {
            return Ok(());
        }
        let factorization = &mut self.factorization;
        let solver = &mut |x: &mut [f64]| factorization.solve(Form::Plain, x);
        match self.judge.find_null_vector(&[&self.matrix], solver) {
            Some(error) => {
                self.is_factored = false;
                Err(error)
            }
            None => {
                self.null_space_is_clear = true;
                Ok(())
            }
        }
    }
}

/// Looks for a null vector of a matrix that could not be factored, with the factor of a slightly shifted one, which
/// serves this search alone. The error that says that the matrix is singular, or the one given.
pub(super) fn explain_singular(
    judge: &mut Judge,
    matrix: &Csr,
    coordinates: Option<&[[f64; 3]]>,
    error: SolveError,
) -> SolveError {
    let scale = judge.scale.iter().zip(0..);
    let shifts: Vec<_> = scale.map(|(scale, dof)| (dof, dof, SHIFT / (scale * scale))).collect();
    let shifted = Csr::from_triplets(matrix.n_rows(), matrix.n_rows(), &shifts).and_then(|shift| matrix.plus(&shift));
    let Ok(shifted) = shifted else { return error };
    let Ok(mut solver) = SparseLu::analyze(shifted.pattern(), coordinates, judge.options.threads) else {
        return error;
    };
    if solver.factor(&shifted).is_err() {
        return error;
    }
    judge.find_null_vector(&[matrix], &mut |x| solver.solve(Form::Plain, x)).unwrap_or(error)
}

/// The first entry that a pattern lacks.
pub(super) fn outside(pattern: &Pattern, wanted: &Pattern) -> SolveError {
    for row in 0..pattern.n_rows() {
        for &column in pattern.row(row) {
            if wanted.position(row, column as usize).is_none() {
                return SolveError::OutsidePattern { row, column: column as usize };
            }
        }
    }
    SolveError::Internal { what: "comparison of patterns" }
}

/// Refuses a matrix whose halves differ by more than rounding.
pub(super) fn check_symmetry(matrix: &Csr) -> Result<(), SolveError> {
    if matrix.is_symmetric(ASYMMETRY) {
        return Ok(());
    }
    let bound = ASYMMETRY * matrix.max_abs();
    for row in 0..matrix.n_rows() {
        let (columns, values) = matrix.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            let column = column as usize;
            let transposed = matrix.get(column, row);
            if (value - transposed).abs() > bound {
                return Err(SolveError::NotSymmetric { row, column, value, transposed });
            }
        }
    }
    Ok(())
}

impl<F: Factorization> LinearSolver for Checked<F> {
    fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
        self.is_factored = false;
        self.null_space_is_clear = false;
        self.take(matrix)?;
        self.judge.look_at(&[&self.matrix])?;
        if F::NEEDS_SYMMETRY {
            check_symmetry(&self.matrix)?;
        }
        match self.factorization.factor(&self.matrix) {
            Ok(pivot) => {
                self.is_factored = true;
                if pivot.is_suspicious() { self.check_null_space() } else { Ok(()) }
            }
            Err(error) => Err(self.classify(error)),
        }
    }

    fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
        if !self.is_factored {
            return Err(SolveError::NotFactored);
        }
        self.judge.check_rhs(rhs, x)?;
        let factorization = &mut self.factorization;
        let matrix = [&self.matrix];
        let first = self.judge.solve(&matrix, &mut |x| factorization.solve(Form::Plain, x), rhs, x);
        match first {
            Ok(report) => {
                if self.judge.has_grown(rhs, x) {
                    self.check_null_space()?;
                }
                Ok(report)
            }
            Err(error @ SolveError::ResidualTooLarge { .. }) => {
                self.check_null_space()?;
                if !self.factorization.retry(&self.matrix)? {
                    return Err(error);
                }
                self.null_space_is_clear = false;
                let factorization = &mut self.factorization;
                let mut report =
                    self.judge.solve(&[&self.matrix], &mut |x| factorization.solve(Form::Plain, x), rhs, x)?;
                report.refactored = true;
                Ok(report)
            }
            Err(error) => Err(error),
        }
    }

    fn condition_estimate(&mut self) -> Result<f64, SolveError> {
        if !self.is_factored {
            return Err(SolveError::NotFactored);
        }
        let factorization = &mut self.factorization;
        let inverse = inverse_norm_estimate(self.matrix.n_rows(), &mut |form, x| factorization.solve(form, x));
        Ok(inverse * self.matrix.norm_1())
    }
}

/// A dense factorisation of a sparse matrix.
pub(super) struct DenseOfSparse {
    pattern: Arc<Pattern>,
    dense: Dense,
}

impl Factorization for DenseOfSparse {
    const NEEDS_SYMMETRY: bool = false;

    fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    fn factor(&mut self, matrix: &Csr) -> Result<Pivot, SolveError> {
        let n = matrix.n_rows();
        let fill = |values: &mut [f64]| {
            values.fill(0.0);
            for row in 0..n {
                let (columns, entries) = matrix.row(row);
                for (&column, value) in columns.iter().zip(entries) {
                    values[column as usize * n + row] = *value;
                }
            }
        };
        self.dense.factor(Kind::General, fill).map(|(ratio, dof)| Pivot::from((ratio, dof as u32)))
    }

    fn solve(&mut self, form: Form, x: &mut [f64]) {
        self.dense.solve(form, x);
    }
}

macro_rules! checked_door {
    ($(#[$documentation:meta])* $name:ident, $inner:ty) => {
        $(#[$documentation])*
        pub struct $name {
            inner: Checked<$inner>,
        }

        impl LinearSolver for $name {
            fn factor(&mut self, matrix: &Csr) -> Result<(), SolveError> {
                self.inner.factor(matrix)
            }

            fn solve(&mut self, rhs: &[f64], x: &mut [f64]) -> Result<SolveReport, SolveError> {
                self.inner.solve(rhs, x)
            }

            fn condition_estimate(&mut self) -> Result<f64, SolveError> {
                self.inner.condition_estimate()
            }
        }
    };
}

checked_door! {
    /// Solver for sparse symmetric positive definite matrices.
    CheckedLlt, Llt
}
checked_door! {
    /// Solver for general sparse matrices.
    CheckedLu, SparseLu
}
checked_door! {
    /// Solver for general matrices of a few hundred unknowns, by dense LU with partial pivoting.
    CheckedDense, DenseOfSparse
}

impl CheckedLlt {
    /// Orders and analyses a pattern. With `coordinates`, one point (any length unit) a dof, by nested dissection.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square or the coordinates are not one a dof;
    /// [`SolveError::OutOfMemory`].
    pub fn new(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        Ok(Self { inner: Checked::new(Llt::analyze(pattern, coordinates, options.threads)?, options) })
    }
}

impl CheckedLu {
    /// Orders and analyses a pattern. With `coordinates`, one point (any length unit) a dof, by nested dissection.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square or the coordinates are not one a dof;
    /// [`SolveError::OutOfMemory`].
    pub fn new(
        pattern: &Arc<Pattern>,
        coordinates: Option<&[[f64; 3]]>,
        options: SolverOptions,
    ) -> Result<Self, SolveError> {
        Ok(Self { inner: Checked::new(SparseLu::analyze(pattern, coordinates, options.threads)?, options) })
    }
}

impl CheckedDense {
    /// Takes the memory for matrices on a pattern: 8 n² bytes.
    ///
    /// # Errors
    /// [`SolveError::Shape`] when the pattern is not square, [`SolveError::OutOfMemory`].
    pub fn new(pattern: &Arc<Pattern>, options: SolverOptions) -> Result<Self, SolveError> {
        let n = pattern.n_rows();
        if pattern.n_cols() != n {
            return Err(SolveError::Shape { what: "columns of a square matrix", expected: n, found: pattern.n_cols() });
        }
        let dense = Dense::new(n, options.threads)?;
        Ok(Self { inner: Checked::new(DenseOfSparse { pattern: Arc::clone(pattern), dense }, options) })
    }
}
