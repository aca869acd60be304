//! Whether a scene is solved with a factor or by conjugate gradients with multigrid.
//!
//! Decided before memory is taken, from the number of unknowns. Promises: a reason in words wherever the iteration cannot
//! be used. Does not assemble and does not solve.

use std::sync::Arc;

use wfl_discrete::{pruning::Pruning, system::System};
use wfl_host::memory::claim;
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::{CheckedMultigrid, LinearMethod, NodeLayout, Operator, SolveError, SolverOptions};

use super::plan::{Extent, LinearPlan};
use super::without_matrix;

/// The number of unknowns of a mesh in three dimensions that the models below were measured with.
const REFERENCE: f64 = 1e5;
/// Bytes of a factor for each unknown there; they grow with the third root of the number of unknowns, as planes that cut
/// a cube do (George 1973). Measured on cubes of trilinear hexahedra: 2.7 GB for 108,000 unknowns, 12.7 GB for 353,000.
const FACTOR_BYTES: f64 = 25e3;
/// Seconds of a factorisation there, and the power of the number of unknowns they grow with: 4.5 s for 108,000, 39 s for
/// 353,000.
const FACTOR_SECONDS: f64 = 3.9;
const FACTOR_POWER: f64 = 1.85;
/// Seconds of a solution with the factor there, which reads it twice; they grow as its bytes do.
const SOLUTION_SECONDS: f64 = 0.4;
/// Seconds in which the levels are made there, and of a solution by some 15 iterations; both grow with the unknowns.
const LEVELS_SECONDS: f64 = 0.8;
const ITERATION_SECONDS: f64 = 0.7;
/// Bytes of all levels for each unknown.
const LEVELS_BYTES: f64 = 700.0;
/// Below so many unknowns a factor takes less than half a second, and nothing is gained.
const SMALL: usize = 30_000;

/// The iteration of a scene, with its matrix.
pub(super) struct Iterative {
    solver: CheckedMultigrid,
}

impl Iterative {
    /// Makes the levels of a matrix.
    ///
    /// # Errors
    /// [`SolveError`]: not positive definite, singular, or too large.
    pub(super) fn new(layout: NodeLayout, matrix: Arc<Csr>, options: SolverOptions) -> Result<Self, SolveError> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size in bytes")]
        claim(iteration(matrix.n_rows(), 0).bytes as u64, "the levels of multigrid")?;
        let mut solver = CheckedMultigrid::new(layout, options);
        solver.take(matrix)?;
        Ok(Self { solver })
    }

    /// Makes the levels of an operator; `None` where only a matrix can tell whether it is singular.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(super) fn of_operator(
        layout: NodeLayout,
        operator: Arc<dyn Operator>,
        options: SolverOptions,
    ) -> Result<Option<Self>, SolveError> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size in bytes")]
        claim(without_matrix::bytes(operator.n_rows()) as u64, "the levels of multigrid")?;
        let mut solver = CheckedMultigrid::new(layout, options);
        Ok(solver.take_operator(operator)?.then_some(Self { solver }))
    }

    /// The solver behind it.
    pub(super) fn solver(&mut self) -> &mut CheckedMultigrid {
        &mut self.solver
    }

    /// What it is.
    pub(super) fn method(&self) -> LinearPlan {
        LinearPlan::Iterative(Extent::Made(self.solver.level_sizes().to_vec()))
    }
}

/// Why a system cannot be solved by the iteration; `None` if it can.
#[must_use]
pub fn obstacle(system: &System) -> Option<String> {
    layout(system).err()
}

/// The unknowns by nodes, or why there is no iteration.
pub(super) fn layout(system: &System) -> Result<NodeLayout, String> {
    if !system.is_linear() {
        return Err("the scene is not linear: its tangents are factored".to_owned());
    }
    if let Some(term) = system.terms.iter().find(|t| !t.law.symmetric) {
        return Err(format!("the term `{}` is not symmetric", term.law.name));
    }
    if !system.uses(Pruning::Symmetric) {
        return Err("symmetry is not used".to_owned());
    }
    system.node_layout()
}

/// What a method is foreseen to take.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cost {
    seconds: f64,
    bytes: f64,
}

