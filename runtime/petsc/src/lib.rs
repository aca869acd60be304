//! Solvers of PETSc behind the door that every linear solver of WFL passes.
//!
//! `Session` is MPI and PETSc from start to end; `Petsc` is the library that a run is linked with; `method` chooses a
//! method, `engine` falls back to more robust ones; `rows` gives every rank its rows; `objects` owns the handles and is, with
//! `ffi`, the only unsafe code. The C side, `shim.c`, is compiled with the headers of the machine. Without the feature
//! `petsc` this crate is empty, so that nothing of PETSc is needed to build and test the rest.
//!
//! Promises: all ranks make the same calls in the same order, since all that is decided follows from numbers that all ranks
//! have. Does not check solutions: `wfl_sparse` does that for every library. Knows no meshes, forms and scenes.
#![cfg(feature = "petsc")]
#![deny(unsafe_code)]

mod engine;
#[expect(unsafe_code, reason = "declarations of C functions")]
mod ffi;
mod library;
mod method;
#[expect(unsafe_code, reason = "the owner of the handles of C objects")]
mod objects;
mod rows;

pub use library::Petsc;
pub use method::Choice;
pub use objects::{Failure, Session};
