//! What became of a run, for Python, and the pictures of it.

use std::path::PathBuf;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::{prelude::*, types::PyDict};
use wfl_contact::ContactPoints;
use wfl_gradient::{Differentiated, Direction, NearKink, Request, When, gradients, jacobian, tangents};
use wfl_report::{Pages, RunFolder};
use wfl_run::save;
use wfl_tasks::ending::Ending;

use crate::{arrays, desk::Listeners, scene::PyScene, steps, told, work::Finished};

/// A run that has ended; `wfl.Result` has the words for it.
#[pyclass(frozen, name = "Outcome", module = "wfl._wfl")]
pub(crate) struct PyOutcome {
    finished: Finished,
}

/// A chart: its name, its title and its SVG.
type Chart = (String, String, String);

impl PyOutcome {
    /// What is told of a run.
    pub(crate) fn told<'py>(
        py: Python<'py>,
        finished: Finished,
        dim: usize,
    ) -> PyResult<(Bound<'py, PyDict>, PyOutcome)> {
        let made = PyDict::new(py);
        let outcome = &finished.outcome;
        let all = outcome.steps.iter().enumerate().map(|(k, s)| steps::step(py, k, s)).collect::<PyResult<Vec<_>>>()?;
        made.set_item("steps", all)?;
        made.set_item("messages", told::dicts(py, &finished.told)?)?;
        made.set_item("ending", word(finished.ending))?;
        made.set_item("summary", &finished.summary)?;
        made.set_item("files", &outcome.files)?;
        made.set_item("report", serde_json::to_string(&outcome.report).unwrap_or_default())?;
        let known = finished.known.iter().map(|v| PyArray1::from_vec(py, v.clone())).collect::<Vec<_>>();
        made.set_item("known", known)?;
        let contact = PyDict::new(py);
        for (region, points) in &finished.contact {
            contact.set_item(region, contact_arrays(py, points, dim)?)?;
        }
        made.set_item("contact", contact)?;
        made.set_item("kept", kept(py, &finished)?)?;
        Ok((made, PyOutcome { finished }))
    }
}

fn word(ending: Ending) -> &'static str {
    match ending {
        Ending::Done => "done",
        Ending::NotConverged => "not_converged",
        Ending::NotFinite => "not_finite",
        Ending::NotAsExpected => "not_as_expected",
    }
}

fn contact_arrays<'py>(py: Python<'py>, points: &ContactPoints, dim: usize) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    made.set_item("points", arrays::points(py, &points.positions, dim)?)?;
    made.set_item("weights", PyArray1::from_vec(py, points.weights.clone()))?;
    made.set_item("normals", arrays::points(py, &points.normals, dim)?)?;
    let states: Vec<u8> = points.states.iter().map(|s| *s as u8).collect();
    made.set_item("state", PyArray1::from_vec(py, states))?;
    made.set_item("gap", PyArray1::from_vec(py, points.gaps.clone()))?;
    made.set_item("slip", arrays::points(py, &points.slips, dim)?)?;
    made.set_item("traction", arrays::points(py, &points.tractions, dim)?)?;
    Ok(made)
}

/// The outputs that stayed in memory: number and value of the step, grids by name, tables by file.
fn kept<'py>(py: Python<'py>, finished: &Finished) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let mut list = Vec::new();
    for step in &finished.outcome.kept {
        let made = PyDict::new(py);
        made.set_item("number", step.number)?;
        made.set_item("t", step.time)?;
        let grids = PyDict::new(py);
        for (name, pieces) in &step.grids {
            let pieces = pieces.iter().map(|p| arrays::piece(py, p)).collect::<PyResult<Vec<_>>>()?;
            grids.set_item(name, pieces)?;
        }
        made.set_item("grids", grids)?;
        let tables = PyDict::new(py);
        for table in &step.tables {
            let flat: Vec<f64> = table.rows.iter().flatten().copied().collect();
            let rows = PyArray1::from_vec(py, flat).reshape([table.rows.len(), table.columns.len()])?;
            tables.set_item(&table.file, (&table.columns, rows))?;
        }
        made.set_item("tables", tables)?;
        list.push(made);
    }
    Ok(list)
}

/// What there is to tell of derivatives.
fn tell(made: &Bound<'_, PyDict>, near: &[NearKink], notes: &[String]) -> PyResult<()> {
    made.set_item("warnings", near.iter().map(|near| near.finding().line()).collect::<Vec<_>>())?;
    made.set_item("notes", notes)
}

