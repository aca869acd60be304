//! Joints: interfaces whose own law is elastic.
//!
//! Two laws may be written with the same words: one of contact, whose stiffness is a penalty and should leave no overlap and
//! no slip of points that stick, and one of a joint, whose stiffness is a property of a layer that is thin and not there
//! (Goodman, Taylor and Brekke 1968). What tells them apart is tension. Contact does not pull. A joint resists being drawn
//! apart with a force that grows with the opening, as it does being closed; so its overlap and its slip are strains.
//!
//! Promises: asks the forces of all terms on the same faces, at single points, what they do where nothing has moved but the
//! sides, along their normal, by lengths of many sizes, up to that of the largest displacement: a joint may break. A
//! constant force is none that grows, and what an initial stress of the bodies gives up is no tension. A joint that does not
//! resist tension is not told from a penalty. An adhesion pulls the less the further it opens; that it resists being closed
//! tells it from a contact whose sign is wrong.

use std::sync::Arc;

use wfl_compiler::types::{BasisSlot, FieldKind, FieldOp, InputSlot, Side};
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    system::System,
};

use super::{ContactTerm, slopes::is_traction};

/// Openings that are tried, in parts of the largest displacement: what holds may be far softer or far stiffer than the bodies.
const OPENINGS: [f64; 6] = [1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0];
/// Twice an opening adds at least this part of the force that the opening has added: a joint pulls the more the further it opens.
const GROWS: f64 = 0.5;
/// A tension counts beyond this multiple of the initial traction: a tension as large as that may be what is left of it.
const INITIAL: f64 = 2.0;

impl ContactTerm {
    /// By point: whether the law is that of an elastic joint, of the points that are `asked`; `scales` are the largest
    /// displacement and the largest traction where nothing has moved.
    pub(super) fn elastic_joint(
        &self,
        system: &System,
        values: FieldValues<'_>,
        asked: &[bool],
        scales: [f64; 2],
    ) -> Vec<bool> {
        let [moved, initial] = scales;
        let places: Vec<usize> = (0..asked.len()).filter(|k| asked[*k]).collect();
        let mut holds = vec![false; asked.len()];
        if places.is_empty() {
            return holds;
        }
        let normals = self.normals(system);
        let pulls = |opening: f64| self.pulls(system, values, asked, &normals, opening);
        let closed = pulls(0.0);
        for part in OPENINGS {
            let (once, twice) = (pulls(part * moved), pulls(2.0 * part * moved));
            for (k, place) in places.iter().enumerate() {
                let grown = once[k] - closed[k];
                let resists = grown > 0.0 && twice[k] - once[k] >= GROWS * grown;
                holds[*place] |= resists && once[k] > INITIAL * initial;
            }
        }
        holds
    }

    /// By point: whether the law resists being closed with a force that grows, by lengths up to the largest displacement `moved`:
    /// its sign is right there, and where it pulls it is meant to.
    pub(super) fn resists_closing(
        &self,
        system: &System,
        values: FieldValues<'_>,
        n_points: usize,
        moved: f64,
    ) -> Vec<bool> {
        let (asked, normals) = (vec![true; n_points], self.normals(system));
        let pulls = |closing: f64| self.pulls(system, values, &asked, &normals, -closing);
        let open = pulls(0.0);
        let mut resists = vec![false; n_points];
        for part in OPENINGS {
            let (once, twice) = (pulls(part * moved), pulls(2.0 * part * moved));
            for (k, resists) in resists.iter_mut().enumerate() {
                let grown = open[k] - once[k];
                *resists |= grown > 0.0 && once[k] - twice[k] >= GROWS * grown;
            }
        }
        resists
    }

    /// The tension at the points that are `asked` where the sides are apart by `opening` and nothing else has moved.
    fn pulls(
        &self,
        system: &System,
        values: FieldValues<'_>,
        asked: &[bool],
        normals: &[[f64; 3]],
        opening: f64,
    ) -> Vec<f64> {
        let dim = system.mesh.dim();
        let is_vector = |slot: &BasisSlot| {
            let field = system.fields.get(slot.field.index());
            field.is_some_and(|f| f.kind == FieldKind::Unknown && f.n_components == dim)
        };
        // the near side moves against the normal, the far side along it
        let along = |point: usize, slot: &BasisSlot| {
            let normal = normals[point][usize::from(slot.entry)];
            if slot.side == Side::Here { -normal } else { normal }
        };
        let replace = |point: usize, slot: &InputSlot, value: f64| match slot {
            InputSlot::Field(b) if b.op == FieldOp::Value && is_vector(b) => 0.5 * opening * along(point, b),
            InputSlot::Field(_) if is_traction(&system.fields, slot) => 0.0,
            InputSlot::Previous(b) if is_vector(b) => 0.0,
            _ => value,
        };
        let places: Vec<usize> = (0..asked.len()).filter(|k| asked[*k]).collect();
        let mut sums = vec![0.0; places.len()];
        let own = &system.terms[self.term];
        let is_here = |t: &&AssembledTerm| {
            std::ptr::eq(*t, own) || Arc::ptr_eq(&t.integrator.domain, &self.sampled.domain) && !t.on_cells()
        };
        for term in system.terms.iter().filter(is_here) {
            let fluxes = term.fluxes_with(&system.mesh, values, |point| asked[point], replace);
            for ((sum, point), flux) in sums.iter_mut().zip(&places).zip(fluxes) {
                let tests = term.law.tests.iter().zip(flux);
                let values = tests.filter(|(slot, _)| slot.op == FieldOp::Value && is_vector(slot));
                // the work on an opening, of both sides: half of it on each
                *sum += values.map(|(slot, force)| 0.5 * force * along(*point, slot)).sum::<f64>();
            }
        }
        sums
    }
}