#[expect(clippy::cast_precision_loss, reason = "counts")]
fn factor(n: usize, solutions: usize) -> Cost {
    let size = n as f64 / REFERENCE;
    let seconds = FACTOR_SECONDS * size.powf(FACTOR_POWER) + solutions as f64 * SOLUTION_SECONDS * size.powf(4.0 / 3.0);
    Cost { seconds, bytes: FACTOR_BYTES * n as f64 * size.cbrt() }
}

#[expect(clippy::cast_precision_loss, reason = "counts")]
fn iteration(n: usize, solutions: usize) -> Cost {
    let size = n as f64 / REFERENCE;
    let seconds = (LEVELS_SECONDS + solutions as f64 * ITERATION_SECONDS) * size;
    Cost { seconds, bytes: LEVELS_BYTES * n as f64 }
}

/// Whether the iteration is to be used.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, solutions: usize) -> bool {
    let n = system.n_unknowns();
    let pays = || {
        let (direct, iterative) = (factor(n, solutions), iteration(n, solutions));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size in bytes")]
        let fits = claim(direct.bytes as u64, "the factor of the matrix").is_ok();
        iterative.seconds < direct.seconds || !fits
    };
    let is_wanted = match method {
        LinearMethod::Direct => false,
        LinearMethod::Iterative => true,
        LinearMethod::Auto => system.mesh.dim() == 3 && n >= SMALL && pays(),
    };
    is_wanted && obstacle(system).is_none()
}

/// The iteration with what it is foreseen to take; `None` for a factor.
pub(super) fn plan(system: &System, method: LinearMethod, solutions: usize) -> Option<LinearPlan> {
    if !is_chosen(system, method, solutions) {
        return None;
    }
    let n = system.n_unknowns();
    let bytes = if without_matrix::pays(system) { without_matrix::bytes(n) } else { iteration(n, solutions).bytes };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size in bytes")]
    let size = |bytes: f64| bytes as u64;
    let in_place = (system.mesh.dim() == 3 && n >= SMALL).then(|| size(factor(n, solutions).bytes));
    Some(LinearPlan::Iterative(Extent::Foreseen((size(bytes), in_place))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_is_foreseen_as_it_was_measured() {
        let near = |found: f64, measured: f64| (found / measured - 1.0).abs() < 0.2;
        assert!(near(factor(108_000, 0).bytes, 2.7e9) && near(factor(353_000, 0).bytes, 12.7e9));
        assert!(near(factor(108_000, 0).seconds, 4.5) && near(factor(353_000, 0).seconds, 39.0));
    }

    #[test]
    fn many_solutions_pay_for_a_factor() {
        let pays = |n, solutions| iteration(n, solutions).seconds < factor(n, solutions).seconds;
        assert!(pays(100_000, 1) && !pays(60_000, 1000) && pays(2_000_000, 10));
    }

    #[test]
    fn a_factor_takes_more_for_each_unknown_the_more_there_are_and_the_levels_do_not() {
        let by_unknown = |of: fn(usize, usize) -> Cost, n: usize| of(n, 0).bytes / n as f64;
        assert!((by_unknown(factor, 800_000) / by_unknown(factor, 100_000) - 2.0).abs() < 1e-12, "the third root");
        assert!((by_unknown(iteration, 800_000) / by_unknown(iteration, 100_000) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_scene_with_contact_is_factored_whatever_is_asked_for() {
        use crate::test_block::Block;
        let system = Block::with_friction(1).system;
        assert!(obstacle(&system).is_some_and(|why| why.contains("not linear")));
        assert!(!is_chosen(&system, LinearMethod::Iterative, 1));
        assert_eq!(plan(&system, LinearMethod::Iterative, 1), None);
    }

    #[test]
    fn a_small_plane_scene_is_iterated_on_request_alone() {
        use crate::test_block::{Block, LAPLACE};
        let system = Block::new(1, &[LAPLACE], &[]).system;
        assert!(!is_chosen(&system, LinearMethod::Auto, 1) && !is_chosen(&system, LinearMethod::Direct, 1));
        assert_eq!(is_chosen(&system, LinearMethod::Iterative, 1), obstacle(&system).is_none());
    }

    #[test]
    fn a_term_that_is_not_symmetric_is_named() {
        use crate::test_block::{Block, LAPLACE};
        let system = Block::new(1, &[LAPLACE, "u(1)*Test_u(2)"], &[]).system;
        assert_eq!(obstacle(&system).as_deref(), Some("the term `law` is not symmetric"));
    }
}
