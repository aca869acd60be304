//! What is said of a scene before it is run: formulations of contact that carry no stress, Nitsche parameters below their
//! safe value, bodies that are not positive definite, lock or do not know a rotation, distances and forces with the
//! wrong sign, quadrature rules with too few points, known fields that jump between their nodes.
//!
//! The numbers are those of the runtime; here they become messages at their places. Does not change the scene.

pub mod contact;
mod data;
mod definite;
mod distances;
pub mod hourglass;
mod load_rules;
mod locking;
mod nitsche;
mod objectivity;
pub mod signs;
mod tractions;

use wfl::{Code, Diagnostic};
use wfl_problem::{Equations, Scene};

use crate::Loaded;

pub use nitsche::{found_parameters, parameters};

/// A scene before its run, for those who look at it.
struct Before<'a> {
    loaded: &'a Loaded,
    scene: &'a Scene,
    /// The equations at the first step; `None` where a known field has no finite value: the run itself says so with the
    /// place.
    first: Option<Equations>,
    /// What is said of the forms of contact.
    of_contact: Vec<Diagnostic>,
}

impl Before<'_> {
    fn at_first(&self, look: impl FnOnce(&Equations) -> Vec<Diagnostic>) -> Vec<Diagnostic> {
        self.first.as_ref().map_or_else(Vec::new, look)
    }
}

/// What is looked at before a run.
struct Check {
    /// The codes of its messages: no other check has them.
    codes: &'static [Code],
    look: fn(&Before<'_>) -> Vec<Diagnostic>,
}

/// Everything that is looked at, in the order in which it is told.
const CHECKS: &[Check] = &[
    Check {
        codes: &[Code::W503, Code::W504],
        look: |at| at.at_first(|first| nitsche::parameters(at.loaded, at.scene, first)),
    },
    Check { codes: &[Code::W611], look: |at| at.at_first(|first| definite::bodies(at.loaded, first)) },
    Check { codes: &[Code::W514], look: |at| at.at_first(|first| objectivity::bodies(at.loaded, at.scene, first)) },
    Check { codes: &[Code::W515], look: |at| at.at_first(|first| objectivity::shears(at.scene, first)) },
    Check { codes: &[Code::W511], look: |at| hourglass::rules(at.loaded, at.scene) },
    Check { codes: &[Code::W512], look: |at| load_rules::loads(at.scene) },
    Check { codes: &[Code::W513], look: |at| at.at_first(|first| locking::bodies(at.scene, first)) },
    Check { codes: &[Code::W517], look: |at| at.at_first(|first| distances::signs(at.scene, first)) },
    Check { codes: &[Code::W518], look: |at| at.at_first(|first| tractions::unknowns(at.loaded, at.scene, first)) },
    Check { codes: &[Code::W519], look: |at| data::jumps(at.loaded, at.scene) },
    Check { codes: &[Code::E613, Code::E614], look: |at| signs::forces(at.loaded, at.scene, &at.of_contact) },
    Check { codes: &[Code::W507, Code::W508, Code::W509, Code::W510], look: |at| at.of_contact.clone() },
];

/// Everything there is to say before a run.
#[must_use]
pub fn before_run(loaded: &Loaded, scene: &Scene) -> Vec<Diagnostic> {
    let of_contact = contact::warnings(loaded, &scene.contact_forms());
    let before = Before { loaded, scene, first: scene.at_first_step().ok(), of_contact };
    let mut out = Vec::new();
    for check in CHECKS {
        let found = (check.look)(&before);
        debug_assert!(found.iter().all(|d| check.codes.contains(&d.code)), "{:?}: {found:?}", check.codes);
        out.extend(found);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_has_codes_of_its_own() {
        let mut codes: Vec<Code> = CHECKS.iter().flat_map(|check| check.codes).copied().collect();
        let n = codes.len();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), n, "{codes:?}");
    }
}
