//! Points that stick and move all the same: laws that forget where their sides stick.
//!
//! A law on the change of the slip in a step, `gamma ([u] - [u]_before) - sigma`, holds a point by an elastic slip
//! (P + sigma)/gamma, and begins the next step without it: the point moves on by as much in every step, under constant
//! loads, too. What the points of a term have lost so far is compared with how far its sides have moved, at that time and
//! in the whole run, and with how far the bodies are deformed. All are lengths of the scene, so that its units do not
//! matter. Means over the area that sticks count: a single point at an edge says nothing.
//!
//! Promises: nothing is told of what is rounding, or small against what moves. Reads no law.

use wfl_host::team::Team;

/// Told from this part of how far the sides have moved against each other by then, and of the most that they do in the run:
/// below it the slip has the digits that meshes give.
const OF_MOTION: f64 = 0.05;
const OF_LARGEST: f64 = 0.01;
/// And from this part of how far points of a body have moved against each other: below it nobody sees it.
const OF_DEFORMATION: f64 = 1e-3;

/// What a term has lost of the slip of points that stick, up to the end of a step. Means are over the area that sticks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Creep {
    /// The name of the term.
    pub term: String,
    /// The largest slip that a point which sticks has lost (length).
    pub slip: f64,
    /// What it lost of that in the last step.
    pub step: f64,
    /// Where it is.
    pub position: [f64; 3],
    /// The mean of what was lost (length).
    pub lost: f64,
    /// How far the sides have moved along the face, in the mean over the area in contact.
    pub moved: f64,
    /// The largest difference of the displacements of two points of one body, by component (length).
    pub deformed: f64,
}

impl Creep {
    /// The one with the larger slip.
    pub(super) fn worse(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(if b.slip > a.slip { b } else { a }),
            (a, b) => a.or(b),
        }
    }

    /// True if the slip that was lost counts in a run whose sides have moved by at most `moved`.
    #[must_use]
    pub fn counts(&self, moved: f64) -> bool {
        self.lost > (OF_MOTION * self.moved).max(OF_LARGEST * moved).max(OF_DEFORMATION * self.deformed)
    }
}

/// What a point has lost.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lost {
    pub(super) point: usize,
    pub(super) slip: f64,
    pub(super) step: f64,
}

/// Integrals over the area in contact, and over what of it sticks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sticking {
    area: f64,
    moved: f64,
    sticking: f64,
    lost: f64,
    worst: Option<Lost>,
}

impl Sticking {
    /// Adds a point in contact whose sides have moved against each other; where it sticks with what it has lost.
    pub(super) fn add(&mut self, weight: f64, moved: f64, sticks: Option<Lost>) {
        self.area += weight;
        self.moved += weight * moved;
        let Some(lost) = sticks else { return };
        self.sticking += weight;
        self.lost += weight * lost.slip;
        if self.worst.is_none_or(|worst| lost.slip > worst.slip) {
            self.worst = Some(lost);
        }
    }

    /// The same in numbers, from the points of all ranks; `deformed` as in [`Creep`].
    pub(super) fn creep(
        self,
        term: &str,
        deformed: f64,
        team: &dyn Team,
        position: impl Fn(usize) -> [f64; 3],
    ) -> Option<Creep> {
        let mut sums = [self.area, self.moved, self.sticking, self.lost];
        team.sum(&mut sums);
        let [area, moved, sticking, lost] = sums;
        let mean = |x: f64, of: f64| if of > 0.0 { x / of } else { 0.0 };
        let largest = team.largest(self.worst.map_or(0.0, |worst| worst.slip));
        let rank = team.first(self.worst.is_some_and(|worst| worst.slip == largest));
        let here = self.worst.map_or_else(Vec::new, |w| [&[w.slip, w.step], &position(w.point)[..]].concat());
        let worst = rank.map_or_else(|| vec![0.0; 5], |rank| team.numbers_of(rank, &here));
        let [slip, step, x, y, z] = worst[..] else { return None };
        Some(Creep {
            term: term.to_owned(),
            slip,
            step,
            position: [x, y, z],
            lost: mean(lost, sticking),
            moved: mean(moved, area),
            deformed,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_counts_against_what_moves_in_the_scene() {
        let creep = |lost: f64, moved: f64, deformed: f64| Creep { lost, moved, deformed, ..Creep::default() };
        assert!(creep(2e-4, 4e-4, 1e-2).counts(4e-4), "half of the slip");
        assert!(!creep(1.2e-5, 4e-4, 1e-2).counts(4e-4), "a thirtieth of the slip");
        assert!(!creep(2e-4, 4e-4, 1e-2).counts(1.0), "a small part of how far the sides move later");
        assert!(!creep(1e-9, 1e-9, 1e-2).counts(1e-9), "all of a slip that is nothing against the deformation");
        assert!(!creep(0.0, 0.0, 0.0).counts(0.0), "nothing is no creep");
    }

    #[test]
    fn means_are_over_what_sticks_and_over_what_is_in_contact() {
        let mut sum = Sticking::default();
        sum.add(1.0, 4.0, None);
        sum.add(3.0, 2.0, Some(Lost { point: 7, slip: 0.5, step: 0.1 }));
        sum.add(1.0, 0.0, Some(Lost { point: 9, slip: 0.1, step: 0.2 }));
        let creep = sum.creep("law", 8.0, &wfl_host::team::Alone, |point| [point as f64, 0.0, 0.0]).unwrap();
        assert!((creep.lost - 1.6 / 4.0).abs() < 1e-15 && (creep.moved - 2.0).abs() < 1e-15);
        assert_eq!((creep.slip, creep.step, creep.position[0], creep.deformed), (0.5, 0.1, 7.0, 8.0));
    }

    #[test]
    fn where_nothing_sticks_nothing_is_lost() {
        let mut sum = Sticking::default();
        sum.add(2.0, 3.0, None);
        let creep = sum.creep("law", 1.0, &wfl_host::team::Alone, |_| [1.0; 3]).unwrap();
        assert_eq!((creep.lost, creep.slip, creep.moved), (0.0, 0.0, 3.0));
        assert!(!creep.counts(3.0));
    }

    #[test]
    fn of_two_terms_the_one_with_the_larger_slip_is_told() {
        let creep = |slip: f64| Some(Creep { slip, ..Creep::default() });
        assert_eq!(Creep::worse(creep(1.0), creep(2.0)), creep(2.0));
        assert_eq!(Creep::worse(creep(2.0), creep(1.0)), creep(2.0));
        assert_eq!(Creep::worse(None, creep(1.0)), creep(1.0));
        assert_eq!(Creep::worse(creep(0.0), None), creep(0.0));
    }
}
