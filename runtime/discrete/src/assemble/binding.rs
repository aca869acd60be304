//! A point law bound to a domain: which basis tables its slots read, which nodes they gather.
//!
//! Made once per term; everything that evaluation needs per batch is looked up here.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use wfl_compiler::{
    ir::LANES,
    types::{BasisSlot, FieldId, FieldOp, InputSlot, RateOrder, Side},
};

use crate::domain::{Domain, Group, PointName, nearest_points};
use crate::{
    assemble::simd::Lanes,
    field::{Field, FieldError, FieldSpace},
};
use wfl_mesh::{
    element::Table,
    mesh::{FacetRef, Mesh},
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
    /// Values and reference derivatives at the points, those of a field on facets in the parameters of the facet.
    pub table: Table,
    /// Of a field on facets: derivatives of the reference point of the cell in those parameters.
    pub tangents: Option<[[f64; 3]; 2]>,
    /// Highest derivative that a slot reads.
    pub order: usize,
    /// Node numbers: `nodes[entity * n_nodes + i]`.
    pub nodes: Vec<u32>,
    /// Where its dofs start among the local dofs of the law.
    pub offset: usize,
    /// Functions whose value is not zero (to rounding) at all points: those of the nodes on the facet, as a rule.
    pub support: Vec<u16>,
    starts: Starts,
}

/// Where the numbers of a basis start: values among those that every batch shares, derivatives in the workspace.
#[derive(Clone, Copy, Debug, Default)]
struct Starts {
    /// `[point][function]`
    values: usize,
    /// `[point][function of the support]`
    support: usize,
    /// `[direction][point][function]`, or `[direction][function]` where gradients are the same at all points.
    gradients: usize,
    /// `[pair of directions][point][function]`
    hessians: usize,
    /// Gradients are the same at all points: linear functions on cells with an affine map.
    constant_gradients: bool,
}

/// Basis functions under one operation: those of point `q` start at `start + q * step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Operand {
    /// In [`GroupBinding::values`], else among the derivatives of the workspace.
    pub(super) is_value: bool,
    /// Of point 0.
    pub(super) start: usize,
    /// From point to point.
    pub(super) step: usize,
    /// How many functions.
    pub(super) n: usize,
}

impl Operand {
    /// The functions at a point.
    #[inline(always)]
    pub(super) fn at<'a>(&self, values: &'a [Lanes], derivatives: &'a [Lanes], q: usize) -> &'a [Lanes] {
        let from = if self.is_value { values } else { derivatives };
        &from[self.start + q * self.step..][..self.n]
    }
}

impl Basis {
    /// The functions under an operation; `on_support` leaves out those whose value is zero at all points.
    pub(super) fn operand(&self, op: FieldOp, direction: usize, on_support: bool) -> Operand {
        let n = self.n_nodes;
        let derivatives = |start: usize| {
            let start = start + direction * self.table.n_points * n;
            Operand { is_value: false, start, step: n, n }
        };
        match op {
            FieldOp::Value if on_support => {
                let n = self.support.len();
                Operand { is_value: true, start: self.starts.support, step: n, n }
            }
            FieldOp::Value => Operand { is_value: true, start: self.starts.values, step: n, n },
            FieldOp::Grad if self.starts.constant_gradients => {
                Operand { is_value: false, start: self.starts.gradients + direction * n, step: 0, n }
            }
            FieldOp::Grad => derivatives(self.starts.gradients),
            FieldOp::Hess => derivatives(self.starts.hessians),
        }
    }

    /// All functions, or those of the support.
    pub(super) fn functions(&self, on_support: bool) -> Vec<usize> {
        if on_support { self.support.iter().map(|i| usize::from(*i)).collect() } else { (0..self.n_nodes).collect() }
    }

    /// Whether one of two functions, this one and that of another basis, is zero (to rounding) at each point.
    pub(super) fn is_apart(&self, function: usize, other: &Self, of_other: usize) -> bool {
        let is_zero = |of: &Self, q: usize, k: usize| of.table.values[q * of.n_nodes + k].abs() <= NO_VALUE;
        (0..self.table.n_points).all(|q| is_zero(self, q, function) || is_zero(other, q, of_other))
    }

    /// Local dof of a component at a node.
    pub(super) fn dof(&self, node: usize, component: usize) -> usize {
        self.offset + node * self.n_components + component
    }

    /// True if gradients are the same at all points.
    pub(super) fn has_constant_gradients(&self) -> bool {
        self.starts.constant_gradients
    }

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
    /// From what the past gives of a rate.
    History(RateOrder, SlotPlace),
    /// Geometry.
    Geometry(InputSlot),
}

