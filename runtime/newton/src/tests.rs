//! Steps of a block on a floor, from their start to their end: each has a solution by hand.
//!
//! A square of edge 1 with stress = grad u moves down by `u` at its floor: its stiffness is 1 there, and a force of 2 by
//! area, of which the top carries half, is a force of 1. The floor is 10 by length.

use super::test_block::{Block, CUBIC, LAPLACE, PENALTY, PENALTY_WITH_FRICTION};
use super::*;
use wfl_discrete::{
    system::{LinearTerms, Tangent},
    window::Window,
};
use wfl_linear::LinearSolver;
use wfl_sparse::solve::SolverOptions;

/// Forces by area, down and to the right, that grow with the step.
const WEIGHT: &str = "[0,2*t].Test_u";

/// A block with all that a step is solved with.
pub(crate) struct Solving {
    pub(crate) block: Block,
    pub(crate) solver: LinearSolver,
    pub(crate) tangent: Tangent,
    pub(crate) options: NewtonOptions,
    pub(crate) u: Vec<f64>,
    pub(crate) offset: Vec<f64>,
}

impl Solving {
    pub(crate) fn new(cells: &[&str], floor: &[&str]) -> Self {
        let block = Block::new(1, cells, floor);
        let mut solver = LinearSolver::new(&block.system, SolverOptions::default()).unwrap();
        solver.bulk_changed(&block.system).unwrap();
        let (tangent, u) = (block.system.new_tangent(), vec![0.0; block.system.numbering.n_dofs]);
        Self { block, solver, tangent, options: NewtonOptions::default(), u, offset: Vec::new() }
    }

    /// Brings the laws to a step.
    fn at(&mut self, time: f64) -> &mut Self {
        let window = Window::new(time, 1.0);
        if self.block.system.begin_step(window).unwrap() {
            self.solver.bulk_changed(&self.block.system).unwrap();
        }
        self.block.contact.begin_step(window);
        self
    }

    /// What a step is solved with, and its unknowns.
    pub(crate) fn with<R>(
        &mut self,
        watch: &mut dyn Watch,
        f: impl FnOnce(&mut LoadStep<'_>, &mut Vec<f64>) -> R,
    ) -> R {
        let mut step = LoadStep {
            system: &self.block.system,
            contact: &mut self.block.contact,
            solver: &mut self.solver,
            tangent: &mut self.tangent,
            offset: &self.offset,
            linear: LinearTerms::ByMatrix,
            options: self.options,
            solves_once: false,
            watch,
            spent: Spent::default(),
            rounding: None,
            reached: None,
        };
        f(&mut step, &mut self.u)
    }

    /// Solves a step from where the last one ended.
    fn solve(&mut self) -> StepHistory {
        self.try_solve(&mut Silent).expect("the step can be solved")
    }

    fn try_solve(&mut self, watch: &mut dyn Watch) -> Result<StepHistory, NewtonError> {
        self.with(watch, |step, u| {
            let from = u.clone();
            solve_step(step, &from, u)
        })
    }

    /// The motion of the floor.
    fn floor(&self) -> [f64; 2] {
        let field = &self.block.system.fields[0];
        let node = (0..field.n_nodes()).find(|k| field.node_position(*k)[1] == 0.0).unwrap();
        [self.u[2 * node], self.u[2 * node + 1]]
    }
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12 * expected.abs().max(1e-3), "{found} in place of {expected}");
}

#[test]
fn a_linear_scene_takes_one_iteration() {
    let mut solving = Solving::new(&[LAPLACE, WEIGHT], &[]);
    let history = solving.solve();
    assert!(history.converged() && history.n_iterations() == 1);
    near(solving.floor()[1], -1.0);
}

#[test]
fn a_linear_scene_is_factored_once_for_all_steps() {
    let mut solving = Solving::new(&[LAPLACE, WEIGHT], &[]);
    for time in [1.0, 2.0, 5.0] {
        assert!(solving.at(time).solve().converged());
        near(solving.floor()[1], -time);
    }
    assert_eq!(solving.solver.factorisations(), 1);
}

