//! `gradient` statements: what a scene itself wants differentiated, found behind its run, and known to its expectations.

use wfl::{Diagnostic, ResolvedScript, ast::AtSteps};
use wfl_compiler::{Constant, types::Shape};
use wfl_problem::Scene;
use wfl_run::{Outcome, put_expectations};

use super::{Differentiated, Gradients, Request, WantedResult, When, gradients, refused::message};

/// What the `gradient` statements of a scene ask for; one request for those in the same parameters and fields.
///
/// # Errors
/// A value of the step variable that is no number, with its place.
pub fn stated(scene: &Scene, script: &ResolvedScript) -> Result<Vec<Request>, Box<Diagnostic>> {
    let mut made: Vec<Request> = Vec::new();
    for statement in &script.gradients {
        let mut results = Vec::new();
        for (result, text) in statement.results.iter().zip(&statement.texts) {
            let when = match &result.at {
                AtSteps::Last => When::Last,
                AtSteps::Sum => When::Sum,
                AtSteps::Mean => When::Mean,
                AtSteps::At(_, value) => match scene.number_of(value, &[]).filter(|t| t.is_finite()) {
                    Some(time) => When::At(time),
                    None => return Err(Box::new(message("this is no value of the step variable").at(value.span, ""))),
                },
            };
            let measure = result.measure.name.clone();
            let name = match when {
                When::Sum => format!("sum({measure})"),
                When::Mean => format!("mean({measure})"),
                _ => text.clone(),
            };
            results.push(WantedResult { name, measure, when });
        }
        let names = |list: &[wfl::ast::Ident]| -> Vec<String> { list.iter().map(|name| name.name.clone()).collect() };
        let (parameters, fields) = (names(&statement.parameters), names(&statement.fields));
        match made.iter_mut().find(|r| r.parameters == parameters && r.fields == fields) {
            Some(same) => same.results.extend(results),
            None => made.push(Request { results, parameters, fields, ..Request::default() }),
        }
    }
    Ok(made)
}

/// The derivatives that a scene states, and others that are asked for, of a run that has converged. The expectations of the
/// scene are judged again with them.
///
/// # Errors
/// As [`gradients`].
pub fn settle(
    of: (&Scene, &ResolvedScript),
    with: (&dyn wfl_compiler::backend::KernelBackend, usize),
    more: Option<&Request>,
    outcome: &mut Outcome,
) -> Result<Gradients, Box<Diagnostic>> {
    let ((scene, script), (backend, threads)) = (of, with);
    let mut found = Gradients::default();
    for request in stated(scene, script)?.iter().chain(more) {
        let run = Differentiated { scene, script, outcome, backend, threads };
        found.join(gradients(run, request)?);
    }
    if script.gradients.is_empty() {
        return Ok(found);
    }
    let mut derivatives: Vec<(String, Constant)> = Vec::new();
    for known in script.gradients.iter().flat_map(|g| &g.derivatives) {
        let of_result = found.results.iter().find(|r| r.name == known.measure.name);
        let entries = of_result.and_then(|r| r.parameters.iter().find(|p| p.0 == known.parameter.name));
        let shape = scene.params.iter().find(|p| p.0 == known.parameter.name).map_or(Shape::SCALAR, |p| p.1.shape);
        if let Some((_, values)) = entries {
            derivatives.push((known.name.clone(), Constant { shape, values: values.clone(), declared: None }));
        }
    }
    let (expectations, diagnostics) = scene.expectations(&outcome.known, &derivatives);
    put_expectations(&mut outcome.report, &expectations);
    outcome.diagnostics.extend(diagnostics);
    (outcome.expectations, outcome.derivatives) = (expectations, derivatives);
    Ok(found)
}

impl Gradients {
    /// Adds others of the same run; what is known stays.
    fn join(&mut self, others: Self) {
        for other in others.results {
            let Some(known) = self.results.iter_mut().find(|r| r.name == other.name) else {
                self.results.push(other);
                continue;
            };
            for (list, more) in [(&mut known.parameters, other.parameters), (&mut known.fields, other.fields)] {
                more.into_iter().for_each(|entry| {
                    if list.iter().all(|k| k.0 != entry.0) {
                        list.push(entry);
                    }
                });
            }
            known.sides.extend(other.sides);
        }
        others.near.into_iter().for_each(|near| {
            if !self.near.contains(&near) {
                self.near.push(near);
            }
        });
        others.notes.into_iter().for_each(|note| {
            if !self.notes.contains(&note) {
                self.notes.push(note);
            }
        });
        self.solutions += others.solutions;
        self.factorisations += others.factorisations;
        self.steps_again += others.steps_again;
        self.seconds += others.seconds;
    }
}
