//! The operators of the language: what their rows in `wfl/src/operators.rs` and `wfl/src/scalar_functions.rs` build.
//!
//! A function is written in operations of the graph; its derivative then follows from `derive.rs`. A function whose
//! derivative cannot follow that way gets a node of its own there. Formulas of more than a few lines stand in the files
//! of this folder, the rows name them.

mod arguments;
mod by_name;
mod def;
mod field;
mod formula;
mod hyperelastic;
mod lookup;
mod page;
mod project;
mod scalar;
mod table;
mod tensor;

pub(crate) use by_name::derivative_of;
pub use def::OpDef;
pub(crate) use formula::rebuild;
pub use page::function_table;
pub(crate) use project::carried_normal;
pub(crate) use scalar::power;
pub use table::all;
pub(crate) use table::{find, names};
