//! The active set: which branch each projection is on at each integration point.
//!
//! Branch data at a point are described in `compiler/src/pieces.rs` (there: guides). Promises: pure functions of what the
//! projections give and of the branch data before.

use wfl_compiler::{BALL_NUMBERS, Projection, ProjectionKind};

use super::{Complementarity, ContactTerm, ProjectionState, Regularisation};
use wfl_discrete::assemble::FieldValues;
use wfl_discrete::system::System;

/// Part of the argument across the direction of slip that a point keeps which slides at twice its bound.
const ACROSS: f64 = 0.5;

impl ContactTerm {
    /// The branches of the term as it is written at this state: a start without a past.
    ///
    /// Inner projections enter the radius of outer ones, so the law is read as often as they can be nested.
    pub(super) fn as_written(&self, system: &System, values: FieldValues<'_>, friction: f64) -> Vec<f64> {
        let mut data = self.open();
        for _ in 0..self.projections.len() {
            let mut current: Vec<&[f64]> = values.current.to_vec();
            current[self.field] = &data;
            let state = self.read(&system.mesh, FieldValues { current: &current, ..values });
            let next = self.written_branches(&state, &data, friction);
            if next == data {
                break;
            }
            data = next;
        }
        data
    }

    /// Closes points (sticking) if the term as written is open everywhere and no point is further away than
    /// the mesh is large; the start of a scene in which contact closes. `moved` is how far the sides can come near each
    /// other by what is prescribed, in units of length: points further apart stay open, unless all are.
    ///
    /// A closed zone that is too wide opens by about one ring of entities an iteration, so that it is worth to be near.
    pub(super) fn close_if_open(&self, system: &System, values: FieldValues<'_>, data: &mut [f64], moved: f64) {
        let (low, high) = system.mesh.bounds();
        let reach = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let half_lines = || {
            self.projections
                .iter()
                .zip(&self.scaling.slopes)
                .filter(|(p, _)| p.acts && p.kind == ProjectionKind::HalfLine)
        };
        let mut open = half_lines().next().is_some();
        let mut near = Vec::new();
        self.law.for_each_point(&system.mesh, &self.sampled, values, |_, _, _, _, out| {
            let within = |limit: f64| {
                let close =
                    |p: &Projection, slope: f64| out[p.output..][..p.n].iter().all(|x| *x < 0.0 && -x <= limit * slope);
                half_lines().all(|(p, slope)| close(p, *slope))
            };
            open &= within(reach);
            near.push(within(moved));
        });
        let team = system.team();
        if team.all(open) {
            let every = !team.any(near.contains(&true));
            for (point, _) in data.chunks_exact_mut(self.n_data).zip(&near).filter(|(_, near)| every || **near) {
                self.stick_point(point);
            }
        }
    }

    /// Every point closed and sticking, wherever it is.
    pub fn stick_all(&self, data: &mut [f64]) {
        data.chunks_exact_mut(self.n_data).for_each(|point| self.stick_point(point));
    }

    /// Lets every point slide, closed as it is: along the argument there, where that has a direction.
    pub(super) fn slide_all(&self, state: &ProjectionState, data: &mut [f64]) {
        for (data, out) in data.chunks_exact_mut(self.n_data).zip(state.points()) {
            for p in self.projections.iter().filter(|p| p.kind == ProjectionKind::Ball) {
                let x = &out[p.output..][..p.n];
                let length = x.iter().fold(0.0f64, |m, x| m.hypot(*x));
                let (numbers, along) = data[p.guide..].split_at_mut(BALL_NUMBERS);
                (numbers[0], numbers[1], numbers[2]) = (0.0, ACROSS, 1.0);
                for (slot, x) in along.iter_mut().zip(x) {
                    *slot = if length > 0.0 && length.is_finite() { x / length } else { 0.0 };
                }
            }
        }
    }

    /// Closed and sticking.
    fn stick_point(&self, point: &mut [f64]) {
        for p in &self.projections {
            match p.kind {
                ProjectionKind::HalfLine => point[p.guide..][..p.n].fill(1.0),
                ProjectionKind::Ball => point[p.guide] = 1.0,
            }
        }
    }

    /// Writes compliance and overstress into branch data, branches as they are.
    pub(super) fn write_regularisation(&self, regularisation: &Regularisation, data: &mut [f64]) {
        for point in data.chunks_exact_mut(self.n_data) {
            for (k, p) in self.projections.iter().enumerate() {
                let at = match p.kind {
                    ProjectionKind::HalfLine => p.guide + p.n,
                    ProjectionKind::Ball => p.guide + 3,
                };
                point[at] = self.scaling.compliance(k, regularisation.layer);
                point[at + 1] = self.scaling.overstress(k, regularisation.overstress);
            }
        }
    }

