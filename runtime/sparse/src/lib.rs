//! Sparse matrices and their linear solvers.
//!
//! [`csr`] holds patterns, values and products; [`solve`] orderings, factorisations, low-rank updates, Krylov iterations
//! and the checks of every solution; [`norm`] the norm in which solutions are judged. Promises the same bytes for any
//! number of threads, and no solution without a small true residual. Does not know meshes, fields or forms: where dofs
//! lie is known only to orderings, as coordinates.
#![forbid(unsafe_code)]

pub mod csr;
pub mod index;
pub mod norm;
pub mod solve;
