//! Formulas of positions and the step variable, with their slopes in parameters: prescribed values, data, first values.

use wfl::ast::Expr;
use wfl_compiler::{InterpreterBackend, ValueLaw, compile_slopes, types::InputSlot};

use super::{
    extended::Extended,
    refused::{first, no_derivative, not_made},
};
use crate::value::Value;
use wfl::Diagnostic;

/// A formula, differentiated.
pub(super) struct Formula {
    /// By entry of the parameters that change; `None` where it does not follow it.
    slopes: Vec<Option<Value>>,
}

impl Formula {
    /// `what` names it in messages.
    pub(super) fn new(extended: &Extended<'_>, what: &str, e: &Expr) -> Result<Self, Box<Diagnostic>> {
        let (env, place) = (extended.env(), extended.positions());
        let made = compile_slopes(&env, &place, what, e, &extended.directions());
        let Some(laws) = made.value else { return Err(no_derivative(what, first(made.diagnostics))) };
        let callable = |law: Option<ValueLaw>| law.map(|law| Value::new(law, &InterpreterBackend)).transpose();
        let slopes = laws.into_iter().map(callable).collect::<Result<_, _>>().map_err(|e| not_made(&e.to_string()))?;
        Ok(Self { slopes })
    }

    /// True if no parameter changes it.
    pub(super) fn is_still(&self) -> bool {
        self.slopes.iter().all(Option::is_none)
    }

    /// Adds to the derivatives in the parameters what `functional` (by position, component fastest) makes of the slopes at a
    /// step.
    pub(super) fn add(
        &self,
        extended: &Extended<'_>,
        at: (&[[f64; 3]], (f64, f64)),
        functional: &[f64],
        gradient: &mut [f64],
    ) -> Result<(), Box<Diagnostic>> {
        let (positions, step) = at;
        if positions.is_empty() || functional.iter().all(|x| *x == 0.0) {
            return Ok(());
        }
        for (value, sum) in self.slopes.iter().zip(gradient).filter_map(|(v, sum)| Some((v.as_ref()?, sum))) {
            let slopes = values(value, |slot| extended.value_of(slot), positions, step)?;
            *sum += slopes.iter().zip(functional).map(|(s, f)| s * f).sum::<f64>();
        }
        Ok(())
    }
}

/// The values of a law of positions and parameters.
pub(super) fn evaluated(
    law: ValueLaw,
    known: impl Fn(&InputSlot) -> f64,
    positions: &[[f64; 3]],
    step: (f64, f64),
) -> Result<Vec<f64>, Box<Diagnostic>> {
    let value = Value::new(law, &InterpreterBackend).map_err(|e| not_made(&e.to_string()))?;
    values(&value, known, positions, step)
}

fn values(
    value: &Value,
    known: impl Fn(&InputSlot) -> f64,
    positions: &[[f64; 3]],
    step: (f64, f64),
) -> Result<Vec<f64>, Box<Diagnostic>> {
    let found = value.at_step(step).at_positions_with(positions, &known);
    found.map_err(|bad| not_made(&format!("the slope of a formula is {} at {:?}", bad.value, bad.position)))
}
