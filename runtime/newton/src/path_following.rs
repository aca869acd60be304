//! Piecewise linear path following: what is left of the residual is taken away part by part, from breakpoint to
//! breakpoint.
//!
//! The state follows A(u) = (1 - s) R with R the residual it begins with. On one active set that is a straight line; at a
//! breakpoint one point changes its branch and the line goes on behind it, forwards or backwards in s, as a path of pivots
//! does (Lemke 1965; Katzenelson 1965; Eaves 1976). A search for a smaller defect ends between two active sets whose
//! tangents differ in the sign of their determinant, as those of friction may; a path turns round there and finds the
//! state behind. It does not circle: a path of a piecewise linear map has no branches.
//!
//! Promises: passes one breakpoint an iteration, or as far as the directions of slip allow. Does not say when to begin one.

use super::{
    LoadStep, NewtonError, StepHistory,
    load_step::{Measured, Norm},
};
use wfl_contact::Breakpoints;
use wfl_discrete::finite::largest;

/// A path is left that has gone backwards this far, in units of its length, or that is where its first breakpoint was within
/// this part of it.
const FURTHEST: f64 = 100.0;
const AGAIN: f64 = 1e-7;
/// What may be left of a linear solve.
const UNSEEN: f64 = 1e-8;
/// A state is on the path if the residual beside it is this part of that of the start.
const ON_THE_PATH: f64 = 1e-9;

/// Where a path is.
pub(super) struct Path {
    /// The residual of the start.
    start: Vec<f64>,
    /// The part that has been taken away, and whether it grows.
    done: f64,
    forwards: f64,
    /// Breakpoints that were passed last, and how fast.
    passed: Option<(Breakpoints, f64)>,
    /// How often it turned round.
    turns: usize,
    /// The first breakpoints, and where they were passed.
    first: Option<(Breakpoints, f64)>,
    lost: bool,
}

impl Path {
    /// A path from a state with this residual.
    pub(super) fn new(residual: &[f64]) -> Self {
        Self { start: residual.to_vec(), done: 0.0, forwards: 1.0, passed: None, turns: 0, first: None, lost: false }
    }

    /// True if the path goes round, or on for ever.
    pub(super) fn is_lost(&self) -> bool {
        self.lost
    }

    /// Goes on to the next breakpoint, or to the end of the path. Returns the part of it that was passed.
    pub(super) fn advance(
        &mut self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        here: &Measured,
        norm: &Norm,
        history: &mut StepHistory,
    ) -> Result<(f64, Measured), NewtonError> {
        let system = step.system;
        let mut direction = Vec::new();
        let beside: Vec<f64> =
            here.residual.iter().zip(&self.start).map(|(r, start)| r - (1.0 - self.done) * start).collect();
        let free =
            |v: &[f64]| system.team().largest(largest(system.numbering.free_dofs.iter().map(|d| v[*d as usize])));
        if free(&beside) > ON_THE_PATH * free(&self.start) {
            step.correct(&beside, UNSEEN, &mut direction, history)?;
            let from = u.to_vec();
            step.go(&from, &direction, 1.0, u);
        }
        step.correct(&self.start, UNSEEN, &mut direction, history)?;
        let from = u.to_vec();
        step.go(&from, &direction, 1.0, u);
        let line = step.contact.along(system, &from, u);
        if let Some((passed, rate)) = &self.passed
            && self.forwards * step.contact.passage(&line, 0.0, passed) * rate < 0.0
        {
            self.forwards = -self.forwards;
            self.turns += 1;
        }
        let left = if self.forwards > 0.0 { 1.0 - self.done } else { f64::INFINITY };
        let (at, next) = step.contact.next_breakpoints(&line, self.forwards, left);
        if at.is_infinite() {
            self.lost = true;
            step.go(&from, &direction, 0.0, u);
            return Ok((0.0, step.measure(u, norm)?));
        }
        let part = self.forwards * at;
        step.go(&from, &direction, part, u);
        self.done += part;
        step.contact.cross(system, u, &next);
        let rate = self.forwards * step.contact.passage(&line, part, &next);
        if !next.is_empty() {
            let again = |(first, done): &(Breakpoints, f64)| *first == next && (done - self.done).abs() < AGAIN;
            self.lost = self.done < -FURTHEST || self.first.as_ref().is_some_and(again);
            self.first.get_or_insert((next.clone(), self.done));
        }
        self.passed = (!next.is_empty()).then_some((next, rate));
        let found = step.measure(u, norm)?;
        if at == left {
            // what is left is of second order: directions of slip that have turned
            history.turns += self.turns;
            *self = Self::new(&found.residual);
        }
        Ok((part, found))
    }
}
