//! What a second look at contact needs, where the first one finds a condition broken.
//!
//! The first look takes every half-line for contact, what an argument is without gradients for a gap, and the force of the
//! term for that of the law. None of that need be:
//!
//! - An argument may grow as the sides part (cohesion), which says the derivative along the normal.
//! - Bodies under initial stress have a traction without gradients, in their terms or in that of the law. A constant in
//!   an argument up to its size is no gap, and a constant force of the term is none of the law: what its open form gives.
//! - Where the derivatives of an argument in the displacements follow the gradients, the law has a normal of its own that
//!   turns with the body: without gradients it is another law, and says nothing of gap and traction.
//!
//! Promises: numbers at the points of the term, in their order. Does not judge.

use std::sync::Arc;

use wfl_compiler::{
    Projection, ProjectionKind, interpret_lanes,
    types::{BasisSlot, FieldKind, FieldOp, InputSlot, Side},
};

use super::{
    ContactTerm,
    slopes::{is_displacement, is_traction},
};
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    system::System,
};

/// Where what gradients change in the derivatives of an argument changes the gap in it by more than this part of the
/// argument, the normal of the law has turned: a tenth is six degrees, more than the normals of small strains turn by.
const TURNED: f64 = 0.1;
/// A derivative along the normal below this part of the largest is none: far above roundoff, and far below what a law
/// that closes along its normal has.
const ALONG: f64 = 1e-6;

/// See the module.
pub(super) struct Careful {
    /// By projection: its argument grows as the sides approach each other.
    pub(super) closes: Vec<bool>,
    /// By point and test slot of the term: the force without its projections; empty where there is none.
    pub(super) open: Vec<Vec<f64>>,
    /// By point: the outputs of the law where nothing has moved.
    pub(super) rest: Vec<Vec<f64>>,
    /// By point: the normal of the law follows the bodies.
    pub(super) turns: Vec<bool>,
    /// The largest traction where nothing has moved (stress).
    pub(super) initial: f64,
}

impl Careful {
    /// The part of an argument `gap` without gradients that is no initial traction: of entries `x` at rest, at most the
    /// initial traction is taken away, and of a half-line nothing that would widen an overlap.
    pub(super) fn without_traction(&self, gap: &[f64], x: &[f64], kind: ProjectionKind) -> Vec<f64> {
        let size = x.iter().fold(0.0f64, |m, x| m.hypot(*x));
        if size == 0.0 || self.initial == 0.0 || kind == ProjectionKind::HalfLine && x[0] < 0.0 {
            return gap.to_vec();
        }
        let part = (self.initial / size).min(1.0);
        gap.iter().zip(x).map(|(g, x)| g - part * x).collect()
    }
}

/// What is a gap of the outputs of a law without gradients, for the argument of a projection at a point.
pub(super) fn gap_of(careful: Option<&Careful>, point: usize, outputs: &[f64], p: &Projection) -> Vec<f64> {
    let own = |outputs: &[f64]| outputs[p.output..][..p.n].to_vec();
    let gap = own(outputs);
    careful.map_or_else(|| gap.clone(), |careful| careful.without_traction(&gap, &own(&careful.rest[point]), p.kind))
}

