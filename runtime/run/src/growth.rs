//! Whether the unknowns of a run grow without end although nothing drives them to: the exponential growth of a sign that is
//! wrong.
//!
//! Under given loads a stable body grows like a power of time at most. So the size of each field is compared at the end of the
//! run, at three quarters and at half of its time: what grows like t^k grows by 2^k in the second half, and what grows
//! exponentially by the same factor in both quarters of it. A constant that stands in the values hides nothing: what a field is beside
//! its value nearest to zero is looked at as well. What is given (loads, prescribed values) may grow by as much. Known
//! are single numbers of each step; nothing is evaluated but loads that follow the steps.

use wfl::{Code, Diagnostic};
use wfl_compiler::{
    Class,
    types::{FieldKind, InputSlot},
};
use wfl_discrete::{field::FieldSpace, finite::largest, system::System};
use wfl_problem::{Scene, Solving};

use super::StepResult;

/// Growth in the second half of the time, in parts of that of what is given, that no power of time below the tenth has.
const LINEAR: f64 = 1e3;
/// The same where terms are not linear: an instability that is meant (a snap, a slip that runs away) ends.
const NONLINEAR: f64 = 1e6;
/// The fewest steps in which growth can be told from a beginning.
const FEWEST: usize = 4;

/// What a field is beside its value nearest to zero is rounding below this part of its values: solutions keep ten digits at least.
const ROUNDED: f64 = 1e-9;

/// What growth is looked for with.
#[derive(Clone, Debug, Default)]
pub(super) struct Growth {
    /// What loads that do not follow the steps give.
    steady: Option<f64>,
}

/// The sizes of fields at the end of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sizes {
    /// By unknown that is watched its largest value; and then by unknown the largest one beside the value nearest to zero of its component.
    pub(crate) fields: Vec<f64>,
    /// The largest load, and the largest prescribed value.
    pub(crate) given: [f64; 2],
}

impl Growth {
    /// The sizes at the end `u` of a step of a scene with several.
    pub(super) fn sizes(&mut self, scene: &Solving<'_>, u: &[f64]) -> Sizes {
        let system = &scene.system;
        let of_field = |k: usize| system.range(k).map_or(0.0, |range| largest(u[range].iter().copied()));
        let watched = watched(system);
        let mut fields: Vec<f64> = watched.iter().map(|k| of_field(*k)).collect();
        fields.extend(watched.into_iter().map(|k| beside_constant(system, u, k)));
        let mut given = [self.loads(system), system.numbering.largest_prescribed(u)];
        system.team().max(&mut fields);
        system.team().max(&mut given);
        Sizes { fields, given }
    }

    /// The largest nodal load: terms without unknowns, at the step of the system.
    fn loads(&mut self, system: &System) -> f64 {
        let zero = vec![0.0; system.numbering.n_dofs];
        let sum = |follow: bool| {
            let mut out = zero.clone();
            for (k, term) in system.terms.iter().enumerate() {
                if term.law.class == Class::Constant && follows(term) == follow {
                    // what has no finite value ends the run with its place
                    let _ = system.term_residual(k, &zero, &mut out);
                }
            }
            largest(out)
        };
        let steady = *self.steady.get_or_insert_with(|| sum(false));
        let some = system.terms.iter().any(|t| t.law.class == Class::Constant && follows(t));
        if some { steady.max(sum(true)) } else { steady }
    }
}

