//! Laws of derivatives along a direction, on the points of the laws that they are derivatives of: terms, updates of states,
//! measures.

use std::sync::Arc;

use wfl::{Checked, Diagnostic, ResolvedScript, ast::Expr};
use wfl_compiler::{
    Companions, ValueLaw, backend::KernelBackend, compile_growth_along, compile_term_along, compile_value_along,
};
use wfl_discrete::{
    assemble::{AssembledTerm, Domain, FieldValues},
    value::{Sampled, Value},
    window::Window,
};

use super::{
    extended::Extended,
    laws::{Of, Placed, acts, callable, update_of},
    measures::{Summed, Weighed},
    refused::{first, no_derivative, not_made},
};

/// A value at its points; nothing where no direction moves it.
type Moved = Option<(Value, Sampled)>;

/// The laws of a scene along directions.
pub(super) struct Along {
    terms: Vec<(Of, AssembledTerm)>,
    /// By state of the scene.
    states: Vec<Moved>,
    /// By measure that is wanted its parts.
    measures: Vec<Vec<Moved>>,
    /// By measure and part by how much its region grows.
    growths: Vec<Vec<Moved>>,
}

impl Along {
    pub(super) fn new(
        extended: &Extended<'_>,
        script: &ResolvedScript,
        results: &[Weighed],
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let scene = extended.scene;
        let mut placed: Vec<Placed> = Vec::new();
        for (k, (summary, term)) in scene.terms.iter().zip(&scene.system.terms).enumerate() {
            let domain = &term.integrator.domain;
            let place = extended.place(domain, term.law.listing.graph.mapping);
            let Some(source) = scene.source_of(script, summary.origin) else {
                return Err(not_made(&format!("the text of `{}` is not at hand", summary.name)));
            };
            let companions = extended.companions_on(domain);
            let made = compile_term_along(&extended.env(), &place, &summary.name, source, companions);
            placed.extend(acts(made, &summary.name, domain, Of::Term(k))?);
        }
        let mut states = Vec::new();
        for state in &scene.states {
            let name = &scene.system.fields[state.field].name;
            let (Some(update), Some((value, sampled))) = (update_of(script, name), state.at_points()) else {
                return Err(not_made(&format!("the update of `{name}` is not at hand")));
            };
            let law = (value, extended.companions());
            states.push(moved(extended, (name, update), law, &sampled.domain, backend)?);
        }
        let (mut measures, mut growths) = (Vec::new(), Vec::new());
        for result in results {
            let (measure, declared) = extended.measures[result.measure];
            let (Summed::Points(points), Some((_, parts))) = (&result.summed, measure.at_points()) else {
                measures.push(Vec::new());
                growths.push(Vec::new());
                continue;
            };
            let of = |(value, sampled): &(Value, Sampled)| {
                let law = (value, points.companions(extended, &sampled.domain));
                moved(extended, (&measure.name, &declared.expr), law, &sampled.domain, backend)
            };
            measures.push(parts.iter().map(of).collect::<Result<_, _>>()?);
            let grown = |(_, sampled): &(Value, Sampled)| match points.grows {
                true => growth(extended, &measure.name, &sampled.domain, backend),
                false => Ok(None),
            };
            growths.push(parts.iter().map(grown).collect::<Result<_, _>>()?);
        }
        Ok(Self { terms: callable(extended, placed, backend)?, states, measures, growths })
    }

    /// Brings laws to a step.
    pub(super) fn set_step(&mut self, at: Window) {
        self.terms.iter_mut().for_each(|(_, term)| term.set_step(at));
        let of_measures = self.measures.iter_mut().chain(&mut self.growths).flatten();
        let values = self.states.iter_mut().chain(of_measures).flatten();
        values.for_each(|(value, _)| *value = value.at_step(at));
    }

    /// Adds what the equations of some terms change by to `out`.
    pub(super) fn residual(
        &self,
        extended: &Extended<'_>,
        values: FieldValues<'_>,
        wanted: impl Fn(usize) -> bool,
        out: &mut [f64],
    ) -> Result<(), Box<Diagnostic>> {
        let mesh = &extended.scene.system.mesh;
        for (_, term) in self.terms.iter().filter(|(of, _)| matches!(of, Of::Term(k) if wanted(*k))) {
            term.add_residual(mesh, values, out).map_err(|e| not_made(&format!("along a direction: {e}")))?;
        }
        Ok(())
    }