/// What the plan of a tangent takes of the functions of a basis at one point.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Functions {
    field: FieldId,
    side: Side,
    n: usize,
    constant_gradients: bool,
    support: Vec<u16>,
}

/// The bases of one group.
#[derive(Clone, Debug)]
pub struct GroupBinding {
    /// One entry per field and side.
    pub bases: Vec<Basis>,
    /// Values of the basis functions, the same in all lanes.
    pub(super) values: Vec<Lanes>,
    /// How many numbers a batch has for the derivatives of the basis functions.
    pub(super) n_derivatives: usize,
}

/// What evaluation has to make for a kernel and the contraction behind it.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    /// By input slot of the law.
    pub(super) inputs: Vec<bool>,
    /// By basis: nodal values are read.
    pub(super) gather: Vec<bool>,
    /// By basis: the highest derivative.
    pub(super) orders: Vec<usize>,
    /// The position of points is read.
    pub(super) position: bool,
    /// The position of images is read.
    pub(super) image: bool,
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
    /// What all inputs and slots together need.
    pub needs: Needs,
    /// What binds the law again where the images of its points follow the bodies.
    moving: Option<Arc<Rebinding>>,
    /// Where points are others in each state: the values at points that were given for those of another one.
    carried: Vec<Carried>,
}

/// Values at the points of one state for those of another: that of the nearest point of the face.
#[derive(Clone, Debug, PartialEq)]
struct Carried {
    field: usize,
    /// By point of the domain the number of the point that the value is taken from.
    nodes: Vec<u32>,
}

/// What a law that is bound again has from before.
#[derive(Default)]
struct Again<'a> {
    /// The binding on the same points with other images.
    known: Option<&'a Binding>,
    /// Values that were given at other points.
    carried: Vec<Carried>,
}

/// A law on points whose images move, and where it was bound last.
#[derive(Debug)]
struct Rebinding {
    fields: Vec<Field>,
    inputs: Vec<InputSlot>,
    tests: Vec<BasisSlot>,
    trials: Vec<BasisSlot>,
    last: Mutex<Option<Integrator>>,
}

/// A law on a domain, callable.
#[derive(Clone, Debug)]
pub struct Integrator {
    /// Where.
    pub domain: Arc<Domain>,
    /// Slots and tables.
    pub binding: Arc<Binding>,
}

impl Integrator {
    /// The same with the images at these values of all fields; itself where images stay. It is one and the same for the
    /// same displacements until others are asked for.
    ///
    /// # Panics
    /// Where a field that lives behind all faces does not live behind the one of an image.
    #[must_use]
    pub fn at(&self, mesh: &Mesh, current: &[&[f64]]) -> Self {
        let (Some(points), Some(of)) = (&self.domain.moving, &self.binding.moving) else { return self.clone() };
        let domain = points.at(mesh, current);
        let carried = if points.are_of_pieces() { of.carried(&domain, current) } else { Vec::new() };
        let last = || of.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) =
            last().as_ref().filter(|made| Arc::ptr_eq(&made.domain, &domain) && made.binding.carried == carried)
        {
            return made.clone();
        }
        let slots = LawSlots { inputs: &of.inputs, tests: &of.tests, trials: &of.trials };
        let known = Some(&*self.binding).filter(|_| !points.are_of_pieces());
        let binding = Binding::fixed(mesh, &domain, &of.fields, slots, Again { known, carried });
        let binding = binding.expect("fields live behind all faces");
        let made = Self { domain, binding: Arc::new(binding) };
        *last() = Some(made.clone());
        made
    }

    /// True where the images of the points follow the bodies.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.binding.moving.is_some()
    }

    /// By face that images may lie on: what the fields of the law have behind it, as pairs of a field and its nodes there.
    pub(super) fn behind_targets(&self) -> Vec<Vec<(usize, Vec<u32>)>> {
        let (Some(points), Some(of)) = (&self.domain.moving, &self.binding.moving) else { return Vec::new() };
        let bases = self.binding.groups.first().map_or(&[][..], |g| &g.bases);
        let there: Vec<usize> = bases.iter().filter(|b| b.side == Side::There).map(|b| b.field.index()).collect();
        let behind = |facet: FacetRef| {
            let nodes = |k: &usize| match &of.fields[*k].space {
                FieldSpace::Nodal(space) => {
                    let position = space.position_of_cell(facet.cell);
                    position.map_or_else(Vec::new, |position| space.entity_nodes(position).to_vec())
                }
                FieldSpace::Global => vec![0],
                FieldSpace::Points(_) => Vec::new(),
            };
            there.iter().map(|k| (*k, nodes(k))).collect()
        };
        points.targets().map(behind).collect()
    }
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

