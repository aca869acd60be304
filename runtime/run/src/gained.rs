//! The energy that a step which the run chooses gains or loses beside the work of its forces: what of its error no
//! displacement shows.
//!
//! A body that meets a stiff one is turned back within a way that is small beside the way it has come, and displacements are
//! compared with that. The energy says what became of its velocity: with K the kinetic energy and W the work of all
//! other forces, loads and supports among them, K + W stays. The work of linear forces is that of their means at both ends of
//! the step. That of others is summed by Simpson's rule along the straight line between these: the trapezoidal rule closes
//! the balance of a step by itself, whatever a force does within it, and the alpha methods do not look at its end. The way
//! does not matter where forces have a potential; of friction and damping the difference is of third order.
//!
//! Promises: equations and rates are left as they were. Scenes without second rates, without terms that are not linear, and
//! those in which such a term reads a multiplier have none: a rigid contact stops the mass of its nodes within any step,
//! however short. Nor have those of backward Euler and of explicit steps, which gain none and which nothing shortens.

use wfl_compiler::{Class, types::RateForm};
use wfl_discrete::{
    assemble::AssembledTerm,
    rates::{Rates, Scheme},
    system::{FIXED, System},
    window::Window,
};
use wfl_newton::{DEFAULT_TOLERANCE, NewtonError};
use wfl_problem::Solving;

use super::{
    balance::{Balance, Kinds, change_of_moving, kinetic_of, moving},
    rates,
};

/// The part of the displacements that a step is known to: what Newton's method leaves. A body at rest has the kinetic energy of
/// less than that, and none of its steps is too long for it.
const KNOWN: f64 = DEFAULT_TOLERANCE;

/// Roundings of a displacement that a velocity is made of, in units of roundoff: those of both ends of the step, and of what was
/// kept of the steps before.
const ROUNDINGS: f64 = 16.0;

/// Energies at the end of the last step.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Gained {
    pub(super) balance: Balance,
    /// The largest energy so far: kinetic, or what linear terms or the others have taken up or given since the start.
    pub(super) largest: f64,
}

impl Gained {
    /// Those where time starts, or the run goes on, at `u`; `None` for a scene that needs none.
    pub(super) fn start(scene: &mut Solving<'_>, at: Window, u: &[f64]) -> Result<Option<Self>, NewtonError> {
        if !is_needed(scene.system) {
            return Ok(None);
        }
        let balance = Balance::start(Kinds::Linear, scene, at, u)?;
        let largest = balance.kinetic[1];
        Ok(Some(Self { balance, largest }))
    }

    /// The same behind a step that was solved and ends at `u`, and the energy that it has gained or lost in units of the
    /// largest one. Of a part above `allowed` what rounding of the motion makes is left out: where a body has hardly begun to
    /// move from where it is, its velocity is a small difference of large numbers.
    pub(super) fn behind(&self, scene: &mut Solving<'_>, u: &[f64], allowed: f64) -> Result<(Self, f64), NewtonError> {
        let window = scene.system.step();
        let within = rates::offset(scene) != 0.0;
        if within {
            scene.set_data(window.at_end())?;
        }
        let found = self.behind_end(scene, window.at_end(), u, allowed);
        if within {
            scene.set_data(window)?;
            scene.system.set_laws(window);
        }
        found
    }

    fn behind_end(
        &self,
        scene: &mut Solving<'_>,
        window: Window,
        u: &[f64],
        allowed: f64,
    ) -> Result<(Self, f64), NewtonError> {
        let mut balance = self.balance.clone();
        balance.add(Kinds::Linear, scene, window, u)?;
        let bent = work_of_bends(scene.system, window, u)?;
        let lost = balance.lost() - self.balance.lost() - bent;
        let is_meant = scene.system.rates().is_some_and(|rates| damps_on_purpose(rates.scheme()));
        let gained = if is_meant { bent.abs().max(-lost) } else { lost.abs() };
        let taken_up = balance.works.iter().take(2).fold(0.0f64, |most, work| most.max(work.abs()));
        let largest = self.largest.max(balance.kinetic[1]).max(taken_up);
        // of forces that cancel, and of the noise of a body at rest, no more is known than a part of what they do each
        let each = self.work_of_each(scene.system, &balance, u);
        let of = |gained: f64| if gained == 0.0 { 0.0 } else { gained / largest.max(each) };
        let mut part = of(gained);
        if part > allowed {
            let kinetic = self.balance.kinetic[1].max(balance.kinetic[1]);
            part = of((gained - rounding_of_motion(scene.system, u, kinetic)?).max(0.0));
        }
        Ok((Self { balance, largest }, part))
    }

    /// The work of the forces of the last step on the way to `u`, without signs. A way is known to a part of the displacements.
    fn work_of_each(&self, system: &System, now: &Balance, u: &[f64]) -> f64 {
        let Some(past) = system.past() else { return 0.0 };
        let mut way = vec![0.0; u.len()];
        for dofs in moving(system.rates()) {
            let most = system.team().largest(u[dofs.clone()].iter().fold(0.0f64, |most, x| most.max(x.abs())));
            for d in dofs {
                way[d] = (u[d] - past.unknowns[d]).abs() + KNOWN * most;
            }
        }
        let of = |(before, now): (&Vec<f64>, &Vec<f64>)| -> f64 {
            let forces = before.iter().zip(now).zip(&way);
            forces.map(|((a, b), way)| 0.5 * (a.abs() + b.abs()) * way).sum()
        };
        system.team().total(self.balance.forces.iter().zip(&now.forces).map(of).sum())
    }
}

