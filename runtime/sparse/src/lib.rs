//! Sparse matrices and their linear solvers.
//!
//! [`csr`] holds patterns, values and products; [`solve`] orderings, factorisations, low-rank updates, Krylov
//! iterations and the backward-error check of every solution; [`norm`] the norm of that check. Promises the same bytes
//! for any number of threads, and no solution without a small true residual. Does not know meshes, fields or forms;
//! orderings may receive the coordinates of dofs.
#![forbid(unsafe_code)]

pub mod csr;
pub mod index;
pub mod norm;
pub mod solve;
