//! Newton's method on the assembled problem: exact tangents, damping by a merit function, honest stopping.
//!
//! The residual of each field is measured relative to its own scale ([`wfl_discrete::system::System::scales`]). An
//! iteration stops at the tolerance, or at the rounding floor (a multiple of the unit roundoff times |K||u|) and says
//! which. There are three mechanisms: damped semismooth Newton steps with a choice of merit (`line_search`,
//! `critical_point`), one homotopy in the regularised law of contact (`homotopy`), and piecewise linear path following
//! (`path_following`). Which of them a step uses, and when the next takes over, stands in one table (`schedule`).
//! Linear systems are solved by [`wfl_linear`].
#![forbid(unsafe_code)]

mod began;
mod branch;
mod critical_point;
mod downhill;
mod error;
mod history;
mod hold;
mod homotopy;
mod inexact;
mod initial_guess;
mod iteration;
mod line_search;
mod load_step;
mod measures;
mod method;
mod path_following;
mod refinement;
mod rest;
mod schedule;
mod swallowed;

#[cfg(test)]
#[path = "../../contact/src/test_block.rs"]
mod test_block;
#[cfg(test)]
mod tests;

pub use error::{NewtonError, Singular};
pub use history::{Iteration, StepHistory, Stop};
pub use load_step::{LoadStep, Rounding, Spent};
pub use method::Method;
pub use schedule::{PlannedStage, planned_stages};

use wfl_discrete::assemble::TermError;
use wfl_sparse::solve::{LinearMethod, SolveError};

/// When an iteration stops and how it searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonOptions {
    /// Largest relative residual of a converged step.
    pub tolerance: f64,
    /// Most iterations in a step.
    pub max_iterations: usize,
    /// Line search on; off takes every full step.
    pub search: bool,
    /// How the system of a linear scene is solved.
    pub linear: LinearMethod,
    /// An equilibrium that is not stable is left, pushed by so much of the extent of the mesh; `None` stays there.
    pub perturb: Option<f64>,
}

/// The largest relative tolerance that can be asked for: where a tenth of the forces is out of balance nothing is solved.
pub const LARGEST_TOLERANCE: f64 = 0.1;

/// The largest push that leaves an equilibrium, in parts of the extent of the mesh: beyond it the state that it is pushed to says
/// little of where it came from.
pub const LARGEST_PERTURBATION: f64 = 0.1;

/// Default relative tolerance: Newton converges quadratically there, so that it costs one iteration more than 1e-5.
pub const DEFAULT_TOLERANCE: f64 = 1e-10;

impl Default for NewtonOptions {
    fn default() -> Self {
        Self {
            tolerance: DEFAULT_TOLERANCE,
            max_iterations: 150,
            search: true,
            linear: LinearMethod::Auto,
            perturb: None,
        }
    }
}

/// What to tell while a step runs.
pub trait Watch {
    /// After each iteration.
    fn iteration(&mut self, _iteration: &Iteration) {}

    /// True if who watches wants no further iteration: the step then ends with [`NewtonError::Stopped`]. Asked before
    /// each iteration.
    fn stops(&mut self) -> bool {
        false
    }
}

/// Watches nothing.
pub struct Silent;

impl Watch for Silent {}

/// Solves one step from `u`, which holds the prescribed values already; leaves the best state in `u`. `before` is the
/// end of the last step, without them.
///
/// Scenes with contact first run with a frozen active set (`contact`); if that does not settle, the methods of the
/// schedule follow. A smooth scene on cells that is singular at rest (all zero) is started from a displaced state, which
/// the history tells.
///
/// # Errors
/// [`NewtonError`]; a step that does not converge is no error but is marked in the history.
pub fn solve_step(step: &mut LoadStep<'_>, before: &[f64], u: &mut [f64]) -> Result<StepHistory, NewtonError> {
    let was_warm = step.contact.is_warm();
    let degenerate = initial_guess::may_be_degenerate(step.system, u);
    let start = u.to_vec();
    let predicted = if step.options.search { initial_guess::predict(step, before, u)? } else { None };
    step.contact.set_closes_far(false);
    let mut result = iteration::iterate(step, u, predicted.as_ref());
    let is_loose = matches!(&result, Err(NewtonError::Solve(SolveError::Singular { .. })));
    if is_loose && !was_warm && !step.contact.is_empty() && step.system.has_nonlinear_bodies() {
        // what holds a body may be the contact that is open at the start
        u.copy_from_slice(&start);
        step.contact.set_closes_far(true);
        result = iteration::iterate(step, u, predicted.as_ref());
    }
    if degenerate && result.as_ref().is_err_and(NewtonError::is_of_the_state) {
        u.copy_from_slice(&start);
        if initial_guess::displace(step.system, u) {
            match iteration::iterate(step, u, None) {
                Ok(mut history) => {
                    history.displaced = true;
                    result = Ok(history);
                }
                Err(error) if error.ends_the_run() => result = Err(error),
                Err(_) => {}
            }
        }
    }
    if let (Ok(history), Some(size)) = (&mut result, step.options.perturb)
        && history.converged()
        && step.offset.is_empty()
        && let Some(more) = branch::leave(step, u, size)?
    {
        let done = history.n_iterations();
        history.iterations.extend(more.iterations.into_iter().map(|i| Iteration { number: done + i.number, ..i }));
        history.stop = more.stop;
    }
    settle_contact(step, was_warm, u, result.as_ref().ok());
    result
}

/// Leaves contact with the active set that belongs to the state that was reached. The one at hand does where the last
/// correction was made with it. Where nothing had to be corrected it is a guess: of a step before, or of a start at which
/// all points may be closed that nothing presses yet, which says nothing of the step to come. Nor does a state of rest, in
/// which nothing presses any more.
fn settle_contact(step: &mut LoadStep<'_>, was_warm: bool, u: &[f64], history: Option<&StepHistory>) {
    let history = history.filter(|h| h.converged());
    let last = history.and_then(|h| h.iterations.iter().rev().find(|i| i.method != Method::Refinement));
    let is_solved = last.is_some_and(|i| i.method.freezes());
    let is_moved = history.is_some_and(|h| h.n_iterations() > 0);
    let is_at_rest =
        history.is_some_and(|h| h.stop == Some(Stop::Rest)) || step.system.team().all(u.iter().all(|u| *u == 0.0));
    step.contact.set_warm(history.is_some() && !is_at_rest && (is_moved || was_warm));
    if step.contact.is_warm() {
        if !is_solved && !step.contact.is_empty() {
            step.contact.freeze_as_written(step.system, u);
        }
        step.contact.accept(step.system, u);
    }
}

/// A state that the equations cannot be evaluated at is an error of the step.
type Evaluated<T> = Result<T, TermError>;
