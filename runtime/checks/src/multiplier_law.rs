//! How far the law of a multiplier holds at single points.
//!
//! An augmented Lagrangian asks `m + P(gamma g - m) = 0` of the multiplier m, the gap g and the projection P of the law
//! of contact. Where that holds point by point, g and m satisfy the conditions of contact whatever gamma is. It does
//! where the points are the nodes of m and the faces of a node have one normal. Elsewhere the equations hold on the
//! average over the faces of a node only, and what is left at the points depends on gamma, and with it the solution.
//!
//! Promises: a number without unit, 0 where the solution does not depend on gamma. Does not know of gamma: the size of
//! what is left is taken in parts of what the law asks of the same multipliers where nothing presses.

use std::sync::Arc;

use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp},
};

use super::Solved;
use wfl_discrete::assemble::{AssembledTerm, FieldValues};
use wfl_sparse::csr::Csr;

/// What a law asks is rounding below this part of what it asks of twice the multiplier: a value of a formula is known
/// to some hundred roundoffs.
const ROUNDING: f64 = 1e-10;

/// What is left of the law of a multiplier.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LawDefect {
    /// The multiplier.
    pub(super) multiplier: String,
    /// The integral of what is left at the points, in parts of that of the multiplier.
    pub(super) size: f64,
}

impl Solved<'_> {
    /// What is left at the points of the laws with kinks of each multiplier. Multipliers whose forces are below `least` of
    /// the forces of the bodies, or of what these are summed from, are left out: bodies that move without a load have forces
    /// that are rounding.
    pub(super) fn law_defects(&self, least: f64) -> Vec<LawDefect> {
        let multipliers =
            (0..self.system.fields.len()).filter(|k| self.system.fields[*k].kind == FieldKind::Multiplier);
        let unknown = |k: &usize| self.system.fields[*k].kind == FieldKind::Unknown;
        let bodies = (0..self.system.n_bodies()).filter(|body| unknown(&self.system.field_of_body(*body)));
        let forces = bodies.map(|body| self.residual.forces[body]);
        let ranges = (0..self.system.fields.len()).filter(unknown).filter_map(|k| self.system.range(k));
        let summed = ranges.flat_map(|range| &self.residual.linear_sizes[range]).copied();
        let beside = self.system.team().largest(forces.chain(summed).fold(0.0, f64::max));
        let presses = |k: &usize| self.force_of(*k).is_none_or(|force| force > least * beside);
        multipliers
            .filter(|k| self.system.range(*k).is_some() && presses(k))
            .filter_map(|k| self.law_defect(k))
            .collect()
    }

    /// The largest force of a multiplier at some node; `None` where it has none.
    fn force_of(&self, field: usize) -> Option<f64> {
        let slices = self.system.slices(self.u);
        let largest = self.system.team().largest(slices[field].iter().fold(0.0f64, |m, x| m.max(x.abs())));
        let unknown = |k: &usize| self.system.fields[*k].kind == FieldKind::Unknown;
        let fields: Vec<usize> =
            self.system.numbering.free_dofs.iter().map(|d| self.system.field_of(*d as usize)).collect();
        let mut acts = 0.0f64;
        for (row, _) in fields.iter().enumerate().filter(|(_, f)| unknown(f)) {
            // an operator without a matrix holds bodies alone
            let whole = |matrix: &&Csr| matrix.n_rows() == fields.len();
            for matrix in [self.system.bulk(), &self.tangent.changing].into_iter().filter(whole) {
                let (columns, values) = matrix.row(row);
                let own = columns.iter().zip(values).filter(|(c, _)| fields[**c as usize] == field);
                acts = own.fold(acts, |m, (_, value)| m.max(value.abs()));
            }
        }
        let acts = self.system.team().largest(acts);
        (acts > 0.0).then_some(acts * largest)
    }

    fn law_defect(&self, field: usize) -> Option<LawDefect> {
        let tests = |t: &AssembledTerm| t.law.tests.iter().filter(|s| s.field.index() == field).count();
        let terms: Vec<&AssembledTerm> = self.system.terms.iter().filter(|t| tests(t) > 0).collect();
        let domain = &terms.first()?.integrator.domain;
        let values_alone =
            |t: &AssembledTerm| t.law.tests.iter().all(|s| s.field.index() != field || s.op == FieldOp::Value);
        let is_a_law = terms.iter().any(|t| t.law.class == Class::Kinked)
            && terms.iter().all(|t| Arc::ptr_eq(domain, &t.integrator.domain) && values_alone(t));
        if !is_a_law {
            return None;
        }
        let slices = self.system.slices(self.u);
        let left = self.law_size(field, &terms, &slices);
        // nothing presses where nothing has moved and the multiplier pulls, whichever sign that is
        let zeros: Vec<Vec<f64>> = slices.iter().map(|s| vec![0.0; s.len()]).collect();
        let asked_of = |factor: f64| {
            let own: Vec<f64> = slices[field].iter().map(|m| factor * m).collect();
            let rest = |k: usize| if self.system.range(k).is_some() { zeros[k].as_slice() } else { slices[k] };
            let alone: Vec<&[f64]> = (0..slices.len()).map(|k| if k == field { &own } else { rest(k) }).collect();
            self.law_size(field, &terms, &alone)
        };
        let asked = asked_of(1.0).max(asked_of(-1.0));
        // within a bound that does not depend on the multiplier nothing is asked of it but rounding; twice goes beyond
        let beyond = 0.5 * asked_of(2.0).max(asked_of(-2.0));
        // nor of one below the smallest number with all digits: what an open face leaves
        (asked > ROUNDING * beyond && asked >= f64::MIN_POSITIVE)
            .then(|| LawDefect { multiplier: self.system.fields[field].name.clone(), size: left / asked })
    }

    /// The integral of the length of what tests the multiplier, of all terms together.
    fn law_size(&self, field: usize, terms: &[&AssembledTerm], current: &[&[f64]]) -> f64 {
        let n = self.system.fields[field].n_components;
        let previous = self.system.previous_slices();
        let values = FieldValues { current, previous: &previous, rates: self.system.rates() };
        let (mut sums, mut weights) = (Vec::new(), Vec::new());
        for (k, term) in terms.iter().enumerate() {
            let mut point = 0;
            term.for_each_flux(&self.system.mesh, values, |flux, weight| {
                if k == 0 {
                    sums.resize(sums.len() + n, 0.0);
                    weights.push(weight);
                }
                for (slot, f) in term.law.tests.iter().zip(flux).filter(|(s, _)| s.field.index() == field) {
                    sums[point * n + usize::from(slot.entry)] += f;
                }
                point += 1;
            });
        }
        let length = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.hypot(*x));
        let counted = terms.first().map_or_else(Vec::new, |t| t.integrator.domain.counted_points(&self.system.mesh));
        let points = sums.chunks_exact(n).zip(&weights).zip(counted).filter(|(_, counts)| *counts);
        self.system.team().total(points.map(|((sum, weight), _)| weight * length(sum)).sum())
    }
}