impl ContactTerm {
    /// Looks at the law; `values` has the branches of the law as written, `rest` is where nothing has moved.
    pub(super) fn look(&self, system: &System, values: FieldValues<'_>, rest: FieldValues<'_>) -> Careful {
        let law = &self.law.law;
        let moves = |slot: &InputSlot| match slot {
            InputSlot::Field(b) | InputSlot::Previous(b) => {
                is_traction(&system.fields, &InputSlot::Field(*b)) || is_displacement(&system.fields, b)
            }
            _ => false,
        };
        let tractions: Vec<bool> = law.inputs.iter().map(|s| is_traction(&system.fields, s)).collect();
        let moved: Vec<bool> = law.inputs.iter().map(moves).collect();
        let without = |inputs: &[f64], left_out: &[bool]| -> Vec<f64> {
            inputs.iter().zip(left_out).map(|(x, out)| if *out { 0.0 } else { *x }).collect()
        };
        // slip that a state keeps is none at rest
        let is_kept = |slot: &InputSlot| match slot {
            InputSlot::Field(b) | InputSlot::Previous(b) => {
                system.fields.get(b.field.index()).is_some_and(|f| f.kind == FieldKind::State)
            }
            _ => false,
        };
        let kept: Vec<bool> = law.inputs.iter().map(is_kept).collect();
        let normals = self.normals(system);
        let n_out = law.kernel.kernel().outputs.len();
        let mut scratch = Vec::new();
        let mut outputs = |inputs: &[f64]| -> Vec<f64> {
            let mut out = vec![[0.0; 1]; n_out];
            interpret_lanes(&law.kernel, self.law.uniforms(), inputs.as_chunks::<1>().0, &mut scratch, &mut out);
            out.iter().map(|x| x[0]).collect()
        };
        let mut along = vec![0.0f64; self.projections.len()];
        let (mut at_rest, mut turns) = (Vec::new(), Vec::new());
        for (point, normal) in self.points_at(system, values).iter().zip(&normals) {
            let still = without(&point.inputs, &moved);
            let unslipped = outputs(&without(&still, &kept));
            // a law may be none where its state is zero
            at_rest.push(if unslipped.iter().all(|x| x.is_finite()) { unslipped } else { outputs(&still) });
            let slopes = self.slopes.at_point(&without(&point.inputs, &tractions));
            let now = self.slopes.at_point(&point.inputs);
            let largest = |numbers: &mut dyn Iterator<Item = f64>| numbers.fold(0.0f64, |m, x| m.max(x.abs()));
            let change = largest(&mut slopes.iter().zip(&now).map(|(a, b)| a - b));
            let values = point.inputs.iter().zip(&moved).zip(&tractions);
            let displaced = largest(&mut values.filter(|((_, moved), t)| **moved && !**t).map(|((x, _), _)| *x));
            let argument = |p: &Projection| largest(&mut point.outputs[p.output..][..p.n].iter().copied());
            let arguments = largest(&mut self.projections.iter().map(argument));
            turns.push(change * displaced > TURNED * arguments);
            for (projection, along) in along.iter_mut().enumerate() {
                *along += self.approach(system, projection, &slopes, normal);
            }
        }
        let mut open = Vec::new();
        if self.acts_when_open {
            self.open_fluxes(system, values, |flux| open.push(flux));
        }
        // every rank adds its points
        system.team().sum(&mut along);
        let closes = along.iter().map(|along| *along >= 0.0).collect();
        Careful { closes, open, rest: at_rest, turns, initial: self.initial_traction(system, rest) }
    }

    /// 1 where an argument grows as the sides approach each other along the normal out of the near side, -1 where it
    /// falls, 0 where it does neither or the field is no vector of the space.
    fn approach(&self, system: &System, projection: usize, slopes: &[f64], normal: &[f64; 3]) -> f64 {
        let dim = system.mesh.dim();
        let (mut along, mut size) = (0.0f64, 0.0f64);
        for (at, slope) in self.slopes.of_projection(projection) {
            let BasisSlot { field, side, entry, .. } = slope.slot;
            let is_vector = system.fields.get(field.index()).is_some_and(|f| f.n_components == dim);
            if is_vector && is_displacement(&system.fields, &slope.slot) {
                let sign = if side == Side::Here { 1.0 } else { -1.0 };
                along += sign * slopes[at] * normal[usize::from(entry)];
                size = size.max(slopes[at].abs());
            }
        }
        if along.abs() > ALONG * size { along.signum() } else { 0.0 }
    }

    /// The normals out of the near side at the points.
    pub(super) fn normals(&self, system: &System) -> Vec<[f64; 3]> {
        let groups = &self.sampled.domain.groups;
        let of = |g: usize| {
            let group = &groups[g];
            (0..group.entities.len()).flat_map(move |k| (0..group.n_points()).map(move |q| (k, q)))
        };
        let all = (0..groups.len()).flat_map(|g| of(g).map(move |(k, q)| (g, k, q)));
        all.map(|(g, k, q)| groups[g].unit_normal(&system.mesh, k, q)).collect()
    }

