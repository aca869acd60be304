//! The linear systems of a scene: which solver they get, what it is foreseen to take, and the solver at work.
//!
//! The choice follows from the classes of the terms, the numbers of unknowns and of steps, and the memory there is
//! ([`LinearSolver`]); `wfl check` and a run tell it in the same words ([`LinearPlan`]). Promises: a reason in words wherever an
//! iteration cannot be used, and no solution that has not passed the checks of [`wfl_sparse::solve`]. Knows systems and
//! their tangents, no laws of contact and no load steps.
#![forbid(unsafe_code)]

mod condensation;
mod cost;
mod filtered;
mod iterative;
mod library;
mod linear_solver;
mod plan;
mod saddle;
mod without_matrix;

#[cfg(test)]
#[path = "../../contact/src/test_block.rs"]
mod test_block;

pub use condensation::condenses;
pub use filtered::obstacle_of_filter;
pub use iterative::obstacle;
pub use linear_solver::{LinearSolver, shares_forces};
pub use plan::LinearPlan;
