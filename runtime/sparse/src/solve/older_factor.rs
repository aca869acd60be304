//! Solves with a matrix whose factor is that of an earlier one: GMRES with the factor as preconditioner.
//!
//! ```text
//! S A M⁻¹ S⁻¹ y = S b    x = M⁻¹ S⁻¹ y    A: the matrix at hand, M: the factored one, S: the scale of the equations of A
//! ```
//!
//! With the preconditioner on the right the residual that GMRES reduces is the true one.
//!
//! Promises: a solution that has passed the backward-error check with A itself, or none; never more iterations than cost
//! as much as a factor of A. Does not factor: `checked` does, where this comes to nothing.

use super::SolveReport;
use super::backward_error::BackwardErrorCheck;
use super::factorization::Factorization;
use super::krylov::{Gmres, Limits};
use super::triangular_solve::Transpose;
use crate::csr::Csr;

/// Most iterations: the basis is kept, and a rate so low is that of another matrix.
const MAX_ITERATIONS: usize = 60;
/// Iterations before their rate is looked at: a few points of contact that change their branch show no rate before.
const TRIAL_ITERATIONS: usize = 10;
/// Iterations aim at this part of the tolerance, because their norm is not quite that of the backward-error check.
const WITHIN: f64 = 0.3;
/// Where iterations cost this part of a factor, the next matrix gets its own: the matrices move away from the first one.
const WORN: f64 = 0.5;

/// An earlier factor in use.
pub(super) struct OlderFactor {
    gmres: Gmres,
    /// The next matrix is to be factored.
    is_worn: bool,
}

impl OlderFactor {
    pub(super) fn new() -> Self {
        Self { gmres: Gmres::new(MAX_ITERATIONS), is_worn: true }
    }

    /// Says whether the next matrix is to be factored.
    pub(super) fn set_worn(&mut self, is_worn: bool) {
        self.is_worn = is_worn;
    }

    /// Whether the next matrix may be solved with the factor of an earlier one.
    pub(super) fn serves(&self, factorization: &impl Factorization) -> bool {
        !self.is_worn && factorization.worthwhile_iterations() > TRIAL_ITERATIONS
    }

    /// Solves to `tolerance`, as a part of the right-hand side (2-norms of scaled equations); nothing where the iterations
    /// came to nothing.
    pub(super) fn solve(
        &mut self,
        factorization: &mut impl Factorization,
        matrix: &Csr,
        check: &mut BackwardErrorCheck,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Option<SolveReport> {
        let allowed = factorization.worthwhile_iterations();
        let options = *check.options();
        let scale = check.scale().to_vec();
        let wanted = WITHIN * tolerance * check.scaled_norm(rhs);
        let (mut iterations, mut converged) = (0, true);
        let gmres = &mut self.gmres;
        let mut solver = |b: &mut [f64]| {
            let unscale = |y: &mut [f64]| y.iter_mut().zip(&scale).for_each(|(y, s)| *y /= s);
            b.iter_mut().zip(&scale).for_each(|(b, s)| *b *= s);
            let size = b.iter().map(|b| b * b).sum::<f64>().sqrt();
            let limits = Limits {
                target: wanted.max(options.iteration_tolerance * size),
                max_iterations: allowed.saturating_sub(iterations),
                trial_iterations: TRIAL_ITERATIONS,
            };
            let mut direction = vec![0.0; b.len()];
            let mut multiply = |y: &[f64], out: &mut [f64]| {
                direction.copy_from_slice(y);
                unscale(&mut direction);
                factorization.solve(Transpose::No, &mut direction);
                matrix.multiply(&direction, out, options.threads);
                out.iter_mut().zip(&scale).for_each(|(out, s)| *out *= s);
            };
            let mut y = vec![0.0; b.len()];
            let outcome = gmres.solve(&mut multiply, b, &mut y, limits);
            iterations += outcome.iterations;
            converged &= outcome.converged;
            b.copy_from_slice(&y);
            unscale(b);
            factorization.solve(Transpose::No, b);
        };
        let outcome = check.solve(&[matrix], &mut solver, rhs, x, tolerance);
        #[expect(clippy::cast_precision_loss, reason = "counts of iterations")]
        let worn = iterations as f64 > WORN * allowed as f64;
        self.is_worn = worn || !converged;
        let report = outcome.ok().filter(|_| converged && !check.has_grown(rhs, x));
        report.map(|report| SolveReport { krylov_iterations: iterations, ..report })
    }
}
