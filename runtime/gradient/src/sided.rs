//! Laws along a direction to one side: at points between two branches they take the one that the direction leads to.
//!
//! A kink is between its branches where both sides of it are within [`NEAR`] of the largest of what they are made of in the region: so the
//! points that are told are those that are decided here. Laws without kinks are not in the lists.

use std::sync::Arc;

use wfl::{Diagnostic, ResolvedScript, ast::Expr};
use wfl_compiler::{
    ToSide, ValueLaw, backend::KernelBackend, compile_term_to_side, compile_value_to_side, kinks_of_term,
    kinks_of_value, types::FieldId,
};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Domain, FieldValues, Integrator, LawSlots, tangent_kernel},
    system::StandIn,
    value::{Sampled, Value},
    window::Window,
};

use super::{
    extended::Extended,
    laws::update_of,
    measures::{Summed, Weighed},
    near::NEAR,
    refused::{first, message, no_derivative, not_made},
};

/// The laws of a scene to one side.
pub(super) struct Sided {
    terms: Vec<SidedTerm>,
    /// By state of the scene.
    states: Vec<Option<SidedValue>>,
    /// By measure that is wanted its parts.
    measures: Vec<Vec<Option<SidedValue>>>,
}

/// The kinks of a law.
struct Ties {
    /// The field of their tolerances, and how many it has.
    field: usize,
    n: usize,
    sides: Value,
    sampled: Sampled,
}

/// Tolerances of kinks at a state.
#[derive(Clone, Debug, Default)]
struct Tolerances {
    numbers: Vec<f64>,
    /// A point is between two branches.
    near: bool,
}

struct SidedTerm {
    /// The term of the scene.
    term: usize,
    form: AssembledTerm,
    ties: Ties,
    at: Tolerances,
}

struct SidedValue {
    value: Value,
    sampled: Sampled,
    ties: Ties,
}

impl Ties {
    fn new(
        extended: &Extended<'_>,
        of: (usize, usize),
        sides: ValueLaw,
        domain: &Arc<Domain>,
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let (field, n) = of;
        let (sides, sampled) = bound(extended, sides, domain, backend)?;
        Ok(Self { field, n, sides, sampled })
    }

    /// Values now and before with the tolerances in their place.
    fn with<'v>(&self, numbers: &'v [f64], values: FieldValues<'v>) -> [Vec<&'v [f64]>; 2] {
        [values.current, values.previous].map(|list| {
            let mut list = list.to_vec();
            // a scene that reads nothing of the past has none
            if let Some(own) = list.get_mut(self.field) {
                *own = numbers;
            }
            list
        })
    }

    fn tolerances(&self, extended: &Extended<'_>, values: FieldValues<'_>) -> Tolerances {
        let mut pairs = Vec::new();
        let mesh = &extended.scene.system.mesh;
        self.sides.for_each_point(mesh, &self.sampled, values, |_, _, _, _, v| pairs.extend_from_slice(v));
        let n = self.sides.n_components();
        let mut numbers = vec![0.0; self.n];
        for point in pairs.chunks_exact(n) {
            for (kink, largest) in point.chunks_exact(3).zip(&mut numbers) {
                *largest = f64::max(*largest, kink[2]);
            }
        }
        numbers.iter_mut().for_each(|x| *x *= NEAR);
        let is_near = |point: &[f64]| point.chunks_exact(3).zip(&numbers).any(|(p, tol)| (p[0] - p[1]).abs() <= *tol);
        Tolerances { near: pairs.chunks_exact(n).any(is_near), numbers }
    }
}

impl Sided {
    pub(super) fn new(
        extended: &mut Extended<'_>,
        script: &ResolvedScript,
        results: &[Weighed],
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let scene = extended.scene;
        let mut terms = Vec::new();
        for k in 0..scene.system.terms.len() {
            terms.extend(term(extended, script, k, backend)?);
        }
        let mut states = Vec::new();
        for state in &scene.states {
            let name = &scene.system.fields[state.field].name;
            let (Some(update), Some(at)) = (update_of(script, name), state.at_points()) else {
                return Err(not_made(&format!("the update of `{name}` is not at hand")));
            };
            states.push(value(extended, (name, update), at, backend)?);
        }
        let mut measures = Vec::new();
        for result in results {
            let (measure, declared) = extended.measures[result.measure];
            let (Summed::Points(_), Some((_, parts))) = (&result.summed, measure.at_points()) else {
                measures.push(Vec::new());
                continue;
            };
            let mut list = Vec::new();
            for (law, sampled) in parts {
                list.push(value(extended, (&measure.name, &declared.expr), (law, sampled), backend)?);
            }
            measures.push(list);
        }
        Ok(Self { terms, states, measures })
    }

