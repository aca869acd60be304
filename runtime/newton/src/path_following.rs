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
/// this part of it: a solution lies ahead or not far behind, and rounding moves breakpoints by less.
const FURTHEST: f64 = 100.0;
const AGAIN: f64 = 1e-7;
/// What a linear solve may leave, relative to its right-hand side: a state stays on the path over all breakpoints.
const UNSEEN: f64 = 1e-8;
/// A state is on the path if the residual beside it is this part of that of the start: more than rounding, less than a
/// breakpoint moves.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Silent,
        test_block::{LAPLACE, PENALTY_WITH_FRICTION},
        tests::Solving,
    };

    /// Follows a path from rest to its end: the part that each advance passes, and the state there.
    fn follow(cells: &[&str], floor: &str) -> (Vec<f64>, Vec<f64>, bool) {
        let mut solving = Solving::new(cells, &[floor]);
        solving.with(&mut Silent, |step, u| {
            let norm = Norm::new(vec![1.0], true);
            step.contact.freeze_as_written(step.system, u);
            let residual = step.system.residual(u, &step.form()).unwrap();
            let mut path = Path::new(&residual.values);
            let (mut parts, mut history) = (Vec::new(), StepHistory::default());
            let mut here = step.measure(u, &norm).unwrap();
            for _ in 0..20 {
                step.assemble_tangent(u, true).unwrap();
                let (part, next) = path.advance(step, u, &here, &norm, &mut history).unwrap();
                parts.push(part);
                here = next;
                if path.is_lost() || here.stop(step.options).is_some() {
                    break;
                }
            }
            (parts, u.clone(), path.is_lost())
        })
    }

    /// A floor that is 1/4 below the body.
    const BELOW: &str = "pos_part(10*(u.Normal - 0.25))*(Test_u.Normal)";

    #[test]
    fn a_path_passes_each_breakpoint_at_its_exact_part() {
        // without the floor the body goes down by 1: it touches after a quarter, with one point and then with the other
        let (parts, u, lost) = follow(&[LAPLACE, "[0,2].Test_u"], BELOW);
        assert!((parts[0] - 0.25).abs() < 1e-14 && !lost, "{parts:?}");
        assert!((parts.iter().sum::<f64>() - 1.0).abs() < 1e-13, "{parts:?}");
        let lowest = u.iter().copied().fold(0.0, f64::min);
        assert!((lowest + 3.5 / 11.0).abs() < 1e-13, "x + 10 (x - 1/4) = 1: {lowest}");
    }

    #[test]
    fn a_path_that_meets_nothing_goes_to_its_end_at_once() {
        let (parts, u, lost) = follow(&[LAPLACE, "[0,0.4].Test_u"], BELOW);
        assert!(parts == [1.0] && !lost);
        assert!((u.iter().copied().fold(0.0, f64::min) + 0.2).abs() < 1e-14);
    }

    #[test]
    fn a_path_ends_in_slip_where_the_force_is_beyond_the_bound() {
        let (parts, u, lost) = follow(&[LAPLACE, "[-4,2].Test_u"], PENALTY_WITH_FRICTION);
        assert!(!lost, "{parts:?}");
        let slip = u.iter().copied().fold(0.0, f64::max);
        assert!((slip - (2.0 - 5.0 / 11.0)).abs() < 1e-9, "{slip}");
    }
}
