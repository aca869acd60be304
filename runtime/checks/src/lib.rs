//! What a converged state, or a tangent that is singular, says of a scene: balance, conditions of contact, digits,
//! uniqueness, rigid motions.
//!
//! Promises: reads systems and states, changes neither. Does not decide whether a run continues.
#![forbid(unsafe_code)]

mod alternating;
mod bending;
mod common_motion;
pub mod consistency;
mod cubic;
mod definite;
mod digits;
mod distances;
mod hourglass;
mod load_rules;
mod locking;
mod moments;
mod multiplier_law;
mod objectivity;
mod physics;
mod response;
mod rigid_motions;
mod row_signs;
mod signs;
mod singular;
mod stability;
mod strains;
mod tractions;
mod turned;
mod turned_sides;
mod uniqueness;
mod worst;

pub use alternating::{Alternating, PorePressure, alternating, pore_pressures};
pub use bending::{LockedBending, locked_bending};
pub use cubic::{CubicBody, cubic_bodies};
pub use definite::{NegativeBody, negative_bodies};
pub use digits::{Accuracy, digits, uncertainty_of_unknowns};
pub use distances::{DistantContact, ReversedGap, distant_contacts, has_closed, reversed_gaps};
pub use hourglass::{Hourglass, hourglasses};
pub use load_rules::{CoarseLoad, coarse_loads, under_rule};
pub use locking::{LockedBody, locked_bodies};
pub use objectivity::{Turning, TurningBody, turning_bodies};
pub use physics::{About, Conditions, NarrowZone, PhysicsCheck, Zigzag, balance, conditions, rests};
pub use response::{Response, bound};
pub use rigid_motions::LooseMotions;
pub use row_signs::RowSigns;
pub use signs::{DrivenSides, UnbalancedLoad, driven_sides, unbalanced_loads};
pub use stability::{Doubt, Spend, Unstable, doubted, is_due, unstable};
pub use strains::{LargeStrain, SmallStrainBody, large_strains, small_strain_bodies};
pub use tractions::{UndeclaredMultiplier, undeclared_multipliers};
pub use turned::{TurnedCells, turned_cells};
pub use uniqueness::{Others, others};

use wfl_contact::Contact;
use wfl_discrete::system::{Residual, System, Tangent};
use wfl_newton::NewtonError;

/// A converged state.
#[derive(Clone, Copy)]
pub struct Solved<'a> {
    /// The equations.
    pub system: &'a System,
    /// The laws of contact.
    pub contact: &'a Contact,
    /// The last tangent that was assembled on the way to the state.
    pub tangent: &'a Tangent,
    /// The unknowns by dof.
    pub u: &'a [f64],
    /// The residual there, as the scene is written.
    pub residual: &'a Residual,
}

/// A tangent that is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Examined<'a> {
    system: &'a System,
    contact: &'a Contact,
    tangent: &'a Tangent,
}

/// An error of a linear solver at the state `u`, with the reason where it is that the tangent is singular.
#[must_use]
pub fn explained(error: NewtonError, system: &System, contact: &Contact, tangent: &Tangent, u: &[f64]) -> NewtonError {
    error.with_reason(|met| Examined { system, contact, tangent }.why_singular(u, met))
}
