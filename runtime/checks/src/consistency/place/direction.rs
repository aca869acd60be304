//! The direction of contact at a place: the normal of the face, but for an obstacle with a normal of its own.
//!
//! Promises: pure functions of the laws at the place.

use wfl_compiler::ProjectionKind;

use super::{Motion, Place, STRAIN, Vector, dot};

/// Cosine of the largest angle between the normal of a face and the direction of contact there: an obstacle that a face looks
/// at, if only from the side. A force along the face is friction, or that of a law whose components are mixed up.
pub(in crate::consistency) const TILTED: f64 = 0.05;
/// Overlaps that are tried until a force acts: from the strain of the tests to many times the size of the cell.
const DOUBLINGS: i32 = 30;
/// Directions are one if the cosine between them is within this of 1: rounding of normals.
const ALIGNED: f64 = 1e-9;

/// Corrections of the way to an obstacle and of the direction there: for a sphere at a distance of its radius each
/// halves what is left, and 9 digits take 30; one at five times that takes 110.
const TURNS: usize = 120;

/// Where an argument vanishes, from zero on; differences are taken over `step`.
pub(in crate::consistency) fn root(step: f64, argument: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let mut by = 0.0;
    for _ in 0..TURNS {
        let here = argument(by)?;
        if here == 0.0 {
            return Some(by);
        }
        let change = -here * step / (argument(by + step)? - here);
        by += Some(change).filter(|c| c.is_finite())?;
        if change.abs() <= f64::EPSILON * by.abs() {
            return Some(by);
        }
    }
    // what is left is rounding of the argument, or it has no root
    let (here, ahead) = (argument(by)?, argument(by + step)?);
    (here.abs() <= ALIGNED * (ahead - here).abs()).then_some(by)
}