impl LawSlots<'_> {
    /// The highest derivative by field and side.
    fn fields(self) -> BTreeMap<(FieldId, Side), usize> {
        let mut pairs: BTreeMap<(FieldId, Side), usize> = BTreeMap::new();
        let mut note = |slot: &BasisSlot| {
            let order = pairs.entry((slot.field, slot.side)).or_default();
            *order = (*order).max(slot.op.order());
        };
        self.tests.iter().chain(self.trials).for_each(&mut note);
        for slot in self.inputs {
            if let InputSlot::Field(s) | InputSlot::Previous(s) | InputSlot::History(_, s) = slot {
                note(s);
            }
        }
        pairs
    }
}

impl Binding {
    /// Binds the slots of a law on a domain to the spaces of the fields.
    ///
    /// # Errors
    /// [`FieldError`] when a field has no dofs on an entity of the domain.
    pub fn new(mesh: &Mesh, domain: &Domain, fields: &[Field], law: LawSlots<'_>) -> Result<Self, FieldError> {
        let mut made = Self::fixed(mesh, domain, fields, law, Again::default())?;
        made.moving = domain.moving.as_ref().map(|_| {
            Arc::new(Rebinding {
                fields: fields.to_vec(),
                inputs: law.inputs.to_vec(),
                tests: law.tests.to_vec(),
                trials: law.trials.to_vec(),
                last: Mutex::default(),
            })
        });
        Ok(made)
    }

    /// The same with the images as they are.
    fn fixed(
        mesh: &Mesh,
        domain: &Domain,
        fields: &[Field],
        law: LawSlots<'_>,
        again: Again<'_>,
    ) -> Result<Self, FieldError> {
        let Again { known, carried } = again;
        let pairs = law.fields();
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
                InputSlot::History(order, s) => Input::History(*order, place(s)),
                other => Input::Geometry(*other),
            })
            .collect();
        let mut groups = Vec::with_capacity(domain.groups.len());
        let mut first = 0;
        for (g, group) in domain.groups.iter().enumerate() {
            let mut bases = Vec::with_capacity(pairs.len());
            let mut offset = 0;
            let points = first..first + group.entities.len() * group.n_points();
            first = points.end;
            for (k, ((field, side), order)) in pairs.iter().enumerate() {
                let stays = known.filter(|_| *side == Side::Here).map(|known| &known.groups[g].bases[k]);
                let elsewhere = carried.iter().find(|c| c.field == field.index());
                let basis = match (stays, elsewhere) {
                    (Some(basis), _) => Basis { offset, ..basis.clone() },
                    (None, Some(c)) => at_points(&fields[c.field], *field, offset, group, &c.nodes[points.clone()]),
                    (None, None) => basis(mesh, group, &fields[field.index()], *field, *side, *order, offset)?,
                };
                offset += basis.n_dofs();
                bases.push(basis);
            }
            groups.push(GroupBinding::new(mesh.dim(), group, bases));
        }
        let tests = law.tests.iter().map(place).collect();
        let trials = law.trials.iter().map(place).collect();
        let mut binding = Self { inputs, tests, trials, groups, needs: Needs::default(), moving: None, carried };
        binding.needs = binding.needs_of(pairs.len(), |_| true, true, true);
        Ok(binding)
    }

    /// Number of fields and sides that are evaluated in a group, also where this rank has no entity of it.
    pub(super) fn n_bases(&self) -> usize {
        self.needs.orders.len()
    }

    /// What evaluation has to make for a kernel that reads some of the inputs, and for the test and trial slots.
    pub(super) fn needs_of(&self, n_bases: usize, reads: impl Fn(usize) -> bool, tests: bool, trials: bool) -> Needs {
        let mut needs = Needs {
            inputs: (0..self.inputs.len()).map(reads).collect(),
            gather: vec![false; n_bases],
            orders: vec![0; n_bases],
            position: false,
            image: false,
        };
        for (input, is_read) in self.inputs.iter().zip(&needs.inputs) {
            match input {
                Input::Current(place) | Input::Previous(place) | Input::History(_, place) if *is_read => {
                    needs.gather[place.basis] = true;
                    needs.orders[place.basis] = needs.orders[place.basis].max(place.op.order());
                }
                Input::Geometry(InputSlot::X(_)) if *is_read => needs.position = true,
                Input::Geometry(InputSlot::ImageX(_)) if *is_read => needs.image = true,
                _ => {}
            }
        }
        let contracted = [(tests, &self.tests), (trials, &self.trials)];
        for place in contracted.iter().filter(|(wanted, _)| *wanted).flat_map(|(_, places)| places.iter()) {
            needs.orders[place.basis] = needs.orders[place.basis].max(place.op.order());
        }
        needs
    }
}

