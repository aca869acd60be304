//! How far a correction is followed where laws are not linear: to where the energy is the least along it.
//!
//! What is looked at is the slope of the energy along the correction, the residual times the direction. The residual
//! norm says little there: of |grad u|^(p-2) grad u with large p a correction is thousands of times too long or p - 1
//! times too short, and the norm grows before the energy does. With multipliers the energy is that with the multipliers
//! the correction leads to: along it the sides then move as they are allowed to.
//!
//! Promises: a state whose slope is a part of what it was, or the end of what volumes allow (`load_step`) where the way
//! still goes downhill, or none. Needs no energy to exist: where the direction does not go downhill nothing is done.

use wfl_compiler::{Class, types::FieldKind};

use super::{
    LoadStep, Method, NewtonError,
    load_step::{LARGEST_FORCING, Measured, Norm},
};
use wfl_discrete::system::System;

/// The slope that may be left of what it was, downhill and uphill: a step that ends downhill may be too short by a
/// factor each time.
const DOWNHILL_LEFT: f64 = 0.1;
const UPHILL_LEFT: f64 = 0.5;
/// A full step that leaves this part of the residual norm is taken: Newton converges there, and a better length costs another
/// residual.
pub(super) const GOOD: f64 = 0.25;
/// More than this part of the residual norm is much: with less the bodies have all but arrived, and contact decides the step.
const OPEN: f64 = 0.1;
/// Most trials, and the longest way in units of the correction: six doublings, and halvings of a logarithm from there to
/// corrections that are thousands of times too long (power laws, `docs/newton.md`).
const MOST_TRIALS: usize = 60;
const LONGEST: f64 = 64.0;
/// A slope that changes its sign within this part of a step has a jump there: eight halvings more would reach rounding, and laws
/// that are steep and smooth (1e10 times as stiff as bodies) are told from it.
const JUMP: f64 = 1e-13;
/// Factor by which a step is cut that goes uphill, before one that goes downhill is known: from a correction a thousand times
/// too long four residuals.
const UPHILL_CUT: f64 = 1.0 / 8.0;

/// True if a correction may be far too long or too short for what it is of: with frozen branches, where bodies or faces are not
/// linear then (friction by the logarithm of a slip rate, pressure by a power of a gap, beside linear bodies as well), but not where
/// sides meet at other places with each step, and forces end at edges; as written, where bodies are not linear and there may be an
/// energy.
pub(super) fn applies(system: &System, method: Method) -> bool {
    let bodies = || system.terms.iter().any(|t| t.on_cells() && t.law.class >= Class::Nonlinear);
    match method {
        Method::Residual => system.is_symmetric() && bodies(),
        _ => method.freezes() && (bodies() || !system.is_affine_when_frozen() && !system.has_moving_images()),
    }
}

/// What is followed down to where it vanishes, along a direction.
#[derive(Clone, Copy)]
enum Slope {
    /// The slope of the energy: the residual times the direction.
    Energy,
    /// The simplified Newton correction times the direction, which a correction always begins with below zero: where friction
    /// couples the normal into the tangent, the residual times the direction may not.
    Correction,
}

impl Slope {
    /// It along a direction (by free number) where the residual by dof is this one, in units that the direction gives it.
    fn of(self, step: &mut LoadStep<'_>, motion: &[f64], residual: &[f64]) -> Result<f64, NewtonError> {
        let system = step.system;
        let dofs = &system.numbering.free_dofs;
        let part: f64 = match self {
            Self::Energy => dofs.iter().zip(motion).map(|(dof, d)| residual[*dof as usize] * d).sum(),
            Self::Correction => {
                let (mut rhs, mut correction) = (Vec::new(), Vec::new());
                system.numbering.gather(residual, &mut rhs);
                step.solve(&rhs, &mut correction, LARGEST_FORCING)?;
                let own =
                    dofs.iter().zip(motion.iter().zip(&correction)).filter(|(dof, _)| system.owns(**dof as usize));
                own.map(|(_, (d, c))| d * c).sum()
            }
        };
        Ok(system.team().total(part))
    }
}

/// Where a direction begins, and what is followed along it.
struct Beginning {
    base: Vec<f64>,
    measure: Slope,
    /// It at the beginning.
    slope: f64,
}

/// True if the slope that is left, as a part of what it was, is small; it is negative uphill.
fn low_enough(left: f64) -> bool {
    (-UPHILL_LEFT..=DOWNHILL_LEFT).contains(&left)
}

/// The next trial between the longest step known to go downhill and the shortest known to go uphill.
fn between(low: f64, high: f64) -> f64 {
    if high == f64::INFINITY {
        2.0 * low
    } else if low == 0.0 {
        UPHILL_CUT * high
    } else {
        (low * high).sqrt()
    }
}

/// True if a step to `found` has left much of the frozen equations open: then what the projections say of the laws is not
/// the state that the bodies are in, and no reason to shorten the step.
pub(super) fn leaves_much(here: f64, found: &Measured) -> bool {
    found.norm > OPEN * here
}

