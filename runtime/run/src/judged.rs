//! How good a converged state is: its digits, the conditions of mechanics, other states that solve the same equations.

use std::time::Instant;

use wfl_checks::{Accuracy, NarrowZone, Others, PhysicsCheck, Solved, Spend, TurnedCells, Unstable, Zigzag};
use wfl_compiler::types::FieldKind;
use wfl_contact::slid_past_faces;
use wfl_discrete::{
    assemble::BranchCounts,
    field::Field,
    rates::Scheme,
    system::{Form, Residual, System},
};
use wfl_newton::{NewtonError, StepHistory, Stop};
use wfl_problem::{Scene, Solving};

use super::{
    Run, StepResult, findings,
    stepping::{Reached, StepError},
    watched::Seen,
};

/// What is known of a converged state: the fields of [`StepResult`].
#[derive(Default)]
struct Judged {
    accuracy: Option<Accuracy>,
    hidden: f64,
    checks: Vec<PhysicsCheck>,
    turned: Vec<TurnedCells>,
    narrow: Vec<NarrowZone>,
    zigzags: Vec<Zigzag>,
    others: Others,
    unstable: Option<Unstable>,
    /// The residual there.
    residual: Residual,
}

/// The most that is known of other states, of so many steps: what a step costs does not grow with their number.
#[derive(Clone, Copy, Default)]
pub(super) struct KnownOfOthers {
    steps: usize,
    most: Others,
    /// A step had directions in which it was not stable.
    unstable: bool,
}

/// The fields whose laws know no rotations at the first step: the check of the scene has told them, or they are no bodies.
pub(super) fn turning_fields(scene: &Scene, judges: bool) -> Vec<String> {
    let dim = scene.system.mesh.dim();
    let may_turn = |f: &Field| f.kind == FieldKind::Unknown && f.n_components == dim && dim > 1;
    let judges = judges && scene.system.fields.iter().any(may_turn);
    // a known field without a finite value is told by the step that reads it
    let first = if judges { scene.at_first_step().ok() } else { None };
    let found = first.map_or_else(Vec::new, |first| wfl_checks::turning_bodies(&first.system));
    found.into_iter().map(|body| body.field).collect()
}

/// The equations of the first step, assembled, and first values; `None` where they cannot be had.
fn start(scene: &Scene) -> Option<(System, Vec<f64>)> {
    let (mut equations, u) = scene.started().ok()?;
    equations.system.begin_step(scene.steps.first_window()).ok()?;
    Some((equations.system, u))
}

impl Run {
    /// What the steps so far have shown of other states.
    fn known_of_others(&mut self) -> KnownOfOthers {
        let known = &mut self.known_of_others;
        for step in &self.steps[known.steps.min(self.steps.len())..] {
            known.most = known.most.max(step.others);
            known.unstable |= step.unstable.is_some();
        }
        known.steps = self.steps.len();
        *known
    }

    /// What is known of a step that has come to its end, before states are renewed: the equations are those of the old ones. A
    /// state that is given has nothing to judge.
    pub(super) fn judged(&mut self, scene: &Solving<'_>, reached: Reached) -> Result<StepResult, StepError> {
        let Reached { history, window, attempts, branches } = reached;
        let solved = self.judges && history.converged() && history.stop != Some(Stop::Given);
        let begin = Instant::now();
        let judged = if solved { self.judge(scene, &history)? } else { Judged::default() };
        let is_explicit = scene.system.rates().is_some_and(|rates| rates.scheme() == Scheme::Explicit);
        let seen = match solved {
            true => self.watched.look(scene, &self.u),
            false if self.judges && is_explicit => self.watched.look_at_sizes(scene, &self.u),
            false => Seen::default(),
        };
        let Judged { accuracy, hidden, checks, turned, narrow, zigzags, others, unstable, residual } = judged;
        let branches = if solved { residual.branches } else { branches.unwrap_or_else(|| self.branches(scene)) };
        let slid = if solved { slid_past_faces(scene.system, scene.contact, &self.u) } else { Vec::new() };
        self.clock.check += begin.elapsed().as_secs_f64();
        Ok(StepResult {
            window,
            history,
            attempts,
            accuracy,
            hidden,
            checks,
            turned,
            narrow,
            slid,
            zigzags,
            others,
            unstable,
            seen,
            branches,
            ..StepResult::default()
        })
    }

