//! Numbers that must be finite, and the message about one that is not.
//!
//! Values given by formulas of a scene (prescribed values, first guesses, known fields, mappings) enter the system
//! through [`crate::value::Value::at_positions`] only, which gives [`NotFinite`] instead of such a number. States and
//! residuals pass [`crate::system::System::residual`], which refuses them. Does not decide what a run does then.

use thiserror::Error;
use wfl::{Code, Diagnostic, SourceId, Span, ast::Expansions};
use wfl_compiler::{NonFinite, locate};
use wfl_host::team::Team;
pub use wfl_sparse::norm::largest;

/// A value of an expression that is not finite.
#[derive(Clone, Debug, Error)]
#[error("{value} at {position:?}")]
pub struct NotFinite {
    /// Infinite, or not a number.
    pub value: f64,
    /// The operation that made it, with its place in the scene, where that is known.
    pub cause: Option<Box<NonFinite>>,
    /// Where.
    pub position: [f64; 3],
}

/// A value that a scene gives and that is not finite.
#[derive(Clone, Debug, Error)]
#[error("{what} is {at}")]
pub struct BadGiven {
    /// What was to get the value: "the prescribed value of `u`".
    pub what: String,
    /// The statement or its expression.
    pub span: Span,
    /// The value.
    pub at: Box<NotFinite>,
}

impl BadGiven {
    /// What the first of several ranks that has met such a value says of it, on all of them.
    ///
    /// # Errors
    /// That value, if there is one.
    pub fn agreed<T>(own: Result<T, Self>, team: &dyn Team) -> Result<T, Self> {
        let Some(rank) = team.first(own.is_err()) else { return own };
        let bad = own.err();
        let told = bad.as_ref().filter(|_| rank == team.rank());
        let [value, x, y, z] = told.map_or([0.0; 4], |bad| {
            let [x, y, z] = bad.at.position;
            [bad.at.value, x, y, z]
        });
        let what = team.of_rank(rank, told.map_or(&[], |bad| bad.what.as_bytes()));
        let span = told.map_or([0; 3], |bad| [bad.span.source.index(), bad.span.start as usize, bad.span.end as usize]);
        #[expect(clippy::cast_precision_loss, reason = "places in texts")]
        let numbers = [&[value, x, y, z][..], &span.map(|n| n as f64)].concat();
        let numbers = team.numbers_of(rank, if told.is_some() { &numbers } else { &[] });
        if let Some(bad) = bad.filter(|_| rank == team.rank()) {
            return Err(bad);
        }
        let [value, x, y, z, source, start, end] = numbers[..] else { unreachable!("seven numbers of one rank") };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "places in texts")]
        let span = Span { source: SourceId::new(source as usize), start: start as u32, end: end as u32 };
        let at = Box::new(NotFinite { value, cause: None, position: [x, y, z] });
        Err(Self { what: String::from_utf8_lossy(&what).into_owned(), span, at })
    }

    /// E610 at the operation that made the value, or at the statement. `time` is the step variable, where there is one.
    #[must_use]
    pub fn diagnostic(&self, expansions: &Expansions, time: Option<f64>) -> Diagnostic {
        let step = time.map_or(String::new(), |t| format!(", step t = {t}"));
        let at = format!("at position {}{step}", position(self.at.position));
        let d = Diagnostic::new(Code::E610, format!("{} is {}", self.what, word(self.at.value)));
        told(d, self.at.cause.as_deref(), &at, expansions, Some((self.span, self.at.value)))
    }
}

/// A measure that is not finite.
#[derive(Clone, Debug)]
pub struct BadMeasure {
    /// Its name.
    pub name: String,
    /// Its expression.
    pub span: Span,
    /// Infinite, or not a number.
    pub value: f64,
    /// The first point where its expression is not finite; `None` where only the sum is not.
    pub at: Option<NotFinite>,
    /// It is a number that other measures make.
    pub is_made: bool,
}

impl BadMeasure {
    /// E611 at the operation that made the value, or at the expression; `time` is the step variable.
    #[must_use]
    pub fn diagnostic(&self, expansions: &Expansions, time: f64) -> Diagnostic {
        let d =
            Diagnostic::new(Code::E611, format!("the measure `{}` is {} at t = {time}", self.name, word(self.value)));
        match &self.at {
            Some(at) => {
                let place = format!("at position {}", position(at.position));
                told(d, at.cause.as_deref(), &place, expansions, Some((self.span, at.value)))
            }
            None if self.is_made => d
                .at(self.span, "made of measures and reductions: one of them is not a number, or a division is by 0")
                .help("`if F > 0 then k/F else 0` gives it a value where that happens"),
            None => {
                d.at(self.span, "finite at every point, but not summed up: values too large, or a region of size 0")
            }
        }
    }
}

