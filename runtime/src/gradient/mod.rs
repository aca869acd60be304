//! Derivatives of the results of a run in its parameters: through contact, friction, states and steps, by the adjoint.
//!
//! Step n has the equations `R_n(u_n, u_(n-1), s_(n-1); p) = 0` and the states `s_n = S(u_n, u_(n-1), s_(n-1); p)`. From
//! the last step to the first one, with `ubar` and `sbar` the derivative of the result in what step n ends with:
//! `ubar += S_u' sbar`, `K_n' l = ubar`, `pbar += S_p' sbar - R_p' l`, and the step before gets
//! `S_(u-)' sbar - R_(u-)' l` and `S_s' sbar - R_s' l`. Prescribed values have `ubar - R_g' l`. `K_n` is the tangent as the
//! terms are written, on the branches of the solution: one solution a step and result, however many parameters.
//!
//! Laws of derivatives are compiled on request ([`wfl_compiler::compile_term_gradient`]): a run without derivatives
//! compiles and stores nothing. Promises: what has no derivative is an error with its place, zero is never written for
//! it; points between two branches are counted. Does not run scenes.

mod adjoint;
mod extended;
mod formulas;
mod laws;
mod measures;
mod near;
mod parameters;
mod refused;
mod request;
mod transposed;

use std::time::Instant;

use wfl::{Diagnostic, ResolvedScript};
use wfl_compiler::backend::KernelBackend;

use crate::{Outcome, Scene};
pub use near::NearKink;
pub use refused::{NO_DERIVATIVE, not_together};
pub use request::{Request, Result as WantedResult, When};

/// What is differentiated: a run with the scene that it is of.
#[derive(Clone, Copy)]
pub struct Differentiated<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its text, with the values of its parameters.
    pub script: &'a ResolvedScript,
    /// Its run, with the trajectory.
    pub outcome: &'a Outcome,
    /// Makes laws callable.
    pub backend: &'a dyn KernelBackend,
    /// Threads of the solver.
    pub threads: usize,
}

/// The derivatives of one result.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// The result as it was asked for.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// By parameter, in the order of the request, its entries (one for a number, first index fastest for others).
    pub parameters: Vec<(String, Vec<f64>)>,
    /// By data field its values: `[node * components + component]`.
    pub fields: Vec<(String, Vec<f64>)>,
}

/// The derivatives of several results.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// By result, in the order of the request.
    pub results: Vec<Gradient>,
    /// Points between two branches, where the derivative is that of one side.
    pub near: Vec<NearKink>,
    /// What else there is to know of them, in words.
    pub notes: Vec<String>,
    /// Solutions with a transposed tangent.
    pub solutions: usize,
    /// Factorisations of one.
    pub factorisations: usize,
    /// Seconds that they took.
    pub seconds: f64,
}

impl Gradients {
    /// The derivative of a result in a parameter of one entry.
    #[must_use]
    pub fn number(&self, result: &str, parameter: &str) -> Option<f64> {
        let result = self.results.iter().find(|r| r.name == result)?;
        match result.parameters.iter().find(|p| p.0 == parameter)?.1.as_slice() {
            [one] => Some(*one),
            _ => None,
        }
    }
}

/// The derivatives of results of a run.
///
/// # Errors
/// The message about what has no derivative, or cannot be solved.
pub fn gradients(of: Differentiated<'_>, request: &Request) -> Result<Gradients, Box<Diagnostic>> {
    let begin = Instant::now();
    refused::check(of, request)?;
    let live = parameters::live(of.script, of.scene, request)?;
    let mut made = adjoint::solve(of, request, &live)?;
    made.notes.extend(parameters::notes(of.script, request, &live));
    made.seconds = begin.elapsed().as_secs_f64();
    Ok(made)
}
