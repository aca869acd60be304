//! `balance water of p, pf`: what the equations of scalar unknowns add up to.
//!
//! Each equation is multiplied by one and all are added. Terms with the gradient of the test function drop out and exchange
//! between the unknowns cancels; what is left is what each term takes up, what loads and prescribed values bring (in) or
//! take (out), and what the equations leave (lost). in - out - sum of the terms = lost, where a statement counts as in or
//! out by the sign of its sum. Promises: the equations are those that were solved, as they are written.

use std::collections::BTreeMap;

use wfl::{Code, Diagnostic, ast::BalancePart};
use wfl_compiler::types::FieldKind;
use wfl_discrete::window::Window;

use super::{
    Builder, Energy, Scene,
    reactions::{Added, Held, Measured},
};

/// Of what moved this part may be lost: Newton's tolerance leaves less.
const LOST: f64 = 1e-8;

/// The equations of a balance.
#[derive(Clone, Debug)]
struct Equations {
    /// The fields by their positions.
    fields: Vec<usize>,
    /// The terms that have a number of their own.
    terms: Vec<String>,
    /// By statement the dofs that it prescribes.
    held: Vec<Vec<usize>>,
}

/// What moves in a step, of a balance by the name of what it loses.
#[derive(Clone, Debug)]
pub struct Turnover {
    /// The measure.
    pub(crate) name: String,
    /// The most that one of its terms takes from some nodes and gives to others, beside what comes in and goes out.
    pub(crate) amount: f64,
}

/// What they add up to.
#[derive(Debug, Default)]
struct Sums {
    brought: f64,
    taken: f64,
    by_term: Vec<f64>,
}

/// One number of a balance.
#[derive(Clone, Debug)]
pub(super) struct Balanced {
    of: Equations,
    part: BalancePart,
    /// The term of the number, by its place.
    term: usize,
    /// States are read as they were at the end of the previous step.
    pub(super) reads_past: bool,
}

impl Balanced {
    /// Its value at a state, not a number where an equation is none; made by all ranks together.
    pub(super) fn value(&self, at: &Measured<'_>) -> f64 {
        let Some(sums) = self.of.sums(at) else { return f64::NAN };
        match self.part {
            BalancePart::In => sums.brought,
            BalancePart::Out => sums.taken,
            BalancePart::Term => sums.by_term.get(self.term).copied().unwrap_or(0.0),
            BalancePart::Lost => sums.brought - sums.taken - sums.by_term.iter().sum::<f64>(),
        }
    }

    /// Of what is lost: what moves from node to node; made by all ranks together.
    pub(super) fn moved(&self, at: &Measured<'_>) -> Option<f64> {
        if self.part != BalancePart::Lost {
            return None;
        }
        let of_term = |added: &Vec<Added>| self.of.fields.iter().map(|field| added[*field].moved).sum();
        Some(at.sums()?.iter().map(of_term).fold(0.0, f64::max))
    }
}

impl Sums {
    /// What a statement brings, or takes where it is negative.
    fn bring(&mut self, amount: f64) {
        if amount >= 0.0 {
            self.brought += amount;
        } else {
            self.taken -= amount;
        }
    }
}

impl Equations {
    /// The sums at a state; `None` where a number is not finite.
    fn sums(&self, at: &Measured<'_>) -> Option<Sums> {
        let system = at.system;
        let mut sums = Sums { by_term: vec![0.0; self.terms.len()], ..Sums::default() };
        for (term, by_field) in system.terms.iter().zip(at.sums()?) {
            let sum: f64 = self.fields.iter().map(|field| by_field[*field].sum).sum();
            match self.terms.iter().position(|name| Energy::is_of(name, &term.law.name)) {
                Some(place) => sums.by_term[place] += sum,
                None => sums.bring(-sum),
            }
        }
        let rows = at.rows();
        if system.team().any(rows.is_none()) {
            return None;
        }
        let left = rows.unwrap_or_default();
        for dofs in &self.held {
            sums.bring(system.team().total(dofs.iter().map(|dof| left[*dof]).sum()));
        }
        Some(sums)
    }
}