    /// The branches of the terms at a state that was not solved for, where a file shows them.
    pub(super) fn branches(&self, scene: &Solving<'_>) -> Vec<BranchCounts> {
        if scene.vtk.is_empty() {
            return Vec::new();
        }
        scene.system.residual(&self.u, &Form::AS_WRITTEN).map_or_else(|_| Vec::new(), |residual| residual.branches)
    }

    /// In which directions the converged state is not stable. Told once: later states lie on the branch of the first.
    fn look_at_stability(&mut self, scene: &Solving<'_>, spend: Spend) -> Option<Unstable> {
        let Self { stepper, row_signs, u, .. } = self;
        let (solver, tangent) = (stepper.solver.as_mut()?, stepper.tangent.as_mut()?);
        let start = || start(scene);
        let doubt = wfl_checks::doubted(scene.system, u, solver, spend, row_signs, &start)?;
        // the tangent of the last iterate is needed no more, and takes as much memory as that of the state
        tangent.forget_operator();
        solver.forget_applied();
        wfl_checks::unstable(&doubt, solver, row_signs, &start)
    }

    /// How good the converged state is.
    fn judge(&mut self, scene: &Solving<'_>, history: &StepHistory) -> Result<Judged, NewtonError> {
        let form = Form { linear: self.stepper.linear, ..Form::AS_WRITTEN };
        let residual = match self.stepper.residual.take() {
            Some(residual) => residual,
            None => scene.system.residual(&self.u, &form)?,
        };
        let known = self.known_of_others();
        let (solver, tangent) = (self.stepper.solver.as_mut(), self.stepper.tangent.as_ref());
        let (Some(solver), Some(tangent)) = (solver, tangent) else {
            return Ok(Judged { residual, ..Judged::default() });
        };
        let Solving { system, contact, .. } = scene;
        let state = Solved { system, contact, tangent, u: &self.u, residual: &residual };
        let left = history.iterations.last().map_or(0.0, |i| i.residual);
        // where no system was solved, the factor at hand is of an earlier state, and a resumed run has none
        let is_solved = !history.solves.is_empty();
        let due = wfl_checks::is_due(self.steps.len(), scene.steps.is_last(self.steps.len(), system.step().end));
        let (response, often) = (&mut self.stepper.response, scene.steps.are_many_and_equal() && !due);
        let mut digits = || match history.correction {
            _ if !is_solved => None,
            None if often => {
                wfl_checks::bound(response, state, solver).or_else(|| wfl_checks::digits(state, solver, None))
            }
            correction => wfl_checks::digits(state, solver, correction),
        };
        let (accuracy, conditions) = if system.team().is_alone() {
            rayon::join(digits, || wfl_checks::conditions(state, left))
        } else {
            // ranks exchange numbers in one order
            (digits(), wfl_checks::conditions(state, left))
        };
        let mut found = wfl_checks::balance(state, scene.newton.tolerance, due.then_some(&self.turning));
        found.extend(conditions.checks);
        let (narrow, zigzags) = (conditions.narrow, conditions.zigzags);
        let turned = wfl_checks::turned_cells(system, &self.u);
        // a check never fails a state that has converged: what it cannot evaluate it does not judge
        let others = wfl_checks::others(system, contact, solver, &self.u, known.most).unwrap_or_default();
        let spend = if due { Spend::Factor } else { Spend::Nothing };
        let unstable = |of: &mut Self| if known.unstable { None } else { of.look_at_stability(scene, spend) };
        let few = history.hidden > 0.0 || accuracy.as_ref().is_some_and(|a| a.digits() < findings::FEW_DIGITS);
        let doubtful = few || found.iter().any(|c| !c.holds());
        // where the prescribed values alone turn cells inside out, the state of rest is no state at all
        if doubtful && wfl_checks::rests(state, &form).unwrap_or(false) {
            // what differs from zero is rounding, and so is every number made of it
            return Ok(Judged { others, unstable: unstable(self), residual, ..Judged::default() });
        }
        let unstable = unstable(self);
        let hidden = history.hidden;
        Ok(Judged { accuracy, hidden, checks: found, turned, narrow, zigzags, others, unstable, residual })
    }
}
