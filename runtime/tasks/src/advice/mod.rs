//! What is said of a scene before it is run: formulations of contact that carry no stress, Nitsche parameters below their
//! safe value, bodies that are not positive definite, lock or do not know a rotation, distances and forces with the
//! wrong sign, quadrature rules with too few points.
//!
//! The numbers are those of the runtime; here they become messages at their places. Does not change the scene.

pub mod contact;
mod definite;
mod distances;
pub mod hourglass;
mod load_rules;
mod locking;
mod nitsche;
mod objectivity;
pub mod signs;

use wfl::Diagnostic;
use wfl_runtime::Scene;

use crate::Loaded;

pub use nitsche::{found_parameters, parameters};

/// Everything there is to say before a run.
#[must_use]
pub fn before_run(loaded: &Loaded, scene: &Scene) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    // where a known field has no finite value, the run itself says so with the place
    let first = scene.at_first_step().ok();
    if let Some(first) = &first {
        found.extend(nitsche::parameters(loaded, scene, first));
        found.extend(definite::bodies(loaded, first));
        found.extend(objectivity::bodies(loaded, scene, first));
        found.extend(objectivity::shears(scene, first));
    }
    found.extend(hourglass::rules(loaded, scene));
    found.extend(load_rules::loads(scene));
    if let Some(first) = &first {
        found.extend(locking::bodies(scene, first));
        found.extend(distances::signs(scene, first));
    }
    let of_contact = contact::warnings(loaded, &scene.contact_forms());
    found.extend(signs::forces(loaded, scene, &of_contact));
    found.extend(of_contact);
    found
}
