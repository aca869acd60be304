//! Where a run stands, as values: what an attempt at a step goes back to, and what a run goes on from.
//!
//! Promises: a step depends on the scene and on these numbers alone; whoever goes back to them finds the bits of a run that
//! was never anywhere else.

use wfl_contact::FrictionMemory;
use wfl_discrete::{
    rates::{Rates, RatesMemory},
    system::Known,
};
use wfl_sparse::solve::SolverMemory;

use super::{balance::Balance, friction::Friction, memory::Memory, remembered::Adaptive};

/// Where a step, or a part of it, begins: what attempts at it change.
#[derive(Clone)]
pub(super) struct Snapshot {
    pub(super) u: Vec<f64>,
    pub(super) changes: Changes,
    /// What was summed over the parts of earlier steps, once a part of this one has passed.
    pub(super) sums: Option<Sums>,
}

/// What an attempt changes beside the unknowns.
#[derive(Clone)]
pub(super) enum Changes {
    /// An explicit step: it has no contact of its own, and renews states at its end.
    Rates(Option<Rates>),
    /// A step that is solved.
    All {
        /// Contact, states, and the tangent.
        memory: Memory,
        /// Known fields, the past and rates.
        known: Known,
    },
}

/// What is summed over the parts of steps.
#[derive(Clone)]
pub(super) struct Sums {
    pub(super) balance: Option<Balance>,
    pub(super) friction: Option<Friction>,
}

/// Where a run stands between two steps: all that the next one depends on beside the scene. Of several ranks that have a
/// part of the mesh each has its own, else all have the whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The unknowns.
    pub(super) u: Vec<f64>,
    /// Contact, states, and the tangent that steps begin with.
    pub(super) memory: Memory,
    /// The rates.
    pub(super) rates: RatesMemory,
    /// What factors there are.
    pub(super) solver: SolverMemory,
    /// The present increment is 2^-level of a step, and so many parts of this size have converged in a row.
    pub(super) level: u32,
    pub(super) easy: u32,
    /// What steps that the run chooses remember.
    pub(super) adaptive: Option<Adaptive>,
    /// The balance of energy.
    pub(super) balance: Option<Balance>,
    /// What friction remembers.
    pub(super) friction: Option<FrictionMemory>,
}

impl State {
    /// What its numbers take in memory.
    pub(super) fn bytes(&self) -> u64 {
        let of = |lists: &[Vec<f64>]| lists.iter().map(Vec::len).sum::<usize>();
        let contact = &self.memory.contact;
        let contact = of(&contact.active) + of(&contact.terms) + of(&contact.converged);
        let numbers = self.u.len() + self.memory.changing.len() + of(&self.memory.states) + contact;
        8 * (numbers + of(&self.rates.kept) + self.solver.factored.len()) as u64
    }

    /// All unknowns, prescribed ones included, field after field, node after node, component fastest.
    #[must_use]
    pub fn unknowns(&self) -> &[f64] {
        &self.u
    }
}
