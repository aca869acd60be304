//! Ends of cracks at which a multiplier is left out, since both sides are one node there: told where the crack is closed.
//!
//! The equation of a multiplier at such a node is empty, and its value zero. Where the crack is open beside it, so is the
//! traction; where it is closed, the traction is not zero, and what the multiplier is on the faces beside the node is wrong by
//! as much. Decides nothing: numbers of a state alone.

use std::collections::BTreeSet;

use wfl::{Code, Diagnostic};

use super::Scene;
use crate::{field::FieldSpace, finite::largest, system::System};

/// A crack counts as closed at its ends where the multiplier beside them is more than this part of its largest value.
const CLOSED: f64 = 1e-3;

/// A multiplier that is left out at ends of a `split`.
#[derive(Clone, Debug)]
pub(crate) struct Tips {
    field: usize,
    /// The nodes where it is left out.
    count: usize,
    /// Its unknowns at the other nodes of their faces.
    beside: Vec<usize>,
}

impl Tips {
    /// Those at these nodes of a field; `None` for a field without nodes.
    pub(super) fn new(system: &System, field: usize, ends: &BTreeSet<u32>) -> Option<Self> {
        let FieldSpace::Nodal(space) = &system.fields[field].space else { return None };
        let (start, n) = (system.range(field)?.start, system.fields[field].n_components);
        let faces = (0..space.n_positions()).map(|position| space.entity_nodes(position));
        let touched = faces.filter(|nodes| nodes.iter().any(|node| ends.contains(node)));
        let beside: BTreeSet<u32> = touched.flatten().filter(|node| !ends.contains(node)).copied().collect();
        let dofs = beside.iter().flat_map(|node| (0..n).map(move |c| start + *node as usize * n + c));
        Some(Self { field, count: ends.len(), beside: dofs.collect() })
    }

    /// W680 for a state.
    fn told(&self, scene: &Scene, time: f64, u: &[f64]) -> Option<Diagnostic> {
        let most = largest(u[scene.system.range(self.field)?].iter().copied());
        let part = largest(self.beside.iter().map(|dof| u[*dof])) / most;
        // of a multiplier that is zero everywhere there is no part
        if part.is_nan() || part <= CLOSED {
            return None;
        }
        let name = &scene.system.fields[self.field].name;
        let (ends, part) = (if self.count == 1 { "end" } else { "ends" }, (100.0 * part).round());
        let text = format!(
            "at t = {time} `{name}` is zero at {} {ends} of a crack that is closed there: beside them it is {part} % of its \
             largest value",
            self.count
        );
        let note = "both sides are one node there: without a jump a multiplier has no equation, and on the faces beside it is \
                    wrong by as much";
        let help = "one value a face has no such node: `DP0`, beside displacements of degree two";
        Some(Diagnostic::new(Code::W680, text).at_or_note(scene.place_of_field(name), "").note(note).help(help))
    }
}

/// W680 for the multipliers of a scene at a state; nothing of one whose nodes several ranks share.
pub(crate) fn closed_tips(scene: &Scene, time: f64, u: &[f64]) -> Vec<Diagnostic> {
    let alone = scene.system.team().is_alone();
    scene.tips.iter().filter(|_| alone).filter_map(|tips| tips.told(scene, time, u)).collect()
}
