//! What is told of steps and iterations, as dictionaries; the classes of the package are made of them in Python.

use numpy::PyArray1;
use pyo3::{prelude::*, types::PyDict};
use wfl_newton::Iteration;
use wfl_run::StepResult;

/// An iteration.
pub(crate) fn iteration<'py>(py: Python<'py>, i: &Iteration) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    made.set_item("number", i.number)?;
    made.set_item("method", i.method.name())?;
    made.set_item("residual", i.residual)?;
    made.set_item("floor", i.floor)?;
    made.set_item("merit", i.merit)?;
    made.set_item("step", i.step)?;
    made.set_item("changed", i.changed)?;
    made.set_item("contact", i.contact.map(|c| (c[0], c[1], c[2])))?;
    Ok(made)
}

/// A step.
pub(crate) fn step<'py>(py: Python<'py>, number: usize, step: &StepResult) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    made.set_item("number", number)?;
    made.set_item("t", step.window.end)?;
    made.set_item("increment", step.window.increment)?;
    made.set_item("converged", step.history.converged())?;
    made.set_item("stop", step.history.stop.map(wfl_newton::Stop::word))?;
    made.set_item("iterations", step.iterations())?;
    made.set_item("attempts", step.attempts.len())?;
    made.set_item("digits", step.accuracy.as_ref().map(wfl_checks::Accuracy::digits))?;
    made.set_item("friction_work", step.friction.map(|f| f.taken))?;
    let history = step.history.iterations.iter().map(|i| iteration(py, i)).collect::<PyResult<Vec<_>>>()?;
    made.set_item("history", history)?;
    let measures = PyDict::new(py);
    for (name, value) in &step.measures {
        measures.set_item(name, value)?;
    }
    made.set_item("measures", measures)?;
    let checks: Vec<_> = step.checks.iter().map(|c| (c.name.clone(), c.value, c.limit, c.holds())).collect();
    made.set_item("checks", checks)?;
    let state = (!step.state.is_empty()).then(|| PyArray1::from_vec(py, step.state.clone()));
    made.set_item("state", state)?;
    Ok(made)
}
