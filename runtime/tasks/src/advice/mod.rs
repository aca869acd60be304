//! What is said of a scene before it is run: formulations of contact that carry no stress, Nitsche parameters below their
//! safe value, bodies that are not positive definite or lock, quadrature rules with too few points.
//!
//! The numbers are those of the runtime; here they become messages at their places. Does not change the scene.

pub mod contact;
mod definite;
pub mod hourglass;
mod load_rules;
mod locking;
mod nitsche;

use wfl::Diagnostic;
use wfl_runtime::{Scene, contact_forms};

use crate::Loaded;

pub use nitsche::{found_parameters, parameters};

/// Everything there is to say before a run.
#[must_use]
pub fn before_run(loaded: &Loaded, scene: &mut Scene) -> Vec<Diagnostic> {
    let mut found = nitsche::parameters(loaded, scene);
    found.extend(definite::bodies(loaded, scene));
    found.extend(hourglass::rules(loaded, scene));
    found.extend(load_rules::loads(scene));
    found.extend(locking::bodies(scene));
    found.extend(contact::warnings(loaded, &contact_forms(scene)));
    found
}