/// A quantity of a result file, or a `Print`, that is not finite somewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct BadOutput {
    /// What it is: "`q` in \"base.vtu\"".
    pub what: String,
    /// The step variable when it was first met.
    pub time: f64,
    /// The first such value.
    pub value: f64,
    /// Where.
    pub position: [f64; 3],
}

impl BadOutput {
    /// The text of W610.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { what, time, value, position: x } = self;
        format!("{what} is {} at {}, t = {time}: it has no finite value there", word(*value), position(*x))
    }
}

/// "not a number" or "infinite".
#[must_use]
pub fn word(value: f64) -> &'static str {
    if value.is_nan() { "not a number" } else { "infinite" }
}

/// A diagnostic with the operation that made a number that is not finite. `at` says at which point; `given` is the
/// place of the whole expression and its value, for a cause without a place.
#[must_use]
pub fn told(
    d: Diagnostic,
    cause: Option<&NonFinite>,
    at: &str,
    expansions: &Expansions,
    given: Option<(Span, f64)>,
) -> Diagnostic {
    let d = match cause.and_then(|c| needs(&c.operation)) {
        Some(help) => d.help(help),
        None => d,
    };
    let outside = cause.and_then(|c| c.outside.as_ref());
    let text = cause.map(|c| {
        let operands: Vec<String> = c.operands.iter().map(|o| short(*o)).collect();
        match outside.map(|curve| (curve, curve.range())) {
            None => format!("{}({}) is {} {at}", c.operation, operands.join(", "), c.result),
            Some((curve, (first, last))) => {
                let (file, x) = (&curve.name, operands.join(", "));
                format!("{x} is outside the rows of {file}, which go from {first} to {last}, {at}")
            }
        }
    });
    let d = if outside.is_some() { Diagnostic { code: Code::E447, ..d } } else { d };
    match (cause.and_then(|c| c.origin), text, given) {
        (Some(origin), Some(text), _) => locate(d, origin, expansions, text),
        (None, _, Some((span, value))) => d.at(span, format!("this is {value} {at}")),
        (_, Some(text), None) => d.note(text),
        (_, None, _) => d.note(format!("a field value is not finite {at}")),
    }
}

/// A position as it is shown.
#[must_use]
pub fn position(x: [f64; 3]) -> String {
    let x: Vec<String> = x.iter().map(|c| short(*c)).collect();
    format!("[{}]", x.join(", "))
}

/// Six digits: positions and operands are shown to be recognised, not to be computed with.
#[must_use]
pub fn short(x: f64) -> String {
    let rounded = format!("{x:.6}").parse::<f64>().unwrap_or(x);
    if rounded != 0.0 && x.abs() < 1e6 || x == 0.0 { format!("{rounded}") } else { format!("{x:.5e}") }
}

/// What an operation needs so that its value is finite.
fn needs(operation: &str) -> Option<&'static str> {
    Some(match operation {
        "log" | "log10" => "a logarithm needs a positive argument; log(1 + v) is finite at 0",
        "sqrt" => "a root needs an argument of at least 0, and its derivative one above 0",
        "division" => "the denominator is 0 here",
        "pow" => "a power of a negative number needs a whole exponent; a power of 0 one of at least 0",
        "asin" | "acos" => "the argument lies between -1 and 1",
        "acosh" => "the argument is at least 1",
        "atanh" => "the argument lies between -1 and 1, ends excluded",
        "table" | "table_slope" => "min(t, last row) and max(t, first row) hold the values at the ends",
        "exp" | "sinh" | "cosh" => "the argument is above 709: the value is larger than any number",
        _ => return None,
    })
}

/// An unknown or its equation that has no finite value at a state.
#[derive(Clone, Debug, Error)]
#[error("the {what} of `{field}` is {value} at {position:?}")]
pub struct BadState {
    /// "value" or "residual", or what else became too large for a number.
    pub what: &'static str,
    /// The field.
    pub field: String,
    /// Infinite, or not a number.
    pub value: f64,
    /// Where.
    pub position: [f64; 3],
    /// The largest absolute value of the unknowns at that state.
    pub largest: f64,
}
