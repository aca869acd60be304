//! Conjugate gradients with a multigrid preconditioner, for matrices that are symmetric and positive definite and too
//! large to factor.
//!
//! Elements of degree 2 and above get their first coarser level from elements of degree 1 on the same cells (p-multigrid);
//! all others come from smoothed aggregation with the rigid motions of bodies (Vanek, Mandel and Brezina 1996). Work and
//! memory grow as the number of unknowns does.
//!
//! `solver` is the door, `cycle` that of other solvers, `hierarchy` makes the levels and goes through them, `changing` adds a part
//! that changes to them, `coarsest` is factored, `level` smooths, `aggregate`,
//! `prolongation` and `galerkin` make a coarser level, `wear` says how long levels serve, `blocks` and `nodes` hold matrices by nodes.
//!
//! Promises: the same bits for any number of threads; a solution only with a small true residual. Does not know meshes and
//! forms: which unknowns belong to a node, where nodes are and how elements of degree 1 move them is told by plain numbers
//! ([`NodeLayout`]).

mod aggregate;
mod blocks;
mod changing;
mod coarsest;
mod conjugate_gradients;
mod cycle;
mod galerkin;
mod hierarchy;
mod level;
mod nodes;
mod operator;
mod prolongation;
mod solver;
#[cfg(test)]
mod tests;
mod wear;

pub(super) use cycle::Cycle;
pub use nodes::{Interpolation, NearNullSpace, NodeLayout, scale_of};
pub use operator::{CoarserLevel, FinestLevel, Operator, OperatorLevels};
pub use solver::{CheckedMultigrid, Source};
pub(super) use wear::Wear;
