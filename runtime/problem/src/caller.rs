//! What the caller of the runtime gives to a scene that is prepared: data fields, first values, steps.
//!
//! A run with such values does not follow from texts alone: whoever writes results says so in the settings of the run.

use thiserror::Error;
use wfl::Span;
use wfl_compiler::types::FieldKind;

use super::{
    Scene,
    given::{CallerValues, Given, Source},
    options::Equal,
};

/// Why values cannot be given to a scene.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum GiveError {
    /// No such field.
    #[error("the scene has no field `{name}`; its fields are {known}")]
    NoField {
        /// The name.
        name: String,
        /// The fields of the scene.
        known: String,
    },
    /// A field that is solved for, given as data, or the other way round.
    #[error("`{name}` is {is}: {help}")]
    OtherKind {
        /// The field.
        name: String,
        /// What it is.
        is: &'static str,
        /// What to do.
        help: &'static str,
    },
    /// Values of the step variable that no run can have.
    #[error("the values of the step variable {why}")]
    Steps {
        /// What is wrong with them.
        why: &'static str,
    },
}

impl Scene {
    fn field_named(&self, name: &str) -> Result<usize, GiveError> {
        let fields = &self.system.fields;
        let known = || fields.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = fields.iter().position(|f| f.name == name);
        found.ok_or_else(|| GiveError::NoField { name: name.to_owned(), known: known() })
    }

    fn caller_values(&self, field: usize, span: Span, source: Source) -> Given {
        let f = &self.system.fields[field];
        Given::Caller(CallerValues::new(&f.name, f.n_dofs(), span, source))
    }

    /// Gives a data field its values from now on, in place of what the scene says; messages about them are at `span`.
    ///
    /// # Errors
    /// [`GiveError`] for a name that is no data field.
    pub fn give_data(&mut self, name: &str, span: Span, source: Source) -> Result<(), GiveError> {
        let field = self.field_named(name)?;
        if self.system.fields[field].kind != FieldKind::Data {
            let (is, help) = ("not data", "its first values are given as a start");
            return Err(GiveError::OtherKind { name: name.to_owned(), is, help });
        }
        let given = self.caller_values(field, span, source);
        put(&mut self.data, field, given);
        Ok(())
    }

    /// Gives an unknown, a multiplier or a state its first values, in place of what the scene says. A run that begins
    /// afterwards starts from them; messages about them are at `span`.
    ///
    /// # Errors
    /// [`GiveError`] for a name of no such field.
    pub fn give_start(&mut self, name: &str, span: Span, source: Source) -> Result<(), GiveError> {
        let field = self.field_named(name)?;
        if self.system.fields[field].kind == FieldKind::Data {
            let (is, help) = ("data", "its values are given as data");
            return Err(GiveError::OtherKind { name: name.to_owned(), is, help });
        }
        let given = self.caller_values(field, span, source);
        put(&mut self.starts, field, given);
        Ok(())
    }

    /// Sets the values of the step variable, in place of those of `steps`. A run that begins afterwards goes through them.
    ///
    /// # Errors
    /// [`GiveError::Steps`] for no value, values that are not finite or go to and fro, or a single one in a scene with
    /// rates, whose first value is where time starts.
    pub fn set_steps(&mut self, values: &[f64]) -> Result<(), GiveError> {
        let no = |why| Err(GiveError::Steps { why });
        let runs = |sign: f64| values.windows(2).all(|w| sign * (w[1] - w[0]) > 0.0);
        match values {
            [] => no("are none"),
            v if v.iter().any(|x| !x.is_finite()) => no("are not finite"),
            [_] if self.steps.from_start => no("are at least two in a scene with rates: time starts at the first"),
            _ if !(runs(1.0) || runs(-1.0)) => no("go in one direction, each further than the one before"),
            _ => {
                self.steps.values = values.to_vec();
                self.steps.equal = Equal::of(values);
                self.steps.auto = None;
                self.steps.orders.clear();
                Ok(())
            }
        }
    }

    /// Goes through the steps that another run has chosen, with its orders of backward differentiation, which are given by
    /// value of the step variable.
    ///
    /// # Errors
    /// As [`Self::set_steps`].
    pub fn follow_steps(&mut self, values: &[f64], orders: Vec<(f64, usize)>) -> Result<(), GiveError> {
        self.set_steps(values)?;
        self.steps.orders = orders;
        Ok(())
    }
}

/// Puts the values of a field in the place of others, or behind them.
fn put(list: &mut Vec<(usize, Given)>, field: usize, given: Given) {
    match list.iter_mut().find(|(f, _)| *f == field) {
        Some(known) => known.1 = given,
        None => list.push((field, given)),
    }
}
