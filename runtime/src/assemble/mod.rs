//! Assembly: point laws and basis functions to global residuals and matrices.
//!
//! Entities are computed in parallel and added in one fixed order, so results do not depend on the number of
//! threads. Does not know solvers or steps.

mod binding;
mod domain;
mod evaluate;
mod geometry;
mod term;

pub use binding::{Basis, Binding, GroupBinding, Input, LawSlots, SlotPlace};
pub use domain::{Domain, Group, GroupSide};
pub use evaluate::{Bound, FieldValues, Workspace};
pub use geometry::Lanes;
pub use term::{AssembledTerm, BranchCounts, Integrator, NonFinitePlace, TermError};