#[test]
fn a_body_that_is_pressed_rests_on_the_floor() {
    let mut solving = Solving::new(&[LAPLACE, WEIGHT], &[PENALTY]);
    let history = solving.solve();
    assert_eq!(history.stop, Some(Stop::Tolerance));
    near(solving.floor()[1], -1.0 / 11.0);
    assert_eq!(history.iterations.last().unwrap().contact, Some([0, 0, 2]), "both points are closed");
}

#[test]
fn a_body_that_is_lifted_leaves_the_floor() {
    let mut solving = Solving::new(&[LAPLACE, "[0,-2].Test_u"], &[PENALTY]);
    let history = solving.solve();
    near(solving.floor()[1], 1.0);
    assert_eq!(history.iterations.last().unwrap().contact, Some([2, 0, 0]));
}

#[test]
fn a_load_that_ends_leaves_nothing_but_rounding() {
    let mut solving = Solving::new(&[LAPLACE, "[0.3*t,2*t].Test_u"], &[PENALTY_WITH_FRICTION]);
    let pressed = solving.at(1.0).solve();
    assert!(pressed.converged() && solving.block.contact.is_warm());
    let history = solving.at(0.0).solve();
    assert!(history.converged() && history.n_iterations() <= 10 && solving.u.iter().all(|u| u.abs() < 1e-14));
    let is_at_rest = solving.u.iter().all(|u| *u == 0.0);
    assert_eq!(solving.block.contact.is_warm(), !is_at_rest, "rest says nothing of the step to come");
}

