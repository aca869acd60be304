//! What holds a body for an iteration that the tangent leaves loose.
//!
//! Promises: a stiffness that the pattern of the tangent has a place for. Does not say when a body is to be held.

use super::{LoadStep, NewtonError};
use wfl_sparse::solve::SolveError;

/// A stiffness at one free dof: that which its body has there.
pub(super) struct Hold {
    pub(super) free: usize,
    pub(super) stiffness: f64,
}

impl Hold {
    /// Of a tangent with a null vector: the dof that moves most, of those at which a stiffness can be added.
    pub(super) fn of(step: &LoadStep<'_>, error: &NewtonError) -> Option<Self> {
        let NewtonError::Solve(SolveError::Singular { mode, .. }) = error else { return None };
        let changing = &step.tangent.changing;
        let pattern = changing.pattern();
        let stiffness = |free: usize| (step.system.bulk().get(free, free) + changing.get(free, free)).abs();
        let fits = |free: usize| {
            let columns = &pattern.columns()[pattern.row_starts()[free]..pattern.row_starts()[free + 1]];
            columns.contains(&(free as u32)) && stiffness(free) > 0.0
        };
        let moved = mode.values().iter().enumerate().filter(|(free, x)| **x != 0.0 && fits(*free));
        let (free, _) = moved.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        Some(Self { free, stiffness: stiffness(free) })
    }
}
