//! From point laws on a mesh to vectors and matrices.
//!
//! [`space`] numbers nodes, [`domain`] holds the points of integration, [`areas`] what nodes of faces have of
//! them, [`field`] gives them components, [`assemble`]
//! integrates compiled point laws over domains into residuals and tangents, [`value`] evaluates expressions, [`frames`]
//! holds the local frames of prescribed directions, [`rates`] what `Dot_u` and `Dot2_u` read of the past, [`lumped`] a
//! mass on the diagonal, [`redistribution`] one that some nodes give away, [`share`] the rows of ranks, [`window`] when it
//! is. Promises sums in one fixed order for any number of threads, and that a number that is not finite is reported with its
//! place ([`finite`]). Does not solve, step, read scenes or write results.
#![forbid(unsafe_code)]

pub mod areas;
pub mod assemble;
pub mod damping;
pub mod domain;
pub mod field;
pub mod finite;
pub mod frames;
pub mod gradients;
pub mod longest_step;
pub mod lumped;
pub mod point_space;
pub mod point_values;
mod prologue;
pub mod pruning;
pub mod rates;
pub mod redistribution;
pub mod share;
pub mod space;
pub mod system;
pub mod value;
pub mod window;