#[test]
fn a_body_sticks_until_the_force_along_the_floor_is_the_bound() {
    let mut solving = Solving::new(&[LAPLACE, "[-0.4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    let history = solving.solve();
    near(solving.floor()[0], 0.2 / 11.0);
    assert_eq!(history.iterations.last().unwrap().contact, Some([0, 0, 2]));
}

#[test]
fn a_body_slips_against_the_bound() {
    let mut solving = Solving::new(&[LAPLACE, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    let history = solving.solve();
    assert!(history.converged());
    // the bound is half of the pressure 10/11
    near(solving.floor()[0], 2.0 - 5.0 / 11.0);
    assert_eq!(history.iterations.last().unwrap().contact, Some([0, 2, 0]));
}

#[test]
fn a_step_after_a_converged_one_keeps_its_contact_and_takes_one_iteration() {
    let mut solving = Solving::new(&[LAPLACE, WEIGHT], &[PENALTY_WITH_FRICTION]);
    assert!(solving.solve().converged() && solving.block.contact.is_warm());
    let history = solving.at(3.0).solve();
    assert_eq!(history.n_iterations(), 1);
    assert_eq!(history.iterations.last().unwrap().changed, 0);
    near(solving.floor()[1], -3.0 / 11.0);
}

#[test]
fn nothing_to_do_is_done_without_an_iteration_and_says_nothing_of_the_next_step() {
    let mut solving = Solving::new(&[LAPLACE], &[PENALTY]);
    let history = solving.solve();
    assert!(history.converged() && history.n_iterations() == 0);
    assert!(!solving.block.contact.is_warm(), "the active set of the start is a guess");
}

#[test]
fn a_step_that_has_too_few_iterations_is_marked_and_leaves_no_contact_to_go_on_with() {
    let mut solving = Solving::new(&[LAPLACE, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    solving.options.max_iterations = 1;
    let history = solving.solve();
    assert_eq!((history.stop, history.converged()), (Some(Stop::MaxIterations), false));
    assert!(!solving.block.contact.is_warm());
}

/// Wants no more than some iterations, and counts those it was told of.
struct Impatient {
    wanted: usize,
    told: usize,
}

impl Watch for Impatient {
    fn iteration(&mut self, _iteration: &Iteration) {
        self.told += 1;
    }

    fn stops(&mut self) -> bool {
        self.told > self.wanted
    }
}

#[test]
fn who_watches_can_stop_a_step() {
    let mut solving = Solving::new(&[LAPLACE, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    let mut watch = Impatient { wanted: 1, told: 0 };
    let stopped = solving.try_solve(&mut watch);
    assert!(matches!(stopped, Err(NewtonError::Stopped)), "{stopped:?}");
    assert_eq!(watch.told, 2, "the start and one iteration");
}

#[test]
fn every_line_of_a_history_is_told() {
    let mut solving = Solving::new(&[LAPLACE, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    let mut watch = Impatient { wanted: 1000, told: 0 };
    let history = solving.try_solve(&mut watch).unwrap();
    assert_eq!(watch.told, history.iterations.len());
    assert!(history.iterations.iter().enumerate().all(|(k, i)| i.number == k));
}

#[test]
fn a_body_that_nothing_holds_is_an_error_of_the_scene() {
    let mut solving = Solving::new(&["Grad_u(1,2)*Grad_Test_u(1,2)", WEIGHT], &["pos_part(u(1))*Test_u(1)"]);
    let error = solving.try_solve(&mut Silent).unwrap_err();
    assert!(error.is_singular(), "{error}");
}

#[test]
fn a_body_that_is_singular_at_rest_starts_from_a_displaced_state() {
    let mut solving = Solving::new(&[CUBIC, WEIGHT], &[]);
    let history = solving.solve();
    assert!(history.converged() && history.displaced);
    assert!((solving.floor()[1] + 1.0).abs() < 1e-9, "u^3 = -1: {:?}", solving.floor());
}

#[test]
fn a_smooth_body_converges_quadratically() {
    let mut solving = Solving::new(&[LAPLACE, CUBIC, WEIGHT], &[]);
    let history = solving.solve();
    // u + u^3 = -1
    assert!((solving.floor()[1] + 0.682_327_803_828_019_3).abs() < 1e-12);
    let residuals: Vec<f64> = history.iterations.iter().map(|i| i.residual).collect();
    let last = residuals.windows(2).rev().find(|w| w[1] > 1e-13 && w[0] < 1e-2);
    assert!(last.is_none_or(|w| w[1] < 10.0 * w[0] * w[0]), "{residuals:?}");
}

#[test]
fn without_a_search_every_step_is_full() {
    let mut solving = Solving::new(&[LAPLACE, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    solving.options.search = false;
    let history = solving.solve();
    assert!(history.iterations.iter().all(|i| i.step == 1.0));
    assert!(history.iterations[1..].iter().all(|i| i.method == Method::Residual), "contact needs a search");
}

#[test]
fn a_prescribed_motion_of_a_nonlinear_body_is_part_of_the_first_correction() {
    let mut solving = Solving::new(&[LAPLACE, CUBIC], &[]);
    let to = solving.block.moved([0.0; 2], [0.0, 0.5]);
    let history = solving
        .with(&mut Silent, |step, u| {
            let from = u.clone();
            u.copy_from_slice(&to);
            solve_step(step, &from, u)
        })
        .unwrap();
    // the whole body moves, so that nothing is strained
    let [start, predicted] = &history.iterations[..2] else { panic!("{history:?}") };
    assert!(predicted.method == Method::Predictor && predicted.merit < 1e-12 * start.merit, "{history:?}");
    assert!(history.converged());
    near(solving.floor()[1], 0.5);
}

#[test]
fn a_constant_residual_on_top_is_balanced() {
    let mut solving = Solving::new(&[LAPLACE, WEIGHT], &[]);
    // twice the weight at the nodes of the floor, upwards
    solving.offset = [0.0, -1.0].repeat(solving.u.len() / 2);
    assert!(solving.solve().converged());
    near(solving.floor()[1], 1.0);
}

#[test]
fn what_a_step_cost_is_counted() {
    let mut solving = Solving::new(&[LAPLACE, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
    let (history, spent) = solving.with(&mut Silent, |step, u| {
        let from = u.clone();
        (solve_step(step, &from, u).unwrap(), step.spent)
    });
    assert_eq!((spent.iterations, spent.linear_solves), (history.n_iterations(), history.solves.len()));
    assert!(spent.factor >= 0.0 && spent.solve > 0.0);
}
