//! The class behind `wfl.Scene`: arguments and arrays in, arrays and dictionaries out.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard, TryLockError},
};

use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::{
    exceptions::{PyKeyError, PyRuntimeError, PyValueError},
    prelude::*,
    types::{PyDict, PyList, PyTuple},
};
use wfl_compiler::types::FieldKind;
use wfl_newton::NewtonError;
use wfl_problem::Source;
use wfl_run::{RunError, Standing, StepResult};

use crate::{
    arrays,
    desk::{Desk, Listeners, Teller},
    outcome::PyOutcome,
    steps,
    told::{self, Told},
    work::{Asked, RunAsked, Work},
};

/// A prepared scene; `wfl.Scene` has the words for it.
#[pyclass(frozen, name = "Scene", module = "wfl._wfl")]
pub(crate) struct PyScene {
    work: Mutex<Work>,
    desk: Arc<Desk>,
}

/// Where a run stands between two steps; `wfl.State` in Python.
#[pyclass(frozen, name = "State", module = "wfl._wfl")]
pub(crate) struct PyStanding {
    standing: Standing,
}

#[pymethods]
impl PyStanding {
    /// The number of steps that were done.
    #[getter]
    fn n_steps(&self) -> usize {
        self.standing.n_steps()
    }

    /// The unknowns there.
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.standing.state().unknowns())
    }

    fn __repr__(&self) -> String {
        let n = self.standing.n_steps();
        format!("<wfl state behind {n} step{}>", if n == 1 { "" } else { "s" })
    }
}

/// Why something could not be done, without Python.
type Failed = Vec<Told>;

impl PyScene {
    /// The scene, unless it is at work.
    pub(crate) fn held(&self) -> PyResult<MutexGuard<'_, Work>> {
        match self.work.try_lock() {
            Ok(work) => Ok(work),
            Err(TryLockError::Poisoned(work)) => Ok(work.into_inner()),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
                "the scene is at work: a function that it calls cannot use it, and neither can another thread",
            )),
        }
    }

    /// Does work that may ask Python.
    pub(crate) fn at_work<T: Send>(
        &self,
        py: Python<'_>,
        listeners: &Listeners,
        job: impl FnOnce(&mut Work, &mut Teller<'_>) -> Result<T, Failed> + Send,
    ) -> PyResult<T> {
        let mut held = self.held()?;
        let work: &mut Work = &mut held;
        let number = work.session.as_ref().map_or(0, |s| s.steps().len());
        let mut teller = Teller {
            desk: &self.desk,
            steps: listeners.on_step.is_some(),
            iterations: listeners.on_iteration.is_some(),
            number,
        };
        let result = self.desk.work(py, listeners, || job(work, &mut teller))?;
        result.map_err(|list| told::error(py, &list))
    }

    /// Does short work that asks nothing.
    fn quickly<T: Send>(&self, py: Python<'_>, job: impl FnOnce(&mut Work) -> Result<T, Failed> + Send) -> PyResult<T> {
        let mut held = self.held()?;
        let work: &mut Work = &mut held;
        py.detach(|| job(work)).map_err(|list| told::error(py, &list))
    }

    fn field(&self, name: &str) -> PyResult<(MutexGuard<'_, Work>, usize)> {
        let work = self.held()?;
        match work.field(name) {
            Some(field) => Ok((work, field)),
            None => Err(PyKeyError::new_err(name.to_owned())),
        }
    }

    /// A vector of all unknowns.
    fn unknowns_of(work: &Work, u: &PyReadonlyArray1<'_, f64>) -> PyResult<Vec<f64>> {
        let n = work.scene.system.numbering.n_dofs;
        let u = u.as_slice()?;
        if u.len() == n { Ok(u.to_vec()) } else { Err(wrong_length("u", u.len(), n)) }
    }
}

fn wrong_length(name: &str, found: usize, needed: usize) -> PyErr {
    PyValueError::new_err(format!("{name} has {found} numbers, and the scene {needed} unknowns"))
}

/// An error of the equations at the step that was begun.
fn of_equations(work: &Work, error: NewtonError) -> Failed {
    let time = work.session.as_ref().map_or(0.0, |session| session.equations().system.step().stage);
    work.stopped(&RunError::Newton { step: 0, time, error })
}