    /// Brings laws to a step.
    pub(super) fn set_step(&mut self, at: Window) {
        for term in &mut self.terms {
            term.form.set_step(at);
            term.ties.sides = term.ties.sides.at_step(at);
        }
        for value in self.states.iter_mut().chain(self.measures.iter_mut().flatten()).flatten() {
            value.value = value.value.at_step(at);
            value.ties.sides = value.ties.sides.at_step(at);
        }
    }

    /// Finds the points of the equations that are between two branches; true if there are some.
    pub(super) fn look(&mut self, extended: &Extended<'_>, values: FieldValues<'_>) -> bool {
        for term in &mut self.terms {
            term.at = term.ties.tolerances(extended, values);
        }
        self.terms.iter().any(|term| term.at.near)
    }

    /// Whether a term has a law here, which stands for its own where points are between two branches.
    pub(super) fn has(&self, term: usize) -> bool {
        self.terms.iter().any(|own| own.term == term)
    }

    /// Adds what the equations of its terms change by to `out`, by dof.
    pub(super) fn residual(
        &self,
        extended: &Extended<'_>,
        values: FieldValues<'_>,
        wanted: impl Fn(usize) -> bool,
        out: &mut [f64],
    ) -> Result<(), Box<Diagnostic>> {
        let mesh = &extended.scene.system.mesh;
        for own in self.terms.iter().filter(|own| wanted(own.term)) {
            let [current, previous] = own.ties.with(&own.at.numbers, values);
            let values = FieldValues { current: &current, previous: &previous, ..values };
            own.form.add_residual(mesh, values, out).map_err(|e| not_made(&format!("to one side: {e}")))?;
        }
        Ok(())
    }

    /// Calls `f` with the terms that stand for others in the tangent.
    pub(super) fn with_stand_ins<T>(&self, values: FieldValues<'_>, f: impl FnOnce(&[StandIn<'_>]) -> T) -> T {
        let lists: Vec<[Vec<&[f64]>; 2]> =
            self.terms.iter().map(|own| own.ties.with(&own.at.numbers, values)).collect();
        let list: Vec<StandIn<'_>> = self
            .terms
            .iter()
            .zip(&lists)
            .map(|(own, [current, previous])| StandIn {
                term: own.term,
                form: &own.form,
                values: FieldValues { current, previous, ..values },
            })
            .collect();
        f(&list)
    }

    /// What a state changes by, in the order of its nodes; nothing where its law has no kinks.
    pub(super) fn state(&self, extended: &Extended<'_>, state: usize, values: FieldValues<'_>) -> Option<Vec<f64>> {
        let own = self.states[state].as_ref()?;
        let mut next = Vec::new();
        own.for_each(extended, values, |_, v| next.extend_from_slice(v));
        Some(next)
    }

    /// By part of a measure what its points change by; nothing for parts without kinks.
    pub(super) fn measure(
        &self,
        extended: &Extended<'_>,
        result: usize,
        values: FieldValues<'_>,
    ) -> Vec<Option<Vec<f64>>> {
        let of = |own: &Option<SidedValue>| {
            let mut points = Vec::new();
            own.as_ref()?.for_each(extended, values, |_, v| points.push(v[0]));
            Some(points)
        };
        self.measures[result].iter().map(of).collect()
    }
}

impl SidedValue {
    fn for_each(&self, extended: &Extended<'_>, values: FieldValues<'_>, mut f: impl FnMut(f64, &[f64])) {
        let at = self.ties.tolerances(extended, values);
        let [current, previous] = self.ties.with(&at.numbers, values);
        let values = FieldValues { current: &current, previous: &previous, ..values };
        let mesh = &extended.scene.system.mesh;
        self.value.for_each_point(mesh, &self.sampled, values, |_, _, _, weight, v| f(weight, v));
    }
}

