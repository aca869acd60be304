//! Corrections that are solved as far as the contact they lead to asks for.
//!
//! Where a full step solves the equations but for branches that change, a correction is a means to find the next active
//! set, and only that of the last iteration must be exact. A linked library solves it in parts: after each the branches at
//! the end of the full step are looked at, and where what they change is large against what the solution has left, the
//! next iteration takes over. Promises: a correction after which no branch changes is solved as far as one with a factor;
//! decisions follow from whole vectors, so that all ranks take the same. Does not choose steps and active sets.

use super::{
    Evaluated, Method, NewtonError, StepHistory,
    load_step::{LoadStep, Measured, Norm},
};

/// What a solution may leave, relative to what changed branches leave: with a hundredth the iterations of the scenes in
/// `runtime/cli/tests/petsc.rs` are as many as with a factor.
const OF_THE_CHANGES: f64 = 0.01;
/// The part of that which is asked for: half a digit below, so that it is met in one attempt more often than not.
const ASKED: f64 = 0.3;
/// The first attempt at a correction leaves no more than this, relative to its right-hand side, and a later one is asked for
/// a digit at least: three digits are what a correction far from the solution is worth, and an attempt that gains less than
/// a digit costs its start again.
const FIRST: f64 = 1e-3;
const LEAST: f64 = 0.1;
/// The most that one attempt is asked for while branches change, relative to what is left: they may change for what the last has left.
const MOST: f64 = 1e-4;
/// What the last solution of a step may leave, relative to the tolerance: less than shows in any measure.
const OF_THE_TOLERANCE: f64 = 1e-4;

/// How far a correction is to be solved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inexact {
    /// What the first solution may leave of its right-hand side.
    first: f64,
    /// What is left in the end where no branch changes.
    last: f64,
}

impl Inexact {
    /// For an iteration from a state with this relative residual after one with the residual `before`; `best` is the
    /// smallest of earlier ones. `None` where a solution to all digits is due: other methods, nonlinear bodies, our own
    /// solvers, and iterations without progress, which are told by states that come back.
    pub(super) fn of(
        step: &LoadStep<'_>,
        method: Method,
        here: f64,
        before: Option<f64>,
        best: Option<f64>,
    ) -> Option<Self> {
        let least = step.solver.left_of_full_step(step.system)?;
        let applies = method == Method::ActiveSet && !step.has_single_equations();
        if !applies || best.is_some_and(|best| here >= best) {
            return None;
        }
        Some(Self::asked(here, before, step.options.tolerance, least))
    }

    /// What is asked of a correction of a state with this relative residual after one with the residual `before`; no less
    /// than `least` is left.
    fn asked(here: f64, before: Option<f64>, tolerance: f64, least: f64) -> Self {
        let last = (OF_THE_TOLERANCE * tolerance / here).max(least);
        let next = before.map_or(1.0, |before| (here / before) * (here / before));
        Self { first: (ASKED * OF_THE_CHANGES * next).min(FIRST).max(last), last }
    }

    /// The correction of `here`, the tangent assembled, as far as the state at its end asks for.
    pub(super) fn correct(
        self,
        step: &mut LoadStep<'_>,
        from: (&[f64], &Measured),
        norm: &Norm,
        direction: &mut Vec<f64>,
        history: &mut StepHistory,
    ) -> Result<(), NewtonError> {
        let (start, here) = from;
        step.factor()?;
        // one correction, however often it is gone on with
        step.spent.linear_solves += 1;
        let mut report = step.solve_part(&here.residual, self.first, direction)?;
        let mut asked = self.first;
        let mut u = start.to_vec();
        while asked > self.last {
            step.go(start, direction, 1.0, &mut u);
            let found = step.measure(&u, norm)?;
            let Some(part) = self.still(step, here, &found, norm, asked)? else { break };
            let mut more = Vec::new();
            let iterations = report.krylov_iterations;
            report = step.solve_part(&found.residual, part, &mut more)?;
            report.krylov_iterations += iterations;
            direction.iter_mut().zip(&more).for_each(|(d, more)| *d += more);
            asked *= part;
        }
        history.solves.push(report);
        Ok(())
    }

    /// The part of what is left that the next attempt may leave; `None` where what the branches change is large against it.
    fn still(
        self,
        step: &LoadStep<'_>,
        here: &Measured,
        found: &Measured,
        norm: &Norm,
        asked: f64,
    ) -> Evaluated<Option<f64>> {
        let changed: Vec<f64> = found.written.values.iter().zip(&found.residual).map(|(w, r)| w - r).collect();
        Ok(self.part_of(step.weighted_norm(&changed, norm), found.norm, here.norm, asked))
    }

    /// The same from norms: of what the branches change, of what is left, and of the residual that is corrected.
    fn part_of(self, changes: f64, left: f64, here: f64, asked: f64) -> Option<f64> {
        if left <= OF_THE_CHANGES * changes || left <= self.last * here {
            return None;
        }
        let last = self.last / asked;
        let wanted = (ASKED * OF_THE_CHANGES * changes / left).clamp(MOST, LEAST);
        // rounding of both residuals, and branches that change for nothing but what is left
        let is_last = changes <= self.last * here;
        Some(if is_last { last } else { wanted.max(last) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a linear solver leaves where no branch changes.
    const LEAST_LEFT: f64 = 1e-10;

    #[test]
    fn the_first_attempt_follows_the_speed_of_the_last_iteration() {
        assert_eq!(Inexact::asked(1.0, None, 1e-10, LEAST_LEFT).first, 1e-3, "never less than a few digits");
        // the residual has fallen to a tenth: to a hundredth next, of which 0.003 may be left
        assert!((Inexact::asked(0.1, Some(1.0), 1e-10, LEAST_LEFT).first - 3e-5).abs() < 1e-19);
    }

    #[test]
    fn near_the_tolerance_no_attempt_asks_for_more_than_shows() {
        let asked = Inexact::asked(1e-9, Some(1.0), 1e-10, LEAST_LEFT);
        assert!((asked.last - 1e-5).abs() < 1e-19 && asked.first == asked.last);
        assert_eq!(Inexact::asked(1.0, Some(1.0), 1e-10, LEAST_LEFT).last, LEAST_LEFT);
    }

    #[test]
    fn a_correction_ends_where_what_the_branches_change_hides_what_is_left() {
        let asked = Inexact { first: 1e-3, last: 1e-8 };
        assert_eq!(asked.part_of(1.0, 0.01, 1.0, 1e-3), None);
        let part = asked.part_of(1.0, 0.02, 1.0, 1e-3).expect("twice as much is left as may be");
        assert!(part == LEAST, "a tenth is asked for: {part}");
        let part = asked.part_of(0.01, 0.01, 1.0, 1e-3).expect("a hundred times as much is");
        assert!((part - 3e-3).abs() < 1e-17, "{part}");
    }

    #[test]
    fn a_correction_after_which_no_branch_changes_is_solved_to_the_end() {
        let asked = Inexact { first: 1e-3, last: 1e-8 };
        assert_eq!(asked.part_of(0.0, 1e-3, 1.0, 1e-3), Some(1e-8 / 1e-3));
        assert_eq!(asked.part_of(0.0, 1e-8, 1.0, 1e-5), None, "and then it is");
    }
}
