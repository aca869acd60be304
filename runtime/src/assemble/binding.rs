//! A point law bound to a domain: which basis tables its slots read, which nodes they gather.
//!
//! Made once per term; everything that evaluation needs per batch is looked up here.

use std::collections::BTreeMap;

use wfl_compiler::types::{BasisSlot, FieldId, FieldOp, InputSlot, Side};

use crate::{
    assemble::domain::{Domain, Group},
    element::Table,
    field::{Field, FieldError},
    mesh::Mesh,
};

/// A field on one side of a group: its basis at the points and its nodes in each entity.
#[derive(Clone, Debug)]
pub struct Basis {
    /// The field.
    pub field: FieldId,
    /// On which side.
    pub side: Side,
    /// Components at a node.
    pub n_components: usize,
    /// Nodes in an entity.
    pub n_nodes: usize,
    /// Values and reference derivatives at the points.
    pub table: Table,
    /// Highest derivative that a slot reads.
    pub order: usize,
    /// Node numbers: `nodes[entity * n_nodes + i]`.
    pub nodes: Vec<u32>,
    /// Where its dofs start among the local dofs of the law.
    pub offset: usize,
}

impl Basis {
    /// Local dofs.
    #[must_use]
    pub fn n_dofs(&self) -> usize {
        self.n_nodes * self.n_components
    }
}

/// Where one slot finds its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotPlace {
    /// Position in the list of bases.
    pub basis: usize,
    /// Component of the field.
    pub component: usize,
    /// What is taken of the basis functions.
    pub op: FieldOp,
    /// Direction (gradient) or pair of directions `i + dim * j` (second derivatives).
    pub direction: usize,
}

/// One input of a law.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    /// From the current state.
    Current(SlotPlace),
    /// From the state at the end of the previous step.
    Previous(SlotPlace),
    /// Geometry.
    Geometry(InputSlot),
}

/// The bases of one group.
#[derive(Clone, Debug)]
pub struct GroupBinding {
    /// One entry per field and side.
    pub bases: Vec<Basis>,
}

/// A law's slots on a domain.
#[derive(Clone, Debug)]
pub struct Binding {
    /// In the order of the law's input slots.
    pub inputs: Vec<Input>,
    /// Places of the test slots.
    pub tests: Vec<SlotPlace>,
    /// Places of the trial slots.
    pub trials: Vec<SlotPlace>,
    /// For each group of the domain.
    pub groups: Vec<GroupBinding>,
}

/// What a law reads and multiplies.
#[derive(Clone, Copy, Debug)]
pub struct LawSlots<'a> {
    /// Point inputs.
    pub inputs: &'a [InputSlot],
    /// Test slots.
    pub tests: &'a [BasisSlot],
    /// Trial slots.
    pub trials: &'a [BasisSlot],
}

impl Binding {
    /// Binds the slots of a law on a domain to the spaces of the fields.
    ///
    /// # Errors
    /// [`FieldError`] when a field has no dofs on an entity of the domain.
    pub fn new(mesh: &Mesh, domain: &Domain, fields: &[Field], law: LawSlots<'_>) -> Result<Self, FieldError> {
        let mut pairs: BTreeMap<(FieldId, Side), usize> = BTreeMap::new();
        let mut note = |slot: &BasisSlot| {
            let order = pairs.entry((slot.field, slot.side)).or_default();
            *order = (*order).max(slot.op.order());
        };
        law.tests.iter().chain(law.trials).for_each(&mut note);
        for slot in law.inputs {
            if let InputSlot::Field(s) | InputSlot::Previous(s) = slot {
                note(s);
            }
        }
        let index: BTreeMap<(FieldId, Side), usize> = pairs.keys().enumerate().map(|(k, key)| (*key, k)).collect();
        let place = |slot: &BasisSlot| {
            let n = fields[slot.field.index()].n_components;
            let entry = usize::from(slot.entry);
            SlotPlace {
                basis: index[&(slot.field, slot.side)],
                component: entry % n,
                op: slot.op,
                direction: entry / n,
            }
        };
        let inputs = law
            .inputs
            .iter()
            .map(|slot| match slot {
                InputSlot::Field(s) => Input::Current(place(s)),
                InputSlot::Previous(s) => Input::Previous(place(s)),
                other => Input::Geometry(*other),
            })
            .collect();
        let mut groups = Vec::with_capacity(domain.groups.len());
        for group in &domain.groups {
            let mut bases = Vec::with_capacity(pairs.len());
            let mut offset = 0;
            for ((field, side), order) in &pairs {
                let basis = basis(mesh, group, &fields[field.index()], *field, *side, *order, offset)?;
                offset += basis.n_dofs();
                bases.push(basis);
            }
            groups.push(GroupBinding { bases });
        }
        Ok(Self {
            inputs,
            tests: law.tests.iter().map(place).collect(),
            trials: law.trials.iter().map(place).collect(),
            groups,
        })
    }
}

impl GroupBinding {
    /// Local dofs of an entity, all bases.
    #[must_use]
    pub fn n_dofs(&self) -> usize {
        self.bases.last().map_or(0, |b| b.offset + b.n_dofs())
    }
}

/// A basis function below this at every point does not act there; its largest value is 1.
const NO_VALUE: f64 = 1e-14;

impl GroupBinding {
    /// For each node of basis `b`: whether some slot sees its function. Where only values are read, functions that are
    /// 0 at every point (those of nodes off the facet) do nothing, and their dofs stay out of the tangent.
    #[must_use]
    pub fn acting_nodes<'s>(&self, b: usize, mut slots: impl Iterator<Item = &'s SlotPlace>) -> Vec<bool> {
        let basis = &self.bases[b];
        if slots.any(|s| s.basis == b && s.op != FieldOp::Value) {
            return vec![true; basis.n_nodes];
        }
        let value = |point: usize, node: usize| basis.table.values[point * basis.n_nodes + node].abs();
        (0..basis.n_nodes).map(|i| (0..basis.table.n_points).any(|q| value(q, i) > NO_VALUE)).collect()
    }
}

fn basis(
    mesh: &Mesh,
    group: &Group,
    field: &Field,
    id: FieldId,
    side: Side,
    order: usize,
    offset: usize,
) -> Result<Basis, FieldError> {
    let tabulated = field.tabulate(mesh, group, side, order)?;
    let n_nodes = tabulated.table.n_dofs;
    Ok(Basis {
        field: id,
        side,
        n_components: field.n_components,
        n_nodes,
        table: tabulated.table,
        order,
        nodes: tabulated.nodes,
        offset,
    })
}
