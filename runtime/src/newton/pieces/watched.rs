//! What is kept of the projections between two choices of pieces, and how far a step may go.
//!
//! A step with held pieces solves a problem of its own; its end (u, t) need not be nearer to the solution, and full
//! steps can circle. With linear bodies every state between two ends is in equilibrium too, and argument, radius and
//! value of each projection are linear along the step, so only the law of contact has to be looked at: the defect of
//! t = P(t + c (x - t)) in the sum of squares. With c the stiffness of the bodies it measures an error in traction at
//! equal weight for every gamma. Newton directions of it descend (Qi and Sun 1993), and a trial costs no assembly.
//! Promises: pure functions of what was watched. Does not decide what follows where nothing descends.

use wfl_compiler::{Projection, ProjectionKind};

use super::TermPieces;
use crate::{assemble::FieldValues, mesh::Mesh};

/// A step is taken that reduces the defect by this part of its length.
const SUFFICIENT: f64 = 1e-4;
/// Halvings before the best of those tried is taken.
const MAX_HALVINGS: i32 = 13;

/// Arguments, radii and values of the projections of a term at its points.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Point by point, as the watch law lists them.
    values: Vec<f64>,
    /// By point: its weight in integrals.
    weights: Vec<f64>,
}

impl Watched {
    /// What is watched, point by point.
    pub(crate) fn points(&self) -> impl Iterator<Item = &[f64]> {
        let n = self.values.len().checked_div(self.weights.len()).unwrap_or(0).max(1);
        self.values.chunks_exact(n)
    }

    /// Goes part of the way to `target`.
    fn approach(&mut self, target: &Self, part: f64) {
        self.values.iter_mut().zip(&target.values).for_each(|(v, t)| *v += part * (t - *v));
    }
}

impl TermPieces {
    /// Reads arguments, radii and values of held pieces at a state.
    #[must_use]
    pub fn watched(&self, mesh: &Mesh, values: FieldValues<'_>) -> Watched {
        let mut found = Watched::default();
        self.watch.for_each_point(mesh, &self.sampled, values, |_, _, _, weight, out| {
            found.values.extend_from_slice(out);
            found.weights.push(weight);
        });
        found
    }

    /// The squared defect of the projections on the way from `from` to `to`, as an energy: traction squared over
    /// stiffness, integrated.
    fn defect(&self, from: &Watched, to: &Watched, part: f64) -> f64 {
        let mut total = 0.0;
        let mut out = Vec::new();
        for ((a, b), weight) in from.points().zip(to.points()).zip(&from.weights) {
            out.clear();
            out.extend(a.iter().zip(b).map(|(a, b)| a + part * (b - a)));
            for (k, p) in self.projections.iter().enumerate() {
                total += weight.abs()
                    * self.flexibility(k)
                    * self.squared_defect(p, (self.ratio(k), 1.0 - self.softness(k)), &out);
            }
        }
        total
    }

    fn squared_defect(&self, p: &Projection, (ratio, hardness): (f64, f64), out: &[f64]) -> f64 {
        let x = &out[p.output..][..p.n];
        match p.kind {
            ProjectionKind::HalfLine => {
                let t = &out[p.output + p.n..][..p.n];
                t.iter().zip(x).map(|(t, x)| (t - (t + ratio * (hardness * x - t)).max(0.0)).powi(2)).sum()
            }
            ProjectionKind::Ball => {
                let radius = (self.friction * out[p.output + p.n]).max(0.0);
                let t = &out[p.output + p.n + 1..][..p.n];
                let along = |k: usize| t[k] + ratio * (hardness * x[k] - t[k]);
                let length = (0..p.n).fold(0.0f64, |m, k| m.hypot(along(k)));
                let scale = if length <= radius { 1.0 } else { radius / length };
                (0..p.n).map(|k| (t[k] - scale * along(k)).powi(2)).sum()
            }
        }
    }
}

/// The part of a step of all `pieces` that reduces their defect, and what is watched there; `from` and `to` by piece.
pub(crate) fn search<'a>(
    pieces: impl Iterator<Item = &'a TermPieces> + Clone,
    from: &mut [Watched],
    to: &[Watched],
) -> f64 {
    let defect = |part: f64| {
        let each = pieces.clone().zip(from.iter().zip(to));
        each.map(|(p, (a, b))| p.defect(a, b, part)).sum::<f64>().sqrt()
    };
    let start = defect(0.0);
    let mut best = (f64::INFINITY, 1.0);
    for halvings in 0..=MAX_HALVINGS {
        let part = 0.5f64.powi(halvings);
        let found = defect(part);
        if found <= (1.0 - SUFFICIENT * part) * start {
            best = (found, part);
            break;
        }
        if found < best.0 {
            best = (found, part);
        }
    }
    from.iter_mut().zip(to).for_each(|(a, b)| a.approach(b, best.1));
    best.1
}
