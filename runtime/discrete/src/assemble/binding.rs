//! A point law bound to a domain: which basis tables its slots read, which nodes they gather.
//!
//! Made once per term; everything that evaluation needs per batch is looked up here.

use std::{
    borrow::Borrow,
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use wfl_compiler::{
    ir::LANES,
    types::{BasisSlot, FieldId, FieldOp, InputSlot, RateOrder, Side},
};

use crate::domain::{Domain, Group, PointName, nearest_points, table_of_each};
use crate::{
    assemble::{
        basis::{Basis, Functions, NO_VALUE, basis},
        lanes::{has_parts, in_lanes},
        simd::Lanes,
    },
    field::{Field, FieldError, FieldSpace},
};
use wfl_mesh::{
    element::Table,
    mesh::{FacetRef, Mesh},
};

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

/// The bases of one group.
#[derive(Clone, Debug)]
pub struct GroupBinding {
    /// One entry per field and side.
    pub bases: Vec<Basis>,
    /// Values of the basis functions, the same in all lanes.
    pub(super) values: Vec<Lanes>,
    /// How many numbers a batch has for the derivatives of the basis functions.
    pub(super) n_derivatives: usize,
    /// Of points with images: the geometry there with second derivatives, where a slot reads those of a field.
    pub(super) bent: Option<Table>,
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
    /// The same points as entities of their own, where a law is assembled on them.
    pub(super) in_lanes: Option<Arc<Integrator>>,
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

    /// The same points as they are assembled: each an entity of its own where images stay in single cells.
    pub(super) fn assembled(&self) -> Self {
        self.binding.in_lanes.as_deref().unwrap_or(self).clone()
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
    pub fn new<F: Borrow<Field>>(
        mesh: &Mesh,
        domain: &Domain,
        fields: &[F],
        law: LawSlots<'_>,
    ) -> Result<Self, FieldError> {
        let mut made = Self::fixed(mesh, domain, fields, law, Again::default())?;
        let is_assembled = !law.tests.is_empty() && has_parts(domain);
        let acting = || made.groups.iter().map(|group| group.acting(fields)).collect::<Vec<_>>();
        if let Some(domain) = is_assembled.then(|| in_lanes(mesh, domain, &acting())).flatten() {
            let binding = Arc::new(Self::fixed(mesh, &domain, fields, law, Again::default())?);
            made.in_lanes = Some(Arc::new(Integrator { domain: Arc::new(domain), binding }));
        }
        made.moving = domain.moving.as_ref().map(|_| {
            Arc::new(Rebinding {
                fields: fields.iter().map(|field| field.borrow().clone()).collect(),
                inputs: law.inputs.to_vec(),
                tests: law.tests.to_vec(),
                trials: law.trials.to_vec(),
                last: Mutex::default(),
            })
        });
        Ok(made)
    }

    /// The same with the images as they are.
    fn fixed<F: Borrow<Field>>(
        mesh: &Mesh,
        domain: &Domain,
        fields: &[F],
        law: LawSlots<'_>,
        again: Again<'_>,
    ) -> Result<Self, FieldError> {
        let Again { known, carried } = again;
        let pairs = law.fields();
        let index: BTreeMap<(FieldId, Side), usize> = pairs.keys().enumerate().map(|(k, key)| (*key, k)).collect();
        let place = |slot: &BasisSlot| {
            let n = fields[slot.field.index()].borrow().n_components;
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
                    (None, Some(c)) => {
                        Basis::at_points(fields[c.field].borrow(), *field, offset, group, &c.nodes[points.clone()])
                    }
                    (None, None) => basis(mesh, group, fields[field.index()].borrow(), *field, *side, *order, offset)?,
                };
                offset += basis.n_dofs();
                bases.push(basis);
            }
            groups.push(GroupBinding::new(mesh, group, bases));
        }
        let tests = law.tests.iter().map(place).collect();
        let trials = law.trials.iter().map(place).collect();
        let needs = Needs::default();
        let mut binding = Self { inputs, tests, trials, groups, needs, moving: None, in_lanes: None, carried };
        binding.needs = binding.needs_of(pairs.len(), |_| true, true, true);
        Ok(binding)
    }

    /// The same slots with other functions.
    pub(super) fn with_groups(&self, groups: Vec<GroupBinding>) -> Self {
        Self { groups, in_lanes: None, ..self.clone() }
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
    pub(super) fn new(mesh: &Mesh, group: &Group, mut bases: Vec<Basis>) -> Self {
        let (dim, mut values, mut n_derivatives) = (mesh.dim(), Vec::new(), 0);
        for basis in &mut bases {
            let table = &basis.table;
            if group.own.is_some() {
                basis.start_at_point(dim, &mut n_derivatives);
                continue;
            }
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
        let bent = bent(mesh, group, &bases);
        Self { bases, values, n_derivatives, bent }
    }

    /// By basis what the tangent of a group of points is made of: its field, side, functions, those that act, and their
    /// places.
    pub(super) fn functions(&self) -> Vec<Functions> {
        self.bases.iter().map(Basis::of_plan).collect()
    }

    /// By field and side the functions that act; `None` where some act at some of the points alone.
    fn acting<F: Borrow<Field>>(&self, fields: &[F]) -> Option<Vec<Vec<u16>>> {
        let space = |basis: &Basis| &fields[basis.field.index()].borrow().space;
        let is_nodal = |basis: &&Basis| !matches!(space(basis), FieldSpace::Points(_));
        let of = |basis: &Basis| {
            let mut rows = basis.table.values.chunks_exact(basis.n_nodes.max(1));
            let act = |row: &[f64]| basis.support.iter().all(|i| row[usize::from(*i)].abs() > NO_VALUE);
            rows.all(act).then(|| basis.support.clone())
        };
        self.bases.iter().filter(is_nodal).map(of).collect()
    }

    /// True where entities are points.
    pub(super) fn is_of_points(&self) -> bool {
        self.bases.iter().any(|basis| basis.starts.own)
    }

    /// Local dofs of an entity, all bases.
    #[must_use]
    pub fn n_dofs(&self) -> usize {
        self.bases.last().map_or(0, |b| b.offset + b.n_dofs())
    }
}

/// The geometry of images with second derivatives, if a basis has some there.
fn bent(mesh: &Mesh, group: &Group, bases: &[Basis]) -> Option<Table> {
    let images = group.there.as_ref().filter(|_| group.own.is_some())?;
    let reads = |basis: &Basis| basis.side == Side::There && basis.order > 1;
    let element = |k: usize| mesh.geometry_element(mesh.kind(images.cells[k]));
    bases.iter().any(reads).then(|| table_of_each(images.cells.len(), element, |k| images.points[k], 2))
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
