//! The smallest parameter for which Nitsche's method is coercive, from the elements at the interface.
//!
//! At each point of a facet F of a cell K the tangent of a closed and sticking contact term, with the linear terms beside
//! it, is a form of the displacements j on the facet and of the gradients G of the cells:
//! `j.A j + j.B G + G.C j + G.D G`. The least over all j is `-G.N G` with `N = (B+C')' A^-1 (B+C')/4 - D`; where contact is
//! open the linear terms alone leave `N = -D`. The problem is coercive if the bulk outweighs that:
//! `a_K(v,v) >= int_F Grad v . N Grad v`, so that the largest eigenvalue of the right-hand form against a_K is at most 1.
//! N falls as 1/gamma, and the smallest safe gamma is the eigenvalue times gamma. In Nitsche's method with
//! `s(v) = sigma(v) n` and a weight w on each of its terms (1, or 1/2 in a form that has a term for each side) this is
//! `gamma >= w (1+theta)^2/4 sup |s(v)|^2_F / a_K(v,v)`. Nothing is asked of names or methods: s is what the arguments of
//! the projections hold beside the gap, gamma their slope in the displacement, and theta is C in parts of B'.
//!
//! Sufficient, not necessary. Facets are sampled where there are many: evenly, and the thinnest cells on top.

mod point;

use std::collections::BTreeSet;

use nalgebra::{DMatrix, SymmetricEigen};
use wfl_compiler::{
    Class, Dd, ProjectionKind, Real, interpret,
    ir::LANES,
    types::{BasisSlot, FieldKind, FieldOp, InputSlot, Side},
};

use super::{Contact, ContactTerm};
use point::PointLaw;
use wfl_discrete::assemble::{AssembledTerm, Bound, FieldValues, Group, Workspace};
use wfl_discrete::field::Field;
use wfl_discrete::system::System;
use wfl_mesh::mesh::CellId;

/// Facets that are looked at, spread over the interface; as many more with the thinnest cells.
const FACETS: usize = 8;
/// Parameters in parts of the trace constant with which contact is resolved to rounding: below, the pressure drowns in
/// the stress of the elements; above, the overlap in the displacements.
const USUAL: std::ops::RangeInclusive<f64> = 1e-5..=1e6;
/// Modes of a cell below this part of the largest stiffness are rigid motions: the rounding of an eigenvalue solver is 1e-15
/// of the largest, and cells a thousand times as long as wide have modes of 1e-6.
const RIGID: f64 = 1e-11;
/// Numbers that differ by less, relative, differ by rounding: of eigenvalues, known to some hundred roundoffs.
const SAME: f64 = 1e-9;
/// An argument below this part of the first one is closed, and the motions that are tried for it: a distance along a curved
/// obstacle takes about five.
const TOUCHING: f64 = 1e-6;
const MOTIONS: usize = 12;

/// The parameter of a Nitsche term against the smallest safe one.
#[derive(Clone, Debug, PartialEq)]
pub struct Coercivity {
    /// The term.
    pub term: String,
    /// The parameter in use (stress over length).
    pub gamma: f64,
    /// The variant: 1 symmetric, 0 incomplete, -1 skew-symmetric.
    pub theta: f64,
    /// The trace constant `sup |s(v)|^2_F / a_K(v,v)` (stress over length).
    pub trace: f64,
    /// The smallest parameter for which the problem is coercive (stress over length).
    pub bound: f64,
}

impl Coercivity {
    /// The smallest parameter for which the problem is coercive.
    #[must_use]
    pub fn smallest(&self) -> f64 {
        self.bound
    }

    /// True if the parameter in use is at least that; rounding of the eigenvalue is allowed for.
    #[must_use]
    pub fn is_safe(&self) -> bool {
        self.gamma >= self.smallest() * (1.0 - 1e-9)
    }

    /// A good value: the smallest safe one twice over, at least the trace constant.
    #[must_use]
    pub fn usual(&self) -> f64 {
        self.trace.max(2.0 * self.smallest())
    }

