//! How far a correction is followed where bodies are not linear: to where the energy is the least along it.
//!
//! What is looked at is the slope of the energy along the correction, the residual times the direction. The residual
//! norm says little there: of |grad u|^(p-2) grad u with large p a correction is thousands of times too long or p - 1
//! times too short, and the norm grows before the energy does. With multipliers the energy is that with the multipliers
//! the correction leads to: along it the sides then move as they are allowed to.
//!
//! Promises: a state whose slope is a part of what it was, or none. Needs no energy to exist: where the direction does
//! not go downhill nothing is done.

use wfl_compiler::{Class, types::FieldKind};

use super::{
    LoadStep, Method, NewtonError,
    load_step::{Measured, Norm},
};
use wfl_discrete::system::System;

/// The slope that may be left of what it was, downhill and uphill: a step that ends downhill may be too short by a
/// factor each time.
const DOWNHILL_LEFT: f64 = 0.1;
const UPHILL_LEFT: f64 = 0.5;
/// A full step that leaves this part of the residual norm is taken.
const GOOD: f64 = 0.25;
/// More than this part of the residual norm is much.
const OPEN: f64 = 0.1;
/// Most trials, and the longest way in units of the correction.
const MOST_TRIALS: usize = 60;
const LONGEST: f64 = 64.0;
/// By what a step is cut that goes uphill, before one that goes downhill is known.
const UPHILL_CUT: f64 = 1.0 / 8.0;

/// True if some body is not linear and what the correction is of may have an energy.
pub(super) fn applies(system: &System, method: Method) -> bool {
    let bodies = system.terms.iter().any(|t| t.on_cells() && t.law.class >= Class::Nonlinear);
    bodies && (method.freezes() || method == Method::Residual && system.is_symmetric())
}

/// True if the slope that is left, as a part of what it was, is small; it is negative uphill.
fn low_enough(left: f64) -> bool {
    (-UPHILL_LEFT..=DOWNHILL_LEFT).contains(&left)
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
        let system = step.system;
        let (motion, forces) = self.parts(system);
        let slope = |residual: &[f64]| -> f64 {
            let dofs = system.numbering.free_dofs.iter();
            system.team().total(dofs.zip(&motion).map(|(dof, d)| residual[*dof as usize] * d).sum())
        };
        let mut base = start.to_vec();
        let first = if let Some(forces) = &forces {
            step.go(start, forces, 1.0, &mut base);
            let loaded = step.measure(&base, self.norm)?;
            slope(&loaded.residual)
        } else {
            slope(&here.residual)
        };
        if first >= 0.0 || first.is_nan() {
            return Ok(None);
        }
        let (mut low, mut high, mut alpha) = (0.0, f64::INFINITY, 1.0);
        for _ in 0..MOST_TRIALS {
            step.go(&base, &motion, alpha, u);
            match step.measure(u, self.norm) {
                Ok(found) => {
                    let there = slope(&found.residual);
                    let good = alpha == 1.0 && found.norm <= GOOD * here.norm;
                    if low_enough(there / first) || good || found.stop(step.options).is_some() {
                        if forces.is_none() || alpha >= 1.0 {
                            return Ok(Some((alpha, found)));
                        }
                        // multipliers go as far as the bodies do, at most to what the correction leads to
                        step.go(start, self.direction, alpha, u);
                        return Ok(Some((alpha, step.measure(u, self.norm)?)));
                    }
                    if there < 0.0 { low = alpha } else { high = alpha }
                }
                // out of the domain of a function or out of range
                Err(_) => high = alpha,
            }
            alpha = if high == f64::INFINITY {
                2.0 * low
            } else if low == 0.0 {
                UPHILL_CUT * high
            } else {
                (low * high).sqrt()
            };
            if alpha > LONGEST {
                break;
            }
        }
        Ok(None)
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
