//! Formulas of positions and the step variable, with their slopes in parameters: prescribed values, data, first values.

use std::collections::BTreeMap;

use wfl::{DataValue, Diagnostic, FieldKind as Declared, ResolvedScript, StartKind, ast::Expr};
use wfl_compiler::{InterpreterBackend, ValueLaw, compile_position_slopes, compile_slopes, types::InputSlot};
use wfl_discrete::{value::Value, window::Window};

use super::{
    extended::Extended,
    refused::{first, no_derivative, not_made, of_points},
};

/// A formula, differentiated.
pub(super) struct Formula {
    /// By entry of the parameters that change; `None` where it does not follow it.
    slopes: Vec<Option<Value>>,
    /// By direction of space, where parameters move the mesh.
    in_space: Vec<Option<Value>>,
}

impl Formula {
    /// `what` names it in messages.
    pub(super) fn new(extended: &Extended<'_>, what: &str, e: &Expr) -> Result<Self, Box<Diagnostic>> {
        let (env, place) = (extended.env(), extended.positions());
        let made = compile_slopes(&env, &place, what, e, &extended.directions());
        let Some(laws) = made.value else { return Err(no_derivative(what, first(made.diagnostics))) };
        let in_space = match extended.has_motion() {
            true => {
                let made = compile_position_slopes(&env, &place, what, e);
                made.value.ok_or_else(|| no_derivative(what, first(made.diagnostics)))?
            }
            false => Vec::new(),
        };
        let callable = |laws: Vec<Option<ValueLaw>>| -> Result<Vec<Option<Value>>, Box<Diagnostic>> {
            let one = |law: Option<ValueLaw>| law.map(|law| Value::new(law, &InterpreterBackend)).transpose();
            laws.into_iter().map(one).collect::<Result<_, _>>().map_err(|e| not_made(&e.to_string()))
        };
        Ok(Self { slopes: callable(laws)?, in_space: callable(in_space)? })
    }

    /// True if no parameter changes it.
    pub(super) fn is_still(&self) -> bool {
        self.slopes.iter().chain(&self.in_space).all(Option::is_none)
    }

    /// True if it is another one at another place, and places move.
    pub(super) fn follows_places(&self) -> bool {
        self.in_space.iter().any(Option::is_some)
    }

    /// By direction of space the slopes at positions (component fastest); `None` where it does not change.
    pub(super) fn slopes_in_space(
        &self,
        extended: &Extended<'_>,
        at: (&[[f64; 3]], Window),
    ) -> Result<Vec<Option<Vec<f64>>>, Box<Diagnostic>> {
        let (positions, step) = at;
        let of = |slope: &Option<Value>| {
            slope.as_ref().map(|value| values(value, |slot| extended.value_of(slot), positions, step)).transpose()
        };
        self.in_space.iter().map(of).collect()
    }

    /// Adds to the derivatives in the parameters what `functional` (by position, component fastest) makes of the slopes at a
    /// step.
    pub(super) fn add(
        &self,
        extended: &Extended<'_>,
        at: (&[[f64; 3]], Window),
        functional: &[f64],
        gradient: &mut [f64],
    ) -> Result<(), Box<Diagnostic>> {
        let (positions, step) = at;
        if positions.is_empty() || functional.iter().all(|x| *x == 0.0) {
            return Ok(());
        }
        for (value, sum) in self.slopes.iter().zip(&mut *gradient).filter_map(|(v, sum)| Some((v.as_ref()?, sum))) {
            let slopes = values(value, |slot| extended.value_of(slot), positions, step)?;
            *sum += slopes.iter().zip(functional).map(|(s, f)| s * f).sum::<f64>();
        }
        let Some(velocities) = extended.velocities.as_ref().filter(|_| self.follows_places()) else { return Ok(()) };
        let components = functional.len() / positions.len();
        for (d, slopes) in self.slopes_in_space(extended, at)?.iter().enumerate() {
            let Some(slopes) = slopes else { continue };
            let of_node = slopes.chunks_exact(components).zip(functional.chunks_exact(components));
            for (x, (slopes, functional)) in positions.iter().zip(of_node) {
                let product: f64 = slopes.iter().zip(functional).map(|(s, f)| s * f).sum();
                let by_entry = velocities.at(*x).ok_or_else(|| no_node(*x))?;
                by_entry.iter().zip(&mut *gradient).for_each(|(v, sum)| *sum += product * v[d]);
            }
        }
        Ok(())
    }

    /// What the formula moves by at positions (component fastest) that stay, where the parameters move by `live`.
    pub(super) fn moved_in_place(
        &self,
        extended: &Extended<'_>,
        at: (&[[f64; 3]], Window),
        live: &[f64],
    ) -> Result<Vec<f64>, Box<Diagnostic>> {
        let (positions, step) = at;
        let mut out = Vec::new();
        let moving = self.slopes.iter().zip(live).filter_map(|(v, by)| Some((v.as_ref()?, *by)));
        for (value, by) in moving.filter(|_| !positions.is_empty()) {
            let slopes = values(value, |slot| extended.value_of(slot), positions, step)?;
            out.resize(slopes.len(), 0.0);
            out.iter_mut().zip(&slopes).for_each(|(x, slope): (&mut f64, &f64)| *x += by * slope);
        }
        Ok(out)
    }