    /// True unless the parameter is out of all proportion to the stiffness of the cells at the interface.
    #[must_use]
    pub fn is_usual(&self) -> bool {
        USUAL.contains(&(self.gamma / self.trace))
    }
}

/// One facet: its place in the domain.
type Place = (usize, usize);
/// An entry of the tangent at a point: test and trial slot, and its value.
type Entry = ((BasisSlot, BasisSlot), Dd);

/// Whether a contact law of the scene holds stresses of the bodies in its projections, as Nitsche's method does: then
/// the exact solution meets it whatever its parameter is.
#[must_use]
pub fn is_consistent(system: &System, contact: &Contact) -> bool {
    contact.terms().iter().any(|term| term.reads_stresses(&system.fields))
}

/// The parameter of each Nitsche term against the smallest safe one, at the state without displacement; call after the
/// first [`System::begin_step`].
#[must_use]
pub fn coercivity(system: &System, contact: &Contact) -> Vec<Coercivity> {
    let zero = vec![0.0; system.numbering.n_dofs];
    let values = system.values_with(&zero, contact.active_set());
    contact.terms().iter().filter_map(|term| of_term(system, term, values.view())).collect()
}

impl ContactTerm {
    /// Whether the projections hold stresses of the bodies, as in Nitsche's method, which is consistent.
    fn reads_stresses(&self, fields: &[Field]) -> bool {
        !self.on_cells() && self.law.law.inputs.iter().any(|slot| is_stress(fields, slot, None))
    }
}

/// The parameter of a term; `None` for a method without stresses in its projections.
fn of_term(system: &System, term: &ContactTerm, zero: FieldValues<'_>) -> Option<Coercivity> {
    if !term.reads_stresses(&system.fields) {
        return None;
    }
    let probe = Probe { term, system, zero };
    let own: Vec<f64> = probe.places().into_iter().filter_map(|place| probe.facet(place)).flatten().collect();
    let all = system.team().all_numbers(&own);
    let mut worst: Option<[f64; 4]> = None;
    let mut stiffest = 0.0f64;
    for found in all.as_chunks().0 {
        let rank = |[gamma, _, trace, bound]: &[f64; 4]| (bound / gamma, trace / gamma);
        stiffest = stiffest.max(rank(found).1);
        if worst.as_ref().is_none_or(|w| rank(found) > rank(w)) {
            worst = Some(*found);
        }
    }
    let name = &system.terms[term.term].law.name;
    // the facet with the largest bound need not be the one with the largest trace constant
    let of = |[gamma, theta, _, bound]: [f64; 4]| Coercivity {
        term: name.clone(),
        gamma,
        theta,
        trace: gamma * stiffest,
        bound,
    };
    worst.map(of)
}

struct Probe<'a> {
    term: &'a ContactTerm,
    system: &'a System,
    zero: FieldValues<'a>,
}

