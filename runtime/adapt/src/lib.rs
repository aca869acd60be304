//! Settings of a scene, and what they change: the search for a demanded accuracy, the comparison of two solutions, the words
//! that set mesh, degree and method, and what each optimisation saves.
//!
//! Promises: scenes are solved by runs like any other; a number says how far two solutions are apart, or there is none. Does
//! not read files, does not print, and writes nothing.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod compare;
pub mod knobs;
mod savings;

pub use savings::{SavingError, savings};