    /// The forces of the term by its test slots with no projection acting.
    pub(super) fn open_fluxes(&self, system: &System, values: FieldValues<'_>, mut f: impl FnMut(Vec<f64>)) {
        let data = self.open();
        let mut current: Vec<&[f64]> = values.current.to_vec();
        data.stand_in(self.field, &mut current);
        let form = self.form(system);
        let tests = &system.terms[self.term].law.tests;
        let places: Vec<Option<usize>> =
            tests.iter().map(|test| form.law.tests.iter().position(|t| t == test)).collect();
        form.for_each_flux(&system.mesh, FieldValues { current: &current, ..values }, |flux, _| {
            f(places.iter().map(|at| at.map_or(0.0, |at| flux[at])).collect());
        });
    }

    /// The largest stress of the bodies, or force on the faces of the term, where nothing has moved.
    fn initial_traction(&self, system: &System, rest: FieldValues<'_>) -> f64 {
        let (dim, mut largest) = (system.mesh.dim(), 0.0f64);
        let is_displacement = |slot: &BasisSlot| {
            let field = system.fields.get(slot.field.index());
            field.is_some_and(|f| f.kind == FieldKind::Unknown && f.n_components == dim)
        };
        let mut add = |slots: &[BasisSlot], op: FieldOp, flux: &[f64]| {
            let own = slots.iter().zip(flux).filter(|(slot, _)| slot.op == op && is_displacement(slot));
            largest = own.fold(largest, |m, (_, x)| m.max(x.abs()));
        };
        let is_here = |t: &&AssembledTerm| Arc::ptr_eq(&t.integrator.domain, &self.sampled.domain);
        for term in system.terms.iter().filter(|t| t.on_cells()) {
            term.for_each_flux(&system.mesh, rest, |flux, _| add(&term.law.tests, FieldOp::Grad, flux));
        }
        let own = &system.terms[self.term];
        for term in system.terms.iter().filter(is_here).filter(|t| !std::ptr::eq(*t, own)) {
            if term.law.kinks.is_empty() {
                term.for_each_flux(&system.mesh, rest, |flux, _| add(&term.law.tests, FieldOp::Value, flux));
            }
        }
        if self.acts_when_open {
            self.open_fluxes(system, rest, |flux| add(&own.law.tests, FieldOp::Value, &flux));
        }
        system.team().largest(largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn careful(initial: f64) -> Careful {
        Careful { closes: Vec::new(), open: Vec::new(), rest: vec![vec![3.0, -4.0]], turns: Vec::new(), initial }
    }

    #[test]
    fn a_constant_up_to_the_initial_traction_is_no_gap() {
        let found = careful(5.0).without_traction(&[3.5, -4.0], &[3.0, -4.0], ProjectionKind::Ball);
        assert_eq!(found, [0.5, 0.0], "all of the constant has the size of the traction");
        let found = careful(2.5).without_traction(&[3.5, -4.0], &[3.0, -4.0], ProjectionKind::Ball);
        assert_eq!(found, [2.0, -2.0], "half of it");
    }

    #[test]
    fn without_an_initial_traction_a_constant_is_a_gap() {
        assert_eq!(careful(0.0).without_traction(&[3.5], &[3.0], ProjectionKind::HalfLine), [3.5]);
    }

    #[test]
    fn an_open_gap_at_rest_is_not_made_an_overlap() {
        assert_eq!(careful(9.0).without_traction(&[0.5], &[-3.0], ProjectionKind::HalfLine), [0.5]);
        assert_eq!(careful(9.0).without_traction(&[3.5], &[3.0], ProjectionKind::HalfLine), [0.5]);
    }

    #[test]
    fn a_quick_look_takes_the_whole_argument_for_a_gap() {
        let branch = wfl_compiler::BranchLayout::new(ProjectionKind::Ball, 2, wfl_compiler::BranchSizes::default());
        let p = Projection { kind: ProjectionKind::Ball, n: 2, branch, output: 0, acts: true };
        assert_eq!(gap_of(None, 0, &[3.5, -4.0, 9.0], &p), [3.5, -4.0]);
        assert_eq!(gap_of(Some(&careful(5.0)), 0, &[3.5, -4.0, 9.0], &p), [0.5, 0.0]);
    }
}
