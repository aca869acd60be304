//! From the state to result files: which expression is sampled where, and the files of a run.

mod fields;
mod line;
mod locate;
mod piece;

pub use fields::{field_cells, field_grid, field_grids};
pub use line::LineSample;
pub use locate::Located;
pub(crate) use piece::vtk_cell;
pub use piece::{Item, SampledPiece};
