//! Products, factors and triangular solves of dense matrices, and what else faer does for the sparse factorisations.
//!
//! Faer's functions are generic: each crate that calls one compiles it again, and so do its tests. Here they are called with numbers
//! of double and single precision, once, by functions that are compiled in this crate ([`Real`]). Sweeps with one vector
//! ([`sweeps`]) are our own and stand here for the same reason. Knows no sparse matrix of ours, no error and no memory limit.

#![forbid(unsafe_code)]

mod general;
mod indefinite;
mod real;
mod structure;
pub mod sweeps;

pub use faer::{
    Accum, MatMut, MatRef, Par,
    prelude::{Reborrow, ReborrowMut},
};
pub use general::{General, GeneralError, Side};
pub use indefinite::Indefinite;
pub use real::{Real, Work, lower_product, solve_unit_lower};
pub use structure::{Fronts, fronts, minimum_degree};

/// The machine refused memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoMemory;
