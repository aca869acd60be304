//! Derivatives of measures at all steps, in all entries of parameters and data fields: along directions or from results,
//! whichever takes fewer solutions.

use wfl::Diagnostic;
use wfl_run::Passed;

use super::{
    Differentiated, Direction, NearKink, Request, WantedResult, When, gradients,
    parameters::live,
    refused::{check, no_whole_measure},
    tangents,
};

/// How a Jacobian is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A solution a step and column.
    Tangents,
    /// A solution a step, row and step before it.
    Adjoints,
}

/// Derivatives of measures at all steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobian {
    /// The step variable at the end of each step.
    pub times: Vec<f64>,
    /// The measures.
    pub measures: Vec<String>,
    /// Parameters, then data fields: each with its number of entries.
    pub columns: Vec<(String, usize)>,
    /// `[(step * measures + measure) * entries of all columns + entry]`.
    pub values: Vec<f64>,
    /// How it was found.
    pub mode: Mode,
    /// Points between two branches, each of which counts with the one that it is on.
    pub near: Vec<NearKink>,
    /// What else there is to know of it, in words.
    pub notes: Vec<String>,
    /// Solutions with a tangent.
    pub solutions: usize,
}

/// The Jacobian of measures; the mode is chosen where it is not given.
pub(super) fn by(of: Differentiated<'_>, request: &Request, mode: Option<Mode>) -> Result<Jacobian, Box<Diagnostic>> {
    if let Some(result) = request.results.iter().find(|r| r.when != When::Last) {
        return Err(no_whole_measure(&result.name));
    }
    check(of, request)?;
    // names are known before their entries are counted
    live(of.script, of.scene, request)?;
    let measures: Vec<String> = request.results.iter().map(|r| r.measure.clone()).collect();
    let of_parameter = |name: &String| {
        let entries = of.scene.params.iter().find(|p| p.0 == *name).map_or(0, |p| p.1.values.len());
        (name.clone(), entries)
    };
    let of_field = |name: &String| {
        let entries =
            of.scene.system.fields.iter().find(|f| f.name == *name).map_or(0, wfl_discrete::field::Field::n_dofs);
        (name.clone(), entries)
    };
    let columns: Vec<(String, usize)> =
        request.parameters.iter().map(of_parameter).chain(request.fields.iter().map(of_field)).collect();
    let width: usize = columns.iter().map(|c| c.1).sum();
    let steps = of.outcome.trajectory.as_ref().map_or(&[][..], |t| &t.steps);
    let solved = steps.iter().filter(|s| s.kind != Passed::Given).count();
    // a row at a step follows all steps before it
    let from_results = measures.len() * solved * (solved + 1) / 2;
    let cheaper = if width * solved <= from_results { Mode::Tangents } else { Mode::Adjoints };
    let mode = mode.unwrap_or(cheaper);
    let made = Jacobian {
        times: Vec::new(),
        measures,
        columns,
        values: Vec::new(),
        mode,
        near: Vec::new(),
        notes: Vec::new(),
        solutions: 0,
    };
    match mode {
        Mode::Tangents => along(of, made, request.parameters.len()),
        Mode::Adjoints => from(of, request, made),
    }
}

/// By columns.
fn along(of: Differentiated<'_>, mut made: Jacobian, n_parameters: usize) -> Result<Jacobian, Box<Diagnostic>> {
    let mut directions = Vec::new();
    for (k, (name, entries)) in made.columns.iter().enumerate() {
        for entry in 0..*entries {
            let unit = (0..*entries).map(|e| f64::from(u8::from(e == entry))).collect();
            let list = vec![(name.clone(), unit)];
            directions.push(if k < n_parameters {
                Direction { parameters: list, fields: Vec::new() }
            } else {
                Direction { parameters: Vec::new(), fields: list }
            });
        }
    }
    let found = tangents(of, &made.measures, &directions)?;
    for step in 0..found.times.len() {
        for measure in 0..made.measures.len() {
            made.values.extend(found.moved.iter().map(|column| column[measure][step]));
        }
    }
    Ok(Jacobian { times: found.times, near: found.near, notes: found.notes, solutions: found.solutions, ..made })
}

/// By rows.
fn from(of: Differentiated<'_>, request: &Request, mut made: Jacobian) -> Result<Jacobian, Box<Diagnostic>> {
    made.times = of.outcome.steps.iter().map(|s| s.window.end).collect();
    let n = made.times.len();
    let of_step = |step: usize| {
        made.measures.iter().map(move |measure| {
            let weights = (0..n).map(|k| f64::from(u8::from(k == step))).collect();
            WantedResult { name: measure.clone(), measure: measure.clone(), when: When::Steps(weights) }
        })
    };
    let request = Request { results: (0..n).flat_map(of_step).collect(), ..request.clone() };
    let found = gradients(of, &request)?;
    for row in &found.results {
        made.values.extend(row.parameters.iter().chain(&row.fields).flat_map(|(_, entries)| entries));
    }
    Ok(Jacobian { near: found.near, notes: found.notes, solutions: found.solutions, ..made })
}
