//! A point of a contact interface with the laws of all its terms, evaluated for any state of the two bodies.
//!
//! Positions, normals and known fields are those of the mesh; the state replaces the unknowns. Promises: pure functions
//! of the state. Does not judge.

mod direction;
mod stiffness;

pub(super) use direction::{TILTED, root};
use std::collections::BTreeMap;

use wfl_compiler::{
    Class, Projection, ProjectionKind, TermLaw, interpret,
    ir::{LANES, VerifiedKernel},
    types::{BasisSlot, FieldKind, FieldOp, InputSlot, Side},
};

use wfl_contact::{Contact, ContactTerm};
use wfl_discrete::assemble::{AssembledTerm, Binding, Bound, Domain, FieldValues, Workspace};
use wfl_discrete::field::FieldSpace;
use wfl_discrete::system::{System, TermBranches};
use wfl_mesh::mesh::{CellId, Mesh};

/// Strain by which laws are differentiated: exact for laws that are linear, and as good as their rounding for others.
const STRAIN: f64 = 1e-6;
/// Known fields may vary by so much inside a cell, relative, to count as constant: what files and formulas with
/// rounding leave of a constant.
const VARIES: f64 = 1e-9;
/// Normals with a cosine below this belong to faces that look at each other: faces of curved bodies may be 25 degrees off.
const OPPOSITE: f64 = -0.9;

/// A vector or the entries of a gradient (component, then direction); entries beyond the dimension are 0.
pub(super) type Vector = [f64; 3];
/// `gradient[component + dim * direction]`
pub(super) type Gradient = [f64; 9];

/// One body at the point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    /// Its displacement, now and at the end of the previous step.
    pub(super) value: Vector,
    pub(super) before: Vector,
    /// The gradient of its displacement, which has not changed.
    pub(super) gradient: Gradient,
}

/// Two bodies and what multipliers say between them.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// The body that owns the interface, and the other.
    pub(super) bodies: [Motion; 2],
    /// Components of all multipliers, one after the other.
    pub(super) multipliers: Vec<f64>,
    /// What is added to states on the faces: zero, but where it is asked what they do.
    pub(super) memory: f64,
}

/// What the terms of the interface do at the point.
#[derive(Clone, Debug)]
pub(super) struct Fluxes {
    /// Force on each body.
    pub(super) force: [Vector; 2],
    /// What is tested with the gradients of the test functions of each body.
    pub(super) stress: [Gradient; 2],
    /// What is tested with each component of the multipliers.
    pub(super) law: Vec<f64>,
}

/// Which fields are what.
struct Roles {
    displacement: [Option<usize>; 2],
    /// Field, first component in [`State::multipliers`], components.
    multipliers: Vec<(usize, usize, usize)>,
}

/// The inputs of a law at the point.
struct Reader<'a> {
    slots: &'a [InputSlot],
    uniforms: &'a [f64],
    /// As on the mesh without displacement.
    inputs: Vec<f64>,
    /// What is `here` for the law is the other body.
    turned: bool,
    /// By slot: a state of the scene.
    memory: Vec<bool>,
}

struct Law<'a> {
    term: usize,
    kernel: &'a VerifiedKernel,
    law: &'a TermLaw,
    is_load: bool,
    reader: Reader<'a>,
}

/// The projections of a term with their arguments.
struct Watched<'a> {
    kernel: &'a VerifiedKernel,
    reader: Reader<'a>,
    projections: &'a [Projection],
    /// The first field of its branches, and those of a point that is open.
    branches: (usize, TermBranches),
    /// It is a law that pushes bodies, and no aperture of a fluid.
    pushes: bool,
}

/// See the module.
pub(super) struct Place<'a> {
    pub(super) dim: usize,
    /// The direction of contact, out of the first body: the normal of the face, but for a law of an obstacle with a
    /// normal of its own.
    pub(super) normal: Vector,
    /// The normal of the face out of the first body.
    face: Vector,
    /// Cosine between that and the direction in which the law presses the body out of an overlap.
    pub(super) looks: f64,
    /// Of the half lines that act the one that closes first there, by number.
    pub(super) law: usize,
    /// From the face to the centre of the cell.
    pub(super) size: f64,
    roles: Roles,
    interface: Vec<Law<'a>>,
    watched: Vec<Watched<'a>>,
    bulk: [Vec<Law<'a>>; 2],
}

