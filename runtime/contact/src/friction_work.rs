//! The work of friction from one state to the next: what it takes from the motion, or gives back to it.
//!
//! At a point the forces of a term with a ball projection do the work f.J+ J du on the change du of the displacements of
//! both sides, J the slope of the argument of the ball in them: the part of the work that is done along the face. Friction
//! resists, so that this is not negative. A law on the total slip knows no way back: when loads go down, it drives the
//! slip it allowed back to nothing, and gives the energy back that it had taken.
//!
//! Counted are points that slide at the end, and those that slid before and are held now. Points that stick all the time
//! are elastic in a penalty method, and give back what they have stored. Does not judge.

use nalgebra::{DMatrix, DVector};
use wfl_compiler::{Projection, ProjectionKind, interpret_lanes, ir::LANES, types::InputSlot};

use super::{Contact, ContactTerm, slopes::is_displacement};
use wfl_discrete::assemble::{Bound, FieldValues, Workspace};
use wfl_discrete::system::System;

/// The factor on friction of the law as it is written.
const AS_WRITTEN: f64 = 1.0;

/// Energies of friction (force times length).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionWork {
    /// What friction took from the motion; negative where it gave.
    pub taken: f64,
    /// The same with every point counted as taking.
    pub size: f64,
    /// What the friction bound at these points takes over the largest displacement there: what rounding is relative to.
    pub bound: f64,
}

/// A point at one state.
pub(super) struct Point {
    /// What the law of the projections reads.
    pub(super) inputs: Vec<f64>,
    /// What it gives.
    pub(super) outputs: Vec<f64>,
}

/// The work of friction from the state `before` to `u`, of all terms; `None` for a scene without friction.
#[must_use]
pub fn friction_work(system: &System, contact: &Contact, before: &[f64], u: &[f64]) -> Option<FrictionWork> {
    let (now, then) = (system.values_with(u, contact.active_set()), system.values_with(before, contact.active_set()));
    let of = |term: &ContactTerm| term.friction_work(system, now.view(), then.view());
    let all: Vec<FrictionWork> = contact.terms().iter().filter_map(of).collect();
    let sum = |part: fn(&FrictionWork) -> f64| all.iter().map(part).sum();
    (!all.is_empty()).then(|| FrictionWork { taken: sum(|w| w.taken), size: sum(|w| w.size), bound: sum(|w| w.bound) })
}

impl ContactTerm {
    /// The work of friction from the state `before` to `now`; both have room for the branch data of this term. `None`
    /// for a term without friction.
    fn friction_work(&self, system: &System, now: FieldValues<'_>, before: FieldValues<'_>) -> Option<FrictionWork> {
        let is_friction = |p: &Projection| p.kind == ProjectionKind::Ball && p.acts;
        let (position, ball) = self.projections.iter().enumerate().find(|(_, p)| is_friction(p))?;
        if self.on_cells() {
            return None;
        }
        let (mesh, fields, term) = (&system.mesh, &system.fields, &system.terms[self.term]);
        let moves: Vec<(usize, usize)> = (self.law.law.inputs.iter().enumerate())
            .filter_map(|(s, slot)| match slot {
                InputSlot::Field(b) if is_displacement(fields, b) => {
                    Some((s, term.law.tests.iter().position(|t| t == b)?))
                }
                _ => None,
            })
            .collect();
        if moves.is_empty() {
            // the law of a multiplier, whose force stands in another term
            return None;
        }
        let (ends, starts) = (self.points_at(system, now), self.points_at(system, before));
        let slides = |point: &Point| {
            let (x, r) = (&point.outputs[ball.output..][..ball.n], point.outputs[ball.output + ball.n]);
            r > 0.0 && x.iter().fold(0.0f64, |m, x| m.hypot(*x)) > r
        };
        let (mut work, mut at, mut largest) = (FrictionWork::default(), 0, 0.0f64);
        // the derivatives of the argument: where their value is found, row and column
        let places: Vec<[usize; 3]> = (self.slopes.of_projection(position))
            .filter_map(|(at, s)| {
                let moved = |(input, _): &(usize, usize)| self.law.law.inputs[*input] == InputSlot::Field(s.slot);
                Some([at, s.entry, moves.iter().position(moved)?])
            })
            .collect();
        term.for_each_flux(mesh, now, |flux, weight| {
            let (Some(end), Some(start)) = (ends.get(at), starts.get(at)) else { return };
            at += 1;
            if !self.counts(at - 1) || !(slides(end) || slides(start)) {
                return;
            }
            let change =
                DVector::from_iterator(moves.len(), moves.iter().map(|(s, _)| end.inputs[*s] - start.inputs[*s]));
            let force = DVector::from_iterator(moves.len(), moves.iter().map(|(_, test)| flux[*test]));
            let mut slope = DMatrix::zeros(ball.n, moves.len());
            let slopes = self.slopes.at_point(&end.inputs);
            places.iter().for_each(|[at, row, column]| slope[(*row, *column)] = slopes[*at]);
            largest = moves.iter().fold(largest, |m, (s, _)| m.max(end.inputs[*s].abs()));
            if slope.iter().any(|x| !x.is_finite()) {
                return;
            }
            let Ok(inverse) = slope.clone().pseudo_inverse(1e-9 * slope.amax()) else { return };
            let along = &inverse * (&slope * &change);
            let own = &inverse * (&slope * &force);
            work.taken += weight * own.dot(&along);
            work.size += weight * own.norm() * along.norm();
            work.bound += weight * end.outputs[ball.output + ball.n].max(start.outputs[ball.output + ball.n]).max(0.0);
        });
        let mut sums = [work.taken, work.size, work.bound];
        system.team().sum(&mut sums);
        let [taken, size, bound] = sums;
        Some(FrictionWork { taken, size, bound: bound * system.team().largest(largest) })
    }

    /// What the law reads and gives at every point, in the order of groups, entities and points.
    pub(super) fn points_at(&self, system: &System, values: FieldValues<'_>) -> Vec<Point> {
        let data = self.as_written(system, values, AS_WRITTEN);
        let mut current: Vec<&[f64]> = values.current.to_vec();
        current[self.field] = &data;
        let values = FieldValues { current: &current, ..values };
        let law = &self.law.law;
        let (n_in, n_out) = (law.inputs.len(), law.kernel.kernel().outputs.len());
        let bound = Bound { mesh: &system.mesh, domain: &self.sampled.domain, binding: &self.sampled.binding };
        let (mut workspace, mut scratch, mut all) = (Workspace::default(), Vec::new(), Vec::new());
        for (g, group) in self.sampled.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(bound, g, batch, values);
                let inputs = workspace.inputs.as_chunks::<LANES>().0;
                let mut outputs = vec![[0.0; LANES]; group.n_points() * n_out];
                for q in 0..group.n_points() {
                    let out = &mut outputs[q * n_out..][..n_out];
                    interpret_lanes(&law.kernel, self.law.uniforms(), &inputs[q * n_in..], &mut scratch, out);
                }
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    let own = |all: &[[f64; LANES]]| all.iter().map(|values| values[lane]).collect();
                    all.extend((0..group.n_points()).map(|q| Point {
                        inputs: own(&inputs[q * n_in..][..n_in]),
                        outputs: own(&outputs[q * n_out..][..n_out]),
                    }));
                }
            }
        }
        all
    }
}
