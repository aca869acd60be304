//! Whether the unknowns of a run grow without end although nothing drives them to: the exponential growth of a sign that is
//! wrong.
//!
//! Under given loads a stable body grows like a power of time at most. So the size of each field is compared at the end of the
//! run, at three quarters and at half of its time: what grows like t^k grows by 2^k in the second half, and what grows
//! exponentially by the same factor in both quarters of it. What is given (loads, prescribed values) may grow by as much. Known
//! are single numbers of each step; nothing is evaluated but loads that follow the steps.

use wfl::{Code, Diagnostic};
use wfl_compiler::{
    Class,
    types::{FieldKind, InputSlot},
};
use wfl_discrete::{
    finite::largest,
    system::{FIXED, System},
};
use wfl_problem::Solving;

/// Growth in the second half of the time, in parts of that of what is given, that no power of time below the tenth has.
const LINEAR: f64 = 1e3;
/// The same where terms are not linear: an instability that is meant (a snap, a slip that runs away) ends.
const NONLINEAR: f64 = 1e6;
/// The fewest steps in which growth can be told from a beginning.
const FEWEST: usize = 4;

/// The sizes of fields at the ends of steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Growth {
    steps: Vec<Sizes>,
    /// What loads that do not follow the steps give.
    steady: Option<f64>,
}

#[derive(Clone, Debug)]
struct Sizes {
    time: f64,
    /// By unknown with terms on cells its largest value.
    fields: Vec<f64>,
    /// The largest load, and the largest prescribed value.
    given: [f64; 2],
}

impl Growth {
    /// Keeps the sizes at the end `u` of a step of a scene with several.
    pub(super) fn add(&mut self, scene: &Solving<'_>, u: &[f64], time: f64) {
        let system = &scene.system;
        let of_field = |k: usize| system.range(k).map_or(0.0, |range| largest(u[range].iter().copied()));
        let fields = watched(system).into_iter().map(of_field).collect();
        let fixed = (0..u.len()).filter(|d| system.numbering.free[*d] == FIXED).map(|d| u[d]);
        let mut given = [self.loads(system), largest(fixed)];
        let mut sizes: Vec<f64> = fields;
        system.team().max(&mut sizes);
        system.team().max(&mut given);
        self.steps.push(Sizes { time, fields: sizes, given });
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

    /// W647 for fields that grew without end.
    pub(super) fn told(&self, scene: &Solving<'_>) -> Option<Diagnostic> {
        let system = &scene.system;
        let limit = if system.is_linear() { LINEAR } else { NONLINEAR };
        let (first, last) = (self.steps.first()?, self.steps.last()?);
        if self.steps.len() < FEWEST {
            return None;
        }
        let at = |part: f64| {
            let time = first.time + part * (last.time - first.time);
            let distance = |s: &Sizes| (s.time - time).abs();
            self.steps.iter().enumerate().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).map_or(0, |(k, _)| k)
        };
        let (half, three) = (at(0.5), at(0.75));
        if half == 0 || three <= half || three + 1 >= self.steps.len() {
            return None;
        }
        let most = |to: usize, of: &dyn Fn(&Sizes) -> f64| self.steps[..=to].iter().map(of).fold(0.0, f64::max);
        let end = self.steps.len() - 1;
        let given = (0..2).map(|k| grown(most(end, &|s| s.given[k]), most(half, &|s| s.given[k]))).fold(1.0, f64::max);
        watched(system).into_iter().enumerate().find_map(|(k, field)| {
            let of = |at: usize| most(at, &|s| s.fields[k]);
            let (second, third, fourth) = (of(half), grown(of(three), of(half)), grown(of(end), of(three)));
            let whole = third * fourth;
            let steady = third.min(fourth) > whole.powf(0.25);
            let grows = second > 0.0 && whole > limit * given && steady;
            grows.then(|| {
                let text = format!(
                    "its largest value is {:.3e} at t = {}, {:.3e} at t = {}, {:.3e} at t = {}, while loads and prescribed \
                     values grow by a factor {given:.1e} at most",
                    second,
                    self.steps[half].time,
                    of(three),
                    self.steps[three].time,
                    of(end),
                    last.time
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
}

/// A growth; of what was nothing, one without bound.
fn grown(to: f64, from: f64) -> f64 {
    if to <= from { 1.0 } else { to / from }
}

/// The unknowns with terms on cells that resist their gradients.
fn watched(system: &System) -> Vec<usize> {
    let on_cells = |k: &usize| {
        let mut terms = system.terms.iter().filter(|t| t.on_cells() && t.law.class > Class::Constant);
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
