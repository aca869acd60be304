//! What the equations of single numbers are relative to, each for itself: what cancels in it.
//!
//! Of forces on nodes the largest is the scale of all (`System::scales`). A rate, a state variable, a global unknown has
//! an equation of its own: a sum that must vanish, whose summands may be 1e-30 in one equation and 1e30 in the next.

use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp},
};

use super::{Residual, System};
use crate::assemble::AssembledTerm;
use crate::field::FieldSpace;
use crate::finite::largest;

/// An equation is measured at least against this part of the largest of its field: where a part of a field is zero, one
/// solution leaves rounding of its neighbours there, and the next one rounding of that.
const LEAST: f64 = f64::EPSILON;

impl System {
    /// True if the equations of a field are those of single numbers: each of its terms tests values of a scalar or of a
    /// global unknown, and all of them say what cancels. A scalar needs a term that is not affine: affine equations are
    /// solved by one solution, whose rounding is relative to the largest.
    #[must_use]
    pub fn has_single_equations(&self, field: usize) -> bool {
        let f = &self.fields[field];
        let is_global = matches!(f.space, FieldSpace::Global);
        if f.kind != FieldKind::Unknown || self.range(field).is_none() || !(is_global || f.n_components == 1) {
            return false;
        }
        let mut changes = is_global;
        for term in &self.terms {
            let mut slots = term.law.tests.iter().filter(|slot| slot.field.index() == field).peekable();
            if slots.peek().is_none() {
                continue;
            }
            let is_affine = term.law.class < Class::Nonlinear;
            if !slots.all(|slot| slot.op == FieldOp::Value) || !is_affine && term.law.summands.is_none() {
                return false;
            }
            changes |= !is_affine;
        }
        changes
    }

    /// True if one term that is not affine is all that the equations of a field consist of, but for loads: what it gives at nodes
    /// is the residual itself where these are zero, and no measure of it.
    #[must_use]
    pub fn is_of_one_term(&self, field: usize) -> bool {
        let of_field = |t: &AssembledTerm| t.law.tests.iter().any(|slot| slot.field.index() == field);
        let tests = |t: &&AssembledTerm| t.law.class > Class::Constant && of_field(t);
        let mut terms = self.terms.iter().filter(tests);
        terms.next().is_some_and(|term| term.law.class >= Class::Nonlinear) && terms.next().is_none()
    }

    /// By dof, in the rows of this rank, what the residual `here` at `u` is relative to in fields with single equations: the
    /// sum of the magnitudes of what is summed. Of other fields what cancels in the smooth terms that are not linear, such as a friction of 30
    /// that a load of 30 balances: rounding of it is left. Empty without fields of the first kind, and then nothing is
    /// evaluated.
    #[must_use]
    pub fn summands(&self, u: &[f64], here: &Residual) -> Vec<f64> {
        let single: Vec<bool> = (0..self.fields.len()).map(|k| self.has_single_equations(k)).collect();
        if !single.contains(&true) {
            return Vec::new();
        }
        let mut out = vec![0.0; u.len()];
        let values = self.values(u);
        for term in self.terms.iter().filter(|t| t.law.class >= Class::Nonlinear) {
            let is_smooth = term.law.class == Class::Nonlinear;
            if is_smooth || term.law.tests.iter().any(|slot| single[slot.field.index()]) {
                term.add_own_summands(&self.mesh, values.view(), &mut out, self.share.as_deref());
            }
        }
        self.numbering.turn_sizes(&mut out);
        let ranges: Vec<_> = (0..single.len()).filter(|k| single[*k]).filter_map(|k| self.range(k)).collect();
        for d in ranges.iter().cloned().flatten() {
            out[d] += here.linear_sizes[d];
        }
        let mut most: Vec<f64> = ranges.iter().map(|range| largest(range.clone().map(|d| out[d]))).collect();
        self.team().max(&mut most);
        for (range, most) in ranges.into_iter().zip(most) {
            for d in range.filter(|d| self.owns(*d)) {
                out[d] = out[d].max(LEAST * most);
            }
        }
        out
    }
}
