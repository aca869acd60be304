//! Meshes, reference elements and quadrature rules.
//!
//! [`cell`] holds the reference cells, [`mesh`] topology, region sets, readers, generators and point location; [`element`] the Lagrange elements
//! on the reference cells; [`quadrature`] the integration rules there; [`polygon`] cuts polygons; [`refine`] divides cells. Promises that a [`mesh::Mesh`] was checked once and
//! is read-only from then on. Does not know fields, forms, matrices or scenes: `wfl` gives it typed indices alone.
#![forbid(unsafe_code)]

pub mod cell;
pub mod element;
pub mod mesh;
pub mod polygon;
pub mod quadrature;
pub mod refine;
mod vector;