/// A direction that is followed to a critical point of the energy (Deuflhard 2004).
pub(super) struct CriticalPoint<'a> {
    pub(super) direction: &'a [f64],
    pub(super) norm: &'a Norm,
    /// True if the factor at hand gave the direction, as the correction of the residual at its start, and forces end at no edges:
    /// then a law that is steep is followed to where it turns, also where friction hides that the way goes down.
    pub(super) follows_turns: bool,
    /// How far volumes allow to go, at most 1.
    pub(super) allowed: f64,
}

impl CriticalPoint<'_> {
    /// Follows the direction from `start`, whose measures are `here`, to where the slope of the energy is a part of what
    /// it was; leaves the state in `u`. `None` where it does not go downhill, or no such place is found.
    pub(super) fn descend(
        &self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        start: &[f64],
        here: &Measured,
    ) -> Result<Option<(f64, Measured)>, NewtonError> {
        let (motion, forces) = self.parts(step.system);
        let Beginning { base, measure, slope: first } = self.begin(step, start, here, (&motion, forces.as_deref()))?;
        if first >= 0.0 || first.is_nan() {
            return Ok(None);
        }
        let (mut low, mut high, mut alpha) = (0.0, f64::INFINITY, self.allowed);
        let mut turns = false;
        // looked for where a step longer than the correction is asked for
        let mut allowed = (self.allowed < 1.0).then_some(self.allowed);
        for _ in 0..MOST_TRIALS {
            step.go(&base, &motion, alpha, u);
            match step.measure(u, self.norm) {
                Ok(found) => {
                    let there = measure.of(step, &motion, &found.residual)?;
                    let good = alpha == 1.0 && found.norm <= GOOD * here.norm;
                    if low_enough(there / first) || good || found.stop(step.options).is_some() {
                        return self.taken(step, u, start, (alpha, found), forces.as_deref()).map(Some);
                    }
                    if there < 0.0 {
                        low = alpha
                    } else {
                        (high, turns) = (alpha, true)
                    }
                    if high == f64::INFINITY {
                        let most = *allowed.get_or_insert_with(|| step.longest_step(&base, &motion, LONGEST));
                        if alpha >= 0.5 * most {
                            return self.taken(step, u, start, (alpha, found), forces.as_deref()).map(Some);
                        }
                    }
                }
                // out of the domain of a function or out of range
                Err(_) => (high, turns) = (alpha, false),
            }
            alpha = between(low, high);
            if alpha > LONGEST || alpha <= low || alpha >= high {
                break;
            }
        }
        // friction that turns round within rounding of where slip does: the slope jumps, and what is downhill ends there
        if self.follows_turns && turns && low > 0.0 && high <= low * (1.0 + JUMP) {
            step.go(&base, &motion, low, u);
            let found = step.measure(u, self.norm)?;
            return self.taken(step, u, start, (low, found), forces.as_deref()).map(Some);
        }
        Ok(None)
    }

    /// Where a direction begins that moves bodies and may change `forces`, and how steep it is there.
    fn begin(
        &self,
        step: &mut LoadStep<'_>,
        start: &[f64],
        here: &Measured,
        direction: (&[f64], Option<&[f64]>),
    ) -> Result<Beginning, NewtonError> {
        let (motion, forces) = direction;
        let mut base = start.to_vec();
        if let Some(forces) = forces {
            step.go(start, forces, 1.0, &mut base);
            let loaded = step.measure(&base, self.norm)?;
            let slope = Slope::Energy.of(step, motion, &loaded.residual)?;
            return Ok(Beginning { base, measure: Slope::Energy, slope });
        }
        let slope = Slope::Energy.of(step, motion, &here.residual)?;
        if slope >= 0.0 && self.follows_turns {
            let slope = Slope::Correction.of(step, motion, &here.residual)?;
            return Ok(Beginning { base, measure: Slope::Correction, slope });
        }
        Ok(Beginning { base, measure: Slope::Energy, slope })
    }

    /// The step that is taken: multipliers, where there are forces of theirs, go as far as the bodies do, at most to what the
    /// correction leads to.
    fn taken(
        &self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        start: &[f64],
        end: (f64, Measured),
        forces: Option<&[f64]>,
    ) -> Result<(f64, Measured), NewtonError> {
        let (alpha, found) = end;
        if forces.is_none() || alpha >= 1.0 {
            return Ok((alpha, found));
        }
        step.go(start, self.direction, alpha, u);
        Ok((alpha, step.measure(u, self.norm)?))
    }

    /// The part of the direction that moves bodies, and that of the multipliers where there are any.
    fn parts(&self, system: &System) -> (Vec<f64>, Option<Vec<f64>>) {
        let multipliers: Vec<_> = (0..system.fields.len())
            .filter(|f| system.fields[*f].kind == FieldKind::Multiplier)
            .filter_map(|f| system.range(f))
            .collect();
        if multipliers.is_empty() {
            return (self.direction.to_vec(), None);
        }
        let is_force = |dof: u32| multipliers.iter().any(|range| range.contains(&(dof as usize)));
        let part = |force: bool| {
            let dofs = system.numbering.free_dofs.iter().zip(self.direction);
            dofs.map(|(dof, d)| if is_force(*dof) == force { *d } else { 0.0 }).collect()
        };
        (part(false), Some(part(true)))
    }
}

