//! The operators of the language, each at smooth points, at kinks and at extreme magnitudes.

mod defects;
mod extremes;
mod kinks;
mod point;
mod registry;
mod vectors;
