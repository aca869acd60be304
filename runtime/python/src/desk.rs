//! Work on a thread of its own while the caller's thread waits, answers what Python is asked for, and hears Ctrl-C.
//!
//! Promises: the interpreter is released while nothing is asked; Python code runs on the thread that called; an exception
//! in it, or a signal, stops the work before its next iteration and is raised afterwards. Long work has a stack like that
//! of the command.

use std::{
    panic::resume_unwind,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, SyncSender},
    },
    thread,
    time::Duration,
};

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::{exceptions::PyRuntimeError, prelude::*};
use wfl_newton::Iteration;
use wfl_run::{Progress, StepResult};
use wfl_tasks::STACK;

use crate::{arrays, steps};

/// How often signals are looked for while nothing is asked: short against the patience of who pressed Ctrl-C.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// What the worker wants from Python.
enum Errand {
    /// The values of a field at the positions of its nodes.
    Values { source: Arc<Py<PyAny>>, positions: Vec<[f64; 3]>, step: [f64; 2], reply: SyncSender<Option<Vec<f64>>> },
    /// A step has ended.
    Step { number: usize, step: Box<StepResult>, reply: SyncSender<()> },
    /// An iteration has ended.
    Iteration(Box<Iteration>),
    /// The work is done.
    Done,
}

/// Who is told of steps and iterations.
#[derive(Default)]
pub(crate) struct Listeners {
    pub(crate) on_step: Option<Py<PyAny>>,
    pub(crate) on_iteration: Option<Py<PyAny>>,
}

/// Where the worker's errands go.
#[derive(Default)]
pub(crate) struct Desk {
    errands: Mutex<Option<mpsc::Sender<Errand>>>,
    failure: Mutex<Option<PyErr>>,
    stop: AtomicBool,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Desk {
    /// Does work that may ask Python.
    pub(crate) fn work<T: Send>(
        &self,
        py: Python<'_>,
        listeners: &Listeners,
        work: impl FnOnce() -> T + Send,
    ) -> PyResult<T> {
        let (sender, receiver) = mpsc::channel();
        *locked(&self.errands) = Some(sender.clone());
        *locked(&self.failure) = None;
        self.stop.store(false, Ordering::Relaxed);
        let done = move || {
            let result = work();
            // nobody waits any more after a panic of the other side
            let _ = sender.send(Errand::Done);
            result
        };
        let result = thread::scope(|scope| {
            let worker = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, done);
            let worker = worker.map_err(|e| PyRuntimeError::new_err(format!("no thread to work on: {e}")))?;
            let mut receiver = receiver;
            while !worker.is_finished() {
                let (errand, back) = py.detach(move || wait(receiver));
                receiver = back;
                match errand {
                    Some(Errand::Done) => break,
                    Some(errand) => self.answer(py, listeners, errand),
                    None => {}
                }
                if let Err(signal) = py.check_signals() {
                    self.fail(signal);
                }
            }
            Ok::<_, PyErr>(py.detach(|| worker.join()))
        });
        *locked(&self.errands) = None;
        let result = result?.unwrap_or_else(|panic| resume_unwind(panic));
        match locked(&self.failure).take() {
            Some(failure) => Err(failure),
            None => Ok(result),
        }
    }

    /// Stops the work; the first failure is the one that is raised.
    fn fail(&self, failure: PyErr) {
        self.stop.store(true, Ordering::Relaxed);
        locked(&self.failure).get_or_insert(failure);
    }

    fn answer(&self, py: Python<'_>, listeners: &Listeners, errand: Errand) {
        match errand {
            Errand::Values { source, positions, step, reply } => {
                let values = if self.is_stopped() { None } else { self.values(py, &source, &positions, step) };
                let _ = reply.send(values);
            }
            Errand::Step { number, step, reply } => {
                if let Some(on_step) = &listeners.on_step {
                    let told = steps::step(py, number, &step).and_then(|step| on_step.call1(py, (step,)));
                    told.map_or_else(|e| self.fail(e), drop);
                }
                let _ = reply.send(());
            }
            Errand::Iteration(iteration) => {
                if let Some(on_iteration) = &listeners.on_iteration {
                    let told = steps::iteration(py, &iteration).and_then(|i| on_iteration.call1(py, (i,)));
                    told.map_or_else(|e| self.fail(e), drop);
                }
            }
            Errand::Done => {}
        }
    }

    fn values(&self, py: Python<'_>, source: &Py<PyAny>, positions: &[[f64; 3]], step: [f64; 2]) -> Option<Vec<f64>> {
        let asked = || -> PyResult<Vec<f64>> {
            let found = source.bind(py).call1((arrays::points(py, positions, 3)?, step[0], step[1]))?;
            let found: PyReadonlyArray1<'_, f64> = found.cast::<PyArray1<f64>>().map_err(PyErr::from)?.readonly();
            Ok(found.as_slice()?.to_vec())
        };
        asked().map_err(|e| self.fail(e)).ok()
    }

    /// True if the work is to end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn send(&self, errand: Errand) -> bool {
        locked(&self.errands).as_ref().is_some_and(|sender| sender.send(errand).is_ok())
    }

    /// Asks for the values of a field, from the thread that works.
    pub(crate) fn ask(&self, source: &Arc<Py<PyAny>>, positions: &[[f64; 3]], step: [f64; 2]) -> Option<Vec<f64>> {
        let (reply, answer) = mpsc::sync_channel(1);
        let (source, positions) = (Arc::clone(source), positions.to_vec());
        self.send(Errand::Values { source, positions, step, reply }).then(|| answer.recv().ok().flatten()).flatten()
    }
}

/// The next errand, or nothing for a while.
fn wait(receiver: Receiver<Errand>) -> (Option<Errand>, Receiver<Errand>) {
    let errand = receiver.recv_timeout(SIGNALS_EVERY).ok();
    (errand, receiver)
}

/// Tells the desk of a run.
pub(crate) struct Teller<'d> {
    pub(crate) desk: &'d Desk,
    pub(crate) steps: bool,
    pub(crate) iterations: bool,
    /// Number of the next step.
    pub(crate) number: usize,
}

impl Progress for Teller<'_> {
    fn iteration(&mut self, iteration: &Iteration) {
        if self.iterations {
            self.desk.send(Errand::Iteration(Box::new(iteration.clone())));
        }
    }

    fn step_done(&mut self, step: &StepResult) {
        if self.steps {
            let (reply, answer) = mpsc::sync_channel(1);
            if self.desk.send(Errand::Step { number: self.number, step: Box::new(step.clone()), reply }) {
                let _ = answer.recv();
            }
        }
        self.number += 1;
    }

    fn stops(&mut self) -> bool {
        self.desk.is_stopped()
    }
}