#[cfg(test)]
mod tests {
    use super::{CriticalPoint, Method, Norm, applies, between, low_enough};
    use crate::{
        Silent,
        test_block::{Block, CUBIC, LAPLACE, PENALTY},
        tests::Solving,
    };

    /// Friction that grows with the logarithm of a slip, from 1e-87 of it on.
    const STEEP: &str = "asinh(1e87*u(1))*Test_u(1)";

    #[test]
    fn a_step_may_end_uphill_by_half_of_the_slope_but_downhill_by_a_tenth_alone() {
        assert!(low_enough(0.1) && low_enough(-0.5) && low_enough(0.0));
        assert!(!low_enough(0.11) && !low_enough(-0.51) && !low_enough(f64::NAN));
    }

    #[test]
    fn trials_double_until_they_go_uphill_and_then_close_in_by_factors() {
        assert_eq!(between(3.0, f64::INFINITY), 6.0);
        assert_eq!(between(0.0, 1.0), 0.125);
        assert_eq!(between(2.0, 8.0), 4.0);
    }

    /// How far a body |grad u|^2 grad u that is strained by 1 is followed downhill, its floor loaded by a force of 1 down
    /// and moved by `direction`: the slope of the energy at its floor x is x^3 + 1.
    fn followed(start: f64, direction: f64) -> Option<(f64, f64)> {
        let mut solving = Solving::new(&[CUBIC, "[0,2].Test_u"], &[]);
        solving.u = solving.block.moved([0.0, start], [0.0; 2]);
        solving.with(&mut Silent, |step, u| {
            let norm = Norm::new(vec![1.0], false);
            let here = step.measure(u, &norm).unwrap();
            let down = |dof: &u32| if dof % 2 == 1 { direction } else { 0.0 };
            let direction_of: Vec<f64> = step.system.numbering.free_dofs.iter().map(down).collect();
            let search = CriticalPoint { direction: &direction_of, norm: &norm, follows_turns: false, allowed: 1.0 };
            let (from, mut to) = (u.clone(), u.clone());
            let (alpha, _) = search.descend(step, &mut to, &from, &here).unwrap()?;
            let x = start + alpha * direction;
            Some((alpha, (x.powi(3) + 1.0) / (start.powi(3) + 1.0)))
        })
    }

    #[test]
    fn a_step_that_is_far_too_long_is_cut_to_the_minimum_of_the_energy() {
        // from x = -0.1 the correction is x - (x^3 + 1)/(3 x^2)
        let (alpha, left) = followed(-0.1, -0.999 / 0.03).expect("it goes downhill");
        assert!(alpha < 0.1 && (-0.5..=0.1).contains(&left), "{alpha} {left}");
    }

    #[test]
    fn a_step_that_is_too_short_is_doubled() {
        let (alpha, left) = followed(-0.1, -0.125).expect("it goes downhill");
        assert!(alpha >= 4.0 && (-0.5..=0.1).contains(&left), "{alpha} {left}");
    }

    #[test]
    fn a_direction_uphill_is_not_followed() {
        assert_eq!(followed(-0.1, 1.0), None);
        assert_eq!(followed(-0.1, 0.0), None, "nor is one that goes nowhere");
    }

    #[test]
    fn linear_bodies_have_no_critical_point_search() {
        assert!(!applies(&Block::new(1, &[LAPLACE], &[PENALTY]).system, Method::ActiveSet));
        let nonlinear = Block::new(1, &[CUBIC], &[PENALTY]).system;
        assert!(applies(&nonlinear, Method::ActiveSet) && applies(&nonlinear, Method::Residual));
        assert!(!applies(&nonlinear, Method::Natural), "it has a test of its own");
        let steep = Block::new(1, &[LAPLACE], &[STEEP]).system;
        assert!(applies(&steep, Method::ActiveSet), "faces may have laws that are not linear either");
        assert!(!applies(&steep, Method::Residual));
    }

    /// A square that is moved by its floor, whose law turns round at rest: what is left is the place where it does.
    #[test]
    fn a_slope_that_jumps_ends_a_step_where_it_does() {
        let mut solving = Solving::new(&[LAPLACE], &[STEEP]);
        solving.u = solving.block.moved([1e-3, 0.0], [0.0; 2]);
        solving.with(&mut Silent, |step, u| {
            let norm = Norm::new(vec![1.0], false);
            let here = step.measure(u, &norm).unwrap();
            let back = |dof: &u32| if dof.is_multiple_of(2) { -0.3 } else { 0.0 };
            let direction: Vec<f64> = step.system.numbering.free_dofs.iter().map(back).collect();
            let search = CriticalPoint { direction: &direction, norm: &norm, follows_turns: true, allowed: 1.0 };
            let (from, mut to) = (u.clone(), u.clone());
            let (alpha, _) = search.descend(step, &mut to, &from, &here).unwrap().expect("it goes downhill");
            assert!((alpha - 1e-3 / 0.3).abs() < 1e-15, "{alpha}");
        });
    }
}
