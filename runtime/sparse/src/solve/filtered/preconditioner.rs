//! GMRES on scaled equations with a preconditioner of the unscaled ones, once and with its solutions checked.
//!
//! Promises: the same bits for any number of threads where the preconditioner has them.

use super::super::backward_error::BackwardErrorCheck;
use super::super::multigrid::Cycle;
use super::super::{SolveError, SolveReport};
use super::filter::Filter;
use super::gmres::{FlexibleGmres, Operators, Outcome, norm_2};
use crate::csr::Csr;

/// Tightest and loosest 2-norm of the residual, relative to the right-hand side, that an iteration is asked for: rounding
/// of the recursion shows below the one, and nothing is saved above the other.
const TIGHTEST: f64 = 1e-12;
const LOOSEST: f64 = 1e-3;
/// 2-norm of what a correction by refinement may leave of its right-hand side: a few iterations of it are worth more than
/// many.
const ROUGH: f64 = 1e-3;

/// `z` near `A⁻¹ r` of unscaled equations.
pub(super) type Precondition<'a> = dyn FnMut(&[f64], &mut [f64]) + 'a;

/// The sum of some matrices, and what its equations are multiplied by.
#[derive(Clone, Copy)]
pub(super) struct Sum<'a> {
    pub(super) parts: &'a [&'a Csr],
    pub(super) scale: &'a [f64],
}

/// How far, and for how long.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    /// Part of the right-hand side that may be left (2-norms of scaled equations).
    pub(super) left: f64,
    /// Most iterations.
    pub(super) most: usize,
}

/// Solves from zero until the goal.
pub(super) fn solve(
    gmres: &mut FlexibleGmres,
    sum: Sum<'_>,
    precondition: &mut Precondition<'_>,
    rhs: &[f64],
    x: &mut [f64],
    goal: Goal,
) -> Outcome {
    let Sum { parts, scale } = sum;
    let b: Vec<f64> = rhs.iter().zip(scale).map(|(b, scale)| b * scale).collect();
    let target = goal.left * norm_2(&b).sqrt();
    let mut operators = Scaled { parts, scale, precondition, unscaled: vec![0.0; b.len()] };
    gmres.solve(&mut operators, &b, x, target, goal.most)
}

/// What a checked solution took.
pub(super) struct Solved {
    pub(super) report: SolveReport,
    /// Iterations of the first part, and what it was to leave of the right-hand side.
    pub(super) first: (usize, f64),
}

/// The same with one matrix and the solution measured and refined.
///
/// # Errors
/// [`SolveError::TooManyIterations`] or [`SolveError::ResidualTooLarge`] where a factor is needed, also where the solution is so
/// large that the matrix may be singular; those about the right-hand side.
pub(super) fn solve_checked(
    gmres: &mut FlexibleGmres,
    check: &mut BackwardErrorCheck,
    matrix: &Csr,
    precondition: &mut Precondition<'_>,
    rhs: &[f64],
    x: &mut [f64],
    goal: Goal,
) -> Result<Solved, SolveError> {
    check.check_rhs(rhs, x)?;
    let (parts, scale) = ([matrix], check.scale().to_vec());
    let asked = goal.left.clamp(TIGHTEST, LOOSEST);
    let (mut all, mut first, mut failure) = (0, None, None);
    let mut solver = |x: &mut [f64]| {
        let b = x.to_vec();
        let wanted = if first.is_none() { asked } else { ROUGH };
        let sum = Sum { parts: &parts, scale: &scale };
        let outcome = solve(gmres, sum, precondition, &b, x, Goal { left: wanted, ..goal });
        all += outcome.iterations;
        first.get_or_insert((outcome.iterations, wanted));
        if !outcome.converged {
            // not a number: the check refuses it
            x.fill(f64::NAN);
            failure = Some(SolveError::TooManyIterations { iterations: all, reached: f64::NAN, wanted });
        }
    };
    let outcome = check.solve(&parts, &mut solver, rhs, x, goal.left);
    let report = outcome.map_err(|error| failure.unwrap_or(error))?;
    if check.has_grown(rhs, x) {
        return Err(SolveError::TooManyIterations { iterations: all, reached: f64::NAN, wanted: asked });
    }
    let report = SolveReport { krylov_iterations: all, ..report };
    Ok(Solved { report, first: first.unwrap_or((0, asked)) })
}

/// A cycle of multigrid, then a direct solution on the unknowns of contact of what it has left.
pub(super) fn cycle_and_filter(
    cycle: &mut Cycle,
    places: &[u32],
    filter: Option<&mut Filter>,
    parts: &[&Csr],
    r: &[f64],
    z: &mut [f64],
) {
    cycle.apply(places, r, z);
    if let Some(filter) = filter {
        filter.apply(parts, r, z);
    }
}

/// The scaled matrix and its preconditioner.
struct Scaled<'a, 'p> {
    parts: &'a [&'a Csr],
    scale: &'a [f64],
    precondition: &'a mut Precondition<'p>,
    unscaled: Vec<f64>,
}

impl Operators for Scaled<'_, '_> {
    fn multiply(&mut self, x: &[f64], y: &mut [f64]) {
        let threads = rayon::current_num_threads();
        for (k, part) in self.parts.iter().enumerate() {
            if k == 0 { part.multiply(x, y, threads) } else { part.multiply_add(x, y, threads) }
        }
        y.iter_mut().zip(self.scale).for_each(|(y, scale)| *y *= scale);
    }

    fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
        self.unscaled.iter_mut().zip(r).zip(self.scale).for_each(|((out, r), scale)| *out = r / scale);
        (self.precondition)(&self.unscaled, z);
    }
}
