//! From the state to result files: the fields of a scene on the bodies.

mod fields;

pub use fields::{field_cells, field_grid, field_grids};
pub(crate) use wfl_output::vtk_cell;
pub use wfl_output::{Item, LineSample, Located, SampledPiece};
