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

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, SymmetricEigen};
use wfl_compiler::{
    ArgumentSlope, Class, Dd, ProjectionKind, Real, interpret,
    ir::LANES,
    types::{BasisSlot, FieldId, FieldOp, InputSlot, Side},
};

use super::{Contact, ContactTerm, slopes::is_displacement};
use wfl_discrete::assemble::{Bound, FieldValues, Group, Workspace};
use wfl_discrete::field::Field;
use wfl_discrete::system::System;
use wfl_mesh::mesh::CellId;

/// Facets that are looked at, spread over the interface; as many more with the thinnest cells.
const FACETS: usize = 8;
/// Parameters in parts of the trace constant with which contact is resolved to rounding: below, the pressure drowns in
/// the stress of the elements; above, the overlap in the displacements.
const USUAL: std::ops::RangeInclusive<f64> = 1e-5..=1e6;
/// Modes of a cell below this part of the largest stiffness are rigid motions.
const RIGID: f64 = 1e-11;
/// Numbers that differ by less, relative, differ by rounding.
const SAME: f64 = 1e-9;

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
    for found in all.as_chunks().0 {
        let rank = |[gamma, _, trace, bound]: &[f64; 4]| (bound / gamma, *trace);
        if worst.as_ref().is_none_or(|w| rank(found) > rank(w)) {
            worst = Some(*found);
        }
    }
    let name = &system.terms[term.term].law.name;
    worst.map(|[gamma, theta, trace, bound]| Coercivity { term: name.clone(), gamma, theta, trace, bound })
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
        let stride = groups.iter().map(|g| g.n).sum::<usize>().div_ceil(FACETS).max(1);
        let own = groups.iter().enumerate().flat_map(|(g, group)| {
            let facets = group.of.iter().enumerate();
            facets.filter_map(move |(e, position)| Some((group.before + (*position)?, (g, e))))
        });
        let own: Vec<(usize, Place)> = own.collect();
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
        let mut cells = vec![group.here.cells[place.1]];
        if self.term.law.law.inputs.iter().any(|slot| is_stress(&self.system.fields, slot, Some(Side::There))) {
            cells.extend(group.there.as_ref().map(|t| t.cells[place.1]));
        }
        let (dofs, bulk) = self.bulk(&cells);
        if dofs.is_empty() {
            return None;
        }
        let (traction, gradients) = self.traction(place, &dofs);
        let gamma = self.slope(place)?;
        let (trace, theta) = (largest(&bulk, &traction)?, self.theta(place)?);
        let lost = |closed: bool| {
            let form = self.lost(place, closed)?;
            let sum = gradients.iter().fold(DMatrix::zeros(dofs.len(), dofs.len()), |sum, at| {
                sum + at.weight * at.columns.transpose() * &form * &at.columns
            });
            largest(&bulk, &sum)
        };
        let bound = gamma * [true, false].into_iter().filter_map(lost).fold(0.0, f64::max);
        // of a form without weights the formula says the same with less rounding
        let usual = (1.0 + theta).powi(2) / 4.0 * trace;
        let bound = if (bound - usual).abs() <= SAME * usual { usual } else { bound };
        Some([gamma, theta, trace, bound])
    }

    /// The tangent of the facet terms by slots: of the contact term where it is closed and sticks, if `closed`, and of the
    /// linear terms, in double-double arithmetic.
    fn slots(&self, place: Place, closed: bool) -> Vec<((BasisSlot, BasisSlot), Dd)> {
        let p = self.term;
        let mut tied = p.open();
        p.stick_all(&mut tied);
        let mut current = self.zero.current.to_vec();
        current[p.field] = &tied;
        let values = FieldValues { current: &current, ..self.zero };
        let facet = p.sampled.domain.groups[place.0].here.facets[place.1];
        let linear = self.system.terms.iter().filter(|t| t.law.class == Class::Linear && !t.on_cells());
        let mut found = Vec::new();
        for term in linear.chain(closed.then(|| p.form(self.system))) {
            let groups = term.integrator.domain.groups.iter().enumerate();
            let at = |(g, group): (usize, &Group)| Some((g, group.here.facets.iter().position(|f| *f == facet)?));
            let Some((g, entity)) = groups.filter(|(_, group)| !group.is_global).find_map(at) else { continue };
            let (domain, binding) = (&term.integrator.domain, &term.integrator.binding);
            let mut workspace = Workspace::default();
            workspace.prepare(Bound { mesh: &self.system.mesh, domain, binding }, g, entity / LANES, values);
            let law = &term.law;
            let input = |s: usize| Dd::from_f64(workspace.inputs[s * LANES + entity % LANES]);
            let inputs: Vec<Dd> = (0..law.inputs.len()).map(input).collect();
            let uniforms: Vec<Dd> = term.uniforms().iter().map(|x| Dd::from_f64(*x)).collect();
            let mut out = vec![Dd::ZERO; law.tangent.kernel().outputs.len()];
            interpret(&law.tangent, &uniforms, &inputs, &mut Vec::new(), &mut out);
            let entries = law.entries.iter().zip(&out[law.tests.len()..]);
            found.extend(entries.map(|((i, j), x)| ((law.tests[usize::from(*i)], law.trials[usize::from(*j)]), *x)));
        }
        found
    }

    /// The gradients that the arguments of the projections change with.
    fn gradient_slots(&self) -> Vec<BasisSlot> {
        let slots = self.term.slopes.list().iter().map(|s| s.slot).filter(|slot| slot.op != FieldOp::Value);
        slots.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// What gradients take of the form at most: N of the module.
    fn lost(&self, place: Place, closed: bool) -> Option<DMatrix<f64>> {
        let entries = self.slots(place, closed);
        let gradients = self.gradient_slots();
        let mut values: Vec<BasisSlot> = Vec::new();
        for ((a, b), _) in &entries {
            values.extend([a, b].into_iter().filter(|s| s.op == FieldOp::Value));
        }
        values.sort_unstable();
        values.dedup();
        let (n, m) = (values.len(), gradients.len());
        let (mut stiffness, mut mixed, mut own) = (DMatrix::zeros(n, n), DMatrix::zeros(n, m), DMatrix::zeros(m, m));
        let value = |s: &BasisSlot| values.iter().position(|v| v == s);
        let gradient = |s: &BasisSlot| gradients.iter().position(|g| g == s);
        for ((a, b), x) in &entries {
            let x = (*x).to_f64();
            match (value(a), value(b), gradient(a), gradient(b)) {
                (Some(i), Some(j), ..) => {
                    stiffness[(i, j)] += 0.5 * x;
                    stiffness[(j, i)] += 0.5 * x;
                }
                (Some(i), _, _, Some(j)) | (_, Some(i), Some(j), _) => mixed[(i, j)] += x,
                (_, _, Some(i), Some(j)) => {
                    own[(i, j)] += 0.5 * x;
                    own[(j, i)] += 0.5 * x;
                }
                _ => {}
            }
        }
        if n == 0 {
            return Some(-own);
        }
        if [&stiffness, &mixed, &own].into_iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let size = stiffness.amax();
        let inverse = if size > 0.0 { stiffness.pseudo_inverse(SAME * size).ok()? } else { stiffness };
        Some(0.25 * mixed.transpose() * inverse * &mixed - own)
    }

    /// What is tested with gradients in parts of how forces depend on them. The derivatives are multiplied out in
    /// double-double arithmetic, so that a number of the scene comes out as it is written.
    fn theta(&self, place: Place) -> Option<f64> {
        let entries = self.slots(place, true);
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

    /// The form `|s(v)|^2` on the facet over these dofs, and the gradients at its points.
    fn traction(&self, place: Place, dofs: &[u32]) -> (DMatrix<f64>, Vec<Gradients>) {
        let gradients = self.gradients(place, dofs);
        let mut form = DMatrix::zeros(dofs.len(), dofs.len());
        for (at, slopes) in gradients.iter().zip(self.stress_slopes(place)) {
            let stresses = slopes * &at.columns;
            form += at.weight * stresses.tr_mul(&stresses);
        }
        (form, gradients)
    }

    /// The gradients that a unit of each dof makes at the points of a facet.
    fn gradients(&self, place: Place, dofs: &[u32]) -> Vec<Gradients> {
        let (g, entity) = place;
        let (p, slots) = (self.term, self.gradient_slots());
        let inputs = &p.law.law.inputs;
        let read = |slot: &BasisSlot| inputs.iter().position(|input| *input == InputSlot::Field(*slot));
        let rows: Vec<(usize, usize)> =
            slots.iter().enumerate().filter_map(|(row, slot)| Some((row, read(slot)?))).collect();
        let n_points = p.sampled.domain.groups[g].n_points();
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
            workspace.prepare(self.bound(), g, entity / LANES, FieldValues { current: &current, ..self.zero });
            unit[field][node] = kept;
            for (q, at) in found.iter_mut().enumerate() {
                let inputs = p.point_inputs(&workspace, q, entity % LANES);
                rows.iter().for_each(|(row, input)| at.columns[(*row, column)] = inputs[*input]);
                at.weight = workspace.weight(q)[entity % LANES];
            }
        }
        found
    }

    /// At each point of a facet: the derivatives of the arguments of all projections with respect to the gradients, the
    /// whole traction: along the normal from half lines, across it from balls.
    fn stress_slopes(&self, place: Place) -> Vec<DMatrix<f64>> {
        let gradients = self.gradient_slots();
        let first = |projection: usize| self.term.projections[..projection].iter().map(|p| p.n).sum::<usize>();
        let n = first(self.term.projections.len());
        let of = |slopes: Vec<f64>| {
            let mut found = DMatrix::zeros(n, gradients.len());
            for (slope, x) in self.term.slopes.list().iter().zip(slopes) {
                if let Some(column) = gradients.iter().position(|g| *g == slope.slot) {
                    found[(first(slope.projection) + slope.entry, column)] = x;
                }
            }
            found
        };
        self.slopes(place).into_iter().map(of).collect()
    }

    /// The derivatives of the arguments at the points of a facet.
    fn slopes(&self, place: Place) -> Vec<Vec<f64>> {
        let (g, entity) = place;
        let p = self.term;
        let mut workspace = Workspace::default();
        workspace.prepare(self.bound(), g, entity / LANES, self.zero);
        let n_points = p.sampled.domain.groups[g].n_points();
        (0..n_points).map(|q| p.slopes.at_point(&p.point_inputs(&workspace, q, entity % LANES))).collect()
    }

    fn bound(&self) -> Bound<'_> {
        let sampled = &self.term.sampled;
        Bound { mesh: &self.system.mesh, domain: &sampled.domain, binding: &sampled.binding }
    }

    /// The slope of the first half line in the displacement of one side.
    fn slope(&self, place: Place) -> Option<f64> {
        let p = self.term;
        let half = p.projections.iter().position(|pr| pr.kind == ProjectionKind::HalfLine && pr.n == 1)?;
        let slopes = self.slopes(place).into_iter().next()?;
        let mut sides: BTreeMap<(FieldId, Side), f64> = BTreeMap::new();
        for (at, ArgumentSlope { slot, .. }) in p.slopes.of_projection(half) {
            if is_displacement(&self.system.fields, slot) {
                let total = sides.entry((slot.field, slot.side)).or_default();
                *total = total.hypot(slopes[at]);
            }
        }
        sides.into_values().max_by(f64::total_cmp).filter(|s| *s > 0.0)
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
}
