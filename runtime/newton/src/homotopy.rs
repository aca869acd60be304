//! The homotopy in the regularised law of contact: overstress that becomes less in each iteration, and friction and
//! stiffness that come to what is written in parts.
//!
//! Where arguments are a thousand times softer than the bodies and the formulation ties the stresses of the bodies to
//! the traction (Nitsche with theta = -1 and gamma far below E/h), a face has more points that may slip than its
//! stresses have directions: the points hold each other, and branches chosen point by point circle. With
//! t = p + w (x - p), p the projection of x (Duvaut and Lions 1976; `compiler/src/branch.rs`), each of them yields on its
//! own. From a start where all stick w goes from nearly 1 to 0.
//!
//! Where contact is thousands of times as stiff as bodies that have fewer directions to give way in than contact has points (a penalty
//! with many points in a cell), wrong branches lead to forces as wrong. Contact that is no stiffer than the bodies is solved in few
//! iterations, and contact that is four times as stiff in few more. Promises: pure functions of what is heard. Does not decide when
//! to give up: `newton/schedule.rs` does.

use super::method::Method;

/// Parts in which friction is brought to what is written, and iterations for each but the last: a part moves few points from
/// stick to slip, and an active set that has few to change needs few iterations.
pub(super) const FRICTION_PARTS: usize = 8;
pub(super) const FRICTION_BUDGET: usize = 5;
/// What friction begins with above what is written, in units of it: from eight times as much on, where more points stick.
const MORE_FRICTION: f64 = 7.0;
/// Overstress at first, in parts of the stiffness of the bodies: so much that each point yields on its own (see above), and
/// so little that few iterations take it away.
const FIRST: f64 = 0.15;
/// What an iteration leaves of it: where no more than this part of the points changed branches, and where more did.
const CALM: f64 = 0.1;
const CALM_LEAVES: f64 = 0.13;
const OTHERS_LEAVE: f64 = 0.3;
/// It grows by a factor where more than this part of the points changed and the residual is so many times the smallest: both
/// together are an iteration that was thrown back, and the factor takes back two that left a third each.
const WILD: f64 = 0.15;
const RISE: f64 = 10.0;
const GROWTH: f64 = 10.0;
/// In units of the slope of the softest argument: what is as good as none, what it grows to at least, and what it comes
/// back with after so many iterations without.
const LEAST: f64 = 0.03;
const AGAIN: f64 = 3.0;
const WITHOUT: usize = 9;
/// Factor by which contact gets stiffer once it is solved as it is: so few points open or close that some iterations find them. With
/// ten an obstacle that has three points in a triangle circles.
const STIFFER: f64 = 4.0;

/// Overstress over the iterations of a stage.
#[derive(Clone, Debug)]
pub(super) struct Homotopy {
    /// The stiffness of the bodies over the slope of the softest argument.
    reach: f64,
    /// In parts of the stiffness of the bodies.
    present: f64,
    iterations: usize,
    /// Iterations without it, and whether it came back.
    without: usize,
    back: bool,
    /// The smallest residual so far.
    smallest: f64,
    /// The factor on the arguments of contact while it is softer than written.
    softness: f64,
}

impl Homotopy {
    /// Before the first iteration; `reach` is the stiffness of the bodies over the slope of the softest argument.
    pub(super) fn new(reach: f64) -> Self {
        Self { reach, present: FIRST, iterations: 0, without: 0, back: false, smallest: f64::INFINITY, softness: 1.0 }
    }