/// What rounding of the unknowns makes of a kinetic energy at the end `u` of a step: that of the velocities which it is, and of
/// these together with those that are there (Cauchy and Schwarz).
fn rounding_of_motion(system: &mut System, u: &[f64], kinetic: f64) -> Result<f64, NewtonError> {
    let Some((rates, past)) = system.rates().zip(system.past()) else { return Ok(0.0) };
    // unknowns whose forces meet are rounded as one, whether they are one field or several
    let mut most = vec![0.0; u.len()];
    for (body, largest) in system.largest_of_alike(u).into_iter().enumerate() {
        system.dofs_of_body(body).for_each(|d| most[d] = largest);
    }
    let mut moved = u.to_vec();
    moving(Some(rates)).into_iter().flatten().for_each(|d| moved[d] += most[d]);
    let [there, here] = [&moved[..], u].map(|u| rates.ended(u, &past.unknowns)[0].clone());
    let velocities: Vec<f64> = there.iter().zip(&here).map(|(a, b)| ROUNDINGS * f64::EPSILON * (a - b)).collect();
    let own = kinetic_of(system, u, &velocities)?.abs();
    Ok(own + 2.0 * (own * kinetic.abs()).sqrt())
}

/// Whether a scheme gives up an order to damp motion: what it takes is no error of a step.
fn damps_on_purpose(scheme: Scheme) -> bool {
    matches!(scheme, Scheme::Newmark { gamma, .. } if gamma > 0.5)
}

/// Whether a term is one whose work is more than that of the mean of its forces at the ends of a step.
fn bends(term: &AssembledTerm, rates: &Rates) -> bool {
    let is_moved = |field: usize| rates.fields().iter().any(|of| of.field == field && of.form == RateForm::Second);
    term.law.class >= Class::Nonlinear && term.law.tests.iter().any(|slot| is_moved(slot.field.index()))
}

/// Whether displacements alone say too little of a step.
fn is_needed(system: &System) -> bool {
    let judged = |rates: &&Rates| !matches!(rates.scheme(), Scheme::Explicit | Scheme::BackwardEuler);
    let Some(rates) = system.rates().filter(judged) else { return false };
    let has_rates = |field: usize| rates.fields().iter().any(|of| of.field == field);
    let is_soft = |term: &&AssembledTerm| term.law.trials.iter().all(|slot| has_rates(slot.field.index()));
    let mut bent = system.terms.iter().filter(|term| bends(term, rates)).peekable();
    bent.peek().is_some() && bent.all(|term| is_soft(&term))
}

/// What Simpson's rule adds to the work that the means of the forces at the ends of a step do up to `u`: two thirds of what
/// the force in the middle differs from them. All are those of the laws and states of this step.
fn work_of_bends(system: &mut System, window: Window, u: &[f64]) -> Result<f64, NewtonError> {
    let Some((rates, past)) = system.rates().zip(system.past()) else { return Ok(0.0) };
    let before = past.unknowns.clone();
    let [last, _] = rates.ended(u, &before);
    let mut first = vec![0.0; u.len()];
    for of in rates.fields() {
        first[of.dofs.clone()].copy_from_slice(&of.kept[0]);
    }
    let bent: Vec<usize> = (0..system.terms.len()).filter(|k| bends(&system.terms[*k], rates)).collect();
    let zero = vec![0.0; u.len()];
    let forces = system.with_other_rates(window, |system| {
        let mut all = zero.clone();
        for (part, factor) in [(0.0, -1.0 / 3.0), (0.5, 2.0 / 3.0), (1.0, -1.0 / 3.0)] {
            let between = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect::<Vec<_>>();
            if let Some(rates) = system.rates_mut() {
                rates.take(&between(&first, &last), &zero);
            }
            system.set_laws(window);
            let (state, mut force) = (between(&before, u), zero.clone());
            bent.iter().try_for_each(|k| system.term_residual(*k, &state, &mut force))?;
            all.iter_mut().zip(&force).for_each(|(all, f)| *all += factor * f);
        }
        Ok::<_, NewtonError>(all)
    })?;
    Ok(work_on_free(system, forces, change_of_moving(system, u, &before)))
}

/// The work of forces on what nothing prescribes: a support takes up what they do to it.
fn work_on_free(system: &System, mut forces: Vec<f64>, mut change: Vec<f64>) -> f64 {
    let numbering = &system.numbering;
    let all: f64 = forces.iter().zip(&change).map(|(f, c)| f * c).sum();
    numbering.turn(&mut forces);
    numbering.frames.turn(&mut change);
    let fixed = (0..forces.len()).filter(|d| numbering.free[*d] == FIXED);
    system.team().total(all - fixed.map(|d| forces[d] * change[d]).sum::<f64>())
}