/// What is needed to find laws at a point.
/// Where contact is looked at: the scene, and the state of its fields.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub(super) system: &'a System,
    pub(super) contact: &'a Contact,
    pub(super) values: FieldValues<'a>,
}

struct Finder<'a> {
    system: &'a System,
    contact: &'a Contact,
    values: FieldValues<'a>,
    cells: [Option<CellId>; 2],
    facet: wfl_mesh::mesh::FacetRef,
    normal: Vector,
    position: Vector,
}

/// An entry of the displacement, or of its gradient, of a body.
type Number = (usize, u16);

/// An entity of a domain and its orientation.
struct Entity {
    group: usize,
    entity: usize,
    turned: bool,
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// When a value is read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Instant {
    Now,
    /// At the end of the step before.
    Before,
}

impl Reader<'_> {
    fn read(&self, roles: &Roles, state: &State, branches: Option<(usize, &TermBranches)>) -> Vec<f64> {
        let mut inputs = self.inputs.clone();
        if state.memory != 0.0 {
            inputs.iter_mut().zip(&self.memory).filter(|(_, is_one)| **is_one).for_each(|(x, _)| *x += state.memory);
        }
        for (x, slot) in inputs.iter_mut().zip(self.slots) {
            let known = match slot {
                InputSlot::Field(b) => match branches {
                    Some((field, own)) if field == b.field.index() => own.points.get(usize::from(b.entry)).copied(),
                    Some((field, own)) if field + 1 == b.field.index() => {
                        own.regularisation.get(usize::from(b.entry)).copied()
                    }
                    _ => self.of_state(roles, state, b, Instant::Now),
                },
                InputSlot::Previous(b) => self.of_state(roles, state, b, Instant::Before),
                // the states that are looked at are at rest
                InputSlot::History(..) => Some(0.0),
                _ => None,
            };
            *x = known.unwrap_or(*x);
        }
        inputs
    }

    fn of_state(&self, roles: &Roles, state: &State, slot: &BasisSlot, at: Instant) -> Option<f64> {
        let (field, entry) = (slot.field.index(), usize::from(slot.entry));
        let body = self.body(slot);
        if roles.displacement[body] == Some(field) {
            let motion = &state.bodies[body];
            return match slot.op {
                FieldOp::Value if at == Instant::Before => motion.before.get(entry).copied(),
                FieldOp::Value => motion.value.get(entry).copied(),
                FieldOp::Grad => motion.gradient.get(entry).copied(),
                FieldOp::Hess => Some(0.0),
            };
        }
        let found = roles.multipliers.iter().find(|m| m.0 == field && slot.op == FieldOp::Value)?;
        state.multipliers.get(found.1 + entry).copied()
    }

    fn body(&self, slot: &BasisSlot) -> usize {
        usize::from((slot.side == Side::There) != self.turned)
    }
}

impl Law<'_> {
    fn fluxes(&self, roles: &Roles, state: &State) -> Vec<f64> {
        let inputs = self.reader.read(roles, state, None);
        let mut out = vec![0.0; self.kernel.kernel().outputs.len()];
        interpret(self.kernel, self.reader.uniforms, &inputs, &mut Vec::new(), &mut out);
        out.truncate(self.law.tests.len());
        out
    }
}