/// A step that may have come to an end, with its number.
type Stepped = Option<(usize, Box<StepResult>)>;

fn told_step(py: Python<'_>, stepped: Stepped) -> PyResult<Option<Bound<'_, PyDict>>> {
    stepped.map(|(number, step)| steps::step(py, number, &step)).transpose()
}

#[pymethods]
impl PyScene {
    #[new]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        text: Option<String>,
        words: Vec<String>,
        left: Vec<String>,
    ) -> PyResult<Self> {
        let desk = Arc::new(Desk::default());
        let asked = Asked { path, text, words, left };
        let made = desk.work(py, &Listeners::default(), || Work::new(&asked))?;
        Ok(Self { work: Mutex::new(made.map_err(|list| told::error(py, &list))?), desk })
    }

    fn check<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let list = self.at_work(py, &Listeners::default(), |work, _| Ok(work.check()))?;
        told::dicts(py, &list)
    }

    #[getter]
    fn name(&self) -> PyResult<String> {
        Ok(self.held()?.loaded.name.clone())
    }

    #[getter]
    fn dim(&self) -> PyResult<usize> {
        Ok(self.held()?.scene.system.mesh.dim())
    }

    #[getter]
    fn n_dofs(&self) -> PyResult<usize> {
        Ok(self.held()?.scene.system.numbering.n_dofs)
    }

    #[getter]
    fn n_cells(&self) -> PyResult<usize> {
        Ok(self.held()?.scene.system.mesh.n_cells())
    }

    #[getter]
    fn step_variable(&self) -> PyResult<Option<String>> {
        Ok(self.held()?.scene.steps.variable.clone())
    }

    /// Parameters: name, sizes of the tensor, numbers with the first index fastest.
    fn params<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for (name, constant) in &self.held()?.scene.params {
            list.append((name, constant.shape.sizes(), &constant.values))?;
        }
        Ok(list)
    }

    /// Fields: name, kind, sizes of the tensor, where they live, nodes, first unknown.
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let work = self.held()?;
        let system = &work.scene.system;
        let list = PyList::empty(py);
        for (k, field) in system.fields.iter().enumerate() {
            let kind = match field.kind {
                FieldKind::Unknown => "unknown",
                FieldKind::Multiplier => "multiplier",
                FieldKind::Data => "data",
                FieldKind::State => "state",
            };
            let sizes = work.scene.sigs[k].shape.sizes();
            let place = work.place_word(k);
            list.append((&field.name, kind, sizes, place, field.n_nodes(), system.numbering.starts[k]))?;
        }
        Ok(list)
    }

    /// Positions of the nodes of a field.
    fn points<'py>(&self, py: Python<'py>, field: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (work, k) = self.field(field)?;
        let f = &work.scene.system.fields[k];
        let positions: Vec<[f64; 3]> = (0..f.n_nodes()).map(|n| f.node_position(n)).collect();
        arrays::points(py, &positions, work.scene.system.mesh.dim())
    }

    /// Cells of a field on its nodes, see `arrays::cells`.
    fn cells<'py>(&self, py: Python<'py>, field: &str) -> PyResult<Option<Bound<'py, PyList>>> {
        let (work, k) = self.field(field)?;
        wfl_run::field_cells(&work.scene.system.fields[k]).map(|cells| arrays::cells(py, &cells)).transpose()
    }

    /// Regions: name and members.
    fn regions(&self) -> PyResult<Vec<(String, usize)>> {
        Ok(self.held()?.scene.regions.iter().map(|(name, r)| (name.clone(), r.set.len())).collect())
    }

    /// Free unknowns, in the order of residuals.
    fn free<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let free = self.held()?.scene.system.numbering.free_dofs.iter().map(|d| i64::from(*d)).collect();
        Ok(PyArray1::from_vec(py, free))
    }

    #[getter]
    fn times(&self) -> PyResult<Vec<f64>> {
        Ok(self.held()?.scene.steps.values.clone())
    }

    #[setter]
    fn set_times(&self, py: Python<'_>, values: Vec<f64>) -> PyResult<()> {
        let mut work = self.held()?;
        work.scene.set_steps(&values).map_err(|e| told::refused(py, &e.to_string()))?;
        work.given.insert("steps".to_owned());
        work.changes += 1;
        work.session = None;
        Ok(())
    }

    /// Gives a field its values: `source(positions, t, increment)` returns them in one block.
    fn give(&self, py: Python<'_>, name: &str, source: Py<PyAny>, as_start: bool) -> PyResult<()> {
        let mut work = self.held()?;
        let (source, desk) = (Arc::new(source), Arc::clone(&self.desk));
        let asked: Source = Box::new(move |positions, step| desk.ask(&source, positions, [step.stage, step.increment]));
        let span = work.span_of(name).ok_or_else(|| PyKeyError::new_err(name.to_owned()))?;
        let scene = &mut work.scene;
        let given = if as_start { scene.give_start(name, span, asked) } else { scene.give_data(name, span, asked) };
        given.map_err(|e| told::refused(py, &e.to_string()))?;
        work.given.insert(name.to_owned());
        work.changes += 1;
        work.session = None;
        Ok(())
    }

    /// Runs all steps: what became of it, and the outcome that pictures are made of. `keep` says whether the states of all
    /// steps are kept, the outputs, and what derivatives need; `hooks` are called after steps and iterations.
    fn run<'py>(
        slf: &Bound<'py, Self>,
        out: Option<PathBuf>,
        threads: Option<usize>,
        keep: (bool, bool, bool),
        hooks: (Option<Py<PyAny>>, Option<Py<PyAny>>),
    ) -> PyResult<(Bound<'py, PyDict>, PyOutcome)> {
        let (keep_states, keep_outputs, keep_trajectory) = keep;
        let asked = RunAsked { out, threads, keep_states, keep_outputs, keep_trajectory };
        let listeners = Listeners { on_step: hooks.0, on_iteration: hooks.1 };
        let finished = slf.get().at_work(slf.py(), &listeners, |work, teller| {
            teller.number = 0;
            work.run(&asked, teller)
        })?;
        PyOutcome::told(slf.py(), finished, slf.get().dim()?)
    }

    /// The next step that the scene lists.
    fn step<'py>(&self, py: Python<'py>, on_iteration: Option<Py<PyAny>>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let listeners = Listeners { on_iteration, ..Listeners::default() };
        let stepped = self.at_work(py, &listeners, |work, teller| {
            let (session, scene) = work.session()?;
            let number = session.steps().len();
            match session.step(scene, teller) {
                Ok(step) => Ok(step.map(|step| (number, Box::new(step.clone())))),
                Err(error) => Err(work.stopped(&error)),
            }
        })?;
        told_step(py, stepped)
    }

    /// A step to a value of the step variable.
    fn step_to<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        on_iteration: Option<Py<PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let listeners = Listeners { on_iteration, ..Listeners::default() };
        let stepped = self.at_work(py, &listeners, |work, teller| {
            let (session, scene) = work.session()?;
            let number = session.steps().len();
            match session.step_to(scene, t, teller) {
                Ok(step) => Ok(Some((number, Box::new(step.clone())))),
                Err(error) => Err(work.stopped(&error)),
            }
        })?;
        told_step(py, stepped)
    }

    /// Forgets the steps that were taken one by one.
    fn restart(&self) -> PyResult<()> {
        self.held()?.session = None;
        Ok(())
    }

    /// Where the run stands between two steps.
    fn standing(&self, py: Python<'_>) -> PyResult<PyStanding> {
        self.at_work(py, &Listeners::default(), |work, _| {
            let (session, scene) = work.session()?;
            match session.standing(scene) {
                Ok(standing) => Ok(PyStanding { standing }),
                Err(error) => Err(work.stopped(&error)),
            }
        })
    }

    /// Goes back to where the run has stood.
    fn go_back(&self, py: Python<'_>, to: &Bound<'_, PyStanding>) -> PyResult<()> {
        let to = to.get().standing.clone();
        self.at_work(py, &Listeners::default(), |work, teller| {
            let (session, scene) = work.session()?;
            match session.go_back(scene, &to, teller) {
                Ok(()) => Ok(()),
                Err(error) => Err(work.stopped(&error)),
            }
        })
    }

    /// The unknowns between two steps.
    fn unknowns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let u = self.at_work(py, &Listeners::default(), |work, _| Ok(work.session()?.0.unknowns().to_vec()))?;
        Ok(PyArray1::from_vec(py, u))
    }

    fn set_unknowns(&self, py: Python<'_>, u: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let u = Self::unknowns_of(&*self.held()?, &u)?;
        self.at_work(py, &Listeners::default(), |work, _| {
            let (session, scene) = work.session()?;
            session.set_unknowns(scene, &u);
            Ok(())
        })
    }

    /// Begins a step for a caller who solves it.
    fn begin<'py>(&self, py: Python<'py>, t: f64) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let u = self.at_work(py, &Listeners::default(), |work, _| {
            let (session, scene) = work.session()?;
            match session.begin(scene, t) {
                Ok(u) => Ok(u.to_vec()),
                Err(error) => Err(work.stopped(&error)),
            }
        })?;
        Ok(PyArray1::from_vec(py, u))
    }

    fn residual<'py>(&self, py: Python<'py>, u: PyReadonlyArray1<'_, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let u = Self::unknowns_of(&*self.held()?, &u)?;
        let r = self.quickly(py, |work| {
            let (session, _) = work.begun()?;
            session.residual(&u).map_err(|e| of_equations(work, e))
        })?;
        Ok(PyArray1::from_vec(py, r))
    }

    fn forces<'py>(&self, py: Python<'py>, u: PyReadonlyArray1<'_, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let u = Self::unknowns_of(&*self.held()?, &u)?;
        let r = self.quickly(py, |work| {
            let (session, _) = work.begun()?;
            session.forces(&u).map_err(|e| of_equations(work, e))
        })?;
        Ok(PyArray1::from_vec(py, r))
    }

    fn tangent<'py>(&self, py: Python<'py>, u: PyReadonlyArray1<'_, f64>) -> PyResult<Bound<'py, PyTuple>> {
        let u = Self::unknowns_of(&*self.held()?, &u)?;
        let matrix = self.quickly(py, |work| {
            let (session, _) = work.begun()?;
            session.tangent(&u).map_err(|e| of_equations(work, e))
        })?;
        arrays::csr(py, &matrix)
    }

    /// `u` moved by a part of a correction of the free unknowns.
    fn advance<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray1<'_, f64>,
        correction: PyReadonlyArray1<'_, f64>,
        part: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let work = self.held()?;
        let (numbering, correction) = (&work.scene.system.numbering, correction.as_slice()?);
        let start = Self::unknowns_of(&work, &u)?;
        if correction.len() != numbering.n_free() {
            return Err(wrong_length("the correction", correction.len(), numbering.n_free()));
        }
        let mut moved = start.clone();
        numbering.advance(&start, correction, part, &mut moved);
        Ok(PyArray1::from_vec(py, moved))
    }

    /// Takes a state as the end of the step that was begun.
    fn accept<'py>(&self, py: Python<'py>, u: PyReadonlyArray1<'_, f64>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let u = Self::unknowns_of(&*self.held()?, &u)?;
        let stepped = self.at_work(py, &Listeners::default(), |work, teller| {
            let (session, scene) = work.begun()?;
            if !session.has_begun() {
                return Err(Work::not_begun());
            }
            let number = session.steps().len();
            match session.accept(scene, &u, teller) {
                Ok(step) => Ok(Some((number, Box::new(step.clone())))),
                Err(error) => Err(work.stopped(&error)),
            }
        })?;
        told_step(py, stepped)
    }

    /// Ends the steps that were taken one by one.
    fn result<'py>(&self, py: Python<'py>) -> PyResult<Option<(Bound<'py, PyDict>, PyOutcome)>> {
        let finished = self.quickly(py, |work| Ok(work.end_session()))?;
        let dim = self.dim()?;
        finished.map(|finished| PyOutcome::told(py, finished, dim)).transpose()
    }

    /// The bodies with the fields on them, at a state; `known` are the values of data and states by field.
    fn grids<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray1<'_, f64>,
        known: Vec<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let known = known.iter().map(|v| Ok(v.as_slice()?.to_vec())).collect::<PyResult<Vec<_>>>()?;
        let u = Self::unknowns_of(&*self.held()?, &u)?;
        let pieces = self.quickly(py, |work| {
            let pieces = wfl_run::field_grids(&work.scene, &known, &u);
            pieces.map_err(|e| vec![Told::text(&format!("error: {e}\n"))])
        })?;
        pieces.iter().map(|piece| arrays::piece(py, piece)).collect()
    }
}
