//! The work of friction on what slides in a step: forces and bounds at both of its ends.

use nalgebra::DVector;
use wfl_compiler::{
    Projection, ProjectionKind,
    types::{BasisSlot, FieldKind, InputSlot},
};

use super::{Begun, FrictionWork, Pass, beyond, is_displacement, norm};
use crate::{
    at_points::Motions,
    regularisation::AS_WRITTEN,
    slipping::{End, Slipping},
};
use wfl_discrete::assemble::FieldValues;

/// A force whose work is below this part of its size times the way is across the way: the way is the inverse of slopes, known
/// to some hundred roundoffs.
const ACROSS: f64 = 1e-13;

/// What a point slides against.
#[derive(Clone, Copy, Debug, Default)]
struct Slide {
    /// The work of the force at the end of the step on what slid.
    power: f64,
    /// How far that is, in displacements.
    way: f64,
    /// The force along it.
    resists: f64,
}

impl Pass<'_> {
    /// What the law is where nothing has moved, as [`FrictionMemory::rest`] has it: what a first step starts from. The bound
    /// is at most that at the end: sides that overlap at first are pressed by no load.
    pub(super) fn unmoved(&self) -> Vec<f64> {
        let zeros: Vec<Vec<f64>> = self.values.current.iter().map(|values| vec![0.0; values.len()]).collect();
        let moves = |field: usize| {
            let kind = self.system.fields.get(field).map(|f| f.kind);
            matches!(kind, Some(FieldKind::Unknown | FieldKind::Multiplier))
        };
        let unmoved = |values: &[&'_ [f64]]| -> Vec<Vec<f64>> {
            let of =
                |(field, values): (usize, &&[f64])| if moves(field) { zeros[field].clone() } else { values.to_vec() };
            values.iter().enumerate().map(of).collect()
        };
        let [current, previous] = [self.values.current, self.values.previous].map(unmoved);
        let current: Vec<&[f64]> = current.iter().map(Vec::as_slice).collect();
        let previous: Vec<&[f64]> = previous.iter().map(Vec::as_slice).collect();
        let values = FieldValues { current: &current, previous: &previous, ..self.values };
        let data = self.term.as_written_near(self.system, values, AS_WRITTEN);
        let points = self.term.points_on(self.system, values, &data, self.term.law.uniforms());
        let mut all = Vec::new();
        for (k, point) in points.iter().enumerate() {
            let radius = point.outputs[self.ball.output + self.ball.n].min(self.radius(k)).max(0.0);
            let argument = self.argument(&point.outputs);
            let is_known = radius.is_finite() && argument.iter().all(|x| x.is_finite());
            let kept = inside(argument, radius);
            all.extend(kept.iter().map(|x| if is_known { *x } else { 0.0 }));
            all.extend([if is_known { radius } else { 0.0 }, 0.0, 0.0, 0.0]);
        }
        all
    }

    /// Adds what the law is at rest at a point to what the next step begins with; `start` is what this one began with.
    fn keep_rest(&self, k: usize, resists: f64, start: &[f64], all: &mut Vec<f64>) {
        let points = self.rest.as_ref().map_or(&self.points, |rest| &rest.points);
        let pressing = self.pressing(k);
        let before = self.begun(start, k).map_or(0.0, |begun| begun.pressing);
        // sides that have met or parted go on at another rate
        let goes_on = before * pressing > 0.0 && self.term.window.increment > 0.0;
        let rate = if goes_on { (pressing - before) / self.term.window.increment } else { 0.0 };
        all.extend(self.argument(&points[k].outputs));
        all.extend([self.radius(k), resists, pressing, rate]);
    }

    /// The argument of the pressure at a point; zero for a term that has none, or several.
    fn pressing(&self, k: usize) -> f64 {
        let is_gap = |p: &&Projection| p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts;
        let mut gaps = self.term.projections.iter().filter(is_gap);
        match (gaps.next(), gaps.next()) {
            (Some(gap), None) => self.points[k].outputs[gap.output],
            _ => 0.0,
        }
    }

    /// The work of the force on what slid since `start`, and what the law is at rest now, both as [`FrictionMemory::rest`]
    /// has it.
    pub(super) fn work(&self, slips: &[Vec<f64>], start: &[f64]) -> (FrictionWork, Vec<f64>) {
        let (mut work, mut largest, mut at) = (FrictionWork::default(), 0.0f64, 0);
        let mut all = Vec::with_capacity(start.len());
        let term = &self.system.terms[self.term.term];
        // of a fault under initial stress the force of the law is more than that of the term
        let mut open = Vec::new();
        if self.term.acts_when_open && !self.force_is_a_multiplier() {
            self.term.open_fluxes(self.system, self.values, |flux| open.push(flux));
        }
        term.for_each_flux(&self.system.mesh, self.values, |flux, weight| {
            let k = at;
            at += 1;
            let (Some(point), Some(slid)) = (self.points.get(k), slips.get(k)) else { return };
            let Some(motions) = self.motions(point) else { return self.keep_rest(k, 0.0, start, &mut all) };
            let force = self.force_on(&motions, flux, open.get(k));
            let is_slipping = slid.iter().any(|x| *x != 0.0);
            let held = if is_slipping { None } else { self.resists(&motions, k, &force) };
            let slide = if is_slipping { self.slide(&motions, k, slid, &force) } else { Slide::default() };
            self.keep_rest(k, held.unwrap_or(slide.resists), start, &mut all);
            if !self.term.counts(k) || !is_slipping {
                return;
            }
            let power = self.begun(start, k).map_or(slide.power, |begun| self.mean_power(&slide, begun, k));
            if !power.is_finite() || power == 0.0 {
                return;
            }
            largest = motions.inputs.iter().fold(largest, |m, s| m.max(point.inputs[*s].abs()));
            work.taken += weight * power;
            work.size += weight * power.abs();
            work.bound += weight * self.radius(k).max(0.0);
        });
        let mut sums = [work.taken, work.size, work.bound];
        self.system.team().sum(&mut sums);
        let [taken, size, bound] = sums;
        (FrictionWork { taken, size, bound: bound * self.system.team().largest(largest) }, all)
    }

    /// The force of the term on each displacement that moves the argument, without what acts where the law is open.
    fn force_on(&self, motions: &Motions, flux: &[f64], open: Option<&Vec<f64>>) -> Vec<f64> {
        let beside = |test: usize| open.map_or(0.0, |open| open[test]);
        let of = |s: &usize| self.test_of(*s).map_or(0.0, |test| flux[test] - beside(test));
        motions.inputs.iter().map(of).collect()
    }

    /// The test function of the term with an input.
    fn test_of(&self, input: usize) -> Option<usize> {
        let InputSlot::Field(slot) = &self.term.law.law.inputs[input] else { return None };
        self.system.terms[self.term.term].law.tests.iter().position(|test| test == slot)
    }

    /// The displacement behind a part of the argument, of what the term has forces on.
    fn along(&self, motions: &Motions, k: usize, part: &[f64]) -> DVector<f64> {
        let tested: Vec<bool> = motions.inputs.iter().map(|s| self.test_of(*s).is_some()).collect();
        self.term.way(motions, &self.points[k], part, &tested)
    }

    /// What a point slides against that has slid.
    fn slide(&self, motions: &Motions, k: usize, slid: &[f64], force: &[f64]) -> Slide {
        let along = self.along(motions, k, slid);
        let (mut power, mut forces) = (0.0, 0.0f64);
        force.iter().zip(&along).for_each(|(f, d)| (power, forces) = (power + f * d, forces.hypot(*f)));
        let length = along.norm();
        // a force across the slip: its part along it is what rounding leaves of the direction
        let is_across = !power.is_finite() || power.abs() <= ACROSS * forces * length;
        let factor = self.way.unwrap_or(1.0);
        if is_across {
            return Slide { power: 0.0, way: if forces == 0.0 { factor * length } else { 0.0 }, resists: 0.0 };
        }
        Slide { power: factor * power, way: factor * length, resists: power.abs() / length }
    }

    /// What resists a slip at a point that sticks: its force as far as the bound lets it grow. `None` without a force.
    fn resists(&self, motions: &Motions, k: usize, force: &[f64]) -> Option<f64> {
        let (x, radius) = (self.argument(&self.points[k].outputs), self.radius(k));
        let size = norm(x);
        if size <= 0.0 || radius.is_nan() || radius <= 0.0 || force.iter().all(|f| *f == 0.0) {
            return None;
        }
        let held = self.slide(motions, k, x, force).resists;
        Some(held * (radius / size).max(1.0)).filter(|f| f.is_finite())
    }

    /// The work at a point with the mean of the bound over what slid.
    fn mean_power(&self, slide: &Slide, begun: Begun<'_>, k: usize) -> f64 {
        let Begun { end: start, pressing, rate } = begun;
        let radius = self.radius(k);
        let argument = self.argument(&self.points[k].outputs);
        let end = End { argument, radius, resists: slide.resists };
        let is_held = radius > 0.0 && norm(argument) <= radius && norm(start.argument) <= start.radius;
        let knows = |end: &End<'_>| end.radius.is_finite() && end.argument.iter().all(|x| x.is_finite());
        // a law that retains nothing slides within its bound, too, against what it has there
        if is_held || !knows(&start) || !knows(&end) || (start.radius <= 0.0 && radius <= 0.0) {
            return slide.power;
        }
        let meets = Some(-pressing / (rate * self.term.window.increment)).filter(|s| s.is_finite());
        let mean = Slipping { start, end, meets }.mean_force();
        if slide.resists > 0.0 { slide.power * (mean / slide.resists) } else { mean * slide.way }
    }

    /// Whether the forces on displacements are multipliers and read nothing else, the law of which stands in the same term:
    /// what acts where the law is open is that force, too.
    fn force_is_a_multiplier(&self) -> bool {
        let law = &self.system.terms[self.term.term].law;
        let kind = |slot: &BasisSlot| self.system.fields[slot.field.index()].kind;
        let of_forces = law.entries.iter().filter_map(|(test, trial)| {
            let (test, trial) = (&law.tests[usize::from(*test)], &law.trials[usize::from(*trial)]);
            is_displacement(&self.system.fields, test).then(|| kind(trial))
        });
        let mut of_forces = of_forces.peekable();
        of_forces.peek().is_some() && of_forces.all(|kind| kind == FieldKind::Multiplier)
    }
}

/// The part of an argument on the ball: P(x).
fn inside(x: &[f64], radius: f64) -> Vec<f64> {
    x.iter().zip(beyond(x, radius)).map(|(x, beyond)| x - beyond).collect()
}