impl Builder<'_> {
    /// One number of a balance; `None` after a message.
    pub(super) fn balanced(&mut self, measure: &wfl::Measure, part: BalancePart, held: Held<'_>) -> Option<Balanced> {
        let balance = self.script.balances.iter().find(|b| b.span == measure.span)?;
        let first = part == BalancePart::In;
        let (mut fields, mut ranges) = (Vec::new(), Vec::new());
        for name in &balance.fields {
            let position = self.fields.iter().position(|f| f.name == name.name)?;
            let field = &self.fields[position];
            if field.n_components != 1 || field.kind != FieldKind::Unknown {
                if first {
                    let d = Diagnostic::new(
                        Code::E462,
                        format!("`{}` is no scalar: its equations have no sum", field.name),
                    );
                    let d =
                        d.help(format!("the force that is carried: measure f = reaction({}(1)) on ...", field.name));
                    self.diagnostics.push(d.at(name.span, "a balance is one of scalar unknowns"));
                }
                return None;
            }
            let start = held.numbering.starts[position]?;
            fields.push(position);
            ranges.push(start..start + field.n_dofs());
        }
        if first {
            self.has_reactions(&measure.expr, held.integration)?;
        }
        let mut by_statement: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (dof, statement) in held.prescribed.statements() {
            if ranges.iter().any(|range| range.contains(&dof)) {
                by_statement.entry(statement).or_default().push(dof);
            }
        }
        let terms = self.script.terms_of(&balance.fields);
        let end = measure.name.name.strip_prefix(&balance.name.name)?.strip_prefix('_')?;
        let term = terms.iter().position(|term| term == end).unwrap_or_default();
        // a rank without a node of a statement takes part in the sum of it
        let held = (0..held.prescribed.n_statements()).map(|k| by_statement.remove(&k).unwrap_or_default()).collect();
        let reads_past = self.has_states();
        Some(Balanced { of: Equations { fields, terms, held }, part, term, reads_past })
    }
}

/// What is looked at of a step.
#[derive(Clone, Copy)]
pub struct Ended<'s> {
    /// When it is.
    pub window: Window,
    /// Its measures by name.
    pub measures: &'s [(String, f64)],
    /// Of each balance; empty for a step that another process did, which has told it.
    pub moved: &'s [Turnover],
    /// The part of the forces that rounding leaves: of a step that is short beside what it stores no more is known.
    pub floor: f64,
}

/// W650: the step with the largest part that is lost of what moves, where that is more than Newton leaves. In a scene with
/// rates the balances are rates: a step counts by its increment, beside all that moves during the run. One that is short, at a
/// jump of a load, knows its rates to few digits and loses nothing by that.
#[must_use]
pub fn unbalanced<'s>(scene: &Scene, steps: impl Iterator<Item = Ended<'s>> + Clone) -> Vec<Diagnostic> {
    let has_rates = scene.steps.from_start;
    let told = |name: &String| {
        let lost = format!("{name}_lost");
        let moved = |step: &Ended<'_>| step.moved.iter().find(|m| m.name == lost).map(|m| m.amount);
        let all: f64 = steps.clone().filter_map(|step| Some(moved(&step)? * step.window.increment)).sum();
        let worst = steps.clone().filter_map(|step| {
            let moved = moved(&step)?;
            let lost = step.measures.iter().find(|m| m.0 == lost).map_or(0.0, |m| m.1);
            let share = if has_rates { part(lost * step.window.increment, all) } else { part(lost, moved) };
            (part(lost, moved) > step.floor).then_some((step.window.end, lost, share))
        });
        let (time, lost, share) = worst.max_by(|a, b| a.2.total_cmp(&b.2))?;
        (share > LOST).then(|| {
            let of = if has_rates { "in the run" } else { "there" };
            let text = format!("at t = {time} the balance `{name}` loses {lost:.3e}, {share:.1e} of what moves {of}");
            let why = "the step has not converged to that, or points of a mapping have no image";
            Diagnostic::new(Code::W650, text).note(why)
        })
    };
    scene.balances.iter().filter_map(told).collect()
}

fn part(lost: f64, moved: f64) -> f64 {
    if lost == 0.0 { 0.0 } else { lost.abs() / moved }
}
