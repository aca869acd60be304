//! The statements `steps` and `solver`: numbers and words with a meaning for the run, no expressions of fields.

use wfl::{
    Diagnostic,
    ast::{OptionItem, OptionValue},
};

use super::{Builder, constants};
use crate::{
    accuracy::{DEFAULT_QUANTITY, is_accuracy},
    newton::NewtonOptions,
};

/// Load or time steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// The name of the variable; `None` for a single solve.
    pub variable: Option<String>,
    /// Its values.
    pub values: Vec<f64>,
    /// Go on after a step that did not converge.
    pub go_on: bool,
    /// How often the increment of a step that does not converge may be halved.
    pub halve: u32,
    /// Something reads a rate or the increment: the first value is where time starts, and nothing is solved there.
    pub from_start: bool,
}

/// Halvings where the scene does not say how many: the smallest part is then 1/32 of an increment.
const DEFAULT_HALVE: u32 = 5;
/// Most halvings that can be asked for.
const MAX_HALVE: f64 = 30.0;

impl Builder<'_> {
    /// The values of the step variable; `rates` if something reads them.
    pub(super) fn steps(&mut self, rates: bool) -> Option<Steps> {
        let Some(steps) = &self.script.steps else {
            return Some(Steps {
                variable: None,
                values: vec![0.0],
                go_on: false,
                halve: DEFAULT_HALVE,
                from_start: false,
            });
        };
        let [a, b, c] = [(&steps.from, "the first value"), (&steps.to, "the last value"), (&steps.by, "the step")]
            .map(|(e, what)| constants::number(self.env, what, e, self.diagnostics));
        let (from, to, by) = (a?, b?, c?);
        let count = ((to - from) / by).round();
        if by == 0.0 || !count.is_finite() || !(0.0..=1e7).contains(&count) {
            let d = Diagnostic::new("E413", format!("steps from {from} to {to} by {by} never arrive"));
            self.diagnostics.push(d.at(steps.by.span, ""));
            return None;
        }
        if rates && count == 0.0 {
            let d = Diagnostic::new("E413", "a scene with rates needs two values of the step variable");
            let text = "time starts at the first one; the state there is `start`, what follows is solved";
            self.diagnostics.push(d.at(steps.span, text));
            return None;
        }
        let (mut go_on, mut halve) = (false, DEFAULT_HALVE);
        for option in &steps.options {
            match (option.name.name.as_str(), self.option_number(option), word(option)) {
                ("on_fail", _, Some("go_on")) => go_on = true,
                ("on_fail", _, Some("stop")) => go_on = false,
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
                ("halve", Some(n), _) if n.fract() == 0.0 && (0.0..=MAX_HALVE).contains(&n) => halve = n as u32,
                (name, _, _) => self.bad_option(option, name, "halve=0 to halve=30, on_fail=stop, on_fail=go_on"),
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "bounded above"
        )]
        let values = (0..=count as usize)
            .map(|k| if k as f64 == count { from + count * by } else { from + k as f64 * by })
            .collect();
        let variable = Some(steps.variable.name.clone());
        Some(Steps { variable, values, go_on, halve, from_start: rates })
    }

    fn bad_option(&mut self, option: &OptionItem, name: &str, known: &str) {
        let d = Diagnostic::new("E414", format!("option `{name}` is not understood here"));
        self.diagnostics.push(d.at(option.name.span, format!("known: {known}")));
    }

    /// The number given to an option, if it is one.
    fn option_number(&mut self, option: &OptionItem) -> Option<f64> {
        match &option.value {
            Some(OptionValue::Expr(e)) if word(option).is_none() => {
                constants::number(self.env, "an option", e, self.diagnostics)
            }
            _ => None,
        }
    }

    /// What `solver` says: options of Newton, and the error that is asked for with its quantity.
    pub(super) fn solver_options(&mut self) -> (NewtonOptions, Option<(f64, String)>) {
        let mut options = NewtonOptions::default();
        let Some(solver) = &self.script.solver else { return (options, None) };
        let (mut asked, mut of) = (None, DEFAULT_QUANTITY.to_owned());
        for option in &solver.options {
            match (option.name.name.as_str(), self.option_number(option), word(option)) {
                ("tol", Some(t), _) if t >= 0.0 => options.tolerance = t,
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
                ("max_iter", Some(n), _) if n >= 1.0 && n.fract() == 0.0 && n < 1e6 => {
                    options.max_iterations = n as usize;
                }
                ("accuracy", Some(e), _) if is_accuracy(e) => asked = Some(e),
                ("of", _, Some(quantity)) => of = quantity.to_owned(),
                ("search", _, Some("auto")) => options.search = true,
                ("search", _, Some("none")) => options.search = false,
                ("accuracy", _, _) => {
                    let d = Diagnostic::new("E414", "`accuracy` is a relative error from 1e-8 to 1");
                    self.diagnostics.push(d.at(option.name.span, "such as accuracy=1e-3"));
                }
                (name, _, _) => {
                    let known = "tol=1e-10, max_iter=50, search=auto, search=none, accuracy=1e-3, of=L2";
                    self.bad_option(option, name, known);
                }
            }
        }
        (options, asked.map(|error| (error, of)))
    }
}

fn word(option: &OptionItem) -> Option<&str> {
    match &option.value {
        Some(OptionValue::Expr(e)) => match &e.kind {
            wfl::ast::ExprKind::Name(n) => Some(n),
            _ => None,
        },
        Some(OptionValue::Text(t, _)) => Some(t),
        None => None,
    }
}
