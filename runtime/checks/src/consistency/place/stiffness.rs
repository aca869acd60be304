//! How the traction of a body at a place follows from the gradient of its displacement, and the gradient with a traction.
//!
//! Promises: pure functions of the laws of the body there.

use nalgebra::{DMatrix, DVector};

use super::{Gradient, Place, STRAIN, Vector, dot};

/// Corrections of a gradient or of multipliers; laws that are linear need two.
const CORRECTIONS: usize = 20;
/// What the traction of a gradient that was looked for may miss, relative: Newton's method ends at rounding, with
/// room for laws whose summands are some thousand times their sum.
const MISSED: f64 = 1e-11;
impl Place<'_> {
    /// The change of a traction with the gradient, about one.
    fn traction_slope(&self, body: usize, value: &Vector, gradient: &Gradient) -> Option<DMatrix<f64>> {
        let n = self.dim * self.dim;
        let mut slope = DMatrix::zeros(self.dim, n);
        for k in 0..n {
            let moved = |by: f64| {
                let mut g = *gradient;
                g[k] += by;
                self.traction(body, value, &g)
            };
            let (ahead, behind) = (moved(STRAIN)?, moved(-STRAIN)?);
            (0..self.dim).for_each(|i| slope[(i, k)] = (ahead[i] - behind[i]) / (2.0 * STRAIN));
        }
        Some(slope)
    }

    /// The stiffness of the softer body at its face, without displacement (stress).
    pub(in crate::consistency) fn stiffness(&self) -> Option<f64> {
        let bodies = 0..if self.has_two_bodies() { 2 } else { 1 };
        let of = |body| Some(self.traction_slope(body, &[0.0; 3], &[0.0; 9])?.amax());
        let all: Option<Vec<f64>> = bodies.map(of).collect();
        all?.into_iter().min_by(f64::total_cmp).filter(|s| *s > 0.0)
    }

    /// The gradient nearest to `start` with this traction at a displacement; `None` where there is none.
    pub(in crate::consistency) fn gradient(
        &self,
        body: usize,
        value: &Vector,
        traction: &Vector,
        start: &Gradient,
    ) -> Option<Gradient> {
        let size = dot(traction, traction).sqrt();
        let mut gradient = *start;
        let largest = start.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let scale = size.max(self.traction_slope(body, value, start)?.amax() * largest);
        for _ in 0..CORRECTIONS {
            let found = self.traction(body, value, &gradient)?;
            let missing = DVector::from_fn(self.dim, |i, _| traction[i] - found[i]);
            if missing.amax() <= MISSED * scale {
                return Some(gradient);
            }
            let slope = self.traction_slope(body, value, &gradient)?;
            let inverse = slope.clone().pseudo_inverse(1e-10 * slope.amax()).ok()?;
            let change = inverse * missing;
            change.iter().zip(&mut gradient).for_each(|(c, g)| *g += c);
        }
        None
    }
}
