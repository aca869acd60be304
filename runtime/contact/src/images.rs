//! Which points of contact have an image, where images follow the bodies, and which of them press.
//!
//! A body that is pushed over the edge of another one loses its images there, and with them the force of these points. That is
//! right where the contact opens before, and a jump of the force where it does not. Promises: points in the order of the
//! law. Does not judge.

use wfl_discrete::{
    domain::{PointName, nearest_points},
    system::System,
};

use super::{Contact, ContactTerm};

/// The points of a contact term whose images move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Images {
    /// Position of the term in the system.
    pub term: usize,
    /// By point: its ray meets the other body.
    pub found: Vec<bool>,
    /// By point: it has an image and presses on it.
    pub pressed: Vec<bool>,
    /// By point: it is inside the other body and so far from its surface that it has no image.
    pub inside: Vec<bool>,
    /// By point its name, where faces are cut anew in each state.
    pub names: Vec<PointName>,
}

impl Images {
    /// Points that pressed before and have no image now.
    #[must_use]
    pub fn lost(&self, before: &Self) -> usize {
        let pressed: Vec<bool> = match before.names == self.names {
            true => before.pressed.clone(),
            false => nearest_points(&before.names, &self.names).iter().map(|k| before.pressed[*k as usize]).collect(),
        };
        pressed.iter().zip(&self.found).filter(|(pressed, found)| **pressed && !**found).count()
    }
}

/// The points of all contact terms whose images move, at `u`.
#[must_use]
pub fn images(system: &System, contact: &Contact, u: &[f64]) -> Vec<Images> {
    if !system.has_moving_images() {
        return Vec::new();
    }
    let values = system.values_with(u, contact.active_set());
    let of = |term: &ContactTerm| {
        let sampled = term.sampled.at(&system.mesh, values.view().current);
        let found: Vec<bool> = sampled.domain.entities().map(|(group, k)| !group.has_lost_its_image(k)).collect();
        let points = term.points_at(system, values.view());
        let follows = term.sampled.domain.moving.as_ref();
        let inside = follows.map(|follows| follows.are_inside(&system.mesh, values.view().current)).unwrap_or_default();
        let pressed = points.iter().zip(&found).map(|(point, found)| *found && term.presses(point)).collect();
        let names = term.names_at(&system.mesh, values.view());
        Images { term: term.term, found, pressed, inside, names }
    };
    contact.terms().iter().filter(|term| term.moves()).map(of).collect()
}
