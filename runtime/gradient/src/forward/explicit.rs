//! What explicit steps do along a direction: the step of `run/src/explicit.rs`, linearised.

use wfl::Diagnostic;
use wfl_compiler::types::RateOrder;
use wfl_discrete::{
    rates::{Kept, Rates},
    system::FIXED,
};
use wfl_problem::Explicit;
use wfl_run::PassedStep;

use super::{Forwards, Moving};
use crate::{beginning::AtStart, standing::Standing};

/// Rates by dof from what is kept.
fn by_dof(standing: &Standing<'_, '_>, kept: &Kept) -> AtStart {
    let n = standing.solving.system.numbering.n_dofs;
    let mut made = AtStart { first: vec![0.0; n], second: vec![0.0; n] };
    for (of, kept) in standing.rates().into_iter().flat_map(Rates::fields).zip(kept) {
        made.first[of.dofs.clone()].copy_from_slice(&kept[0]);
        made.second[of.dofs.clone()].copy_from_slice(&kept[1]);
    }
    made
}

/// What is kept, from rates by dof.
fn kept(standing: &Standing<'_, '_>, of: &AtStart) -> Kept {
    let mut made = standing.rates().map_or_else(Kept::new, Rates::nothing);
    for (field, kept) in standing.rates().into_iter().flat_map(Rates::fields).zip(&mut made) {
        kept[0].copy_from_slice(&of.first[field.dofs.clone()]);
        kept[1].copy_from_slice(&of.second[field.dofs.clone()]);
    }
    made
}

impl Forwards<'_, '_> {
    /// The end of an explicit step: unknowns, rates, states.
    pub(super) fn explicit(
        &mut self,
        step: &PassedStep,
        explicit: &Explicit,
        one: &mut Moving,
    ) -> Result<(), Box<Diagnostic>> {
        let h = step.window.increment;
        let old = by_dof(&self.standing, &one.before.kept);
        let mut half: Vec<f64> = old.first.iter().zip(&old.second).map(|(r, s)| r + 0.5 * h * s).collect();
        let mut prescribed = vec![0.0; half.len()];
        self.prescribed(step.window, &one.live, &mut prescribed)?;
        let fixed: Vec<bool> = self.standing.solving.system.numbering.free.iter().map(|f| *f == FIXED).collect();
        for d in 0..half.len() {
            let before = one.before.u[d];
            if fixed[d] {
                half[d] = (prescribed[d] - before) / h;
            }
            one.end.u[d] = before + h * half[d];
        }
        let within = AtStart { second: vec![0.0; half.len()], first: half };
        let held = self.standing.rates().expect("explicit steps have rates");
        one.rates = Some(held.with_behind(&held.along(&kept(&self.standing, &within)), self.extended.n));
        self.look(step, one);
        let forces = self.residual(step, one)?;
        self.states(step, one);
        let acceleration = step.rates.as_ref().map_or_else(Kept::new, |r| r.kept_at(&step.u, &step.u));
        let acceleration = by_dof(&self.standing, &acceleration).second;
        let lumped = &explicit.lumped;
        let mut end = AtStart { first: within.first, second: vec![0.0; forces.len()] };
        for d in 0..forces.len() {
            end.second[d] = if fixed[d] {
                (end.first[d] - old.first[d] + 0.5 * h * old.second[d]) / h
            } else {
                let of_divisor = one.mass[d] + 0.5 * h * one.damping[d];
                -(forces[d] + acceleration[d] * of_divisor) / lumped.divisor(d, h)
            };
            end.first[d] += 0.5 * h * end.second[d];
        }
        one.end.kept = kept(&self.standing, &end);
        Ok(())
    }

    /// What mass and damping do along a direction, and the accelerations where time starts, which are forces over the mass;
    /// `one` has moved prescribed and given rates.
    pub(super) fn explicit_start(&mut self, explicit: &Explicit, one: &mut Moving) -> Result<(), Box<Diagnostic>> {
        let step = &*self.standing.steps.step(0)?;
        let n = one.before.u.len();
        (one.mass, one.damping) = (vec![0.0; n], vec![0.0; n]);
        let still = self.standing.rates().map_or_else(Kept::new, Rates::nothing);
        for probe in self.standing.probes(explicit)? {
            for (factor, is_there) in [(1.0, true), (-1.0, false)] {
                if is_there {
                    self.standing.take_probe(&probe);
                } else {
                    self.standing.take_rest(&probe);
                }
                self.laws.set_step(self.standing.step_of(step.window));
                let held = self.standing.rates().expect("explicit steps have rates");
                one.rates = Some(held.with_behind(&held.along(&still), self.extended.n));
                let moved = self.residual_of(step, one, |k| probe.terms.contains(&k))?;
                let to = if probe.order == RateOrder::First { &mut one.damping } else { &mut one.mass };
                to.iter_mut().zip(moved.iter().zip(&probe.signs)).for_each(|(t, (x, sign))| *t += factor * sign * x);
            }
        }
        self.standing.at(0)?;
        let acceleration =
            by_dof(&self.standing, &step.rates.as_ref().map_or_else(Kept::new, |r| r.kept_at(&step.u, &step.u)));
        let mut moved = by_dof(&self.standing, &one.before.kept);
        let free: Vec<bool> = self.standing.solving.system.numbering.free.iter().map(|f| *f != FIXED).collect();
        self.standing.hold_accelerations_zero()?;
        self.laws.set_step(self.standing.step_of(step.window));
        let held = self.standing.rates().expect("explicit steps have rates");
        let rates = AtStart { first: moved.first.clone(), second: vec![0.0; n] };
        one.rates = Some(held.with_behind(&held.along(&kept(&self.standing, &rates)), self.extended.n));
        let forces = self.residual(step, one)?;
        for d in (0..n).filter(|d| free[*d]) {
            moved.second[d] = -(forces[d] + acceleration.second[d] * one.mass[d]) / explicit.lumped.mass[d];
        }
        one.before.kept = kept(&self.standing, &moved);
        Ok(())
    }
}
