//! Whether a scene is solved with factors or by conjugate gradients with multigrid: the one matrix of a linear scene, or the
//! tangents of nonlinear bodies.
//!
//! Decided before memory is taken, from the number of unknowns. Promises: a reason in words wherever the iteration cannot
//! be used. Does not assemble and does not solve.

use std::sync::Arc;

use wfl_discrete::{pruning::Pruning, system::System};
use wfl_host::memory::claim;
use wfl_sparse::solve::{
    CheckedContact, CheckedMultigrid, CheckedSaddle, LinearMethod, NodeLayout, OnContact, SolveError, SolveReport,
    SolverOptions, Source,
};

use super::condensation::condenses;
use super::cost::{Factors, Iteration, Ways, Work};
use super::plan::{Extent, GMRES, Held, ITERATION, LinearPlan, Systems};
use super::saddle;
use super::without_matrix;

/// Of one matrix. Measured on cubes of trilinear hexahedra: 2.7 GB and 4.5 s for a factor of 108,000 unknowns, 12.7 GB and 39 s
/// for 353,000; solutions by some 15 iterations. Below 30,000 unknowns a factor takes less than half a second, and nothing is
/// gained.
const ONE_MATRIX: Ways = Ways {
    factors: Factors { bytes: 25e3, seconds: 3.9, power: 1.85, solution: 0.4 },
    iteration: Iteration { bytes: 700.0, levels: 0.8, solution: 0.7 },
    small: 30_000,
};
/// Of tangents. Measured on four steps of neo-Hookean cubes on one thread (docs/solvers.md): quadratic tetrahedra with 43,000
/// unknowns 14 s with factors and 7 s with the iteration, trilinear hexahedra with 33,000 unknowns 10 and 7, of each of which
/// two or three are not for solutions. Peaks of memory were 0.96 and 0.36 GB, 0.69 and 0.29 GB. With 13,000 unknowns both take two
/// seconds: below 30,000 nothing is gained.
const TANGENTS: Ways = Ways {
    factors: Factors { bytes: 25e3, seconds: 5.0, power: 1.85, solution: 0.4 },
    iteration: Iteration { bytes: 700.0, levels: 1.0, solution: 0.4 },
    small: 30_000,
};
/// Of a step of Newton's method with nonlinear bodies: the first tangent is factored and, in a step of two or three, that of
/// the state at its end, whose stability is looked at; there are five solutions.
const FACTORS_OF_A_STEP: Work = Work { made: 2.0, solutions: 5.0 };
/// The same with levels, which are made once and serve that look, too.
const LEVELS_OF_A_STEP: Work = Work { made: 1.0, solutions: 5.0 };
/// Solutions aim at this part of what they may leave: none shows beside the next residual of Newton's method then. Those with an
/// older factor aim at as much.
const WITHIN: f64 = 0.3;

/// What iterates.
enum Solver {
    /// Conjugate gradients: all is symmetric.
    Conjugate(Box<CheckedMultigrid>),
    /// GMRES: the bodies are.
    Contact(Box<CheckedContact>),
    /// GMRES: a motion beside a pressure.
    Saddle(Box<CheckedSaddle>),
}

/// The iteration of a scene.
pub(super) struct Iterative {
    solver: Solver,
    /// It solves with tangents, as far as each is to be solved; else with one matrix, to a small error.
    of_tangents: bool,
    /// Factors have taken its place until the next attempt at a step.
    is_set_aside: bool,
}

impl Iterative {
    /// Of one matrix, or of an operator in its place; makes its levels.
    ///
    /// # Errors
    /// [`SolveError`]: not positive definite, singular, or too large.
    pub(super) fn of_one(layout: NodeLayout, source: &Source, options: SolverOptions) -> Result<Self, SolveError> {
        let mut this = Self { of_tangents: false, ..Self::of_tangents(layout, options) };
        this.renew(source)?;
        Ok(this)
    }

    /// Of the tangents to come.
    pub(super) fn of_tangents(layout: NodeLayout, options: SolverOptions) -> Self {
        Self::new(Solver::Conjugate(Box::new(CheckedMultigrid::new(layout, options))))
    }

    /// Of the tangents to come of bodies with contact that need not be symmetric.
    pub(super) fn of_contact(of: OnContact, options: SolverOptions) -> Self {
        Self::new(Solver::Contact(Box::new(CheckedContact::new(of, options))))
    }