impl Probe<'_> {
    /// The facets that are looked at, those of them that this rank counts; made by all ranks together.
    fn places(&self) -> Vec<Place> {
        let groups = self.term.sampled.domain.places(&self.system.mesh);
        let own = groups.iter().enumerate().flat_map(|(g, group)| {
            let facets = group.of.iter().enumerate();
            facets.filter_map(move |(e, position)| Some((group.before + (*position)?, (g, e))))
        });
        // where images move each point is an entity
        let is_first = |(_, place): &(usize, Place)| {
            let facets = &self.term.sampled.domain.groups[place.0].here.facets;
            !self.term.moves() || place.1 == 0 || facets[place.1] != facets[place.1 - 1]
        };
        let own: Vec<(usize, Place)> = own
            .filter(is_first)
            .enumerate()
            .map(|(k, (n, place))| (if self.term.moves() { k } else { n }, place))
            .collect();
        let n_facets = if self.term.moves() { own.len() } else { groups.iter().map(|g| g.n).sum() };
        let stride = n_facets.div_ceil(FACETS).max(1);
        let mut chosen: Vec<Place> = own.iter().filter(|(n, _)| n % stride == 0).map(|(_, place)| *place).collect();
        if stride > 1 {
            let in_order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            let mut thin: Vec<(f64, usize)> = own.iter().map(|(n, place)| (self.height(*place), *n)).collect();
            thin.sort_by(in_order);
            thin.truncate(FACETS);
            let numbers: Vec<f64> = thin.iter().flat_map(|(height, n)| [*height, f64::from_bits(*n as u64)]).collect();
            let all = self.system.team().all_numbers(&numbers);
            let number = |bits: f64| usize::try_from(bits.to_bits()).expect("a number of a facet");
            let mut all: Vec<(f64, usize)> = all.as_chunks().0.iter().map(|[h, n]| (*h, number(*n))).collect();
            all.sort_by(in_order);
            let is_chosen = |n: &usize| all.iter().take(FACETS).any(|(_, thin)| thin == n);
            let mut thin: Vec<&(usize, Place)> = own.iter().filter(|(n, _)| is_chosen(n)).collect();
            thin.sort_by_key(|(n, _)| all.iter().position(|(_, thin)| thin == n));
            chosen.extend(thin.into_iter().map(|(_, place)| *place));
        }
        chosen
    }

    /// The points of a facet.
    fn n_points(&self, place: Place) -> usize {
        let group = &self.term.sampled.domain.groups[place.0];
        if !self.term.moves() {
            return group.n_points();
        }
        let facets = &group.here.facets[place.1..];
        facets.iter().take_while(|facet| **facet == facets[0]).count()
    }

    /// Group, entity and number of a point of a facet. Where images move each point is an entity of its own.
    fn spot(&self, place: Place, point: usize) -> (usize, usize, usize) {
        if self.term.moves() { (place.0, place.1 + point, 0) } else { (place.0, place.1, point) }
    }

    /// How far the centre of the cell is from that of the facet.
    fn height(&self, place: Place) -> f64 {
        let (g, entity) = place;
        let here = &self.term.sampled.domain.groups[g].here;
        let (a, b) =
            (self.system.mesh.centroid(here.cells[entity]), self.system.mesh.facet_centroid(here.facets[entity]));
        (0..3).fold(0.0f64, |m, k| m.hypot(a[k] - b[k]))
    }

    /// Parameter, variant, trace constant and bound of a facet, in the order of [`Coercivity`].
    fn facet(&self, place: Place) -> Option<[f64; 4]> {
        let group = &self.term.sampled.domain.groups[place.0];
        // the cell of an image, where it moves: it stands for all that the facet may come to
        let mut cells = vec![group.here.cells[place.1]];
        if self.term.law.law.inputs.iter().any(|slot| is_stress(&self.system.fields, slot, Some(Side::There))) {
            cells.extend(group.there.as_ref().map(|t| t.cells[place.1]));
        }
        let (dofs, bulk) = self.bulk(&cells);
        if dofs.is_empty() {
            return None;
        }
        let (gradients, laws) = (self.gradients(place, &dofs), self.laws(place));
        let sum = |forms: Vec<DMatrix<f64>>| {
            gradients.iter().zip(forms).fold(DMatrix::zeros(dofs.len(), dofs.len()), |sum, (at, form)| {
                sum + at.weight * at.columns.transpose() * form * &at.columns
            })
        };
        let traction = sum(laws.iter().map(|law| law.weight() * law.stresses.tr_mul(&law.stresses)).collect());
        let gamma = laws.iter().find_map(|law| law.slope(self))?;
        let (trace, theta) = (largest(&bulk, &traction)?, self.theta(place)?);
        let lost = |closed: bool| {
            let forms: Option<Vec<DMatrix<f64>>> = laws.iter().map(|law| law.lost(closed)).collect();
            largest(&bulk, &sum(forms?))
        };
        let bound = gamma * [true, false].into_iter().filter_map(lost).fold(0.0, f64::max);
        // the formula says the same with less rounding, where nothing cancels (theta = -1) with none
        let usual = (1.0 + theta).powi(2) / 4.0 * trace;
        let summed = (1.0 + theta.abs()).powi(2) / 4.0 * trace;
        let bound = if (bound - usual).abs() <= SAME * summed { usual } else { bound };
        Some([gamma, theta, trace, bound])
    }

    /// The tangent at a point of a facet by slots: of the linear terms there, and of the contact term where it is closed and
    /// sticks, in double-double arithmetic.
    fn slots(&self, place: Place, point: usize, at: FieldValues<'_>) -> [Vec<Entry>; 2] {
        let p = self.term;
        let mut tied = p.open();
        p.stick_all(&mut tied);
        let mut current = at.current.to_vec();
        tied.stand_in(p.field, &mut current);
        let values = FieldValues { current: &current, ..at };
        let facet = p.sampled.domain.groups[place.0].here.facets[place.1];
        let of = |term: &AssembledTerm| -> Vec<Entry> {
            let (spot, has_images) = (self.spot(place, point), term.integrator.moves());
            let groups = term.integrator.domain.groups.iter().enumerate();
            let at = |(g, group): (usize, &Group)| Some((g, group.here.facets.iter().position(|f| *f == facet)?));
            let found = groups.filter(|(_, group)| !group.is_global && point < group.n_points()).find_map(at);
            let found = if has_images { Some((spot.0, spot.1)) } else { found };
            let Some((g, entity)) = found else { return Vec::new() };
            let point = if has_images { spot.2 } else { point };
            let (domain, binding) = (&term.integrator.domain, &term.integrator.binding);
            let mut workspace = Workspace::default();
            workspace.prepare(Bound { mesh: &self.system.mesh, domain, binding }, g, entity / LANES, values);
            let law = &term.law;
            let n = law.inputs.len();
            let input = |s: usize| workspace.inputs[(point * n + s) * LANES + entity % LANES];
            let mut inputs: Vec<f64> = (0..n).map(input).collect();
            if has_images {
                inputs = ContactTerm::at_touch(self.system, (&domain.groups[g], entity), &law.inputs, &inputs);
            }
            let inputs: Vec<Dd> = inputs.into_iter().map(Dd::from_f64).collect();
            let uniforms: Vec<Dd> = term.uniforms().iter().map(|x| Dd::from_f64(*x)).collect();
            let mut out = vec![Dd::ZERO; law.tangent.kernel().outputs.len()];
            interpret(&law.tangent, &uniforms, &inputs, &mut Vec::new(), &mut out);
            let entries = law.entries.iter().zip(&out[law.tests.len()..]);
            entries.map(|((i, j), x)| ((law.tests[usize::from(*i)], law.trials[usize::from(*j)]), *x)).collect()
        };
        // beside a law whose normal turns the stresses are those of finite strain
        let is_smooth = |t: &AssembledTerm| p.moves() && t.law.class > Class::Constant && t.kinks().is_empty();
        let counts = |t: &&AssembledTerm| t.law.class == Class::Linear || is_smooth(t);
        let linear = self.system.terms.iter().filter(|t| !t.on_cells()).filter(counts);
        [linear.flat_map(of).collect(), of(p.form(self.system))]
    }

    /// The laws at the points of a facet.
    fn laws(&self, place: Place) -> Vec<PointLaw> {
        let n_points = self.n_points(place);
        if self.term.moves() {
            return (0..n_points).map(|point| self.law(place, point, self.zero)).collect();
        }
        if !self.is_affine() {
            let touching =
                |point| self.touching(place, point).unwrap_or_else(|| self.law(place, point, self.zero).open());
            return (0..n_points).map(touching).collect();
        }
        // without a position in them they are one at all points
        let terms = self.system.terms.iter().filter(|t| !t.on_cells());
        let is_everywhere = |slot: &InputSlot| matches!(slot, InputSlot::Field(_) | InputSlot::Normal(..));
        let facet = self.term.sampled.domain.groups[place.0].here.facets[place.1];
        let is_plane = self.system.mesh.facet_map_order(facet) == 0;
        if is_plane && terms.flat_map(|t| &t.law.inputs).all(is_everywhere) {
            let first = self.law(place, 0, self.zero);
            return vec![first; n_points];
        }
        (0..n_points).map(|point| self.law(place, point, self.zero)).collect()
    }

    fn law(&self, place: Place, point: usize, at: FieldValues<'_>) -> PointLaw {
        PointLaw::new(self, &self.slots(place, point, at), &self.slopes(place, point, at))
    }

    /// True if the derivatives of the arguments are the same at all states.
    fn is_affine(&self) -> bool {
        let unknown = |slot: Option<&InputSlot>| match slot {
            Some(InputSlot::Field(b)) => {
                self.system.fields.get(b.field.index()).is_some_and(|f| f.kind == FieldKind::Unknown)
            }
            _ => false,
        };
        let inputs = &self.term.law.law.inputs;
        self.term.slopes.inputs().all(|k| !unknown(inputs.get(k)))
    }

    /// The law at a point where the cell has moved, as a rigid body, until the sides touch there: a gap that is open, or
    /// an overlap, times the derivative of a normal is no stress. `None` where no motion closes the gap.
    fn touching(&self, place: Place, point: usize) -> Option<PointLaw> {
        let (p, fields) = (self.term, &self.system.fields);
        let half = p.projections.iter().find(|pr| pr.kind == ProjectionKind::HalfLine && pr.n == 1)?;
        let copy = |list: &[&[f64]]| -> Vec<Vec<f64>> { list.iter().map(|values| values.to_vec()).collect() };
        // the end of the previous step moves with it: there is no slip
        let (mut moved, mut before) = (copy(self.zero.current), copy(self.zero.previous));
        let mut size = 0.0f64;
        for _ in 0..MOTIONS {
            let [current, previous] = [&moved, &before].map(|list| list.iter().map(Vec::as_slice).collect::<Vec<_>>());
            let at = FieldValues { current: &current, previous: &previous, ..self.zero };
            let law = self.law(place, point, at);
            let argument = self.argument(place, point, at, half.output);
            let direction = law.motion(fields)?;
            let slope: f64 = direction.iter().map(|(_, slope)| slope * slope).sum();
            if !(slope > 0.0 && argument.is_finite()) {
                return None;
            }
            size = size.max(argument.abs());
            if argument.abs() <= TOUCHING * size {
                return Some(law);
            }
            for (slot, along) in &direction {
                let (k, n) = (slot.field.index(), fields[slot.field.index()].n_components);
                for list in [&mut moved, &mut before] {
                    let own = list.get_mut(k).into_iter().flatten().skip(usize::from(slot.entry)).step_by(n);
                    own.for_each(|x| *x -= argument * along / slope);
                }
            }
        }
        None
    }

    /// The argument of a projection at a point.
    fn argument(&self, place: Place, point: usize, at: FieldValues<'_>, output: usize) -> f64 {
        let (g, entity) = place;
        let p = self.term;
        let mut workspace = Workspace::default();
        workspace.prepare(self.bound(), g, entity / LANES, at);
        let mut out = vec![0.0; p.n_outputs()];
        let inputs = p.point_inputs(&workspace, point, entity % LANES);
        interpret(&p.law.law.kernel, p.law.uniforms(), &inputs, &mut Vec::new(), &mut out);
        out[output]
    }

    /// The gradients that the arguments of the projections change with.
    fn gradient_slots(&self) -> Vec<BasisSlot> {
        let slots = self.term.slopes.list().iter().map(|s| s.slot).filter(|slot| slot.op != FieldOp::Value);
        slots.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// What is tested with gradients in parts of how forces depend on them. The derivatives are multiplied out in
    /// double-double arithmetic, so that a number of the scene comes out as it is written.
    fn theta(&self, place: Place) -> Option<f64> {
        let entries = self.slots(place, 0, self.zero).concat();
        let (mut product, mut square) = (Dd::ZERO, Dd::ZERO);
        for ((a, b), force) in entries.iter().filter(|((a, b), _)| a.op == FieldOp::Value && b.op != FieldOp::Value) {
            for (_, facing) in entries.iter().filter(|(pair, _)| *pair == (*b, *a)) {
                product = product + *force * *facing;
            }
            square = square + *force * *force;
        }
        let theta = if square.to_f64() > 0.0 { (product / square).to_f64() } else { 0.0 };
        // no negative zero
        theta.is_finite().then_some(theta + 0.0)
    }

    /// Dofs of some cells and the tangent of the cell terms on them, at the state without displacement.
    fn bulk(&self, cells: &[CellId]) -> (Vec<u32>, DMatrix<f64>) {
        let mut blocks = Vec::new();
        for term in self.system.terms.iter().filter(|t| t.law.class > Class::Constant && t.on_cells()) {
            for cell in cells {
                blocks.extend(term.local_tangent(&self.system.mesh, self.zero, |side, e| side.cells[e] == *cell));
            }
        }
        let mut dofs: Vec<u32> = blocks.iter().flat_map(|(d, _)| d.iter().copied()).collect();
        dofs.sort_unstable();
        dofs.dedup();
        let mut sum = DMatrix::zeros(dofs.len(), dofs.len());
        blocks.iter().for_each(|(local, values)| add(&mut sum, &dofs, local, values));
        (dofs, sum)
    }

    /// The gradients that a unit of each dof makes at the points of a facet.
    fn gradients(&self, place: Place, dofs: &[u32]) -> Vec<Gradients> {
        let (p, slots) = (self.term, self.gradient_slots());
        let inputs = &p.law.law.inputs;
        let read = |slot: &BasisSlot| inputs.iter().position(|input| *input == InputSlot::Field(*slot));
        let rows: Vec<(usize, usize)> =
            slots.iter().enumerate().filter_map(|(row, slot)| Some((row, read(slot)?))).collect();
        let n_points = self.n_points(place);
        let none = |_| Gradients { weight: 0.0, columns: DMatrix::zeros(slots.len(), dofs.len()) };
        let mut found: Vec<Gradients> = (0..n_points).map(none).collect();
        let mut workspace = Workspace::default();
        let mut unit: Vec<Vec<f64>> = self.zero.current.iter().map(|values| values.to_vec()).collect();
        for (column, dof) in dofs.iter().enumerate() {
            let starts = self.system.numbering.starts.iter().take(self.system.fields.len()).enumerate();
            let mut before = starts.filter_map(|(field, start)| Some((field, (*dof as usize).checked_sub((*start)?)?)));
            let Some((field, node)) = before.next_back() else { continue };
            let kept = std::mem::replace(&mut unit[field][node], 1.0);
            let current: Vec<&[f64]> = unit.iter().map(Vec::as_slice).collect();
            for (point, at) in found.iter_mut().enumerate() {
                let (g, entity, q) = self.spot(place, point);
                if q == 0 {
                    let values = FieldValues { current: &current, ..self.zero };
                    workspace.prepare(self.bound(), g, entity / LANES, values);
                }
                let inputs = p.point_inputs(&workspace, q, entity % LANES);
                rows.iter().for_each(|(row, input)| at.columns[(*row, column)] = inputs[*input]);
                at.weight = workspace.weight(q)[entity % LANES];
            }
            unit[field][node] = kept;
        }
        found
    }

    /// The derivatives of the arguments at a point of a facet.
    fn slopes(&self, place: Place, point: usize, at: FieldValues<'_>) -> Vec<f64> {
        let (g, entity, q) = self.spot(place, point);
        let p = self.term;
        let mut workspace = Workspace::default();
        workspace.prepare(self.bound(), g, entity / LANES, at);
        let mut inputs = p.point_inputs(&workspace, q, entity % LANES);
        if p.moves() {
            inputs =
                ContactTerm::at_touch(self.system, (&p.sampled.domain.groups[g], entity), &p.law.law.inputs, &inputs);
        }
        p.slopes.at_point(&inputs)
    }

    fn bound(&self) -> Bound<'_> {
        let sampled = &self.term.sampled;
        Bound { mesh: &self.system.mesh, domain: &sampled.domain, binding: &sampled.binding }
    }
}