    /// Points that this rank counts whose branches differ: open or closed, stick or slip, slip against itself.
    pub(super) fn n_differing(&self, a: &[f64], b: &[f64]) -> usize {
        let differs = |p: &Projection, a: &[f64], b: &[f64]| match p.kind {
            ProjectionKind::HalfLine => a[p.guide..][..p.n] != b[p.guide..][..p.n],
            ProjectionKind::Ball => {
                let along = BALL_NUMBERS + p.guide..BALL_NUMBERS + p.guide + p.n;
                let product: f64 = a[along.clone()].iter().zip(&b[along]).map(|(a, b)| a * b).sum();
                a[p.guide] != b[p.guide] || (a[p.guide] < 0.5 && product < 0.0)
            }
        };
        let points = a.chunks_exact(self.n_data).zip(b.chunks_exact(self.n_data));
        let counted = points.enumerate().filter(|(point, _)| self.counts(*point));
        counted.filter(|(_, (a, b))| self.projections.iter().any(|p| differs(p, a, b))).count()
    }

    /// Branch data before any branch is chosen: open.
    #[must_use]
    pub fn open(&self) -> Vec<f64> {
        vec![0.0; self.n_points() * self.n_data]
    }

    /// The branches that follow from those of `data`.
    pub(super) fn next_branches(&self, law: &Complementarity, state: &ProjectionState, data: &[f64]) -> Vec<f64> {
        let (mut next, mut x) = (data.to_vec(), Vec::new());
        for (data, out) in next.chunks_exact_mut(self.n_data).zip(state.points()) {
            for (k, p) in self.projections.iter().enumerate() {
                let choice = Choice {
                    ratio: Some(self.scaling.ratio(k, law)),
                    compliance: self.scaling.compliance(k, law.regularisation.layer),
                    overstress: self.scaling.overstress(k, law.regularisation.overstress),
                    friction: law.regularisation.friction,
                };
                choice.apply(p, out, &mut x, data);
            }
        }
        next
    }

    /// The branches of the projections as they are written, whose inner ones are on those of `data`.
    fn written_branches(&self, state: &ProjectionState, data: &[f64], friction: f64) -> Vec<f64> {
        let (mut next, mut x) = (data.to_vec(), Vec::new());
        for (data, out) in next.chunks_exact_mut(self.n_data).zip(state.points()) {
            for p in &self.projections {
                Choice::as_written(friction).apply(p, out, &mut x, data);
            }
        }
        next
    }
}

/// How the branch of a projection is chosen.
struct Choice {
    /// The branch is that of `t + c (x - t)`, or that of the argument as it is written.
    ratio: Option<f64>,
    /// The part of the argument that a compliant layer takes.
    compliance: f64,
    /// The part of the argument beyond its bound that the value keeps.
    overstress: f64,
    /// Factor on the radius of a ball.
    friction: f64,
}

impl Choice {
    fn as_written(friction: f64) -> Self {
        Self { ratio: None, compliance: 0.0, overstress: 0.0, friction }
    }

    /// Writes the branch data of a projection at a point where its law gives `out`; `x` has room for its argument.
    fn apply(&self, p: &Projection, out: &[f64], x: &mut Vec<f64>, data: &mut [f64]) {
        x.clear();
        x.extend(out[p.output..][..p.n].iter().map(|x| (1.0 - self.compliance) * x));
        match p.kind {
            ProjectionKind::HalfLine => {
                let t = &out[p.output + p.n..][..p.n];
                for k in 0..p.n {
                    let y = self.ratio.map_or(x[k], |c| t[k] + c * (x[k] - t[k]));
                    data[p.guide + k] = f64::from(u8::from(y >= 0.0));
                }
                data[p.guide + p.n] = self.compliance;
                data[p.guide + p.n + 1] = self.overstress;
            }
            ProjectionKind::Ball => {
                let radius = self.friction * out[p.output + p.n];
                let t = if self.ratio.is_some() { &out[p.output + p.n + 1..][..p.n] } else { &x[..] };
                let data = &mut data[p.guide..][..BALL_NUMBERS + p.n];
                ball(x, t, radius, self.ratio.unwrap_or(1.0), data);
                data[2] = self.friction;
                data[3] = self.compliance;
                data[4] = self.overstress;
            }
        }
    }
}