impl GroupBinding {
    fn new(dim: usize, group: &Group, mut bases: Vec<Basis>) -> Self {
        let (mut values, mut n_derivatives) = (Vec::new(), 0);
        for basis in &mut bases {
            let table = &basis.table;
            basis.starts.values = values.len();
            values.extend(table.values.iter().map(|v| Lanes([*v; LANES])));
            basis.starts.support = values.len();
            let at_points = table.values.chunks_exact(table.n_dofs.max(1));
            values.extend(at_points.flat_map(|row| basis.support.iter().map(|i| Lanes([row[usize::from(*i)]; LANES]))));
            let side = group.there.as_ref().filter(|_| basis.side == Side::There).unwrap_or(&group.here);
            basis.starts.constant_gradients = side.is_affine() && basis.order == 1 && {
                // at a point, the facet of a line, there is none at all
                let mut rows = table.gradients.chunks_exact((table.n_dofs * table.dim).max(1));
                let first = rows.next();
                rows.all(|row| Some(row) == first)
            };
            let n = table.n_points * table.n_dofs;
            basis.starts.gradients = n_derivatives;
            n_derivatives += if basis.order > 0 { dim * n } else { 0 };
            basis.starts.hessians = n_derivatives;
            n_derivatives += if basis.order > 1 { dim * dim * n } else { 0 };
        }
        Self { bases, values, n_derivatives }
    }

    /// By basis what the derivatives of a group of one point are made of: its field, side, functions and those that act.
    pub(super) fn functions(&self) -> Vec<Functions> {
        let of = |b: &Basis| Functions {
            field: b.field,
            side: b.side,
            n: b.n_nodes,
            constant_gradients: b.starts.constant_gradients,
            support: b.support.clone(),
        };
        self.bases.iter().map(of).collect()
    }

    /// Local dofs of an entity, all bases.
    #[must_use]
    pub fn n_dofs(&self) -> usize {
        self.bases.last().map_or(0, |b| b.offset + b.n_dofs())
    }
}

impl Rebinding {
    /// The values at points that the law reads, where they were given for the points of another state: each point of them
    /// ends with its name.
    fn carried(&self, domain: &Domain, current: &[&[f64]]) -> Vec<Carried> {
        let mut names = None;
        let mut all: Vec<Carried> = Vec::new();
        for slot in &self.inputs {
            let InputSlot::Field(b) = slot else { continue };
            let k = b.field.index();
            if all.iter().any(|c| c.field == k) || !matches!(self.fields[k].space, FieldSpace::Points(_)) {
                continue;
            }
            let points = current[k].chunks_exact(self.fields[k].n_components);
            let from: Vec<PointName> = points.filter_map(|point| point.last_chunk().copied()).collect();
            let to = names.get_or_insert_with(|| domain.point_names());
            all.push(Carried { field: k, nodes: nearest_points(&from, to) });
        }
        all
    }
}

/// Values at the points of a group, from these numbers of points.
fn at_points(field: &Field, id: FieldId, offset: usize, group: &Group, nodes: &[u32]) -> Basis {
    let n = group.n_points();
    let values = (0..n * n).map(|p| if p % (n + 1) == 0 { 1.0 } else { 0.0 }).collect();
    Basis {
        field: id,
        side: Side::Here,
        n_components: field.n_components,
        n_nodes: n,
        table: Table { n_points: n, n_dofs: n, dim: group.here.geometry.dim, values, ..Table::default() },
        tangents: None,
        order: 0,
        nodes: nodes.to_vec(),
        offset,
        support: (0..n).map(|i| u16::try_from(i).expect("few points")).collect(),
        starts: Starts::default(),
    }
}

/// A basis function below this at every point does not act there; its largest value is 1.
const NO_VALUE: f64 = 1e-14;

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
    let is_zero = |i: usize| tabulated.table.values.iter().skip(i).step_by(n_nodes).all(|v| v.abs() <= NO_VALUE);
    let support = (0..n_nodes).filter(|i| !is_zero(*i)).map(|i| u16::try_from(i).expect("few functions")).collect();
    Ok(Basis {
        field: id,
        side,
        n_components: field.n_components,
        n_nodes,
        table: tabulated.table,
        tangents: tabulated.tangents,
        order,
        nodes: tabulated.nodes,
        offset,
        support,
        starts: Starts::default(),
    })
}
