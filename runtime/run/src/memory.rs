//! What one step leaves to the next beside the unknowns: kept over a step that failed and over a run that was killed.

use wfl_compiler::types::FieldKind;
use wfl_contact::ContactMemory;
use wfl_discrete::system::{System, Tangent};
use wfl_problem::Solving;

/// What a step inherits from the one before, beside the unknowns. Within a run of several ranks each keeps the rows of the
/// tangent that it has; what a checkpoint keeps has all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// Values of the last tangent of the nonlinear terms; empty before the first one.
    pub changing: Vec<f64>,
    /// The state of contact.
    pub contact: ContactMemory,
    /// By state in the order of the fields: its values.
    pub states: Vec<Vec<f64>>,
}

impl Memory {
    /// What later steps of a scene depend on beside the unknowns.
    pub(super) fn of(scene: &Solving<'_>, tangent: &Tangent) -> Self {
        let system = &scene.system;
        Self {
            changing: tangent.memory(),
            contact: scene.contact.memory(),
            states: states(system).map(|k| system.data()[k].clone()).collect(),
        }
    }

    /// The same with the tangent of all ranks, made by all together: what a run on any number of ranks goes on from. Of
    /// ranks that have a part of the mesh each keeps its own.
    pub(super) fn of_all(scene: &Solving<'_>, tangent: &Tangent) -> Self {
        if keeps_its_own(scene.system) || tangent.is_applied() {
            return Self::of(scene, tangent);
        }
        let changing = tangent.changing.values_of_all(scene.system.team());
        Self { changing, ..Self::of(scene, tangent) }
    }

    /// What is left where there was no tangent yet, or never is one: the state of contact and the states.
    pub(super) fn without_tangent(scene: &Solving<'_>) -> Self {
        let system = &scene.system;
        let states = states(system).map(|k| system.data()[k].clone()).collect();
        Self { changing: Vec::new(), contact: scene.contact.memory(), states }
    }

    /// Goes back to what [`Self::without_tangent`] kept, as [`Self::recall`] does.
    #[must_use]
    pub(super) fn recall_without_tangent(&self, scene: &mut Solving<'_>) -> bool {
        self.changing.is_empty() && self.recall_states(scene)
    }

    /// Goes back to what [`Self::of_all`] kept, as [`Self::recall`] does.
    #[must_use]
    pub(super) fn recall_of_all(&self, scene: &mut Solving<'_>, tangent: &mut Tangent) -> bool {
        let team = scene.system.team();
        if keeps_its_own(scene.system) || tangent.is_applied() || self.changing.is_empty() {
            return self.recall(scene, tangent);
        }
        let mut own = tangent.changing.clone();
        let fits = own.take_own(&self.changing, team);
        fits && Self { changing: own.values().to_vec(), ..self.clone() }.recall(scene, tangent)
    }

    /// Goes back to what was remembered. False if that belongs to another scene.
    #[must_use]
    pub(super) fn recall(&self, scene: &mut Solving<'_>, tangent: &mut Tangent) -> bool {
        tangent.recall(&self.changing) && self.recall_states(scene)
    }

    /// Contact and states alone.
    fn recall_states(&self, scene: &mut Solving<'_>) -> bool {
        let known = scene.system.data();
        let fits = states(scene.system).map(|k| known[k].len()).eq(self.states.iter().map(Vec::len));
        if !fits || !scene.contact.recall(&self.contact) {
            return false;
        }
        let of: Vec<usize> = states(scene.system).collect();
        of.iter().zip(&self.states).for_each(|(k, s)| scene.system.data_mut(*k).clone_from(s));
        true
    }
}

/// Whether the memory of a rank is that of its own rows: it has all of them, or goes on with its part of the mesh.
fn keeps_its_own(system: &System) -> bool {
    system.team().is_alone() || !system.mesh.holders().is_alone()
}

/// The fields that are states.
fn states(system: &System) -> impl Iterator<Item = usize> + '_ {
    (0..system.fields.len()).filter(|k| system.fields[*k].kind == FieldKind::State)
}
