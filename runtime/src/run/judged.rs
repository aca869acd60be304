//! How good a converged state is: its digits, the conditions of mechanics, other states that solve the same equations.

use super::{Run, report};
use crate::{
    checks::{self, Accuracy, NarrowZone, Others, PhysicsCheck, Solved, TurnedCells},
    newton::{NewtonError, StepHistory},
    scene::Scene,
    system::{Form, Residual},
};

/// What is known of a converged state: the fields of [`StepResult`].
#[derive(Default)]
pub(super) struct Judged {
    pub(super) accuracy: Option<Accuracy>,
    pub(super) checks: Vec<PhysicsCheck>,
    pub(super) turned: Vec<TurnedCells>,
    pub(super) narrow: Vec<NarrowZone>,
    pub(super) others: Others,
    /// The residual there.
    pub(super) residual: Residual,
}

impl Run {
    /// How good the converged state is; `residual` is that of the scene there.
    pub(super) fn judge(&mut self, scene: &Scene, history: &StepHistory) -> Result<Judged, NewtonError> {
        let form = Form { linear: self.stepper.linear, ..Form::AS_WRITTEN };
        let residual = scene.system.residual(&self.u, &form)?;
        let known = self.steps.iter().map(|s| s.others).max().unwrap_or_default();
        let (solver, tangent) = (self.stepper.solver.as_mut(), self.stepper.tangent.as_ref());
        let (Some(solver), Some(tangent)) = (solver, tangent) else {
            return Ok(Judged { residual, ..Judged::default() });
        };
        let Scene { system, contact, .. } = scene;
        let state = Solved { system, contact, tangent, u: &self.u, residual: &residual };
        let left = history.iterations.last().map_or(0.0, |i| i.residual);
        let mut digits = || checks::digits(state, solver, history.correction);
        let (accuracy, conditions) = if system.team().is_alone() {
            rayon::join(digits, || checks::conditions(state, left))
        } else {
            // ranks exchange numbers in one order
            (digits(), checks::conditions(state, left))
        };
        let mut found = checks::balance(state, scene.newton.tolerance);
        found.extend(conditions.checks);
        let (narrow, turned) = (conditions.narrow, checks::turned_cells(system, &self.u));
        let others = checks::others(system, contact, solver, &self.u, known)?;
        let doubtful =
            accuracy.as_ref().is_some_and(|a| a.digits() < report::FEW_DIGITS) || found.iter().any(|c| !c.holds());
        if doubtful && checks::rests(system, &self.u, &form)? {
            // what differs from zero is rounding, and so is every number made of it
            return Ok(Judged { others, residual, ..Judged::default() });
        }
        Ok(Judged { accuracy, checks: found, turned, narrow, others, residual })
    }
}
