//! Assembly: point laws and basis functions to global residuals and matrices.
//!
//! Every sum is taken in one fixed order, so results do not depend on the number of threads; laws read the same bits on
//! every processor, contracted tangents agree to rounding. Does not know solvers or steps.

mod applied;
mod basis;
mod binding;
mod block;
mod branches;
mod contract;
mod entries;
mod evaluate;
mod geometry;
mod integrals;
mod lanes;
mod rows;
mod scatter;
mod shared;
mod shares;
mod simd;
mod strips;
mod term;

pub use crate::domain::{
    Cut, Domain, Follows, Group, GroupSide, ImageSearch, MovingPoints, Over, Places, entity_geometries,
};
pub use applied::products_per_second;
pub(crate) use applied::{AppliedTerm, Skeleton};
pub use basis::Basis;
pub use binding::{Binding, GroupBinding, Input, Integrator, LawSlots, Needs, SlotPlace};
pub use branches::BranchCounts;
pub use entries::tangent_kernel;
pub use evaluate::{Bound, FieldValues, Workspace};
pub use simd::Lanes;
pub use term::applied::Counts;
pub(crate) use term::diagonal::{MOST_COMPONENTS, NodeBlocks};
pub use term::{
    AssembledTerm, NonFinitePlace, TermError,
    gradients::{AskedGradients, Gradient, NegativeVolumes, StressAt, VolumeLimit},
    local::PointTangent,
};
