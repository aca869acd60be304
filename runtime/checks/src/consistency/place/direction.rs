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

impl Place<'_> {
    /// The direction of the force that presses the first body out of an overlap, where that is about the normal of the
    /// face; else the normal. With the cosine between the two.
    pub(super) fn direction(&self) -> (Vector, f64) {
        let at = |by: f64| {
            let mut state = self.rest();
            let value = self.face.map(|n| by * n);
            // without slip in the step
            state.bodies[0] = Motion { value, before: value, ..Motion::default() };
            self.fluxes(&state).map(|f| f.force[0])
        };
        // an initial stress acts where they are apart, too
        let apart = at(-STRAIN * self.size * f64::powi(2.0, DOUBLINGS)).unwrap_or_default();
        let force = |by: f64| {
            let force = at(by)?;
            Some([0, 1, 2].map(|k| force[k] - apart[k])).filter(|f| dot(f, f) > 0.0)
        };
        let mut overlaps = (0..DOUBLINGS).map(|k| STRAIN * self.size * f64::powi(2.0, k));
        let Some((by, force)) = overlaps.find_map(|by| Some((by, force(by)?))) else { return (self.face, 0.0) };
        // a force apart and none in an overlap is that of an obstacle behind the body: the face looks away from it
        if at(by).is_some_and(|f| dot(&f, &f) == 0.0) {
            return (self.face, -1.0);
        }
        // friction on an obstacle that moves acts along the face: of such a law the way in which its gap grows
        let force = self.gap_slope(by).unwrap_or(force);
        let unit = force.map(|x| x / dot(&force, &force).sqrt());
        let along = dot(&unit, &self.face);
        (if along > TILTED && along < 1.0 - ALIGNED { unit } else { self.face }, along)
    }

    /// The derivative of the argument of contact in the displacement of the first body at an overlap, where there is
    /// friction, too; `None` where there is none or nothing changes.
    fn gap_slope(&self, by: f64) -> Option<Vector> {
        let step = STRAIN * self.size;
        let at = |moved: Vector| {
            let mut state = self.rest();
            let value = [0, 1, 2].map(|k| by * self.face[k] + moved[k]);
            state.bodies[0] = Motion { value, before: value, ..Motion::default() };
            let (mut found, mut has_ball) = (None, false);
            self.projections(&state, |p, out| {
                has_ball |= p.kind == ProjectionKind::Ball;
                if p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts {
                    found.get_or_insert(out[p.output]);
                }
            });
            found.filter(|_| has_ball)
        };
        let mut slope = [0.0; 3];
        for k in 0..self.dim {
            let along = |by: f64| [0, 1, 2].map(|i| if i == k { by } else { 0.0 });
            slope[k] = (at(along(step))? - at(along(-step))?) / (2.0 * step);
        }
        (slope.iter().all(|x| x.is_finite()) && slope.iter().any(|x| *x != 0.0)).then_some(slope)
    }
}
