//! What is refused before a run: all that is known of derivatives without one. What remains is known behind it alone: steps
//! that did not converge, tangents that are singular, points between two branches, and numbers made of measures, which follow
//! each of them by a slope at the numbers of the run.

use wfl::{Diagnostic, ResolvedScript};
use wfl_compiler::InterpreterBackend;
use wfl_problem::Scene;

use super::{
    Request,
    extended::Extended,
    formulas::Formulas,
    laws::Laws,
    measures::Asked,
    parameters,
    refused::{self, not_made},
    shape,
};

/// Refuses derivatives that a run would be spent on in vain.
///
/// # Errors
/// The message about what has no derivative.
pub fn ahead(scene: &Scene, script: &ResolvedScript, request: &Request) -> Result<(), Box<Diagnostic>> {
    refused::without_run(scene, script, request)?;
    let live = parameters::live(script, scene, request)?;
    refused::places(script, &live)?;
    let mut extended = Extended::new(scene, script, live).map_err(|e| not_made(&e.to_string()))?;
    shape::ahead(&extended, script)?;
    let laws = Asked::ahead(&mut extended, script, request)?;
    Formulas::new(&extended, script)?;
    Laws::new(&extended, script, laws, &InterpreterBackend).map(|_| ())
}
