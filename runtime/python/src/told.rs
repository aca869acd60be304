//! Messages for Python: code, text, place, and the rendering that the command prints.

use pyo3::{prelude::*, types::PyDict};
use wfl::{Diagnostic, SourceMap, one_per_cause, render, visible};
use wfl_tasks::ending::Said;

/// A message.
#[derive(Clone, Debug, Default)]
pub(crate) struct Told {
    pub(crate) code: String,
    pub(crate) is_error: bool,
    pub(crate) text: String,
    /// File, line and column, counted from 1, where it has a place.
    pub(crate) place: Option<(String, usize, usize)>,
    pub(crate) rendered: String,
}

impl Told {
    /// The message of a diagnostic.
    pub(crate) fn diagnostic(d: &Diagnostic, sources: &SourceMap) -> Self {
        let rendered = render(d, sources);
        let place = d.labels.first().map(|label| {
            let (line, column) = sources.line_column(label.span);
            (sources.get(label.span.source).name.clone(), line, column)
        });
        Self { place, is_error: d.is_error(), ..Self::text(&rendered) }
    }

    /// A message that is a text already: `error[E602]: what is wrong`, then notes and helps.
    pub(crate) fn text(rendered: &str) -> Self {
        let rendered = visible(rendered);
        let first = rendered.lines().next().unwrap_or_default();
        let (head, text) = first.split_once(": ").unwrap_or(("error", first));
        let code = head.split_once('[').and_then(|(_, code)| code.strip_suffix(']')).unwrap_or_default().to_owned();
        Self { code, is_error: !head.starts_with("warning"), text: text.to_owned(), place: None, rendered }
    }

    pub(crate) fn said(said: &Said, sources: &SourceMap) -> Self {
        match said {
            Said::Message(d) => Self::diagnostic(d, sources),
            Said::Text(text) => Self::text(text),
        }
    }

    fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let made = PyDict::new(py);
        made.set_item("code", &self.code)?;
        made.set_item("severity", if self.is_error { "error" } else { "warning" })?;
        made.set_item("text", &self.text)?;
        let (file, line, column) = match &self.place {
            Some((file, line, column)) => (Some(file), Some(line), Some(column)),
            None => (None, None, None),
        };
        made.set_item("file", file)?;
        made.set_item("line", line)?;
        made.set_item("column", column)?;
        made.set_item("rendered", &self.rendered)?;
        Ok(made)
    }
}

/// Messages as the command shows them: each cause once.
pub(crate) fn all(diagnostics: &[Diagnostic], sources: &SourceMap) -> Vec<Told> {
    let (told, more) = one_per_cause(diagnostics, sources);
    let mut list: Vec<Told> = told.iter().map(|d| Told::diagnostic(d, sources)).collect();
    for (code, more) in more {
        let rendered = format!("{more} more messages with the code {code}\n");
        list.push(Told { code: code.to_string(), text: rendered.trim_end().to_owned(), rendered, ..Told::default() });
    }
    list
}

/// Messages as dictionaries.
pub(crate) fn dicts<'py>(py: Python<'py>, list: &[Told]) -> PyResult<Vec<Bound<'py, PyDict>>> {
    list.iter().map(|told| told.dict(py)).collect()
}

/// `wfl.WflError` with these messages.
pub(crate) fn error(py: Python<'_>, list: &[Told]) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let class = py.import("wfl._messages")?.getattr("WflError")?;
        let from = class.getattr("_from")?;
        Ok(PyErr::from_value(from.call1((dicts(py, list)?,))?))
    };
    made().unwrap_or_else(|e| e)
}

/// `wfl.WflError` with a text.
pub(crate) fn refused(py: Python<'_>, text: &str) -> PyErr {
    error(py, &[Told::text(&format!("error: {text}\n"))])
}
