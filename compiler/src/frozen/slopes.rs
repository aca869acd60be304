//! The derivative of the argument of each projection with respect to what it reads: exact, and compiled when asked for.
//!
//! An argument of contact is `gamma g - s`: a gap times a stiffness, less a traction. Its derivatives with respect to
//! displacements say what gamma is and which way the sides move apart; those with respect to gradients and multipliers
//! say what the traction is made of. Promises: a pair of entry and slot that is not listed is zero at every state.
//! Projections inside an argument follow their branches, as in the watch law. Says nothing of radii.

use std::collections::BTreeMap;

use super::FrozenLaw;
use crate::{
    build::Env,
    degree::Degree,
    graph::{ExprId, Graph},
    ir::Val,
    law::ValueLaw,
    lower::Lowering,
    scalar::Form,
    term::{tangent_of, value_of, values_law},
    types::{BasisSlot, FieldSig, PlaceSig, Shape},
};

/// One derivative of an argument: an output of [`SlopesLaw::law`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ArgumentSlope {
    /// Position of the projection in [`FrozenLaw::projections`].
    pub projection: usize,
    /// Entry of its argument.
    pub entry: usize,
    /// With respect to what: value, gradient or Hessian of an unknown or a multiplier, on one side.
    pub slot: BasisSlot,
}

/// The derivatives of the arguments of all projections of a term.
#[derive(Clone, Debug)]
pub struct SlopesLaw {
    /// What each output is, sorted by projection, entry and slot. Pairs that are zero at every state are left out.
    pub slopes: Vec<ArgumentSlope>,
    /// One output for each of `slopes`. Its inputs are those of [`FrozenLaw::watch`] in the same order, branches included:
    /// what was read for the one serves the other.
    pub law: ValueLaw,
}

impl SlopesLaw {
    /// The slopes of one projection with the position of their outputs.
    pub fn of_projection(&self, projection: usize) -> impl Iterator<Item = (usize, ArgumentSlope)> {
        let slopes = self.slopes.iter().copied().enumerate();
        slopes.filter(move |(_, s)| s.projection == projection)
    }
}

impl FrozenLaw {
    /// The derivatives of the arguments; `None` if there are none, or if one cannot be written.
    #[must_use]
    pub fn slopes(&self) -> Option<SlopesLaw> {
        let mut g = self.law.listing.graph.clone();
        let derivatives = derivatives(&mut g, &self.fields, &self.arguments)?;
        let mut lowering = Lowering::new(&g);
        // what the watch law reads comes first, in its order
        lowering.values(self.watched);
        let mut found: Vec<(ArgumentSlope, Val)> = Vec::new();
        for (projection, derivative) in derivatives.iter().enumerate() {
            for (entry, slopes) in by_slot(&mut lowering, *derivative).into_iter().enumerate() {
                found.extend(slopes.into_iter().map(|(slot, v)| (ArgumentSlope { projection, entry, slot }, v)));
            }
        }
        let (slopes, outputs): (Vec<ArgumentSlope>, Vec<Val>) = found.into_iter().unzip();
        let name = format!("{}.slopes", self.law.name);
        let shape = Shape::new(&[outputs.len()])?;
        let law = values_law(&self.fields, &name, lowering, &outputs, shape, Degree::default());
        Some(SlopesLaw { slopes, law })
    }
}

/// Along the trial functions.
fn derivatives(g: &mut Graph, fields: &[FieldSig], arguments: &[ExprId]) -> Option<Vec<ExprId>> {
    arguments.iter().map(|a| tangent_of(g, fields, *a).ok()).collect()
}

/// The law of what is watched, which reads what the slopes read: where images move that is more than the arguments.
/// `None` if an argument has no derivative.
pub(super) fn watch_law(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    mut g: Graph,
    of: (ExprId, &[ExprId]),
) -> Option<ValueLaw> {
    let (watched, arguments) = of;
    if g.moves.is_none() {
        return Some(value_of(env, place, name, g, watched));
    }
    let derivatives = derivatives(&mut g, env.fields, arguments)?;
    let mut lowering = Lowering::new(&g);
    let outputs = lowering.values(watched);
    derivatives.iter().for_each(|derivative| drop(lowering.lower(*derivative)));
    let shape = g.shape(watched);
    Some(values_law(env.fields, name, lowering, &outputs, shape, Degree::default()))
}

/// The derivative of each entry of an expression with respect to each slot, from its derivative along the trial
/// functions.
pub(super) fn by_slot(lowering: &mut Lowering<'_>, derivative: ExprId) -> Vec<BTreeMap<BasisSlot, Val>> {
    let forms = lowering.lower(derivative);
    let slots: BTreeMap<u16, BasisSlot> = lowering.slots.trials.iter().map(|(slot, id)| (*id, *slot)).collect();
    let by_slot = |form: &Form| form.iter().map(|((_, trial), v)| (slots[trial], *v)).collect();
    forms.iter().map(by_slot).collect()
}