/// W647 for fields that grew without end.
pub(super) fn told(scene: &Scene, steps: &[StepResult]) -> Option<Diagnostic> {
    let steps: Vec<(f64, &Sizes)> = steps.iter().filter_map(|s| Some((s.window.end, s.seen.sizes.as_ref()?))).collect();
    let system = &scene.system;
    let limit = if system.is_linear() { LINEAR } else { NONLINEAR };
    let (first, last) = (steps.first()?, steps.last()?);
    if steps.len() < FEWEST {
        return None;
    }
    let at = |part: f64| {
        let time = first.0 + part * (last.0 - first.0);
        let distance = |s: &(f64, &Sizes)| (s.0 - time).abs();
        steps.iter().enumerate().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).map_or(0, |(k, _)| k)
    };
    let (half, three) = (at(0.5), at(0.75));
    if half == 0 || three <= half || three + 1 >= steps.len() {
        return None;
    }
    let most = |to: usize, of: &dyn Fn(&Sizes) -> f64| steps[..=to].iter().map(|s| of(s.1)).fold(0.0, f64::max);
    let end = steps.len() - 1;
    let given = (0..2).map(|k| grown(most(end, &|s| s.given[k]), most(half, &|s| s.given[k]))).fold(1.0, f64::max);
    let watched = watched(system);
    let both = watched.iter().chain(&watched).copied().enumerate();
    both.into_iter().find_map(|(k, field)| {
        let of = |at: usize| most(at, &|s| s.fields[k]);
        let (second, third, fourth) = (of(half), grown(of(three), of(half)), grown(of(end), of(three)));
        let whole = third * fourth;
        let steady = third.min(fourth) > whole.powf(0.25);
        let of_values = most(half, &|s| s.fields[k % watched.len()]);
        let begins = if k < watched.len() { second > 0.0 } else { second > ROUNDED * of_values };
        let grows = begins && whole > limit * given && steady;
        grows.then(|| {
            let text = format!(
                "its largest value{} is {:.3e} at t = {}, {:.3e} at t = {}, {:.3e} at t = {}, while loads and prescribed \
                 values grow by a factor {given:.1e} at most",
                if k < watched.len() { "" } else { ", beside the one nearest to zero," },
                second,
                steps[half].0,
                of(three),
                steps[three].0,
                of(end),
                last.0
            );
            let name = &system.fields[field].name;
            Diagnostic::new(Code::W647, format!("`{name}` grows without end"))
                .at_or_note(scene.place_of_field(name), text)
                .note(
                    "that is how a wrong sign grows: of a rate, of one of two couplings, or of a term that should \
                     dissipate",
                )
        })
    })
}

/// The largest value of a field beside that of its component nearest to zero, on all ranks.
fn beside_constant(system: &System, u: &[f64], field: usize) -> f64 {
    let (Some(range), n) = (system.range(field), system.fields[field].n_components) else { return 0.0 };
    let values = &u[range];
    let beside = (0..n).map(|component| {
        let own = values.iter().skip(component).step_by(n);
        let [low, high] = own.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
        let [low, high] = system.team().range(low, high);
        let constant = if low > 0.0 { low } else { high.min(0.0) };
        (high - constant).max(constant - low)
    });
    largest(beside)
}

/// A growth; of what was nothing, one without bound.
fn grown(to: f64, from: f64) -> f64 {
    if to <= from { 1.0 } else { to / from }
}

/// The unknowns with terms on cells, and those with one value for the whole scene.
fn watched(system: &System) -> Vec<usize> {
    let on_cells = |k: &usize| {
        let is_global = matches!(system.fields[*k].space, FieldSpace::Global);
        let mut terms = system.terms.iter().filter(|t| (t.on_cells() || is_global) && t.law.class > Class::Constant);
        terms.any(|t| t.law.tests.iter().any(|s| s.field.index() == *k))
    };
    let unknown = |k: &usize| system.fields[*k].kind == FieldKind::Unknown && system.range(*k).is_some();
    (0..system.fields.len()).filter(unknown).filter(on_cells).collect()
}

/// True for a load that is another one at another step.
fn follows(term: &wfl_discrete::assemble::AssembledTerm) -> bool {
    let known = |s: &InputSlot| matches!(s, InputSlot::Field(_) | InputSlot::Previous(_) | InputSlot::History(..));
    !term.uniforms().is_empty() || term.law.inputs.iter().any(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_nothing_grows_without_bound_and_what_shrinks_does_not() {
        assert_eq!(grown(2.0, 1.0), 2.0);
        assert_eq!(grown(1.0, 2.0), 1.0);
        assert!(grown(1.0, 0.0).is_infinite());
    }
}