    /// Of one matrix of a motion beside a pressure; makes its levels.
    ///
    /// # Errors
    /// [`SolveError`]: no levels, or too large.
    pub(super) fn of_saddle(layout: NodeLayout, source: &Source, options: SolverOptions) -> Result<Self, SolveError> {
        let mut this = Self { of_tangents: false, ..Self::of_saddles(layout, options) };
        this.renew(source)?;
        Ok(this)
    }

    /// Of the tangents to come of a motion beside a pressure.
    pub(super) fn of_saddles(layout: NodeLayout, options: SolverOptions) -> Self {
        Self::new(Solver::Saddle(Box::new(CheckedSaddle::new(layout, options))))
    }

    fn new(solver: Solver) -> Self {
        Self { solver, of_tangents: true, is_set_aside: false }
    }

    /// Makes the levels of a matrix, or of an operator; of the matrix of that where only it can tell whether it is singular.
    fn renew(&mut self, source: &Source) -> Result<(), SolveError> {
        let need = ONE_MATRIX.by_iteration(source.n_rows(), LEVELS_OF_A_STEP);
        match (&mut self.solver, source) {
            (Solver::Contact(solver), Source::Parted(matrix, on_faces)) => {
                claim(need.size(), "the levels of multigrid")?;
                solver.take(matrix, on_faces)
            }
            (Solver::Contact(..), _) => {
                Err(SolveError::Library { text: "the part of the terms on faces is not known".to_owned() })
            }
            (Solver::Saddle(solver), source) => {
                claim(saddle::bytes(source.n_rows()), "the levels of multigrid")?;
                solver.take(&source.matrix().ok_or(SolveError::NotFactored)?)
            }
            (Solver::Conjugate(solver), source) => {
                if let Source::Applied(operator) = source {
                    claim(without_matrix::bytes(operator.n_rows()), "the levels of multigrid")?;
                    if solver.take_operator(Arc::clone(operator))? {
                        return Ok(());
                    }
                }
                claim(need.size(), "the levels of multigrid")?;
                solver.take(source.matrix().ok_or(SolveError::NotFactored)?)
            }
        }
    }

    /// Takes a tangent; levels are made where those at hand do not serve.
    ///
    /// # Errors
    /// As [`Self::of_one`].
    pub(super) fn take(&mut self, source: &Source) -> Result<(), SolveError> {
        let is_kept = match (&mut self.solver, source) {
            (Solver::Conjugate(solver), source) => solver.keep_levels(source)?,
            (Solver::Contact(solver), Source::Parted(matrix, on_faces)) => solver.keep_levels(matrix, on_faces)?,
            (Solver::Contact(..) | Solver::Saddle(_), _) => false,
        };
        if is_kept { Ok(()) } else { self.renew(source) }
    }

    /// Solves with the matrix taken last; of tangents until `tolerance` of the right-hand side is left. Where levels of an
    /// earlier one do not serve, those of the matrix itself are made.
    ///
    /// # Errors
    /// [`SolveError`] of an iteration with the levels of that matrix.
    pub(super) fn solve(
        &mut self,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
        source: Option<&Source>,
    ) -> Result<SolveReport, SolveError> {
        match (self.of_tangents, &mut self.solver) {
            (false, Solver::Conjugate(solver)) => return solver.solve_to(rhs, x, tolerance),
            (false, Solver::Saddle(solver)) => return solver.solve_until(rhs, x, tolerance),
            _ => {}
        }
        let left = WITHIN * tolerance;
        match self.solve_until(rhs, x, left) {
            Err(error) if is_of_iteration(&error) && self.has_kept_levels() => {
                self.renew(source.ok_or(error)?)?;
                self.solve_until(rhs, x, left)
            }
            other => other,
        }
    }

    fn solve_until(&mut self, rhs: &[f64], x: &mut [f64], left: f64) -> Result<SolveReport, SolveError> {
        match &mut self.solver {
            Solver::Conjugate(solver) => solver.solve_until(rhs, x, left),
            Solver::Contact(solver) => solver.solve_until(rhs, x, left),
            Solver::Saddle(solver) => solver.solve_until(rhs, x, left),
        }
    }

    /// Forgets an operator and keeps its levels.
    pub(super) fn forget_operator(&mut self) {
        if let Solver::Conjugate(solver) = &mut self.solver
            && solver.is_applied()
        {
            solver.forget_source();
        }
    }

    fn has_kept_levels(&self) -> bool {
        match &self.solver {
            Solver::Conjugate(solver) => solver.has_kept_levels(),
            Solver::Contact(solver) => solver.has_kept_levels(),
            Solver::Saddle(_) => false,
        }
    }

