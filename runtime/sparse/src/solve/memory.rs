//! State of a solver that is kept for a resumed run.
//!
//! Promises: a resumed run continues bit by bit. Does not write files.

use super::Reference;

/// State of a solver with which a resumed run continues bit by bit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolverMemory {
    /// Values of the changing part in the factor in use; empty if there is none.
    pub factored: Vec<f64>,
    /// Whether that factor is dense.
    pub dense: bool,
    /// Whether the matrix still counts as symmetric and positive definite.
    pub symmetric: bool,
    /// Factorisations so far.
    pub factorisations: usize,
    /// Krylov iterations made with the factor in use.
    pub spent: usize,
    /// Free dofs that do not share a force with their facing dof.
    pub apart: Vec<u32>,
    /// Whether the factors of the bulk and of the capacitance matrix are of single precision.
    pub single: bool,
    /// An iteration is at work.
    pub iterative: bool,
    /// What the factor of the capacitance matrix was made from.
    pub reference: Reference,
}