impl<'a> Finder<'a> {
    fn bound(&self, domain: &'a Domain, binding: &'a Binding) -> Bound<'a> {
        Bound { mesh: &self.system.mesh, domain, binding }
    }

    /// The face in a domain of faces, from either side.
    fn locate(&self, domain: &Domain, binding: &Binding) -> Option<Entity> {
        for (group, all) in domain.groups.iter().enumerate().filter(|(_, g)| g.tangents.is_some() && !g.is_global) {
            for entity in 0..all.entities.len() {
                if all.here.facets.get(entity) == Some(&self.facet) {
                    return Some(Entity { group, entity, turned: false });
                }
                if self.cells[1].is_some_and(|cell| all.here.cells[entity] == cell) {
                    let mut workspace = Workspace::default();
                    let bound = Bound { mesh: &self.system.mesh, domain, binding };
                    workspace.prepare(bound, group, entity / LANES, self.values);
                    if dot(&workspace.normal_at_the_end(domain.dim, all, entity % LANES), &self.normal) < OPPOSITE {
                        return Some(Entity { group, entity, turned: true });
                    }
                }
            }
        }
        None
    }

    /// The inputs at point `q` of an entity, at the position and with the normal of the place.
    fn reader(
        &self,
        bound: Bound<'_>,
        at: &Entity,
        q: usize,
        slots: &'a [InputSlot],
        uniforms: &'a [f64],
    ) -> Reader<'a> {
        let mut workspace = Workspace::default();
        workspace.prepare(bound, at.group, at.entity / LANES, self.values);
        let lane = at.entity % LANES;
        let outward = |side: Side| if (side == Side::There) == at.turned { 1.0 } else { -1.0 };
        let value = |(s, slot): (usize, &InputSlot)| match slot {
            InputSlot::X(k) | InputSlot::ImageX(k) => self.position[usize::from(*k)],
            InputSlot::Normal(side, k) => outward(*side) * self.normal[usize::from(*k)],
            _ => workspace.inputs[(q * slots.len() + s) * LANES + lane],
        };
        let inputs = slots.iter().enumerate().map(value).collect();
        let is_state = |slot: &InputSlot| match slot {
            InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => {
                self.system.fields.get(b.field.index()).is_some_and(|f| f.kind == FieldKind::State)
            }
            _ => false,
        };
        let memory = slots.iter().map(is_state).collect();
        Reader { slots, uniforms, inputs, turned: at.turned, memory }
    }

    /// All terms on the face.
    fn interface(&self) -> Vec<Law<'a>> {
        let law = |(term, t): (usize, &'a AssembledTerm)| {
            let (domain, binding) = (&*t.integrator.domain, &t.integrator.binding);
            let at = self.locate(domain, binding)?;
            let reader = self.reader(self.bound(domain, binding), &at, 0, &t.law.inputs, t.uniforms());
            let is_load = t.law.class == Class::Constant;
            Some(Law { term, kernel: &t.law.residual, law: &t.law, is_load, reader })
        };
        self.system.terms.iter().enumerate().filter(|(_, t)| !t.on_cells()).filter_map(law).collect()
    }

    fn watched(&self) -> Vec<Watched<'a>> {
        let watch = |p: &'a ContactTerm| {
            let (watch, sampled, projections) = p.law();
            let at = self.locate(&sampled.domain, &sampled.binding)?;
            let bound = self.bound(&sampled.domain, &sampled.binding);
            let reader = self.reader(bound, &at, 0, &watch.law.inputs, watch.uniforms());
            let (branches, pushes) = ((p.field, p.open_at(1)), p.pushes(self.system));
            Some(Watched { kernel: &watch.law.kernel, reader, projections, branches, pushes })
        };
        let mut terms: Vec<&ContactTerm> = self.contact.terms().iter().filter(|p| !p.on_cells()).collect();
        // the argument of contact is that of a law which presses, not the aperture of a fluid beside it
        terms.sort_by_key(|p| !p.pushes(self.system));
        terms.into_iter().filter_map(watch).collect()
    }

    /// The terms of a cell whose test functions have gradients: those that make its stress.
    fn bulk(&self, body: usize, displacement: Option<usize>) -> Result<Vec<Law<'a>>, String> {
        let (Some(cell), Some(field)) = (self.cells[body], displacement) else { return Ok(Vec::new()) };
        let mut laws = Vec::new();
        for (term, t) in self.system.terms.iter().enumerate().filter(|(_, t)| t.on_cells()) {
            let tests = || t.law.tests.iter().filter(|s| s.field.index() == field);
            if tests().any(|s| s.op == FieldOp::Hess) {
                return Err("a body is tested with second derivatives".to_owned());
            }
            let (domain, binding) = (&*t.integrator.domain, &t.integrator.binding);
            let place = |(g, group): (usize, &wfl_discrete::assemble::Group)| {
                group.here.cells.iter().position(|c| *c == cell).map(|e| (g, e))
            };
            let Some((group, entity)) = domain.groups.iter().enumerate().find_map(place) else { continue };
            if !tests().any(|s| s.op == FieldOp::Grad) {
                continue;
            }
            let at = Entity { group, entity, turned: body == 1 };
            let all: Vec<Reader<'a>> = (0..domain.groups[group].n_points())
                .map(|q| self.reader(self.bound(domain, binding), &at, q, &t.law.inputs, t.uniforms()))
                .collect();
            self.same_everywhere(&all)?;
            let Some(reader) = all.into_iter().next() else { continue };
            laws.push(Law { term, kernel: &t.law.residual, law: &t.law, is_load: false, reader });
        }
        if laws.is_empty() { Err("a body has no stress".to_owned()) } else { Ok(laws) }
    }

    /// A law of a body is the same at the face as at the points of its cell.
    fn same_everywhere(&self, points: &[Reader<'_>]) -> Result<(), String> {
        let Some(first) = points.first() else { return Ok(()) };
        for (k, slot) in first.slots.iter().enumerate() {
            let (InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b)) = slot else { continue };
            match self.system.fields[b.field.index()].kind {
                FieldKind::State => return Err("a body has a state".to_owned()),
                FieldKind::Data => {
                    let size = points.iter().fold(0.0f64, |m, p| m.max(p.inputs[k].abs()));
                    if points.iter().any(|p| (p.inputs[k] - first.inputs[k]).abs() > VARIES * size) {
                        return Err("the material varies inside cells".to_owned());
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// The displacement of each body: the vectors of the space that the projections read.
fn roles(system: &System, interface: &[Law<'_>], watched: &[Watched<'_>]) -> Result<Roles, String> {
    let dim = system.mesh.dim();
    let on_cells = |f: usize| {
        let tests = |t: &AssembledTerm| t.law.tests.iter().any(|s| s.field.index() == f && s.op == FieldOp::Grad);
        system.terms.iter().any(|t| t.on_cells() && tests(t))
    };
    let is_local = |f: usize| !matches!(system.fields[f].space, FieldSpace::Global | FieldSpace::Points(_));
    let mut displacement = [None; 2];
    for w in watched {
        for slot in w.reader.slots {
            let InputSlot::Field(b) = slot else { continue };
            let f = b.field.index();
            let moves = system.fields.get(f).is_some_and(|field| {
                field.kind == FieldKind::Unknown && field.n_components == dim && is_local(f) && on_cells(f)
            });
            if !moves {
                continue;
            }
            match &mut displacement[w.reader.body(b)] {
                Some(known) if *known != f => return Err("a body has several displacements".to_owned()),
                place => *place = Some(f),
            }
        }
    }
    if displacement[0].is_none() {
        return Err("the projections do not depend on displacements".to_owned());
    }
    let mut multipliers: Vec<(usize, usize, usize)> = Vec::new();
    let mut n = 0;
    for f in interface.iter().flat_map(|l| &l.law.tests).map(|t| t.field.index()) {
        let field = &system.fields[f];
        let is_read = |slot: &InputSlot| matches!(slot, InputSlot::Field(b) if b.field.index() == f);
        // a pressure that no law of contact reads is that of a fluid: an equation of its own says what it is
        let is_fluid = field.kind == FieldKind::Unknown
            && field.n_components == 1
            && !watched.iter().any(|w| w.reader.slots.iter().any(is_read));
        let is_one = field.kind == FieldKind::Multiplier || (!on_cells(f) && is_local(f) && !is_fluid);
        if is_one && !displacement.contains(&Some(f)) && multipliers.iter().all(|m| m.0 != f) {
            multipliers.push((f, n, field.n_components));
            n += field.n_components;
        }
    }
    Ok(Roles { displacement, multipliers })
}

impl<'a> Place<'a> {
    /// The laws at the last point of entity `at` of the domain of a term with projections; an error is why they cannot
    /// be judged.
    pub(super) fn new(at: At<'a>, piece: &'a ContactTerm, g: usize, entity: usize) -> Result<Self, String> {
        let At { system, contact, values } = at;
        let (_, sampled, _) = piece.law();
        let (mesh, domain): (&Mesh, &Domain) = (&system.mesh, &sampled.domain);
        let group = &domain.groups[g];
        let mut workspace = Workspace::default();
        workspace.prepare(Bound { mesh, domain, binding: &sampled.binding }, g, entity / LANES, values);
        let normal = workspace.normal_at_the_end(domain.dim, group, entity % LANES);
        let here = group.here.cells[entity];
        let position = group.position(mesh, entity, group.n_points() - 1);
        let there = group.there.as_ref().map(|t| t.cells[entity]);
        let facet = *group.here.facets.get(entity).ok_or("the term is not on faces")?;
        let finder = Finder { system, contact, values, cells: [Some(here), there], facet, normal, position };
        let (interface, watched) = (finder.interface(), finder.watched());
        let roles = roles(system, &interface, &watched)?;
        let bulk = [finder.bulk(0, roles.displacement[0])?, finder.bulk(1, roles.displacement[1])?];
        let (a, b) = (mesh.centroid(here), mesh.facet_centroid(facet));
        let size = (0..3).fold(0.0f64, |m, k| m.hypot(a[k] - b[k]));
        let mut place =
            Self { dim: domain.dim, normal, face: normal, looks: 1.0, law: 0, size, roles, interface, watched, bulk };
        (place.normal, place.looks) =
            place.direction().ok_or("the normal of the obstacle changes as the body comes to it")?;
        let rest = place.rest();
        let loads = place.interface.iter().filter(|l| l.is_load);
        if loads.flat_map(|l| l.fluxes(&place.roles, &rest)).any(|x| x != 0.0) {
            return Err("a load acts on these faces".to_owned());
        }
        Ok(place)
    }

    /// Nothing has moved.
    pub(super) fn rest(&self) -> State {
        let n = self.roles.multipliers.iter().map(|m| m.2).sum();
        State { bodies: [Motion::default(); 2], multipliers: vec![0.0; n], memory: 0.0 }
    }

    /// True if there is a second body that moves.
    pub(super) fn has_two_bodies(&self) -> bool {
        self.roles.displacement[1].is_some()
    }

    /// Components of each multiplier.
    pub(super) fn multipliers(&self) -> impl Iterator<Item = usize> + '_ {
        self.roles.multipliers.iter().map(|m| m.2)
    }

    /// Positions of the terms on the face that are no loads.
    pub(super) fn terms(&self) -> Vec<usize> {
        self.interface.iter().filter(|l| !l.is_load).map(|l| l.term).collect()
    }

    /// What the terms of the interface do; `None` where that is not finite.
    pub(super) fn fluxes(&self, state: &State) -> Option<Fluxes> {
        let mut sum = Fluxes { force: [[0.0; 3]; 2], stress: [[0.0; 9]; 2], law: vec![0.0; state.multipliers.len()] };
        for law in &self.interface {
            for (slot, flux) in law.law.tests.iter().zip(law.fluxes(&self.roles, state)) {
                if !flux.is_finite() {
                    return None;
                }
                let (field, entry, body) = (slot.field.index(), usize::from(slot.entry), law.reader.body(slot));
                if self.roles.displacement[body] == Some(field) {
                    match slot.op {
                        FieldOp::Value => sum.force[body][entry] += flux,
                        FieldOp::Grad => sum.stress[body][entry] += flux,
                        FieldOp::Hess => {}
                    }
                } else if slot.op == FieldOp::Value
                    && let Some(m) = self.roles.multipliers.iter().find(|m| m.0 == field)
                {
                    sum.law[m.1 + entry] += flux;
                }
            }
        }
        Some(sum)
    }

    /// The traction that the terms of a body put on its face, of a gradient of its displacement.
    pub(super) fn traction(&self, body: usize, value: &Vector, gradient: &Gradient) -> Option<Vector> {
        let mut state = self.rest();
        // around an axis displacements are strains, too
        state.bodies[body] = Motion { value: *value, before: *value, gradient: *gradient };
        let outward = if body == 0 { 1.0 } else { -1.0 };
        let mut sum = [0.0; 3];
        for law in &self.bulk[body] {
            for (slot, flux) in law.law.tests.iter().zip(law.fluxes(&self.roles, &state)) {
                if slot.op == FieldOp::Grad && self.roles.displacement[body] == Some(slot.field.index()) {
                    let (component, direction) =
                        (usize::from(slot.entry) % self.dim, usize::from(slot.entry) / self.dim);
                    sum[component] += flux * outward * self.face[direction];
                }
            }
        }
        sum.iter().all(|x| x.is_finite()).then_some(sum)
    }

    /// How the forces of the interface change with the gradients of the displacement, and what is tested with gradients
    /// with the displacement: the sum of the products of facing entries, and of the squares of the former.
    pub(super) fn couplings(&self, state: &State) -> (f64, f64) {
        let mut forces: BTreeMap<(Number, Number), f64> = BTreeMap::new();
        let mut stresses = forces.clone();
        for law in &self.interface {
            let (n, inputs) = (law.law.tests.len(), law.reader.read(&self.roles, state, None));
            let mut out = vec![0.0; law.law.tangent.kernel().outputs.len()];
            interpret(&law.law.tangent, law.reader.uniforms, &inputs, &mut Vec::new(), &mut out);
            for ((test, trial), value) in law.law.entries.iter().zip(&out[n..]) {
                let (test, trial) = (&law.law.tests[usize::from(*test)], &law.law.trials[usize::from(*trial)]);
                let number = |s: &BasisSlot| {
                    let body = law.reader.body(s);
                    (self.roles.displacement[body] == Some(s.field.index())).then_some((body, s.entry))
                };
                let (Some(a), Some(b)) = (number(test), number(trial)) else { continue };
                match (test.op, trial.op) {
                    (FieldOp::Value, FieldOp::Grad) => *forces.entry((a, b)).or_default() += value,
                    (FieldOp::Grad, FieldOp::Value) => *stresses.entry((b, a)).or_default() += value,
                    _ => {}
                }
            }
        }
        let product = forces.iter().map(|(k, f)| f * stresses.get(k).copied().unwrap_or(0.0)).sum();
        (product, forces.values().map(|f| f * f).sum())
    }

    /// The arguments of the half lines that act, of the laws that push bodies if there are some.
    pub(super) fn contact_arguments(&self, state: &State) -> Vec<f64> {
        let pushes = self.watched.first().is_some_and(|w| w.pushes);
        let mut found = Vec::new();
        self.projections_of(
            state,
            |w| w.pushes == pushes,
            |p, out| {
                if p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts {
                    found.push(out[p.output]);
                }
            },
        );
        found
    }

    /// Calls `f` with each projection and the outputs of its term.
    pub(super) fn projections(&self, state: &State, f: impl FnMut(&Projection, &[f64])) {
        self.projections_of(state, |_| true, f);
    }

    /// The same of some of the terms.
    fn projections_of(
        &self,
        state: &State,
        counts: impl Fn(&Watched<'_>) -> bool,
        mut f: impl FnMut(&Projection, &[f64]),
    ) {
        for w in self.watched.iter().filter(|w| counts(w)) {
            let (field, mut point) = w.branches.clone();
            let mut out = vec![0.0; w.kernel.kernel().outputs.len()];
            // inner projections are part of the radius of outer ones
            for _ in 0..=w.projections.len() {
                let inputs = w.reader.read(&self.roles, state, Some((field, &point)));
                interpret(w.kernel, w.reader.uniforms, &inputs, &mut Vec::new(), &mut out);
                for p in w.projections.iter().filter(|p| p.kind == ProjectionKind::HalfLine) {
                    for k in 0..p.n {
                        p.branch.close_by(&mut point.points, k, out[p.output + k]);
                    }
                }
            }
            w.projections.iter().for_each(|p| f(p, &out));
        }
    }
}
