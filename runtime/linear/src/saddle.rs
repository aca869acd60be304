//! Whether a flow with a pressure is solved by a factor or by GMRES with multigrid of the motion.
//!
//! Decided before memory is taken, from the number of unknowns. Promises: a reason in words wherever the iteration cannot
//! be used. Does not assemble and does not solve.

use wfl_discrete::system::System;
use wfl_sparse::solve::{LinearMethod, NodeLayout};

use super::cost::{Factors, Iteration, Ways, Work};
use super::plan::{Extent, LinearPlan};

/// Factors of a flow (LDLT), and the iteration. Measured on a flow through a cube with Taylor-Hood elements, of 46,000 and 194,000
/// unknowns (docs/solvers.md).
const WAYS: Ways = Ways {
    factors: Factors { bytes: 13e3, seconds: 4.2, power: 1.97, solution: 0.2 },
    iteration: Iteration { bytes: 3.7e3, levels: 0.5, solution: 4.0 },
    small: 30_000,
};

/// The unknowns by nodes, or why the iteration cannot be used.
pub(super) fn layout(system: &System) -> Result<NodeLayout, String> {
    if !system.is_linear() {
        return Err("the scene is not linear".to_owned());
    }
    if !system.team().is_alone() {
        return Err("there are several ranks".to_owned());
    }
    system.node_layout_of_motion()
}

/// Whether the iteration is to be used; `steps` are those that are expected.
#[must_use]
pub(super) fn is_chosen(system: &System, method: LinearMethod, steps: usize) -> bool {
    WAYS.are_left(method, system, [work(steps); 2]) && layout(system).is_ok()
}

/// The iteration with what it is foreseen to take; `None` for a factor.
pub(super) fn plan(system: &System, method: LinearMethod, steps: usize) -> Option<LinearPlan> {
    if !is_chosen(system, method, steps) {
        return None;
    }
    let (n, work) = (system.n_unknowns(), work(steps));
    let (bytes, in_place) = (WAYS.by_iteration(n, work).size(), WAYS.by_factors(n, work).size());
    Some(LinearPlan::Saddle(Extent::Foreseen((bytes, Some(in_place)))))
}

/// What levels take before they are made.
pub(super) fn bytes(n: usize) -> u64 {
    WAYS.by_iteration(n, work(1)).size()
}

#[expect(clippy::cast_precision_loss, reason = "a count of steps")]
fn work(steps: usize) -> Work {
    Work { made: 1.0, solutions: steps as f64 }
}
