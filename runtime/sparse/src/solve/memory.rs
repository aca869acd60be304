//! What a solver carries from one run to the next.
//!
//! Promises that a resumed run goes on bit by bit. Does not write it anywhere.

use super::Reference;

/// What a solver has learnt: with it a resumed run goes on bit by bit as if it had not been stopped.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolverMemory {
    /// Values of the changing part in the factor in use; empty if there is none.
    pub factored: Vec<f64>,
    /// Whether that factor is dense.
    pub dense: bool,
    /// Whether the matrix is still taken for symmetric and positive definite.
    pub symmetric: bool,
    /// Factorisations so far.
    pub factorisations: usize,
    /// Krylov iterations made with the factor in use.
    pub spent: usize,
    /// Free dofs that have turned out not to share a force with the dof that faces them.
    pub apart: Vec<u32>,
    /// Whether the factors of the bulk and of the matrix of the forces are of single precision.
    pub single: bool,
    /// What the factor of the forces was made from.
    pub reference: Reference,
}