/// True if a law reads a gradient of a field of the scene there, on one side or on any.
fn is_stress(fields: &[Field], slot: &InputSlot, side: Option<Side>) -> bool {
    matches!(slot, InputSlot::Field(b)
        if b.op != FieldOp::Value && b.field.index() < fields.len() && side.is_none_or(|s| s == b.side))
}

/// The gradients at a point that a unit of each dof makes.
struct Gradients {
    weight: f64,
    columns: DMatrix<f64>,
}

/// Adds a local matrix where both dofs are known.
fn add(sum: &mut DMatrix<f64>, dofs: &[u32], local: &[u32], values: &[f64]) {
    let place: Vec<Option<usize>> = local.iter().map(|d| dofs.binary_search(d).ok()).collect();
    for (i, row) in place.iter().enumerate() {
        for (j, column) in place.iter().enumerate() {
            if let (Some(r), Some(c)) = (row, column) {
                sum[(*r, *c)] += values[i * local.len() + j];
            }
        }
    }
}

/// The largest eigenvalue of `form v = lambda bulk v` beside the rigid motions, on which both vanish, if it is positive.
fn largest(bulk: &DMatrix<f64>, form: &DMatrix<f64>) -> Option<f64> {
    let symmetric = 0.5 * (bulk + bulk.transpose());
    if symmetric.iter().chain(form.iter()).any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(symmetric);
    let stiffest = eigen.eigenvalues.iter().fold(0.0f64, |m, x| m.max(*x));
    let kept: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|k| eigen.eigenvalues[*k] > RIGID * stiffest).collect();
    let basis = DMatrix::from_fn(bulk.nrows(), kept.len(), |i, j| {
        eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt()
    });
    if kept.is_empty() {
        return None;
    }
    let reduced = basis.transpose() * form * &basis;
    let found = SymmetricEigen::new(0.5 * (&reduced + reduced.transpose()));
    Some(found.eigenvalues.max()).filter(|value| *value > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_eigenvalue_leaves_rigid_motions_out() {
        // a spring between two nodes; s is its force: sup k^2 (a-b)^2 / (k (a-b)^2) = k
        let spring = DMatrix::from_row_slice(2, 2, &[3.0, -3.0, -3.0, 3.0]);
        let force = DMatrix::from_row_slice(2, 2, &[9.0, -9.0, -9.0, 9.0]);
        let value = largest(&spring, &force).expect("a positive one");
        assert!((value - 3.0).abs() < 1e-13);
        assert_eq!(largest(&spring, &-force), None);
    }

    #[test]
    fn a_form_that_the_bulk_does_not_bound_has_no_eigenvalue() {
        let spring = DMatrix::from_row_slice(2, 2, &[3.0, -3.0, -3.0, 3.0]);
        assert_eq!(largest(&spring, &DMatrix::from_element(2, 2, f64::NAN)), None);
        assert_eq!(largest(&DMatrix::zeros(2, 2), &spring), None, "all motions are rigid");
    }

    #[test]
    fn local_entries_of_cells_add_where_both_dofs_are_known() {
        let mut sum = DMatrix::zeros(2, 2);
        add(&mut sum, &[3, 8], &[8, 5, 3], &[1.0, 9.0, 2.0, 9.0, 9.0, 9.0, 4.0, 9.0, 8.0]);
        add(&mut sum, &[3, 8], &[3], &[0.5]);
        assert_eq!(sum, DMatrix::from_row_slice(2, 2, &[8.5, 4.0, 2.0, 1.0]));
    }

    #[test]
    fn a_parameter_is_safe_from_its_bound_on() {
        let with = |gamma: f64| Coercivity { term: String::new(), gamma, theta: 1.0, trace: 3.0, bound: 2.0 };
        assert!(with(2.0).is_safe() && with(2.0 * (1.0 - 1e-10)).is_safe() && !with(1.99).is_safe());
        assert_eq!(with(1.0).usual(), 4.0);
        assert!(with(1.0).is_usual() && !with(1e-6).is_usual() && !with(1e7).is_usual());
    }
}
