//! Hyperelastic laws: potential, second Piola-Kirchhoff stress and Cauchy stress of a displacement gradient.

use crate::ops::OpDef;

pub(super) const TABLE: &[OpDef] = &[];
