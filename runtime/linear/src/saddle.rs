//! Whether a flow with a pressure is solved by a factor or by GMRES with multigrid of the motion.
//!
//! Decided before memory is taken, from the number of unknowns. Promises: a reason in words wherever the iteration cannot
//! be used. Does not assemble and does not solve.

use wfl_discrete::system::System;
use wfl_sparse::solve::{LinearMethod, NodeLayout};

use super::cost::{Factors, Iteration, Ways, Work};
use super::plan::{Extent, LinearPlan, Systems};

/// Factors of a flow (LDLT), and the iteration. Measured on a flow through a cube with Taylor-Hood elements, of 46,000 and 194,000
/// unknowns (docs/solvers.md).
const WAYS: Ways = Ways {
    factors: Factors { bytes: 13e3, seconds: 4.2, power: 1.97, solution: 0.2 },
    iteration: Iteration { bytes: 3.2e3, levels: 0.5, solution: 2.2 },
    small: 30_000,
};

/// Of a step of Newton's method with factors: two are made, and there are five solutions.
const FACTORS_OF_A_STEP: Work = Work { made: 2.0, solutions: 5.0 };
/// The same with levels, which each tangent has of its own. Corrections but the last are solved to a few digits.
const LEVELS_OF_A_STEP: Work = Work { made: 5.0, solutions: 2.0 };

/// The unknowns by nodes, or why the iteration cannot be used.
pub(super) fn layout(system: &System) -> Result<NodeLayout, String> {
    if !system.team().is_alone() {
        return Err("there are several ranks".to_owned());
    }
    if system.has_moving_images() {
        return Err("images follow the bodies".to_owned());
    }
    if let Some(frozen) = system.frozen().first() {
        return Err(format!("the term `{}` is one of contact", system.terms[frozen.term].law.name));
    }
    system.node_layout_of_motion()
}

/// Whether the iteration is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, steps: usize) -> bool {
    WAYS.are_left(method, system, work(system, steps)) && layout(system).is_ok()
}

/// The iteration with what it is foreseen to take; `None` for a factor.
pub(super) fn plan(system: &System, method: LinearMethod, steps: usize) -> Option<LinearPlan> {
    if !is_chosen(system, method, steps) {
        return None;
    }
    let (n, [of_factors, of_levels]) = (system.n_unknowns(), work(system, steps));
    let (bytes, in_place) = (WAYS.by_iteration(n, of_levels).size(), WAYS.by_factors(n, of_factors).size());
    let systems = if system.is_linear() { Systems::One } else { Systems::Tangents };
    Some(LinearPlan::Saddle(systems, Extent::Foreseen((bytes, Some(in_place)))))
}

/// What levels take before they are made.
pub(super) fn bytes(n: usize) -> u64 {
    WAYS.by_iteration(n, LEVELS_OF_A_STEP).size()
}

/// What factors and levels have to do in so many steps.
#[expect(clippy::cast_precision_loss, reason = "a count of steps")]
fn work(system: &System, steps: usize) -> [Work; 2] {
    let steps = steps as f64;
    if system.is_linear() {
        return [Work { made: 1.0, solutions: steps }; 2];
    }
    [FACTORS_OF_A_STEP, LEVELS_OF_A_STEP].map(|of| Work { made: steps * of.made, solutions: steps * of.solutions })
}
