//! How far a Newton correction is followed.
//!
//! Promises: the state that is left behind is the one that was measured last. Does not choose the direction.

use super::{
    LoadStep, Method, NewtonError,
    critical_point::{self, CriticalPoint},
    load_step::{LARGEST_FORCING, Measured, Norm},
};
use wfl_sparse::solve::SolveError;

/// Halvings of a step before the best one seen is taken: the shortest is a thousandth. With three to five nearly incompressible
/// bodies fail (`docs/newton.md`).
const MAX_HALVINGS: usize = 10;
/// Factor by which a step to a state that is not finite is cut, down to the shortest: fifty cuts, since a correction may lead out
/// of the domain of a function by any power of ten.
const DOMAIN_CUT: f64 = 1.0 / 16.0;
const SHORTEST: f64 = 1e-60;
/// A step is accepted when it reduces the residual norm by this part of its length: any descent counts that is more than
/// rounding (the usual constant of Armijo's condition, Dennis and Schnabel 1983).
const SUFFICIENT: f64 = 1e-4;
/// A full step that leaves this part of the residual norm all but solves the equations: no other way has to be looked at.
const SOLVED: f64 = 0.01;
/// A direction and how far it is followed.
#[derive(Clone, Copy)]
pub(super) struct LineSearch<'a> {
    pub(super) direction: &'a [f64],
    pub(super) norm: &'a Norm,
    pub(super) method: Method,
    /// The residual norm at its start.
    pub(super) before: f64,
    /// With a frozen active set: takes every full step.
    pub(super) undamped: bool,
}

/// Change in the logarithm that a number makes on the bent way at most: by `exp(50)` a slip rate grows from rest to that of
/// an earthquake. Beyond it a number that grows is followed straight (zero but for rounding, it may be corrected by any
/// multiple of itself), and one that shrinks stays there, so that it does not become zero, where a logarithm ends.
const LARGEST_CHANGE: f64 = 50.0;

/// The ways that a direction may be followed. On the bent one, single numbers change in proportion, `x exp(alpha d/x)`:
/// the direction at its start is the same. It is the Newton correction of log x. Laws in the logarithm of a slip rate, or
/// in products of a rate and a state, send numbers far beyond zero that are too large.
struct Ways<'a> {
    start: &'a [f64],
    direction: &'a [f64],
    /// Dofs of single numbers, with the correction over the value; empty where none of them would change its sign.
    bent: Vec<(usize, f64)>,
}

impl Ways<'_> {
    fn go(&self, step: &mut LoadStep<'_>, alpha: f64, bent: bool, u: &mut [f64]) {
        step.go(self.start, self.direction, alpha, u);
        for (dof, ratio) in self.bent.iter().filter(|_| bent) {
            u[*dof] = self.start[*dof] * (alpha * ratio).max(-LARGEST_CHANGE).exp();
        }
    }
}