    /// What a state changes by, in the order of its nodes; nothing where it does not.
    pub(super) fn state(&self, extended: &Extended<'_>, state: usize, values: FieldValues<'_>) -> Option<Vec<f64>> {
        let (value, sampled) = self.states[state].as_ref()?;
        let mut next = Vec::new();
        let mesh = &extended.scene.system.mesh;
        value.for_each_point(mesh, sampled, values, |_, _, _, _, v| next.extend_from_slice(v));
        Some(next)
    }

    /// By part of a measure what it changes by at the points that count; zero at others.
    pub(super) fn points(
        &self,
        extended: &Extended<'_>,
        result: (usize, &[Vec<f64>]),
        values: FieldValues<'_>,
    ) -> Vec<Vec<f64>> {
        let (number, counts) = result;
        let mesh = &extended.scene.system.mesh;
        let mut all = Vec::with_capacity(counts.len());
        for (part, counts) in self.measures[number].iter().zip(counts) {
            let mut points = vec![0.0; counts.len()];
            if let Some((value, sampled)) = part {
                let mut at = points.iter_mut().zip(counts);
                value.for_each_point(mesh, sampled, values, |_, _, _, _, v| {
                    if let Some((x, _)) = at.next().filter(|(_, counts)| **counts != 0.0) {
                        *x = v[0];
                    }
                });
            }
            all.push(points);
        }
        all
    }

    /// What a measure changes by, whose values at points count by the first numbers and the growth of whose region by the others.
    pub(super) fn measure(
        &self,
        extended: &Extended<'_>,
        result: (usize, [&[Vec<f64>]; 2]),
        values: FieldValues<'_>,
    ) -> f64 {
        let (number, [points, growing]) = result;
        let mesh = &extended.scene.system.mesh;
        let mut sum = 0.0;
        let of_values = self.measures[number].iter().zip(points);
        for (part, factors) in of_values.chain(self.growths[number].iter().zip(growing)) {
            let (Some((value, sampled)), mut factors) = (part, factors.iter()) else { continue };
            value.for_each_point(mesh, sampled, values, |_, _, _, weight, v| {
                // a point that does not count may have no derivative
                let factor = factors.next().copied().unwrap_or(0.0);
                sum += if factor == 0.0 { 0.0 } else { weight * factor * v[0] };
            });
        }
        sum
    }
}

/// The derivative of an expression along a direction, at its points.
fn moved(
    extended: &Extended<'_>,
    text: (&str, &Expr),
    law: (&Value, Companions),
    domain: &Arc<Domain>,
    backend: &dyn KernelBackend,
) -> Result<Moved, Box<Diagnostic>> {
    let ((name, expr), (value, companions)) = (text, law);
    let place = extended.place(domain, value.law.mapping);
    let made: Checked<Option<ValueLaw>> = compile_value_along(&extended.env(), &place, name, expr, companions);
    let Some(law) = made.value else { return Err(no_derivative(name, first(made.diagnostics))) };
    placed_value(extended, law, domain, backend)
}

/// By how much of itself a domain grows along a direction, at its points.
fn growth(
    extended: &Extended<'_>,
    name: &str,
    domain: &Arc<Domain>,
    backend: &dyn KernelBackend,
) -> Result<Moved, Box<Diagnostic>> {
    let place = extended.place(domain, None);
    let law = compile_growth_along(&extended.env(), &place, name, extended.companions_on(domain));
    placed_value(extended, law, domain, backend)
}

/// A law at the points of a domain.
fn placed_value(
    extended: &Extended<'_>,
    law: Option<ValueLaw>,
    domain: &Arc<Domain>,
    backend: &dyn KernelBackend,
) -> Result<Moved, Box<Diagnostic>> {
    let Some(law) = law else { return Ok(None) };
    let value = Value::new(law, backend).map_err(|e| not_made(&e.to_string()))?;
    let mesh = &extended.scene.system.mesh;
    let sampled = value.bind(mesh, Arc::clone(domain), &extended.fields).map_err(|e| not_made(&e.to_string()))?;
    Ok(Some((value, sampled)))
}
