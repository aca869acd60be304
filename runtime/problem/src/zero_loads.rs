//! Loads whose formula of positions is zero wherever and whenever it is integrated: `load u = 0.1*x on cold` where all of
//! `cold` has x = 0.
//!
//! Promises: a load that has a value costs one evaluation. Does not see formulas that read fields, and of steps that the run
//! chooses itself it says nothing about formulas of the step variable: between steps that were not looked at they may act.

use std::collections::BTreeSet;

use wfl::{Code, Condition, Diagnostic, each_name};
use wfl_compiler::types::UniformSlot;
use wfl_discrete::{assemble::Domain, value::Value, window::Window};

use super::{Builder, Origin, Steps, assemble::Assembled};

/// Values of one formula that are looked at, at most: beyond, a load is taken for one that acts. 2 million are 0.1 s.
const MOST: usize = 2_000_000;
/// Points that are evaluated together.
const TOGETHER: usize = 256;

impl Builder<'_> {
    /// W411 for a load that is zero at all its points in all steps, and whose text does not say so.
    pub(super) fn zero_loads(&mut self, made: &Assembled, steps: Option<&Steps>) {
        let (mut acting, mut idle): (BTreeSet<usize>, BTreeSet<usize>) = Default::default();
        for (term, summary) in made.terms.iter().zip(&made.summaries) {
            let Origin::Load(number, _) = summary.origin else { continue };
            let is_zero = self.zero_formula(number).is_some_and(|value| {
                times(&value, steps).is_some_and(|times| self.is_zero_at(&value, &term.integrator.domain, &times))
            });
            if is_zero { &mut idle } else { &mut acting }.insert(number);
        }
        // of one on what is fixed, that is told already
        let is_told = |load: &Condition, known: &[Diagnostic]| {
            known.iter().any(|d| d.code == Code::W412 && d.labels.iter().any(|l| l.span == load.span))
        };
        for load in idle.difference(&acting).filter_map(|number| self.script.loads.get(*number)) {
            if is_told(load, self.diagnostics) {
                continue;
            }
            let d = Diagnostic::new(Code::W411, "a load that is zero");
            let text = "its formula is 0 wherever its region is integrated, in all steps";
            let help = "another region or formula is meant; a load that is 0 by intent says so: `= 0`";
            self.diagnostics.push(d.at(load.span, text).help(help));
        }
    }

    /// The formula of a load, if it depends on positions or the step variable, and on no parameter that is zero.
    fn zero_formula(&self, number: usize) -> Option<Value> {
        let formula = &self.script.loads.get(number)?.value;
        let mut switched_off = false;
        each_name(formula, &mut |name| {
            switched_off |= self.params.get(name).is_some_and(|p| p.values.contains(&0.0));
        });
        let value = if switched_off { None } else { self.of_positions(formula) }?;
        let varies = !value.law.inputs.is_empty() || value.law.prologue.slots.contains(&UniformSlot::Time);
        varies.then_some(value)
    }

    /// Whether a formula is zero at the points of a domain at all these values of the step variable.
    fn is_zero_at(&self, value: &Value, domain: &Domain, times: &[f64]) -> bool {
        let n: usize = domain.groups.iter().map(|g| g.entities.len() * g.n_points()).sum();
        if n == 0 || n.saturating_mul(times.len()) > MOST {
            return false;
        }
        let is_zero = |points: &[[f64; 3]], time: f64| {
            let found = value.at_step(Window::instant(time)).at_positions(points);
            found.is_ok_and(|values| values.iter().all(|v| *v == 0.0))
        };
        let mut points = Vec::with_capacity(TOGETHER.min(n));
        for point in 0..n {
            points.push(domain.position(&self.mesh, point));
            // the first one alone: nearly every load has a value there
            if point > 0 && points.len() < TOGETHER && point + 1 < n {
                continue;
            }
            if !times.iter().rev().all(|t| is_zero(&points, *t)) {
                return false;
            }
            points.clear();
        }
        true
    }
}

/// The values of the step variable at which a formula acts, one for a formula without it; `None` where they are not known.
fn times(value: &Value, steps: Option<&Steps>) -> Option<Vec<f64>> {
    if !value.law.prologue.slots.contains(&UniformSlot::Time) {
        return Some(vec![0.0]);
    }
    steps.filter(|steps| steps.auto.is_none()).map(|steps| steps.values.clone())
}
