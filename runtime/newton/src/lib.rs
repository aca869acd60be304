//! Newton's method on the assembled problem: exact tangents, damping by a merit function, honest stopping.
//!
//! The residual of each field is measured relative to its own scale ([`wfl_discrete::system::System::scales`]). An
//! iteration stops at the tolerance, or at the rounding floor (a multiple of the unit roundoff times |K||u|) and says
//! which. There are three mechanisms: damped semismooth Newton steps with a choice of merit (`line_search`,
//! `critical_point`), one homotopy in the regularised law of contact (`homotopy`), and piecewise linear path following
//! (`path_following`). Which of them a step uses, and when the next takes over, stands in one table (`schedule`).
#![forbid(unsafe_code)]

mod critical_point;
mod error;
mod history;
mod homotopy;
mod inexact;
mod initial_guess;
mod iteration;
mod iterative;
mod library;
mod line_search;
mod linear_solver;
mod load_step;
mod measures;
mod method;
mod path_following;
mod refinement;
mod schedule;

pub use error::{NewtonError, Singular};
pub use history::{Iteration, StepHistory, Stop};
pub use iterative::obstacle;
pub use linear_solver::{LinearSolver, condenses, shares_forces};
pub use load_step::{LoadStep, Rounding, Spent};
pub use method::Method;
pub use schedule::{PlannedStage, planned_stages};

use wfl_discrete::assemble::TermError;
use wfl_sparse::solve::LinearMethod;

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
}

/// The largest relative tolerance that can be asked for: where a tenth of the forces is out of balance nothing is solved.
pub const LARGEST_TOLERANCE: f64 = 0.1;

/// Default relative tolerance.
pub const DEFAULT_TOLERANCE: f64 = 1e-10;

impl Default for NewtonOptions {
    fn default() -> Self {
        Self { tolerance: DEFAULT_TOLERANCE, max_iterations: 150, search: true, linear: LinearMethod::Auto }
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

/// Solves one step from `u`, which holds the prescribed values already; leaves the best state in `u`. `from` is the
/// same state before they were written into it.
///
/// Scenes with contact first run with a frozen active set (`contact`); if that does not settle, the methods of the
/// schedule follow. A smooth scene on cells that is singular at rest (all zero) is started from a displaced state, which
/// the history tells.
///
/// # Errors
/// [`NewtonError`]; a step that does not converge is no error but is marked in the history.
pub fn solve_step(step: &mut LoadStep<'_>, from: &[f64], u: &mut [f64]) -> Result<StepHistory, NewtonError> {
    let degenerate = initial_guess::may_be_degenerate(step.system, u);
    let rest = u.to_vec();
    let predicted = if step.options.search { initial_guess::predict(step, from, u)? } else { None };
    let mut result = iteration::iterate(step, u, predicted.as_ref());
    if degenerate && result.as_ref().is_err_and(NewtonError::is_of_the_state) {
        u.copy_from_slice(&rest);
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
    let converged = result.as_ref().is_ok_and(StepHistory::converged);
    step.contact.set_warm(converged);
    if converged {
        step.contact.accept(step.system, u);
    }
    result
}

/// A state that the equations cannot be evaluated at is an error of the step.
type Evaluated<T> = Result<T, TermError>;