    /// Whether a symmetric matrix, or an operator, is positive definite by the levels at hand; `None` where they do not tell.
    pub(super) fn looks_definite(&mut self, source: &Source) -> Option<bool> {
        match &mut self.solver {
            Solver::Conjugate(solver) => solver.looks_definite(source).ok()?,
            Solver::Contact(..) | Solver::Saddle(_) => None,
        }
    }

    /// Whether solutions show that the matrix is positive definite: with conjugate gradients, and not of tangents, of which each is
    /// solved with few right-hand sides.
    pub(super) fn shows_definite(&self) -> bool {
        !self.of_tangents && matches!(self.solver, Solver::Conjugate(_))
    }

    /// What it is called.
    pub(super) fn name(&self) -> &'static str {
        if matches!(self.solver, Solver::Conjugate(_)) { ITERATION } else { GMRES }
    }

    /// Whether it solves tangents.
    pub(super) fn is_of_tangents(&self) -> bool {
        self.of_tangents
    }

    /// Whether its levels say nothing of the whole: they are those of the bodies without contact, or of a motion without its pressure.
    pub(super) fn has_levels_of_a_part(&self) -> bool {
        matches!(self.solver, Solver::Contact(..) | Solver::Saddle(_))
    }

    /// Whether it is at work.
    pub(super) fn is_at_work(&self) -> bool {
        !self.is_set_aside
    }

    /// Says whether factors take its place; levels are made anew afterwards.
    pub(super) fn set_aside(&mut self, is_set_aside: bool) {
        self.is_set_aside = is_set_aside;
        match &mut self.solver {
            Solver::Conjugate(solver) => solver.expire(),
            Solver::Contact(solver) => solver.expire(),
            Solver::Saddle(_) => {}
        }
    }

    /// What it is.
    pub(super) fn method(&self) -> LinearPlan {
        let solver = match &self.solver {
            Solver::Conjugate(solver) => solver,
            Solver::Contact(solver) => {
                return LinearPlan::WithContact(solver.n_on_contact(), Extent::Made(solver.level_sizes().to_vec()));
            }
            Solver::Saddle(solver) => {
                let systems = if self.of_tangents { Systems::Tangents } else { Systems::One };
                return LinearPlan::Saddle(systems, Extent::Made(solver.level_sizes().to_vec()));
            }
        };
        let levels = Extent::Made(solver.level_sizes().to_vec());
        let plan = if self.of_tangents { LinearPlan::Tangents(levels) } else { LinearPlan::Iterative(levels) };
        if solver.is_applied() { LinearPlan::WithOperator(Box::new(plan), Held::Applied) } else { plan }
    }
}

/// Whether an iteration failed for what another method need not fail for.
pub(super) fn is_of_iteration(error: &SolveError) -> bool {
    use SolveError::{Library, NotPositiveDefinite, NotSymmetric, ResidualTooLarge, TooManyIterations, VanishingPivot};
    matches!(
        error,
        NotPositiveDefinite { .. }
            | NotSymmetric { .. }
            | TooManyIterations { .. }
            | ResidualTooLarge { .. }
            | VanishingPivot { .. }
            | Library { .. }
    )
}

/// Why a system cannot be solved by the iteration; `None` if it can.
#[must_use]
pub fn obstacle(system: &System) -> Option<String> {
    layout(system).err()
}

/// The unknowns by nodes, or why there is no iteration.
pub(super) fn layout(system: &System) -> Result<NodeLayout, String> {
    let mut terms = system.terms.iter().chain(system.frozen().iter().map(|frozen| &frozen.form));
    if let Some(term) = terms.find(|t| !t.law.symmetric) {
        return Err(format!("the term `{}` is not symmetric", term.law.name));
    }
    if !system.uses(Pruning::Symmetric) {
        return Err("symmetry is not used".to_owned());
    }
    if let Some(why) = obstacle_of_tangents(system) {
        return Err(why);
    }
    system.node_layout()
}

/// What stands against it in the terms that are not linear.
fn obstacle_of_tangents(system: &System) -> Option<String> {
    if system.is_linear() {
        return None;
    }
    if !system.team().is_alone() {
        return Some("there are several ranks, and the scene is not linear".to_owned());
    }
    if system.has_moving_images() {
        return Some("images follow the bodies".to_owned());
    }
    if let Some(field) = (0..system.fields.len()).find(|field| system.has_single_equations(*field)) {
        return Some(format!("the equations of `{}` are laws at points", system.fields[field].name));
    }
    condenses(system).then(|| "the terms that are not linear touch few unknowns: the rest is factored once".to_owned())
}

