//! The path through the pieces: what is left of the residual is taken away step by step, and each kink is passed.
//!
//! The state follows A(u) = (1 - s) R with R the residual it begins with. Within a piece that is a straight line; at a
//! kink one point changes its branch and the line goes on behind it, forwards or backwards in s, as a path of pivots
//! does (Lemke 1965; Katzenelson 1965; Eaves 1976). A search for a smaller defect ends between two pieces whose
//! tangents differ in the sign of their determinant, as those of friction may; a path turns round there and finds the
//! state behind. It does not circle: a path of a piecewise linear map has no branches.
//!
//! Promises: passes one kink an iteration, or as far as the directions of slip allow. Does not say when to begin one.

use super::{Kinks, Measured, NewtonError, StepHistory, correct, measure, step_to};
use crate::{finite::largest, strategy::Strategy, system::System};

/// A path is left that has gone backwards this far, in units of its length, or that is where its first kink was within
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
    /// Kinks that were passed last, and how fast.
    passed: Option<(Kinks, f64)>,
    /// How often it turned round.
    turns: usize,
    /// The first kinks, and where they were passed.
    first: Option<(Kinks, f64)>,
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

    /// Goes on to the next kink, or to the end of the path. Returns the part of it that was passed.
    pub(super) fn advance(
        &mut self,
        (system, strategy): (&mut System, &mut Strategy),
        u: &mut [f64],
        (here, weights): (&Measured, &[f64]),
        history: &mut StepHistory,
    ) -> Result<(f64, Measured), NewtonError> {
        let mut direction = Vec::new();
        let beside: Vec<f64> =
            here.residual.iter().zip(&self.start).map(|(r, start)| r - (1.0 - self.done) * start).collect();
        let free = |v: &[f64]| largest(system.numbering.free_dofs.iter().map(|d| v[*d as usize]));
        if free(&beside) > ON_THE_PATH * free(&self.start) {
            correct(system, strategy, (&beside, UNSEEN), &mut direction, history)?;
            let from = u.to_vec();
            step_to(system, &from, &direction, 1.0, u);
        }
        correct(system, strategy, (&self.start, UNSEEN), &mut direction, history)?;
        let from = u.to_vec();
        step_to(system, &from, &direction, 1.0, u);
        let line = system.line(&from, u)?;
        if let Some((kinks, rate)) = &self.passed
            && self.forwards * system.passage(&line, 0.0, kinks) * rate < 0.0
        {
            self.forwards = -self.forwards;
            self.turns += 1;
        }
        let left = if self.forwards > 0.0 { 1.0 - self.done } else { f64::INFINITY };
        let (at, kinks) = system.next_kinks(&line, self.forwards, left);
        if at.is_infinite() {
            self.lost = true;
            step_to(system, &from, &direction, 0.0, u);
            return Ok((0.0, measure(system, u, weights, true)?));
        }
        let part = self.forwards * at;
        step_to(system, &from, &direction, part, u);
        self.done += part;
        system.go_on(u, &kinks)?;
        let rate = self.forwards * system.passage(&line, part, &kinks);
        if !kinks.is_empty() {
            let again = |(first, done): &(Kinks, f64)| *first == kinks && (done - self.done).abs() < AGAIN;
            self.lost = self.done < -FURTHEST || self.first.as_ref().is_some_and(again);
            self.first.get_or_insert((kinks.clone(), self.done));
        }
        self.passed = (!kinks.is_empty()).then_some((kinks, rate));
        let found = measure(system, u, weights, true)?;
        if at == left {
            // what is left is of second order: directions of slip that have turned
            history.turns += self.turns;
            *self = Self::new(&found.residual);
        }
        Ok((part, found))
    }
}
