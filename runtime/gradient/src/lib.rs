//! Derivatives of the results of a run in its parameters: through contact, friction, states and steps, by the adjoint.
//!
//! Step n has the equations `R_n(u_n, u_(n-1), s_(n-1); p) = 0` and the states `s_n = S(u_n, u_(n-1), s_(n-1); p)`. From
//! the last step to the first one, with `ubar` and `sbar` the derivative of the result in what step n ends with:
//! `ubar += S_u' sbar`, `K_n' l = ubar`, `pbar += S_p' sbar - R_p' l`, and the step before gets
//! `S_(u-)' sbar - R_(u-)' l` and `S_s' sbar - R_s' l`. Prescribed values have `ubar - R_g' l`. `K_n` is the tangent as the
//! terms are written, on the branches of the solution: one solution a step and result, however many parameters.
//!
//! From the first step to the last one, along a direction of the parameters: `K_n du_n = -(R_p dp + R_(u-) du_(n-1) + R_s
//! ds_(n-1) + R_g dg)`, then `ds_n`: one solution a step and direction, however many results. Both use laws of their own, so
//! that each is a test of the other. To one side points between two branches go with the direction (`sided.rs`).
//!
//! Where parameters move the mesh, the velocity of its nodes is one more field that laws are differentiated in (`shape.rs`): the
//! derivative in a parameter is that in the velocities times those that its formulas give.
//!
//! Laws of derivatives are compiled on request ([`wfl_compiler::compile_term_gradient`]): a run without derivatives
//! compiles and stores nothing. Promises: what has no derivative is an error with its place, zero is never written for
//! it; points between two branches are counted. Does not run scenes, and does not change what it is handed.
#![forbid(unsafe_code)]

mod adjoint;
mod ahead;
mod along;
mod beginning;
mod computed;
mod extended;
mod formulas;
mod forward;
mod jacobian;
mod laws;
mod linear;
mod measures;
mod near;
mod parameters;
mod refused;
mod request;
mod shape;
mod sided;
mod sides;
mod standing;
mod stated;
mod steps;
mod velocities;

use std::time::Instant;

pub use ahead::ahead;
use forward::Derivative;
pub use forward::{Direction, Moved, Tangents};
pub use jacobian::{Jacobian, Mode};
pub use near::NearKink;
pub use refused::{NO_DERIVATIVE, not_together};
pub use request::{Request, Result as WantedResult, Side, When};
pub use sides::ToSides;
pub use stated::{settle, stated};
use wfl::{Diagnostic, ResolvedScript};
use wfl_compiler::backend::KernelBackend;
use wfl_problem::Scene;
use wfl_run::Outcome;

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
    /// Derivatives to one side, by parameter that was asked for.
    pub sides: Vec<ToSides>,
}

/// The derivatives of several results.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// By result, in the order of the request.
    pub results: Vec<Gradient>,
    /// Points between two branches, each of which counts with the one that it is on.
    pub near: Vec<NearKink>,
    /// What else there is to know of them, in words.
    pub notes: Vec<String>,
    /// Solutions with a transposed tangent.
    pub solutions: usize,
    /// Factorisations of one.
    pub factorisations: usize,
    /// Steps that were computed again to keep to a bound of memory.
    pub steps_again: usize,
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
    if !request.sides.is_empty() {
        sides::add(of, request, &mut made)?;
    }
    made.notes.extend(parameters::notes(of.script, of.scene, request, &live));
    let silent: Vec<String> = request.fields.iter().filter_map(|f| without_influence(of.scene, &made, f)).collect();
    made.notes.extend(silent);
    made.seconds = begin.elapsed().as_secs_f64();
    Ok(made)
}

/// How many nodes of a data field no result follows; nothing where all or none are followed.
fn without_influence(scene: &Scene, of: &Gradients, field: &str) -> Option<String> {
    let own = scene.system.fields.iter().find(|f| f.name == field)?;
    let by_result: Vec<&Vec<f64>> =
        of.results.iter().filter_map(|r| r.fields.iter().find(|f| f.0 == field)).map(|f| &f.1).collect();
    let (n, stride) = (own.n_nodes(), own.n_components);
    let is_silent = |node: &usize| by_result.iter().all(|v| v[node * stride..][..stride].iter().all(|x| *x == 0.0));
    let silent = (0..n).filter(is_silent).count();
    let told = || format!("`{field}` has no influence at {silent} of {n} nodes: derivatives there are exactly zero");
    (silent > 0 && silent < n).then(told)
}

/// What measures do along directions of the parameters, at all steps.
///
/// # Errors
/// As [`gradients`]; for a direction of another size than its parameter.
pub fn tangents(
    of: Differentiated<'_>,
    measures: &[String],
    directions: &[Direction],
) -> Result<Tangents, Box<Diagnostic>> {
    let begin = Instant::now();
    let request = forward::request(measures, directions);
    refused::check(of, &request)?;
    let live = parameters::live(of.script, of.scene, &request)?;
    let mut made = forward::solve(of, &request, &live, directions, Derivative::TwoSided)?;
    made.notes.extend(parameters::notes(of.script, of.scene, &request, &live));
    made.seconds = begin.elapsed().as_secs_f64();
    Ok(made)
}

/// The derivatives of measures at all steps in all entries of parameters and data fields.
///
/// # Errors
/// As [`gradients`].
pub fn jacobian(of: Differentiated<'_>, request: &Request) -> Result<Jacobian, Box<Diagnostic>> {
    jacobian::by(of, request, None)
}

/// The same, along directions or from results.
///
/// # Errors
/// As [`gradients`].
pub fn jacobian_by(of: Differentiated<'_>, request: &Request, mode: Mode) -> Result<Jacobian, Box<Diagnostic>> {
    jacobian::by(of, request, Some(mode))
}
