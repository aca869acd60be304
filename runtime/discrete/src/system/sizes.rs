//! What residuals are relative to, and what rounding leaves of them.

use wfl_compiler::types::{FieldKind, Side};

use super::{LinearTerms, Residual, System, Tangent};
use crate::{assemble::AssembledTerm, field::Field, finite::largest};

/// Where unknowns are below this part of the extent of the mesh, what cancels inside the laws of bodies is asked for: above,
/// it takes no more than three digits of sixteen.
const SMALL: f64 = 1e-3;

impl System {
    /// By dof of a vector of the space its length at the node, which does not depend on the axes; of other fields the number.
    #[must_use]
    pub fn lengths(&self, u: &[f64]) -> Vec<f64> {
        let mut out = u.to_vec();
        let dim = self.mesh.dim();
        let vectors = (0..self.fields.len()).filter(|k| dim > 1 && self.fields[*k].n_components == dim);
        for range in vectors.filter_map(|k| self.range(k)) {
            for node in out[range].chunks_exact_mut(dim) {
                let length = node.iter().fold(0.0f64, |m, x| m.hypot(*x));
                node.fill(length);
            }
        }
        out
    }

    /// By body: what relative residuals are relative to. For unknowns the largest nodal force of loads, linear or
    /// nonlinear terms, of all bodies that meet on an interface (one that nothing touches has no force of its own);
    /// for multipliers, whose equations balance inside one term, the size of what cancels: of [`Self::sizes`].
    #[must_use]
    pub fn scales(&self, here: &Residual, sizes: &[f64]) -> Vec<f64> {
        let mut sizes = self.largest_by_body(sizes);
        self.team().max(&mut sizes);
        let forces = self.among_alike(&here.forces);
        let is_multiplier = |b: usize| self.fields[self.field_of_body(b)].kind == FieldKind::Multiplier;
        (0..sizes.len()).map(|b| if is_multiplier(b) { sizes[b] } else { forces[b] }).collect()
    }

    /// By body, for multipliers beside forces of these sizes: the value whose force at nodes is as large as the largest
    /// force, and what that value is in the equations of the multiplier. Zero for other bodies, and where no force acts.
    /// A traction that a law makes zero has nothing else to be measured against: what it is made of is zero with it.
    #[must_use]
    pub fn multipliers_beside(&self, forces: &[f64], tangent: &Tangent) -> Vec<[f64; 2]> {
        let mut out = vec![[0.0; 2]; self.n_bodies()];
        let kind = |body: usize| self.fields[self.field_of_body(body)].kind;
        for (field, own) in (0..self.fields.len()).filter_map(|k| Some((k, self.range(k)?))) {
            if self.fields[field].kind != FieldKind::Multiplier {
                continue;
            }
            // bodies of one field that nothing connects have rows of their own: one product serves all
            let mut ones = vec![0.0; self.numbering.n_dofs];
            ones[own].fill(1.0);
            let (mut part, mut sums) = (ones.clone(), ones.clone());
            if !self.multiply_linear(&ones, None, [&mut part, &mut sums, &mut []]) {
                sums.fill(0.0);
            }
            let changing = self.row_sums(tangent, |dof| ones[dof as usize]);
            sums.iter_mut().zip(changing).for_each(|(sum, changing)| *sum += changing);
            let mut rows = self.largest_by_body(&sums);
            self.team().max(&mut rows);
            let acts_on = |k: usize| kind(k) == FieldKind::Unknown && rows[k] > 0.0;
            let values: Vec<f64> =
                (0..rows.len()).map(|k| if acts_on(k) { forces[k] / rows[k] } else { 0.0 }).collect();
            let beside = self.largest_beside(&values, acts_on);
            let bodies = out.iter_mut().enumerate().filter(|(body, _)| self.field_of_body(*body) == field);
            bodies.for_each(|(body, found)| *found = [beside[body], beside[body] * rows[body]]);
        }
        out
    }

    /// By body, for multipliers: the largest of what their equations are made of where all unknowns have the size of the
    /// largest at `u` of their kind. Zero for other bodies. Unknowns are rounded as a whole: a condition `u = 0` holds as far as
    /// that allows, however small the unknowns are that it is about.
    #[must_use]
    pub fn conditions_beside(&self, u: &[f64], tangent: &Tangent) -> Vec<f64> {
        let largest = self.largest_of_alike(u);
        let mut all = vec![0.0; self.numbering.n_dofs];
        for body in self.unknown_bodies() {
            self.dofs_of_body(body).for_each(|dof| all[dof] = largest[body]);
        }
        let (mut part, mut sums) = (all.clone(), all.clone());
        if !self.multiply_linear(&all, None, [&mut part, &mut sums, &mut []]) {
            sums.fill(0.0);
        }
        let rows = self.row_sums(tangent, |dof| all[dof as usize]);
        sums.iter_mut().zip(rows).for_each(|(sum, row)| *sum += row);
        let mut rows = self.largest_by_body(&sums);
        self.team().max(&mut rows);
        let is_multiplier = |body: usize| self.fields[self.field_of_body(body)].kind == FieldKind::Multiplier;
        (0..rows.len()).map(|body| if is_multiplier(body) { rows[body] } else { 0.0 }).collect()
    }