    /// What the formula moves by at nodes (component fastest) and a step, where the parameters move by `live`.
    pub(super) fn moved(
        &self,
        extended: &Extended<'_>,
        at: (&[[f64; 3]], Window),
        live: &[f64],
    ) -> Result<Vec<f64>, Box<Diagnostic>> {
        let positions = at.0;
        let mut out = self.moved_in_place(extended, at, live)?;
        let follows = !positions.is_empty() && self.follows_places();
        let Some(velocities) = extended.velocities.as_ref().filter(|_| follows) else { return Ok(out) };
        for (d, slopes) in self.slopes_in_space(extended, at)?.iter().enumerate() {
            let Some(slopes) = slopes else { continue };
            out.resize(slopes.len(), 0.0);
            let components = slopes.len() / positions.len();
            let of_node = slopes.chunks_exact(components).zip(out.chunks_exact_mut(components));
            for (x, (slopes, out)) in positions.iter().zip(of_node) {
                let by_entry = velocities.at(*x).ok_or_else(|| no_node(*x))?;
                let velocity: f64 = by_entry.iter().zip(live).map(|(v, by)| by * v[d]).sum();
                out.iter_mut().zip(slopes).for_each(|(x, slope)| *x += velocity * slope);
            }
        }
        Ok(out)
    }
}

/// A formula is taken where no field has a node.
fn no_node(x: [f64; 3]) -> Box<Diagnostic> {
    not_made(&format!("no field has a node at {x:?}, whose velocity is asked for"))
}

/// What the formulas of a scene follow of the parameters.
pub(super) struct Formulas {
    /// By `fix` statement that follows one.
    pub(super) fixes: Vec<Option<Formula>>,
    /// By data field.
    pub(super) data: BTreeMap<usize, Formula>,
    /// By field with first values.
    pub(super) starts: BTreeMap<usize, Formula>,
    /// By field with first rates.
    pub(super) rates: BTreeMap<usize, Formula>,
}

impl Formulas {
    pub(super) fn new(extended: &Extended<'_>, script: &ResolvedScript) -> Result<Self, Box<Diagnostic>> {
        let position = |name: &str| extended.scene.system.fields.iter().position(|f| f.name == name);
        let mut fixes = Vec::new();
        for fix in &script.fixes {
            let made = Formula::new(extended, "a prescribed value", &fix.value)?;
            fixes.push(Some(made).filter(|formula| !formula.is_still()));
        }
        let (mut data, mut starts) = (BTreeMap::new(), BTreeMap::new());
        for field in &script.fields {
            if let (Declared::Data { value: DataValue::Formula(e) }, Some(k)) =
                (&field.kind, position(&field.name.name))
            {
                let made = Formula::new(extended, &field.name.name, e)?;
                if !made.is_still() {
                    data.insert(k, made);
                }
            }
        }
        let mut rates = BTreeMap::new();
        for start in &script.starts {
            if let StartKind::Rate { field, value } = &start.kind
                && let Some(k) = position(&field.name)
            {
                let made = Formula::new(extended, "a first rate", value)?;
                if !made.is_still() {
                    rates.insert(k, made);
                }
            }
            if let StartKind::Field { field, value } = &start.kind
                && let Some(k) = position(&field.name)
            {
                let made = Formula::new(extended, "a first value", value)?;
                if made.follows_places() && extended.fields[k].is_at_points() {
                    return Err(of_points(&field.name, value.span));
                }
                let system = &extended.scene.system;
                let follows = || system.numbering.ties().iter().any(|tie| system.field_of(tie.follower) == k);
                if !made.is_still() && follows() {
                    return Err(not_made("first values of nodes that follow others have no derivative yet"));
                }
                if !made.is_still() {
                    starts.insert(k, made);
                }
            }
        }
        Ok(Self { fixes, data, starts, rates })
    }
}

/// The values of a law of positions and parameters.
pub(super) fn evaluated(
    law: ValueLaw,
    known: impl Fn(&InputSlot) -> f64,
    positions: &[[f64; 3]],
    step: Window,
) -> Result<Vec<f64>, Box<Diagnostic>> {
    let value = Value::new(law, &InterpreterBackend).map_err(|e| not_made(&e.to_string()))?;
    values(&value, known, positions, step)
}

fn values(
    value: &Value,
    known: impl Fn(&InputSlot) -> f64,
    positions: &[[f64; 3]],
    step: Window,
) -> Result<Vec<f64>, Box<Diagnostic>> {
    let found = value.at_step(step).at_positions_with(positions, &known);
    found.map_err(|bad| not_made(&format!("the slope of a formula is {} at {:?}", bad.value, bad.position)))
}
