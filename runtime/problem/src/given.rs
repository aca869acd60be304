//! Values at the nodes of a field: of a formula, a file, or the caller of the runtime.
//!
//! Promises: a caller is asked once for each value of the step variable and its increment, however many attempts a step
//! takes; numbers that are not finite, or too few, are an error before anything is assembled.

use std::{
    fmt,
    sync::{Mutex, MutexGuard, PoisonError},
};

use wfl::Span;
use wfl_discrete::{
    finite::{BadGiven, NotFinite},
    value::Value,
    window::Window,
};

/// Values at the nodes of a field.
pub enum Given {
    /// A formula of the position and the step variable, of what it gives the values, and where it stands.
    Formula(Box<Value>, String, Span),
    /// Numbers from a file: `values[node * n_components + component]`.
    Values(Vec<f64>),
    /// Numbers that the caller gives.
    Caller(CallerValues),
}

impl Given {
    /// The values at the positions of all nodes, at a step.
    ///
    /// # Errors
    /// [`BadGiven`] for a value that is not finite.
    pub fn at(&self, positions: &[[f64; 3]], window: Window) -> Result<Vec<f64>, BadGiven> {
        match self {
            Given::Formula(value, what, span) => {
                let found = value.at_step(window).at_positions(positions);
                found.map_err(|at| BadGiven { what: what.clone(), span: *span, at: Box::new(at) })
            }
            Given::Values(values) => Ok(values.clone()),
            Given::Caller(caller) => caller.at(positions, window),
        }
    }
}

impl Given {
    /// Asks the caller anew for what it has given before.
    pub(crate) fn forget(&self) {
        if let Given::Caller(caller) = self {
            caller.forget();
        }
    }
}

/// Gives the values of a field at a step: `f(positions, step)` with the positions of its nodes
/// (length; unused coordinates zero) returns `values[node * n_components + component]`; `None` where it failed, which the
/// caller of the runtime knows.
pub type Source = Box<dyn FnMut(&[[f64; 3]], Window) -> Option<Vec<f64>> + Send + Sync>;

/// A source, and what it said last, with the step variable and the increment that it was asked for.
struct Asked {
    source: Source,
    last: Option<([u64; 2], Vec<f64>)>,
}

/// The values of one field, given by the caller.
pub struct CallerValues {
    asked: Mutex<Asked>,
    what: String,
    span: Span,
    n_dofs: usize,
}

impl CallerValues {
    /// Zeros at `n_dofs` dofs until the caller gives a source.
    pub(super) fn nothing(name: &str, n_dofs: usize, span: Span) -> Self {
        Self::new(name, n_dofs, span, Box::new(move |_, _| Some(vec![0.0; n_dofs])))
    }

    pub(super) fn new(name: &str, n_dofs: usize, span: Span, source: Source) -> Self {
        Self {
            asked: Mutex::new(Asked { source, last: None }),
            what: format!("what the caller gives for `{name}`"),
            span,
            n_dofs,
        }
    }

    /// Asks the source again, whatever it has said.
    pub(super) fn forget(&self) {
        self.asked().last = None;
    }

    fn asked(&self) -> MutexGuard<'_, Asked> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The values at a step.
    pub(super) fn at(&self, positions: &[[f64; 3]], window: Window) -> Result<Vec<f64>, BadGiven> {
        let step = [window.stage, window.increment].map(f64::to_bits);
        let mut asked = self.asked();
        if let Some((known, values)) = &asked.last
            && *known == step
        {
            return Ok(values.clone());
        }
        let bad = |value: f64, position: [f64; 3]| BadGiven {
            what: self.what.clone(),
            span: self.span,
            at: Box::new(NotFinite { value, cause: None, position }),
        };
        let values = (asked.source)(positions, window).filter(|v| v.len() == self.n_dofs);
        let Some(values) = values else { return Err(bad(f64::NAN, [0.0; 3])) };
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            let n_components = (self.n_dofs / positions.len().max(1)).max(1);
            return Err(bad(values[at], positions.get(at / n_components).copied().unwrap_or_default()));
        }
        asked.last = Some((step, values.clone()));
        Ok(values)
    }
}

impl fmt::Debug for CallerValues {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CallerValues({}, {} numbers)", self.what, self.n_dofs)
    }
}
