//! The end of a step, or of a part of one: the balance of energy, new states, rates. Solves nothing.

use std::sync::Arc;

use wfl::{Code, Diagnostic};
use wfl_compiler::{
    KinkKind, TermLaw,
    types::{FieldKind, InputSlot},
};
use wfl_discrete::window::Window;
use wfl_newton::NewtonError;
use wfl_problem::{Energy, Solving};

use super::{
    balance::{Balance, Kinds},
    ended::Ended,
    rates,
    stepping::Stepper,
    trajectory::Passed,
};

impl Stepper {
    /// Renews states and moves `u` to the end of the step. The forces of the balance are those of the equations, so with the
    /// states before; where the equations stand within the step no state is renewed.
    pub(super) fn leave(&mut self, scene: &mut Solving<'_>, window: Window, u: &mut [f64]) -> Result<(), NewtonError> {
        let within = rates::offset(scene) != 0.0;
        if !within {
            self.balance(scene, window, u)?;
        }
        self.renew(scene);
        rates::leave(scene, window, u)?;
        if within {
            self.trajectory.iter_mut().for_each(|kept| kept.ended_at(u));
            self.balance(scene, window, u)?;
        }
        Ok(())
    }

    /// Adds a step, or a part of one, that has converged at `u` to the steps that are kept, before its states are renewed.
    pub(super) fn keep_passed(&mut self, scene: &Solving<'_>, window: Window, u: &[f64], kind: Passed) {
        if let Some(kept) = &mut self.trajectory {
            kept.add(scene, window, u, kind);
        }
    }

    /// Adds a part of a step that has converged at `u` to what friction did, before its states are renewed.
    pub(super) fn slide(&mut self, scene: &Solving<'_>, u: &[f64]) {
        if let Some(friction) = &mut self.friction {
            friction.slide(scene, u, &self.next_states);
        }
    }

    fn balance(&mut self, scene: &mut Solving<'_>, window: Window, u: &[f64]) -> Result<(), NewtonError> {
        if scene.energy.is_none() {
            return Ok(());
        }
        match &mut self.balance {
            Some(balance) => balance.add(Kinds::Named, scene, window, u),
            none => {
                *none = Some(Balance::start(Kinds::Named, scene, window, u)?);
                Ok(())
            }
        }
    }

    /// The energies of a scene that asks for them, by the names of measures.
    pub(super) fn energies(&self, scene: &Solving<'_>) -> Vec<(String, f64)> {
        let (Some(energy), Some(balance)) = (&scene.energy, &self.balance) else { return Vec::new() };
        energy.measures().into_iter().zip(balance.values()).collect()
    }
}

/// W620 for a run that loses more energy than the scene allows, or whose contact does.
pub(super) fn lost(run: &Ended<'_>) -> Option<Diagnostic> {
    let Ended { scene, run, .. } = run;
    let steps = run.steps.iter().map(|s| (s.window.end, s.measures.as_slice()));
    let balance = run.stepper.balance.as_ref();
    let energy = scene.energy.as_ref()?;
    let names = energy.measures();
    let lost = names.last().expect("the last is what is lost");
    let (mut largest, mut worst) = (0.0f64, (0.0f64, 0.0f64));
    for (time, measures) in steps {
        for (_, value) in measures.iter().filter(|(name, _)| names.contains(name) && name != lost) {
            largest = largest.max(value.abs());
        }
        let value = measures.iter().find(|(name, _)| name == lost).map_or(0.0, |m| m.1);
        if value.abs() > worst.1.abs() {
            worst = (time, value);
        }
    }
    let (time, value) = worst;
    let part = value.abs() / largest;
    let word = if value < 0.0 { "gained" } else { "lost" };
    if part > energy.limit {
        let text = format!(
            "by t = {time} the energy {:.3e} is {word}, {part:.1e} of the largest energy of the run, at most {:.0e} expected",
            value.abs(),
            energy.limit
        );
        let help = "smaller steps show whether the steps or a term are the cause";
        return Some(Diagnostic::new(Code::W620, text).help(help));
    }
    let balance = balance?;
    let kinds = || energy.terms.iter().map(|name| (name, contact_of(scene, name)));
    let of = |wanted: Contact, works: &mut dyn Iterator<Item = f64>| {
        let all = kinds().zip(works).filter(|((_, kind), _)| *kind == Some(wanted));
        let most = all.max_by(|a, b| a.1.total_cmp(&b.1)).map(|((name, _), value)| (name, value));
        most.filter(|(_, value)| value / largest > energy.limit)
    };
    let said = |value: f64| {
        let limit = energy.limit;
        format!(
            "the energy {value:.3e}, {:.1e} of the largest energy of the run, at most {limit:.0e} expected",
            value / largest
        )
    };
    let why =
        "contact begins and ends within steps that are too long for it, which the balance of the steps does not show";
    if let Some((name, value)) = of(Contact::Elastic, &mut balance.unreturned()) {
        let text = format!("between two times at which `{name}` has no force it took up, or gave, {}", said(value));
        let d = Diagnostic::new(Code::W620, text).at_or_note(scene.place_of_term(name), why);
        return Some(d.help("smaller steps, or a softer contact"));
    }
    let (name, value) = of(Contact::Frictional, &mut balance.given())?;
    let text = format!("between two times at which `{name}` has no force it gave {}", said(value));
    let d = Diagnostic::new(Code::W620, text).at_or_note(scene.place_of_term(name), why);
    let d = d.note("friction takes energy up; only a wall or a belt that moves gives some");
    Some(d.help("a scheme that damps (bdf2, `newmark` with gamma = 0.53), `massless=` for the nodes of contact, or smaller steps"))
}

/// A contact by what becomes of the energy that it takes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Contact {
    /// Its force follows from the state alone: it gives back what it takes.
    Elastic,
    /// With friction: it keeps some.
    Frictional,
}

/// What a term is; `None` if it is no contact, or one whose law depends on time or on rates.
fn contact_of(scene: &Solving<'_>, name: &str) -> Option<Contact> {
    let kind = |field: usize| scene.system.fields.get(field).map(|f| f.kind);
    let is_of_state = |slot: &InputSlot| match slot {
        InputSlot::Field(b) => matches!(kind(b.field.index()), Some(FieldKind::Unknown | FieldKind::Multiplier)),
        InputSlot::Previous(_) | InputSlot::History(..) => false,
        _ => true,
    };
    let is_of_past = |slot: &InputSlot| match slot {
        InputSlot::Field(b) => is_of_state(slot) || kind(b.field.index()) == Some(FieldKind::State),
        InputSlot::History(..) => false,
        _ => true,
    };
    let laws = || scene.system.terms.iter().map(|t| &t.law).filter(|law| Energy::is_of(name, &law.name));
    let has = |law: &Arc<TermLaw>, wanted: KinkKind| law.kinks.iter().any(|k| k.kind == wanted);
    if !laws().any(|law| has(law, KinkKind::Select)) || !laws().all(|law| law.prologue.slots.is_empty()) {
        return None;
    }
    let selects = |law: &Arc<TermLaw>| law.kinks.iter().all(|k| k.kind == KinkKind::Select);
    if laws().all(|law| law.inputs.iter().all(is_of_state) && selects(law)) {
        return Some(Contact::Elastic);
    }
    let reads_the_past = laws().all(|law| law.inputs.iter().all(is_of_past));
    (reads_the_past && laws().any(|law| !selects(law))).then_some(Contact::Frictional)
}
