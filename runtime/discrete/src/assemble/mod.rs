//! Assembly: point laws and basis functions to global residuals and matrices.
//!
//! Every sum is taken in one fixed order, so results do not depend on the number of threads; laws read the same bits on
//! every processor, contracted tangents agree to rounding. Does not know solvers or steps.

mod binding;
mod contract;
mod domain;
mod entries;
mod evaluate;
mod geometry;
mod integrals;
mod rows;
mod scatter;
mod shared;
mod shares;
mod simd;
mod strips;
mod term;

pub use binding::{Basis, Binding, GroupBinding, Input, LawSlots, Needs, SlotPlace};
pub use domain::{Domain, Group, GroupSide};
pub use entries::tangent_kernel;
pub use evaluate::{Bound, FieldValues, Workspace};
pub use geometry::Lanes;
pub use term::{AssembledTerm, BranchCounts, Integrator, NonFinitePlace, PointTangent, TermError};