impl PyOutcome {
    /// The derivatives of the one result of a request.
    fn followed<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'_, PyScene>,
        request: &Request,
    ) -> PyResult<Bound<'py, PyDict>> {
        // data may be those of functions of the caller, which are asked again
        let asks = Listeners::default();
        let make = |of: Differentiated<'_>| gradients(of, request);
        let found = scene.get().at_work(py, &asks, |work, _| work.differentiated(&self.finished, make))?;
        let made = PyDict::new(py);
        for gradient in &found.results {
            made.set_item("value", gradient.value)?;
            let parameters = PyDict::new(py);
            for (name, entries) in &gradient.parameters {
                parameters.set_item(name, PyArray1::from_slice(py, entries))?;
            }
            made.set_item("parameters", parameters)?;
            let fields = PyDict::new(py);
            for (name, values) in &gradient.fields {
                fields.set_item(name, PyArray1::from_slice(py, values))?;
            }
            made.set_item("fields", fields)?;
            let sides = PyDict::new(py);
            for side in &gradient.sides {
                let both = PyDict::new(py);
                both.set_item("larger", PyArray1::from_slice(py, &side.larger))?;
                both.set_item("smaller", PyArray1::from_slice(py, &side.smaller))?;
                sides.set_item(&side.parameter, both)?;
            }
            made.set_item("sides", sides)?;
        }
        tell(&made, &found.near, &found.notes)?;
        Ok(made)
    }
}

#[pymethods]
impl PyOutcome {
    /// The derivatives of a result: its value, by parameter and by data field its numbers, and what there is to tell. `sides`
    /// are parameters with derivatives to one side, too; empty for none.
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'_, PyScene>,
        result: &str,
        with: &str,
        sides: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let refused = |why: String| told::refused(py, &format!("error: {why}\n"));
        let mut request = Request::read(result, with).map_err(refused)?;
        if !sides.is_empty() {
            request.read_sides(sides).map_err(refused)?;
        }
        self.followed(py, scene, &request)
    }

    /// The derivatives of the sum of measures at all steps, each times its number, as [`Self::gradient`].
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'_, PyScene>,
        weights: Vec<(String, Vec<f64>)>,
        with: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let names: Vec<&str> = weights.iter().map(|w| w.0.as_str()).collect();
        let mut request =
            Request::read(&names.join(", "), with).map_err(|why| told::refused(py, &format!("error: {why}\n")))?;
        for (result, (_, numbers)) in request.results.iter_mut().zip(weights) {
            result.when = When::Steps(numbers);
        }
        request.together = true;
        self.followed(py, scene, &request)
    }

    /// What measures do along a direction of parameters and data fields: by step and measure.
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'_, PyScene>,
        measures: Vec<String>,
        parameters: Vec<(String, Vec<f64>)>,
        fields: Vec<(String, Vec<f64>)>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (asks, direction) = (Listeners::default(), [Direction { parameters, fields }]);
        let make = |of: Differentiated<'_>| tangents(of, &measures, &direction);
        let found = scene.get().at_work(py, &asks, |work, _| work.differentiated(&self.finished, make))?;
        let made = PyDict::new(py);
        let by_measure = found.moved.first().map_or(&[][..], Vec::as_slice);
        let flat: Vec<f64> = (0..found.times.len()).flat_map(|step| by_measure.iter().map(move |m| m[step])).collect();
        made.set_item("values", PyArray1::from_vec(py, flat).reshape([found.times.len(), measures.len()])?)?;
        tell(&made, &found.near, &found.notes)?;
        Ok(made)
    }

    /// Derivatives of measures at all steps in all entries of parameters and data fields.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'_, PyScene>,
        measures: &str,
        with: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let request = Request::read(measures, with).map_err(|why| told::refused(py, &format!("error: {why}\n")))?;
        let asks = Listeners::default();
        let make = |of: Differentiated<'_>| jacobian(of, &request);
        let found = scene.get().at_work(py, &asks, |work, _| work.differentiated(&self.finished, make))?;
        let made = PyDict::new(py);
        let shape = [found.times.len(), found.measures.len(), found.columns.iter().map(|c| c.1).sum()];
        made.set_item("values", PyArray1::from_vec(py, found.values).reshape(shape)?)?;
        tell(&made, &found.near, &found.notes)?;
        Ok(made)
    }

    /// The page about the run and its charts, made in `folder`, which is the folder of its results or an empty one.
    fn pages(
        &self,
        py: Python<'_>,
        scene: &Bound<'_, PyScene>,
        folder: PathBuf,
        at: Vec<f64>,
    ) -> PyResult<(String, Vec<Chart>)> {
        let held = scene.get().held()?;
        let (prepared, finished) = (&held.scene, &self.finished);
        let made = py.detach(|| -> Result<_, String> {
            if finished.options.out.is_none() {
                save(prepared, &finished.options, &finished.outcome, &folder).map_err(|e| e.to_string())?;
            }
            let run = RunFolder::read(&folder).map_err(|e| e.to_string())?;
            let pages = Pages::new(&run, &at).map_err(|e| e.to_string())?;
            let charts = pages.pictures.iter().map(|p| (p.name.clone(), p.chart.title().to_owned(), p.chart.svg()));
            Ok((pages.page.html(), charts.collect()))
        });
        made.map_err(|why| told::refused(py, &why))
    }
}
