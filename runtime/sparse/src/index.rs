//! Indices of rows, columns and dofs.

/// No index: what would have this number does not exist, or is left out.
pub const NONE: u32 = u32::MAX;