    /// By body whether loads act on its free dofs, or on those of one whose forces it meets: forces that depend neither on the
    /// unknowns nor on the past.
    #[must_use]
    pub fn loaded(&self) -> Vec<bool> {
        let own: Vec<f64> = self.loaded.iter().map(|acts| f64::from(u8::from(*acts))).collect();
        let acts = self.among_alike(&own);
        let is_unknown = |body: usize| self.fields[self.field_of_body(body)].kind == FieldKind::Unknown;
        (0..self.n_bodies()).map(|body| is_unknown(body) && acts.get(body).is_some_and(|acts| *acts > 0.0)).collect()
    }

    /// By body whether forces by dof act on its free dofs, on any rank.
    pub(super) fn loaded_by(&self, forces: &[f64]) -> Vec<bool> {
        let mut largest = self.largest_of_free_by_body(forces);
        self.team().max(&mut largest);
        largest.into_iter().map(|force| force != 0.0).collect()
    }

    /// By dof, in the rows of this rank: |K| |u| of linear and changing terms, what rounding errors of the residual `here`
    /// at `u` are relative to.
    #[must_use]
    pub fn sizes(&self, u: &[f64], here: &Residual, tangent: &Tangent) -> Vec<f64> {
        let mut out = here.linear_sizes.clone();
        if self.is_linear() {
            return out;
        }
        if let Some(applied) = &tangent.applied {
            let mut sizes = vec![0.0; u.len()];
            self.add_sizes_of_tangent(applied, u, &mut sizes);
            self.numbering.turn_sizes(&mut sizes);
            self.numbering.free_dofs.iter().for_each(|dof| out[*dof as usize] += sizes[*dof as usize]);
            return out;
        }
        let mut sizes: Vec<f64> = u.iter().map(|x| x.abs()).collect();
        self.numbering.frames.turn_sizes(&mut sizes);
        for row in 0..self.numbering.n_free() {
            let (columns, values) = tangent.changing.row(row);
            let at = |c: u32| sizes[self.numbering.free_dofs[c as usize] as usize];
            let size: f64 = columns.iter().zip(values).map(|(c, v)| v.abs() * at(*c)).sum();
            out[self.numbering.free_dofs[row] as usize] += size;
        }
        out
    }

    /// By dof, in the rows of this rank: what rounding leaves of a residual. Where linear terms are evaluated at their
    /// points only the others count: what rounds there moves nothing.
    #[must_use]
    pub fn rounding(&self, u: &[f64], here: &Residual, tangent: &Tangent) -> Vec<f64> {
        let mut sizes = self.sizes(u, here, tangent);
        if here.linear == LinearTerms::AtPoints {
            sizes.iter_mut().zip(&here.linear_sizes).for_each(|(s, linear)| *s -= linear);
        }
        sizes.iter_mut().for_each(|s| *s = f64::EPSILON * s.max(0.0));
        // of a small strain beside 1 the rounding is that of 1
        let is_small = |u: &[f64]| self.team().largest(largest(u.iter().copied())) < SMALL * self.extent();
        if self.has_nonlinear_bodies() && is_small(u) {
            let inside = self.cancelled(u, here).into_iter().zip(&here.linear_sizes).map(|(all, linear)| all - linear);
            sizes.iter_mut().zip(inside).for_each(|(s, inside)| *s += f64::EPSILON * inside);
        }
        let positions = self.sizes_of_positions(tangent);
        sizes.iter_mut().zip(positions).for_each(|(s, size)| *s += f64::EPSILON * size);
        sizes
    }
}

/// By field: the first of the fields whose test functions stand on opposite sides of one interface term, with equal
/// shapes: displacements of bodies that push each other, whose forces have one unit and one size.
pub(super) fn meeting_fields(fields: &[Field], terms: &[AssembledTerm]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..fields.len()).collect();
    for tests in terms.iter().map(|t| &t.law.tests) {
        let side = |side: Side| tests.iter().filter(move |t| t.side == side).map(|t| t.field.index());
        for here in side(Side::Here) {
            for there in side(Side::There) {
                let alike = fields[here].n_components == fields[there].n_components;
                let (low, high) = (group[here].min(group[there]), group[here].max(group[there]));
                let unknowns = [here, there].iter().all(|f| fields[*f].kind == FieldKind::Unknown);
                if alike && unknowns && low < high {
                    group.iter_mut().filter(|g| **g == high).for_each(|g| *g = low);
                }
            }
        }
    }
    group
}