impl Place<'_> {
    /// The direction of the force that presses the first body out of an overlap, where that is about the normal of the
    /// face; else the normal. With the cosine between the two. `None` where an obstacle has no direction that is also the one
    /// in which the body comes to it.
    pub(super) fn direction(&mut self) -> Option<(Vector, f64)> {
        let face = self.face;
        self.law = self.first_met(&face);
        let apart = self.apart();
        // a small obstacle far away lies between two of the overlaps that are tried
        let far = || self.pressed_out(&self.way_to_touch(&face)?, &face, &apart);
        let Some((overlap, mut unit)) = self.pressed_out(&[0.0; 3], &face, &apart).or_else(far) else {
            return Some((self.face, 0.0));
        };
        // a force apart and none in an overlap is that of an obstacle behind the body: the face looks away from it
        if self.force_at(&overlap).is_some_and(|f| dot(&f, &f) == 0.0) {
            return Some((self.face, -1.0));
        }
        // an obstacle that curves has another normal where the body comes to it in the direction found
        for _ in 0..TURNS {
            let along = dot(&unit, &self.face);
            if !(along > TILTED && along < 1.0 - ALIGNED) {
                return Some((self.face, along));
            }
            self.law = self.first_met(&unit);
            let touching = self.way_to_touch(&unit).unwrap_or_default();
            let (_, next) = self.pressed_out(&touching, &unit, &apart)?;
            let turned = (0..3).map(|k| (next[k] - unit[k]).abs()).fold(0.0, f64::max);
            unit = next;
            if turned <= ALIGNED {
                return Some((unit, dot(&unit, &self.face)));
            }
        }
        None
    }

    /// The force on the first body where it is apart from the obstacle: an initial stress acts there, too. It is the same at
    /// twice the distance; farther away the next obstacle may be.
    fn apart(&self) -> Vector {
        let at = |k: i32| self.force_at(&self.face.map(|n| -STRAIN * self.size * f64::powi(2.0, k) * n));
        let stays = |k: &i32| {
            let [near, far] = [at(*k), at(k + 1)].map(Option::unwrap_or_default);
            let change = [0, 1, 2].map(|i| near[i] - far[i]);
            dot(&change, &change).sqrt() <= ALIGNED * dot(&near, &near).sqrt()
        };
        at((0..DOUBLINGS).find(stays).unwrap_or(DOUBLINGS)).unwrap_or_default()
    }

    /// Of several laws of contact on the face, as those of two walls in whose corner a body lies, the one that closes first
    /// along a direction, counted among half lines that act; the first of all where none closes.
    fn first_met(&self, along: &Vector) -> usize {
        let at = |by: f64| self.arguments_at(&along.map(|x| by * x)).0;
        let step = STRAIN * self.size;
        let way = |k: usize| {
            let by = root(step, |by| at(by).get(k).copied())?;
            let [here, ahead] = [by, by + step].map(|by| at(by).get(k).copied());
            (ahead? > here?).then_some(by)
        };
        let n = at(0.0).len();
        if n < 2 {
            return 0;
        }
        let ways = (0..n).filter_map(|k| Some((way(k)?, k)));
        ways.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, k)| k)
    }

    /// The force on the first body where it has moved by so much, without slip in the step.
    fn force_at(&self, moved: &Vector) -> Option<Vector> {
        let mut state = self.rest();
        state.bodies[0] = Motion { value: *moved, before: *moved, ..Motion::default() };
        self.fluxes(&state).map(|f| f.force[0])
    }

    /// The first overlap along a direction behind `from` in which a force acts, and its direction.
    fn pressed_out(&self, from: &Vector, along: &Vector, apart: &Vector) -> Option<(Vector, Vector)> {
        let at = |by: f64| [0, 1, 2].map(|k| from[k] + by * along[k]);
        let force = |by: f64| {
            let force = self.force_at(&at(by))?;
            Some([0, 1, 2].map(|k| force[k] - apart[k])).filter(|f| dot(f, f) > 0.0)
        };
        let mut overlaps = (0..DOUBLINGS).map(|k| STRAIN * self.size * f64::powi(2.0, k));
        let (by, force) = overlaps.find_map(|by| Some((by, force(by)?)))?;
        // friction on an obstacle that moves acts along the face: of such a law the way in which its gap grows
        let force = self.gap_slope(&at(by)).unwrap_or(force);
        Some((at(by), force.map(|x| x / dot(&force, &force).sqrt())))
    }

    /// How far the first body moves along a direction until the argument of contact vanishes; `None` where it does not get there.
    fn way_to_touch(&self, along: &Vector) -> Option<Vector> {
        let at = |by: f64| along.map(|x| by * x);
        root(STRAIN * self.size, |by| self.projection_at(&at(by)).0).map(at)
    }

    /// The argument of contact where the first body has moved by so much, and whether there is friction, too.
    fn projection_at(&self, moved: &Vector) -> (Option<f64>, bool) {
        let (found, has_ball) = self.arguments_at(moved);
        (found.get(self.law).copied(), has_ball)
    }

    /// The arguments of all half lines that act where the first body has moved by so much, and whether there is friction, too.
    fn arguments_at(&self, moved: &Vector) -> (Vec<f64>, bool) {
        let mut state = self.rest();
        state.bodies[0] = Motion { value: *moved, before: *moved, ..Motion::default() };
        let mut has_ball = false;
        self.projections(&state, |p, _| has_ball |= p.kind == ProjectionKind::Ball);
        (self.contact_arguments(&state), has_ball)
    }

    /// The derivative of the argument of contact in the displacement of the first body at an overlap, where there is
    /// friction, too; `None` where there is none or nothing changes.
    fn gap_slope(&self, overlap: &Vector) -> Option<Vector> {
        let step = STRAIN * self.size;
        let at = |k: usize, by: f64| {
            let mut moved = *overlap;
            moved[k] += by;
            let (found, has_ball) = self.projection_at(&moved);
            found.filter(|_| has_ball)
        };
        let mut slope = [0.0; 3];
        for (k, slope) in slope.iter_mut().enumerate().take(self.dim) {
            *slope = (at(k, step)? - at(k, -step)?) / (2.0 * step);
        }
        (slope.iter().all(|x| x.is_finite()) && slope.iter().any(|x| *x != 0.0)).then_some(slope)
    }
}