    /// Begins again.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.reach);
    }

    /// Overstress of the next active set, in parts of the stiffness of the bodies.
    pub(super) fn overstress(&self) -> f64 {
        if self.present * self.reach < LEAST { 0.0 } else { self.present }
    }

    /// Begins with contact that is softer by this factor.
    pub(super) fn soften(&mut self, softness: f64) {
        self.softness = softness;
    }

    /// Makes contact stiffer, up to what is written.
    pub(super) fn stiffen(&mut self) {
        self.softness = (STIFFER * self.softness).min(1.0);
    }

    /// The factor on the arguments of contact, at most 1.
    pub(super) fn softness(&self) -> f64 {
        self.softness
    }

    /// The factor on friction in an iteration of a stage that brings it in parts to what is written.
    pub(super) fn friction(method: Method, iteration: usize) -> f64 {
        let part = (iteration.saturating_sub(1) / FRICTION_BUDGET).min(FRICTION_PARTS);
        #[expect(clippy::cast_precision_loss, reason = "few parts")]
        let done = part as f64 / FRICTION_PARTS as f64;
        match method {
            Method::MoreFriction => 1.0 + MORE_FRICTION * (1.0 - done).powi(2),
            Method::LessFriction => done,
            _ => 1.0,
        }
    }

    /// Hears of an iteration: the part of the points that changed branches, and the residual of the scene as written.
    pub(super) fn hear(&mut self, changed: f64, residual: f64) {
        self.iterations += 1;
        let smallest = self.smallest;
        self.smallest = smallest.min(residual);
        if self.iterations == 1 {
            return;
        }
        self.without += usize::from(self.overstress() == 0.0);
        let again = AGAIN / self.reach;
        if changed > WILD && residual > RISE * smallest {
            self.without = 0;
            self.present = (GROWTH * self.present).max(again).min(FIRST);
        } else if self.without > WITHOUT {
            (self.without, self.back) = (0, true);
            self.present = again;
        } else {
            self.present *= if changed <= CALM && !self.back { CALM_LEAVES } else { OTHERS_LEAVE };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(reach: f64, heard: &[(f64, f64)]) -> Homotopy {
        let mut overstress = Homotopy::new(reach);
        heard.iter().for_each(|(changed, residual)| overstress.hear(*changed, *residual));
        overstress
    }

    #[test]
    fn it_vanishes_faster_where_few_points_change() {
        let present = |changed: f64| after(1e4, &[(1.0, 1.0), (changed, 0.5)]).overstress();
        assert!((present(0.02) - FIRST * CALM_LEAVES).abs() < 1e-15);
        assert!((present(0.3) - FIRST * OTHERS_LEAVE).abs() < 1e-15);
        let calm = vec![(0.01, 0.1); 7];
        assert_eq!(after(1e4, &calm).overstress(), 0.0, "below the least it is none");
    }

    #[test]
    fn it_grows_where_branches_run_wild_but_not_beyond_the_first() {
        let mut heard = vec![(0.01, 0.1); 4];
        let before = after(1e4, &heard).overstress();
        heard.push((0.5, 2.0));
        assert!((after(1e4, &heard).overstress() - GROWTH * before).abs() < 1e-12);
        heard.extend([(0.5, 3.0); 8]);
        assert_eq!(after(1e4, &heard).overstress(), FIRST);
        // many changes with a small residual are no reason
        assert!(after(1e4, &[(0.5, 1.0), (0.5, 0.9), (0.5, 0.8)]).overstress() < FIRST);
    }

    #[test]
    fn it_comes_back_where_branches_do_not_settle_without_it() {
        let mut heard = vec![(0.01, 0.1); 7 + WITHOUT];
        assert_eq!(after(1e4, &heard).overstress(), 0.0);
        heard.push((0.01, 0.1));
        let back = after(1e4, &heard);
        assert!((back.overstress() - AGAIN / 1e4).abs() < 1e-18);
        heard.push((0.01, 0.1));
        assert!((after(1e4, &heard).overstress() - OTHERS_LEAVE * AGAIN / 1e4).abs() < 1e-18, "and leaves slowly");
    }

    #[test]
    fn friction_from_below_begins_with_none_and_ends_as_it_is_written() {
        let at = |iteration: usize| Homotopy::friction(Method::LessFriction, iteration);
        assert_eq!([at(0), at(1), at(FRICTION_BUDGET)], [0.0; 3], "one budget of iterations for a part");
        assert_eq!(at(FRICTION_BUDGET + 1), 1.0 / 8.0);
        assert_eq!([at(FRICTION_PARTS * FRICTION_BUDGET + 1), at(usize::MAX)], [1.0; 2]);
    }

    #[test]
    fn friction_from_above_shrinks_to_what_is_written_and_never_grows() {
        let all: Vec<f64> = (1..60).map(|k| Homotopy::friction(Method::MoreFriction, k)).collect();
        assert!(all.windows(2).all(|pair| pair[1] <= pair[0]) && all[0] == 8.0 && all[58] == 1.0);
    }

    #[test]
    fn other_methods_have_friction_as_it_is_written() {
        for method in [Method::ActiveSet, Method::Compliance, Method::Overstress, Method::Path, Method::Residual] {
            assert_eq!(Homotopy::friction(method, 1), 1.0, "{method:?}");
        }
    }

    #[test]
    fn a_stage_that_begins_again_has_heard_nothing() {
        let mut homotopy = after(1e4, &[(0.01, 0.1); 5]);
        assert!(homotopy.overstress() < FIRST);
        homotopy.restart();
        homotopy.hear(1.0, 1e9);
        assert_eq!(homotopy.overstress(), FIRST, "the first iteration says nothing yet");
    }
}