/// The ways to solve the systems of a scene, and what they have to do in so many steps.
fn ways(system: &System, steps: usize) -> (Ways, [Work; 2]) {
    #[expect(clippy::cast_precision_loss, reason = "a count of steps")]
    let steps = steps as f64;
    if system.is_linear() {
        return (ONE_MATRIX, [Work { made: 1.0, solutions: steps }; 2]);
    }
    let of_steps = |step: Work| Work { made: steps * step.made, solutions: steps * step.solutions };
    (TANGENTS, [of_steps(FACTORS_OF_A_STEP), of_steps(LEVELS_OF_A_STEP)])
}

/// Whether the iteration is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, steps: usize) -> bool {
    let (ways, work) = ways(system, steps);
    ways.are_left(method, system, work) && obstacle(system).is_none()
}

/// The iteration with what it is foreseen to take; `None` for a factor.
pub(super) fn plan(system: &System, method: LinearMethod, steps: usize) -> Option<LinearPlan> {
    if !is_chosen(system, method, steps) {
        return None;
    }
    let (ways, [of_factors, of_levels]) = ways(system, steps);
    let n = system.n_unknowns();
    let in_place = (system.mesh.dim() == 3 && n >= ways.small).then(|| ways.by_factors(n, of_factors).size());
    let levels = match without_matrix::pays(system) {
        true => without_matrix::bytes_with_entries(system),
        false => ways.by_iteration(n, of_levels).size(),
    };
    let foreseen = Extent::Foreseen((levels, in_place));
    Some(if system.is_linear() { LinearPlan::Iterative(foreseen) } else { LinearPlan::Tangents(foreseen) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::Cost;

    #[test]
    fn a_factor_is_foreseen_as_it_was_measured() {
        let near = |found: f64, measured: f64| (found / measured - 1.0).abs() < 0.2;
        let factor = |n| ONE_MATRIX.by_factors(n, Work { made: 1.0, solutions: 0.0 });
        assert!(near(factor(108_000).bytes, 2.7e9) && near(factor(353_000).bytes, 12.7e9));
        assert!(near(factor(108_000).seconds, 4.5) && near(factor(353_000).seconds, 39.0));
    }

    #[test]
    fn many_solutions_pay_for_a_factor() {
        let work = |solutions| [Work { made: 1.0, solutions }; 2];
        let pays = |n, solutions| ONE_MATRIX.prefer_iteration(n, work(solutions));
        assert!(pays(100_000, 1.0) && !pays(60_000, 1000.0) && pays(2_000_000, 10.0));
    }

    #[test]
    fn a_factor_takes_more_for_each_unknown_the_more_there_are_and_the_levels_do_not() {
        let by_unknown =
            |of: fn(&Ways, usize, Work) -> Cost, n: usize| of(&TANGENTS, n, LEVELS_OF_A_STEP).bytes / n as f64;
        let growth = |of: fn(&Ways, usize, Work) -> Cost| by_unknown(of, 800_000) / by_unknown(of, 100_000);
        assert!((growth(Ways::by_factors) - 2.0).abs() < 1e-12, "the third root");
        assert!((growth(Ways::by_iteration) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_scene_with_friction_is_factored_whatever_is_asked_for() {
        use crate::test_block::Block;
        let system = Block::with_friction(1).system;
        assert!(obstacle(&system).is_some_and(|why| why.contains("not symmetric")));
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
    fn tangents_are_iterated_where_factors_took_longer_or_more_than_there_is() {
        let pays = |n| TANGENTS.prefer_iteration(n, [FACTORS_OF_A_STEP, LEVELS_OF_A_STEP]);
        assert!(!pays(13_005) && pays(33_327) && pays(43_125) && pays(100_000));
    }

    #[test]
    fn a_term_that_is_not_symmetric_is_named() {
        use crate::test_block::{Block, LAPLACE};
        let system = Block::new(1, &[LAPLACE, "u(1)*Test_u(2)"], &[]).system;
        assert_eq!(obstacle(&system).as_deref(), Some("the term `law` is not symmetric"));
    }

    #[test]
    fn nonlinear_bodies_are_iterated_on_request_and_small_ones_not_by_themselves() {
        use crate::test_block::{Block, CUBIC};
        let system = Block::new(2, &[CUBIC], &[]).system;
        assert_eq!(obstacle(&system), None);
        assert!(is_chosen(&system, LinearMethod::Iterative, 1) && !is_chosen(&system, LinearMethod::Auto, 1));
        assert!(matches!(plan(&system, LinearMethod::Iterative, 1), Some(LinearPlan::Tangents(_))));
    }
}
