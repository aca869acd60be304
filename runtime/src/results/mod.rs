//! From the state to result files: which expression is sampled where, and the files of a run.

mod line;
mod locate;
mod piece;

pub use line::LineSample;
pub use locate::Located;
pub use piece::{Item, SampledPiece};
