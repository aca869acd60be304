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

use nalgebra::{DMatrix, SymmetricEigen};
use wfl_compiler::{
    Class, ProjectionKind, interpret,
    ir::LANES,
    types::{BasisSlot, FieldOp, InputSlot, Side},
};

use super::{Contact, ContactTerm};
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
/// Step of the gradients, relative: laws that are linear in them are exact for any.
const STRAIN: f64 = 1e-6;

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
    let mut worst: Option<Coercivity> = None;
    for place in probe.places() {
        let Some(found) = probe.facet(place) else { continue };
        let ratio = |c: &Coercivity| c.smallest() / c.gamma;
        if worst.as_ref().is_none_or(|w| (ratio(&found), found.trace) > (ratio(w), w.trace)) {
            worst = Some(found);
        }
    }
    worst
}

struct Probe<'a> {
    term: &'a ContactTerm,
    system: &'a System,
    zero: FieldValues<'a>,
}

impl Probe<'_> {
    /// The facets that are looked at.
    fn places(&self) -> Vec<Place> {
        let groups = &self.term.sampled.domain.groups;
        let all: Vec<Place> =
            groups.iter().enumerate().flat_map(|(g, group)| (0..group.entities.len()).map(move |e| (g, e))).collect();
        let stride = all.len().div_ceil(FACETS).max(1);
        let mut chosen: Vec<Place> = all.iter().step_by(stride).copied().collect();
        if stride > 1 {
            let mut thin: Vec<(f64, Place)> = all.iter().map(|p| (self.height(*p), *p)).collect();
            thin.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            chosen.extend(thin.iter().take(FACETS).map(|(_, p)| *p));
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

    fn facet(&self, place: Place) -> Option<Coercivity> {
        let group = &self.term.sampled.domain.groups[place.0];
        let mut cells = vec![group.here.cells[place.1]];
        if self.term.law.law.inputs.iter().any(|slot| is_stress(&self.system.fields, slot, Some(Side::There))) {
            cells.extend(group.there.as_ref().map(|t| t.cells[place.1]));
        }
        let (dofs, bulk) = self.bulk(&cells);
        if dofs.is_empty() {
            return None;
        }
        let (traction, gradients) = self.traction(place, &dofs)?;
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
        Some(Coercivity { term: self.system.terms[self.term.term].law.name.clone(), gamma, theta, trace, bound })
    }

    /// The tangent of the facet terms by slots: of the contact term where it is closed and sticks, if `closed`, and of the
    /// linear terms. Slots of gradients are those that the projections read.
    fn slots(&self, place: Place, closed: bool) -> Vec<((BasisSlot, BasisSlot), f64)> {
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
            let inputs: Vec<f64> =
                (0..law.inputs.len()).map(|s| workspace.inputs[s * LANES + entity % LANES]).collect();
            let mut out = vec![0.0; law.tangent.kernel().outputs.len()];
            interpret(&law.tangent, term.uniforms(), &inputs, &mut Vec::new(), &mut out);
            let entries = law.entries.iter().zip(&out[law.tests.len()..]);
            found.extend(entries.map(|((i, j), x)| ((law.tests[usize::from(*i)], law.trials[usize::from(*j)]), *x)));
        }
        found
    }

    /// The gradients that the projections read, in their order.
    fn gradient_slots(&self) -> Vec<BasisSlot> {
        let slots = self.term.law.law.inputs.iter().filter(|slot| is_stress(&self.system.fields, slot, None));
        slots.filter_map(|slot| if let InputSlot::Field(b) = slot { Some(*b) } else { None }).collect()
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

    /// What is tested with gradients in parts of how forces depend on them.
    fn theta(&self, place: Place) -> Option<f64> {
        let entries = self.slots(place, true);
        let (mut product, mut square) = (0.0, 0.0);
        for ((a, b), force) in entries.iter().filter(|((a, b), _)| a.op == FieldOp::Value && b.op != FieldOp::Value) {
            let facing = entries.iter().filter(|(pair, _)| *pair == (*b, *a)).map(|(_, x)| x);
            product += force * facing.sum::<f64>();
            square += force * force;
        }
        // a sum of products is a whole number but for rounding
        let theta: f64 = if square > 0.0 { product / square } else { 0.0 };
        let whole = theta.round() + 0.0;
        theta.is_finite().then_some(if (theta - whole).abs() < SAME { whole } else { theta })
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
    fn traction(&self, place: Place, dofs: &[u32]) -> Option<(DMatrix<f64>, Vec<Gradients>)> {
        let base = self.stresses(place, self.zero.current);
        let (points, weights) = (base.values.len(), base.weights);
        let n = base.values.first()?.len();
        let mut columns = Vec::with_capacity(dofs.len());
        let rows = base.gradients.first()?.len();
        let gradients = |weight: &f64| Gradients { weight: *weight, columns: DMatrix::zeros(rows, dofs.len()) };
        let mut gradients: Vec<Gradients> = weights.iter().map(gradients).collect();
        let mut copy: Option<(usize, Vec<f64>)> = None;
        for (column, dof) in dofs.iter().enumerate() {
            let field = (0..self.system.fields.len())
                .rfind(|k| self.system.numbering.starts[*k].is_some_and(|s| s <= *dof as usize))?;
            let place_in_field = *dof as usize - self.system.numbering.starts[field]?;
            let (_, values) = match &mut copy {
                Some(kept) if kept.0 == field => kept,
                other => other.insert((field, self.zero.current[field].to_vec())),
            };
            let before = *values.get(place_in_field)?;
            values[place_in_field] = before + STRAIN;
            let mut current = self.zero.current.to_vec();
            current[field] = values;
            let moved = self.stresses(place, &current);
            values[place_in_field] = before;
            for (q, at) in gradients.iter_mut().enumerate() {
                for k in 0..rows {
                    at.columns[(k, column)] = (moved.gradients[q][k] - base.gradients[q][k]) / STRAIN;
                }
            }
            let change = (0..points).flat_map(|q| (0..n).map(move |k| (q, k)));
            columns.push(
                change
                    .map(|(q, k)| weights[q].sqrt() * (moved.values[q][k] - base.values[q][k]) / STRAIN)
                    .collect::<Vec<f64>>(),
            );
        }
        let form = DMatrix::from_fn(dofs.len(), dofs.len(), |i, j| {
            columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum()
        });
        Some((form, gradients))
    }

    /// The arguments of the projections at the points of a facet for given values of the fields, displacements left out
    /// of them.
    fn stresses(&self, place: Place, current: &[&[f64]]) -> Stresses {
        let (g, entity) = place;
        let p = self.term;
        let bound = Bound { mesh: &self.system.mesh, domain: &p.sampled.domain, binding: &p.sampled.binding };
        let mut workspace = Workspace::default();
        let (batch, lane) = (entity / LANES, entity % LANES);
        workspace.prepare(bound, g, batch, FieldValues { current, ..self.zero });
        let law = &p.law.law;
        let (mut scratch, mut out) = (Vec::new(), vec![0.0; law.kernel.kernel().outputs.len()]);
        let mut found = Stresses { values: Vec::new(), gradients: Vec::new(), weights: Vec::new() };
        for q in 0..p.sampled.domain.groups[g].n_points() {
            let inputs: Vec<f64> = (law.inputs.iter().enumerate())
                .map(|(s, slot)| match slot {
                    InputSlot::Field(b) if b.op == FieldOp::Value && b.field.index() < self.system.fields.len() => 0.0,
                    _ => workspace.inputs[(q * law.inputs.len() + s) * LANES + lane],
                })
                .collect();
            interpret(&law.kernel, p.law.uniforms(), &inputs, &mut scratch, &mut out);
            // the whole traction: along the normal from half lines, across it from balls
            let entries = p.projections.iter().flat_map(|pr| out[pr.output..pr.output + pr.n].to_vec()).collect();
            found.values.push(entries);
            let read = law.inputs.iter().zip(&inputs).filter(|(slot, _)| is_stress(&self.system.fields, slot, None));
            found.gradients.push(read.map(|(_, x)| *x).collect());
            found.weights.push(workspace.weight(q)[lane]);
        }
        found
    }

    /// The slope of the first half line in the displacement of one side.
    fn slope(&self, place: Place) -> Option<f64> {
        let (g, entity) = place;
        let p = self.term;
        let half = p.projections.iter().find(|pr| pr.kind == ProjectionKind::HalfLine && pr.n == 1)?;
        let bound = Bound { mesh: &self.system.mesh, domain: &p.sampled.domain, binding: &p.sampled.binding };
        let mut workspace = Workspace::default();
        workspace.prepare(bound, g, entity / LANES, self.zero);
        let law = &p.law.law;
        let mut inputs: Vec<f64> =
            (0..law.inputs.len()).map(|s| workspace.inputs[s * LANES + entity % LANES]).collect();
        let (mut scratch, mut out) = (Vec::new(), vec![0.0; law.kernel.kernel().outputs.len()]);
        interpret(&law.kernel, p.law.uniforms(), &inputs, &mut scratch, &mut out);
        let base = out[half.output];
        let mut sides: Vec<((usize, Side), f64)> = Vec::new();
        for (s, slot) in law.inputs.iter().enumerate() {
            let InputSlot::Field(b) = slot else { continue };
            if b.op != FieldOp::Value || b.field.index() >= self.system.fields.len() {
                continue;
            }
            let kept = inputs[s];
            inputs[s] = kept + STRAIN;
            interpret(&law.kernel, p.law.uniforms(), &inputs, &mut scratch, &mut out);
            inputs[s] = kept;
            let slope = (out[half.output] - base) / STRAIN;
            let key = (b.field.index(), b.side);
            match sides.iter_mut().find(|(k, _)| *k == key) {
                Some((_, total)) => *total = total.hypot(slope),
                None => sides.push((key, slope.abs())),
            }
        }
        sides.iter().map(|(_, s)| *s).max_by(f64::total_cmp).filter(|s| *s > 0.0)
    }
}

/// True if a law reads a gradient of a field of the scene there, on one side or on any.
fn is_stress(fields: &[Field], slot: &InputSlot, side: Option<Side>) -> bool {
    matches!(slot, InputSlot::Field(b)
        if b.op != FieldOp::Value && b.field.index() < fields.len() && side.is_none_or(|s| s == b.side))
}

/// Traction at the points of a facet and the weights of the points.
struct Stresses {
    values: Vec<Vec<f64>>,
    /// The gradients that the projections read.
    gradients: Vec<Vec<f64>>,
    weights: Vec<f64>,
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
