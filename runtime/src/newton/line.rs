//! How far a Newton correction is followed.
//!
//! Promises: the state that is left behind is the one that was measured last. Does not choose the direction.

use super::{
    LARGEST_FORCING, Measured, NewtonError, NewtonOptions,
    energy::{self, Way},
    ladder::Method,
    measure, step_to, stopped,
};
use crate::{strategy::Strategy, system::System};

/// Halvings of a step before the best one seen is taken.
const MAX_HALVINGS: usize = 10;
/// A step to a state that is not finite is cut by this, down to the shortest.
const DOMAIN_CUT: f64 = 1.0 / 16.0;
const SHORTEST: f64 = 1e-60;
/// A step is accepted when it reduces the residual norm by this part of its length.
const SUFFICIENT: f64 = 1e-4;
/// A direction and how far it is followed.
pub(super) struct Line<'a> {
    pub(super) direction: &'a [f64],
    pub(super) weights: &'a [f64],
    pub(super) options: NewtonOptions,
    pub(super) method: Method,
    /// The residual norm at its start.
    pub(super) before: f64,
    /// With held pieces: takes every full step.
    pub(super) whole: bool,
}

impl Line<'_> {
    /// Takes the full step, or the first halved one that reduces the merit, or the best of those tried.
    pub(super) fn advance(
        &mut self,
        system: &mut System,
        strategy: &mut Strategy,
        u: &mut [f64],
        here: &Measured,
    ) -> Result<(f64, Measured), NewtonError> {
        let start: Vec<f64> = u.to_vec();
        let held = self.method.holds();
        if held && system.is_affine_when_held() {
            step_to(system, &start, self.direction, 1.0, u);
            let found = measure(system, u, self.weights, true)?;
            if stopped(&found, self.options).is_some() {
                return Ok((1.0, found));
            }
            return self.nearer(system, u, &start, 1.0, found);
        }
        if self.options.search && energy::may_lead(system, self.method) {
            let way = Way { direction: self.direction, weights: self.weights, options: self.options, held };
            if let Some((alpha, found)) = way.descend(system, u, (&start, here))? {
                return self.nearer(system, u, &start, alpha, found);
            }
        }
        let mut best: Option<(f64, f64)> = None;
        let (mut alpha, mut halvings) = (1.0, 0);
        while halvings <= MAX_HALVINGS {
            step_to(system, &start, self.direction, alpha, u);
            let found = match measure(system, u, self.weights, held) {
                Ok(found) => found,
                // out of the domain of a function (log of a negative number) or out of range
                Err(_) if alpha > SHORTEST => {
                    alpha *= DOMAIN_CUT;
                    continue;
                }
                Err(e) => return Err(e.into()),
            };
            if !self.options.search || stopped(&found, self.options).is_some() {
                return Ok((alpha, found));
            }
            let merit = self.merit(system, strategy, &found, here)?;
            if merit <= 1.0 - SUFFICIENT * alpha || found.norm <= found.rounding {
                return self.nearer(system, u, &start, alpha, found);
            }
            if best.is_none_or(|(_, m)| merit < m) {
                best = Some((alpha, merit));
            }
            alpha *= 0.5;
            halvings += 1;
        }
        // measured again, so that the branches reported are those of the state that is kept
        let alpha = best.map_or(0.0, |(alpha, _)| alpha);
        step_to(system, &start, self.direction, alpha, u);
        let found = measure(system, u, self.weights, held)?;
        self.nearer(system, u, &start, alpha, found)
    }

    /// Where pieces are held: goes back on a step until the projections are nearer to their laws.
    fn nearer(
        &self,
        system: &mut System,
        u: &mut [f64],
        start: &[f64],
        alpha: f64,
        found: Measured,
    ) -> Result<(f64, Measured), NewtonError> {
        let whole = self.whole || energy::may_lead(system, self.method) && energy::leaves_much(self.before, &found);
        let part = if self.method.holds() { system.search_pieces(u, !whole)? } else { 1.0 };
        if part == 1.0 {
            return Ok((alpha, found));
        }
        step_to(system, start, self.direction, part * alpha, u);
        Ok((part * alpha, measure(system, u, self.weights, true)?))
    }

    /// How large a state is against the one before: the norm of the residual, or that of the simplified Newton
    /// correction (Deuflhard 2004, natural monotonicity test), which does not depend on the scaling of the equations.
    fn merit(
        &self,
        system: &System,
        strategy: &mut Strategy,
        found: &Measured,
        here: &Measured,
    ) -> Result<f64, NewtonError> {
        if self.method != Method::Natural {
            return Ok(found.norm / here.norm);
        }
        let (mut rhs, mut correction) = (Vec::new(), Vec::new());
        system.numbering.gather(&found.residual, &mut rhs);
        strategy.solve(&rhs, &mut correction, LARGEST_FORCING)?;
        let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        Ok(norm(&correction) / norm(self.direction))
    }
}