/// A term to one side; nothing for one without kinks.
fn term(
    extended: &mut Extended<'_>,
    script: &ResolvedScript,
    k: usize,
    backend: &dyn KernelBackend,
) -> Result<Option<SidedTerm>, Box<Diagnostic>> {
    let scene = extended.scene;
    let (summary, own) = (&scene.terms[k], &scene.system.terms[k]);
    let (domain, mapping) = (&own.integrator.domain, own.law.listing.graph.mapping);
    let Some(source) = scene.source_of(script, summary.origin) else {
        return Err(not_made(&format!("the text of `{}` is not at hand", summary.name)));
    };
    let n = kinks_of_term(&extended.env(), &extended.place(domain, mapping), source);
    if n == 0 {
        return Ok(None);
    }
    let field = extended.add_tolerances(n);
    let of = (extended.companions(), FieldId::new(field));
    let made = compile_term_to_side(&extended.env(), &extended.place(domain, mapping), &summary.name, source, of);
    let Some(ToSide { law, sides }) = made.value else {
        return Err(no_derivative(&summary.name, first(made.diagnostics)));
    };
    let Some(sides) = sides.filter(|_| !law.tests.is_empty()) else { return Ok(None) };
    let ties = Ties::new(extended, (field, n), sides, domain, backend)?;
    let failed = |e: String| not_made(&e);
    let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
    let binding =
        Binding::new(&scene.system.mesh, domain, &extended.fields, slots).map_err(|e| failed(e.to_string()))?;
    let integrator = Integrator { domain: Arc::clone(domain), binding: Arc::new(binding) };
    let tangent = tangent_kernel(&law);
    let kernels: Vec<_> = std::iter::once(&law.residual).chain(&tangent).collect();
    let mut kernels = backend.compile(&kernels).map_err(|e| failed(e.to_string()))?.into_iter();
    let Some(residual) = kernels.next() else { return Err(not_made("the backend lost a kernel")) };
    let mut starts = scene.system.numbering.starts.clone();
    starts.resize(extended.fields.len(), None);
    let mut form = AssembledTerm::new(law, integrator, None, residual, kernels.next(), &starts);
    if !scene.system.find_place(&mut form) && own.law.class >= wfl_compiler::Class::Nonlinear {
        let d = message(format!(
            "`{}` couples more to one side than the scene has: no derivative to one side",
            summary.name
        ));
        return Err(Box::new(d));
    }
    Ok(Some(SidedTerm { term: k, form, ties, at: Tolerances::default() }))
}

/// An expression to one side; nothing for one without kinks.
fn value(
    extended: &mut Extended<'_>,
    text: (&str, &Expr),
    at: (&Value, &Sampled),
    backend: &dyn KernelBackend,
) -> Result<Option<SidedValue>, Box<Diagnostic>> {
    let ((name, expr), (own, sampled)) = (text, at);
    let (domain, mapping) = (&sampled.domain, own.law.mapping);
    let n = kinks_of_value(&extended.env(), &extended.place(domain, mapping), expr);
    if n == 0 {
        return Ok(None);
    }
    let field = extended.add_tolerances(n);
    let of = (extended.companions(), FieldId::new(field));
    let made = compile_value_to_side(&extended.env(), &extended.place(domain, mapping), name, expr, of);
    let Some(law) = made.value else { return Err(no_derivative(name, first(made.diagnostics))) };
    let Some(ToSide { law, sides: Some(sides) }) = law else { return Ok(None) };
    let ties = Ties::new(extended, (field, n), sides, domain, backend)?;
    let (value, sampled) = bound(extended, law, domain, backend)?;
    Ok(Some(SidedValue { value, sampled, ties }))
}

fn bound(
    extended: &Extended<'_>,
    law: ValueLaw,
    domain: &Arc<Domain>,
    backend: &dyn KernelBackend,
) -> Result<(Value, Sampled), Box<Diagnostic>> {
    let value = Value::new(law, backend).map_err(|e| not_made(&e.to_string()))?;
    let mesh = &extended.scene.system.mesh;
    let sampled = value.bind(mesh, Arc::clone(domain), &extended.fields).map_err(|e| not_made(&e.to_string()))?;
    Ok((value, sampled))
}