impl LineSearch<'_> {
    /// Takes the full step, or the first halved one that reduces the merit, or the best of those tried.
    pub(super) fn advance(
        &self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        here: &Measured,
    ) -> Result<(f64, Measured), NewtonError> {
        let start: Vec<f64> = u.to_vec();
        if self.method.freezes() && step.system.is_affine_when_frozen() {
            step.go(&start, self.direction, 1.0, u);
            let found = step.measure(u, self.norm)?;
            if found.stop(step.options).is_some() {
                return Ok((1.0, found));
            }
            return self.damped(step, u, &start, 1.0, found);
        }
        if step.options.search && critical_point::applies(step.system, self.method) {
            let allowed = step.longest_step(&start, self.direction, 1.0);
            let follows_turns = !step.system.has_moving_images();
            let search = CriticalPoint { direction: self.direction, norm: self.norm, follows_turns, allowed };
            if let Some((alpha, found)) = search.descend(step, u, &start, here)? {
                return self.damped(step, u, &start, alpha, found);
            }
        }
        self.backtrack(step, u, &start, here)
    }

    /// Halves the step until it reduces the merit. Where there is a bent way it is tried first, unless the full step straight
    /// on all but solves the equations.
    fn backtrack(
        &self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        start: &[f64],
        here: &Measured,
    ) -> Result<(f64, Measured), NewtonError> {
        let ways = self.ways(step, start);
        let mut best = None;
        if step.system.team().any(!ways.bent.is_empty()) && step.options.search {
            ways.go(step, 1.0, false, u);
            if let Ok(found) = step.measure(u, self.norm)
                && (found.stop(step.options).is_some() || found.norm <= SOLVED * here.norm)
            {
                return Ok((1.0, found));
            }
            if let Some(taken) = self.halve(step, (&ways, true), u, here, &mut best)? {
                return Ok(taken);
            }
        }
        if let Some((alpha, found)) = self.halve(step, (&ways, false), u, here, &mut best)? {
            if !step.options.search || found.stop(step.options).is_some() {
                return Ok((alpha, found));
            }
            return self.damped(step, u, start, alpha, found);
        }
        // measured again, so that the branches reported are those of the state that is kept
        let (alpha, bent) = best.map_or((0.0, false), |(alpha, bent, _)| (alpha, bent));
        ways.go(step, alpha, bent, u);
        let found = step.measure(u, self.norm)?;
        self.damped(step, u, start, alpha, found)
    }

    /// The first halved step on a way that is accepted; `best` is the best of those that were not, with its merit.
    fn halve(
        &self,
        step: &mut LoadStep<'_>,
        way: (&Ways<'_>, bool),
        u: &mut [f64],
        here: &Measured,
        best: &mut Option<(f64, bool, f64)>,
    ) -> Result<Option<(f64, Measured)>, NewtonError> {
        let (ways, bent) = way;
        let (mut alpha, mut halvings) = (step.longest_step(ways.start, self.direction, 1.0), 0);
        while halvings <= MAX_HALVINGS {
            ways.go(step, alpha, bent, u);
            let found = match step.measure(u, self.norm) {
                Ok(found) => found,
                // out of the domain of a function (log of a negative number) or out of range
                Err(_) if alpha > SHORTEST => {
                    alpha *= DOMAIN_CUT;
                    continue;
                }
                Err(e) => return if best.is_some() { Ok(None) } else { Err(e.into()) },
            };
            if !step.options.search || found.stop(step.options).is_some() {
                return Ok(Some((alpha, found)));
            }
            let merit = match self.merit(step, &found, here, ways.start) {
                // of a tangent that is all but singular no correction is known: the trial is as bad as any
                Err(NewtonError::Solve(SolveError::ResidualTooLarge { .. })) => f64::INFINITY,
                merit => merit?,
            };
            if merit <= 1.0 - SUFFICIENT * alpha || found.norm <= found.rounding {
                return Ok(Some((alpha, found)));
            }
            if best.is_none_or(|(.., m)| merit < m) {
                *best = Some((alpha, bent, merit));
            }
            alpha *= 0.5;
            halvings += 1;
        }
        Ok(None)
    }

    /// The ways along the direction: straight, and bent where a full step changes the sign of a single number, such as a
    /// slip rate or a state variable, with branches as they are written.
    fn ways<'p>(&'p self, step: &LoadStep<'_>, start: &'p [f64]) -> Ways<'p> {
        let mut bent = Vec::new();
        let system = step.system;
        if !self.method.freezes() && !self.norm.equations.is_empty() {
            let single: Vec<bool> = (0..system.fields.len()).map(|k| system.has_single_equations(k)).collect();
            for (dof, d) in system.numbering.free_dofs.iter().zip(self.direction) {
                let at = start[*dof as usize];
                if at != 0.0 && d / at < LARGEST_CHANGE && single[system.field_of(*dof as usize)] {
                    bent.push((*dof as usize, d / at));
                }
            }
        }
        if system.team().all(bent.iter().all(|(_, ratio)| *ratio >= -1.0)) {
            bent.clear();
        }
        Ways { start, direction: self.direction, bent }
    }

    /// Where the active set is frozen: goes back on a step until the projections are nearer to their laws.
    fn damped(
        &self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        start: &[f64],
        alpha: f64,
        found: Measured,
    ) -> Result<(f64, Measured), NewtonError> {
        let undamped = self.undamped
            || critical_point::applies(step.system, self.method) && critical_point::leaves_much(self.before, &found);
        let part = match self.method.freezes() {
            true if undamped => {
                step.contact.take_full_step(step.system, u);
                1.0
            }
            true => step.contact.search(step.system, u),
            false => 1.0,
        };
        if part == 1.0 {
            return Ok((alpha, found));
        }
        step.go(start, self.direction, part * alpha, u);
        if let Ok(nearer) = step.measure(u, self.norm) {
            return Ok((part * alpha, nearer));
        }
        step.go(start, self.direction, alpha, u);
        Ok((alpha, step.measure(u, self.norm)?))
    }

    /// How large a state is against the one before: the norm of the residual, or that of the simplified Newton
    /// correction (Deuflhard 2004, natural monotonicity test), which does not depend on the scaling of the equations.
    fn merit(
        &self,
        step: &mut LoadStep<'_>,
        found: &Measured,
        here: &Measured,
        start: &[f64],
    ) -> Result<f64, NewtonError> {
        if self.method != Method::Natural {
            return Ok(found.norm / here.norm);
        }
        let (mut rhs, mut correction) = (Vec::new(), Vec::new());
        step.system.numbering.gather(&found.residual, &mut rhs);
        step.solve(&rhs, &mut correction, LARGEST_FORCING)?;
        let (system, sizes) = (step.system, self.sizes(step, start));
        let size = |k: usize| sizes.get(k).copied().unwrap_or(1.0);
        let norm = |v: &[f64]| {
            let own = v.iter().enumerate().filter(|(k, _)| system.owns(system.numbering.free_dofs[*k] as usize));
            system.team().total(own.map(|(k, x)| (x / size(k)).powi(2)).sum()).sqrt()
        };
        Ok(norm(&correction) / norm(self.direction))
    }

    /// What corrections are relative to, by free number: each single number has its own size, which has nothing in common
    /// with that of others. Empty where there are none.
    fn sizes(&self, step: &LoadStep<'_>, start: &[f64]) -> Vec<f64> {
        let (system, mut sizes) = (step.system, Vec::new());
        if system.team().all(self.norm.equations.is_empty()) {
            return sizes;
        }
        let mut most = system.largest_by_field(start);
        system.team().max(&mut most);
        let fields: Vec<(bool, f64)> =
            (0..).zip(most).map(|(k, largest)| (system.has_single_equations(k), largest)).collect();
        for dof in &system.numbering.free_dofs {
            let (single, all) = fields[system.field_of(*dof as usize)];
            let own = start[*dof as usize].abs();
            let size = if single && own > 0.0 { own } else { all };
            sizes.push(if size > 0.0 { size } else { 1.0 });
        }
        sizes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Silent, test_block::LAPLACE, tests::Solving};

    /// How far a direction is followed by the residual of a linear body, that is `part` times the Newton correction, and
    /// what is left of the residual norm.
    fn followed(part: f64, search: bool) -> (f64, f64) {
        let mut solving = Solving::new(&[LAPLACE, "[0,2].Test_u"], &[]);
        solving.options.search = search;
        solving.with(&mut Silent, |step, u| {
            let norm = Norm::new(vec![1.0], false);
            let here = step.measure(u, &norm).unwrap();
            let down = |dof: &u32| if dof % 2 == 1 { -part } else { 0.0 };
            let direction: Vec<f64> = step.system.numbering.free_dofs.iter().map(down).collect();
            let (method, undamped) = (Method::Residual, false);
            let line = LineSearch { direction: &direction, norm: &norm, method, before: here.norm, undamped };
            let (alpha, found) = line.advance(step, u, &here).unwrap();
            (alpha, found.norm / here.norm)
        })
    }

    #[test]
    fn a_correction_is_taken_as_it_is() {
        let (alpha, left) = followed(1.0, true);
        assert!(alpha == 1.0 && left < 1e-14, "{left}");
    }

    #[test]
    fn a_step_is_halved_until_the_residual_is_smaller() {
        // a step of 3.5 leaves 2.5 of the residual, its half 0.75; of 2 it leaves as much as there was
        let (alpha, left) = followed(3.5, true);
        assert!(alpha == 0.5 && (left - 0.75).abs() < 1e-14, "{alpha} {left}");
        assert_eq!(followed(2.0, true).0, 0.5);
        assert_eq!(followed(4.0, true).0, 0.25);
    }

    #[test]
    fn without_a_search_a_step_is_as_long_as_its_direction() {
        let (alpha, left) = followed(4.0, false);
        assert!(alpha == 1.0 && (left - 3.0).abs() < 1e-14);
    }

    #[test]
    fn a_direction_that_helps_nowhere_is_followed_to_its_best_trial() {
        let (alpha, left) = followed(-1.0, true);
        assert!(alpha == 0.5f64.powi(10) && (left - 1.0 - alpha).abs() < 1e-12, "{alpha} {left}");
    }
}