/// The branch data of a ball projection: `s, k, -, -, e` from the argument `x`, the value `t`, the radius and `c`.
///
/// Of `t + dt = P(y) + P'(y) (dy)`, y = t + c (x - t), solved for t + dt: the part of t across y drops out, because y
/// has none.
fn ball(x: &[f64], t: &[f64], radius: f64, ratio: f64, data: &mut [f64]) {
    let (numbers, along) = data.split_at_mut(BALL_NUMBERS);
    for (k, y) in along.iter_mut().enumerate() {
        *y = t[k] + ratio * (x[k] - t[k]);
    }
    let largest = along.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    let reduced = if largest > 0.0 { along.iter().map(|y| (y / largest).powi(2)).sum::<f64>().sqrt() } else { 0.0 };
    let stick = radius >= 0.0 && (largest == 0.0 || reduced <= radius / largest);
    numbers[0] = f64::from(u8::from(stick));
    numbers[1] = 0.0;
    if largest > 0.0 {
        along.iter_mut().for_each(|y| *y = *y / largest / reduced);
    }
    if stick || radius <= 0.0 {
        return;
    }
    let k0 = radius / largest / reduced;
    numbers[1] = ratio * k0 / (1.0 - k0 + ratio * k0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(x: &[f64], radius: f64, data: &[f64]) -> Vec<f64> {
        let n = x.len();
        let e = &data[BALL_NUMBERS..];
        if data[0] > 0.5 {
            return x.to_vec();
        }
        let along: f64 = x.iter().zip(e).map(|(x, e)| x * e).sum();
        (0..n).map(|k| radius * e[k] + data[1] * (x[k] - along * e[k])).collect()
    }

    fn projection(x: &[f64], radius: f64) -> Vec<f64> {
        let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let factor = if norm <= radius { 1.0 } else { radius / norm };
        x.iter().map(|x| factor * x).collect()
    }

    fn piece(x: &[f64], t: &[f64], radius: f64, ratio: f64) -> Vec<f64> {
        let mut data = vec![0.0; BALL_NUMBERS + x.len()];
        ball(x, t, radius, ratio, &mut data);
        data
    }

    fn gap(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    const STATES: [([f64; 3], f64); 4] =
        [([3.0, -4.0, 1.0], 2.0), ([0.3, 0.1, -0.2], 2.0), ([0.0, 2.0, 0.1], 0.5), ([-7.0, 0.0, 0.0], 6.9)];

    #[test]
    fn a_settled_projection_keeps_its_value_for_every_ratio() {
        for (x, radius) in STATES {
            let t = projection(&x, radius);
            for ratio in [1e-8, 1e-3, 1.0, 20.0, 1e6] {
                let data = piece(&x, &t, radius, ratio);
                assert!(gap(&value(&x, radius, &data), &t) < 1e-14, "{x:?} {ratio}");
            }
        }
    }

    #[test]
    fn a_settled_piece_is_the_tangent_of_the_projection() {
        for (x, radius) in STATES {
            let t = projection(&x, radius);
            for ratio in [1e-3, 1.0, 50.0] {
                let data = piece(&x, &t, radius, ratio);
                let moved = |s: f64| [x[0] + 2.0 * s, x[1] - s, x[2] + 3.0 * s];
                let error = |s: f64| gap(&value(&moved(s), radius, &data), &projection(&moved(s), radius));
                assert!(error(1e-4) < 1e-6 && error(1e-5) < 1e-8, "{x:?} {ratio}: second order");
            }
        }
    }

    #[test]
    fn a_piece_solves_the_linearised_equation() {
        // t = P(t + c (x - t)) about a state that is not settled: the exact derivative of P makes the residual of the
        // linear equation vanish
        let (x, t, radius, ratio) = ([3.0, 1.0], [0.4, -0.9], 1.0, 0.3);
        let data = piece(&x, &t, radius, ratio);
        let y: Vec<f64> = (0..2).map(|k| t[k] + ratio * (x[k] - t[k])).collect();
        let found = value(&x, radius, &data);
        let step: Vec<f64> = (0..2).map(|k| found[k] - t[k]).collect();
        let along = |s: f64| -> Vec<f64> { (0..2).map(|k| y[k] + s * (1.0 - ratio) * step[k]).collect() };
        let (a, b) = (projection(&along(1e-6), radius), projection(&along(-1e-6), radius));
        let base = projection(&y, radius);
        for k in 0..2 {
            let linear = base[k] + (a[k] - b[k]) / 2e-6;
            assert!((found[k] - linear).abs() < 1e-8, "entry {k}: {} against {linear}", found[k]);
        }
    }

    #[test]
    fn an_open_or_resting_point_has_a_piece() {
        let open = piece(&[1.0, 0.0], &[0.0, 0.0], 0.0, 0.1);
        assert_eq!(value(&[1.0, 0.0], 0.0, &open), [0.0, 0.0]);
        let rest = piece(&[0.0, 0.0], &[0.0, 0.0], 0.0, 0.1);
        assert!(rest[0] > 0.5, "the tie sticks");
        assert_eq!(value(&[0.0, 0.0], -1.0, &piece(&[0.0, 0.0], &[0.0, 0.0], -1.0, 1.0)), [0.0, 0.0]);
        let tiny = piece(&[3e-320, 0.0], &[0.0, 0.0], 1e-321, 1.0);
        assert!(tiny.iter().all(|g| g.is_finite()));
    }
}
