//! Friction from step to step: the energy that it takes, and whether a law keeps the points where its sides stick.
//!
//! At a point the argument x of the ball has the slip that the law sees, and what is beyond the ball, x - P(x), is what
//! slides: over the slope of the argument in the displacements, the slip of return mapping. A law with a memory (a state, or
//! the change since the last step) begins each step at rest, so that this is the slip of the step, obstacles that move
//! included. A law on the total slip begins at what it had at the end of the last step. The work is the force of the term on
//! the displacements times that slip, with the mean of the bound over what slides ([`Slipping`]): that at the end of the step
//! would be wrong by half of its change. Friction resists, so that it is not negative; a law on the total slip knows no way
//! back: when loads go down, it drives the slip it allowed back to nothing, and gives the energy back that it had taken.
//!
//! At a point that sticks nothing slides; what its argument has left is elastic. The next step has to find the same
//! argument there: with the past renewed and nothing moved ([`Rest`]). A law that finds none forgets the point where its
//! sides stick, and they creep ([`Creep`]).
//!
//! Promises: nothing counts that the law itself does not see, whatever else moves. Does not judge the work.

mod power;

use std::collections::BTreeSet;

use nalgebra::DVector;
use wfl_compiler::{
    Projection, ProjectionKind,
    types::{BasisSlot, FieldKind, InputSlot, RateFactor, RateOrder, UniformSlot},
};

use super::{
    Contact, ContactTerm,
    at_points::{Motions, Point},
    creep::{Creep, Lost, Sticking},
    regularisation::AS_WRITTEN,
    slipping::End,
    slopes::is_displacement,
};
use wfl_discrete::{
    assemble::FieldValues,
    system::{System, TermBranches},
    value::uniforms_at,
    window::Window,
};

/// A law is one of increments if its argument changes by less than this part when past and present move together, and it
/// forgets a point if less than this part of the slip there is left when the past is renewed: rounding.
const NOTHING: f64 = 1e-6;
/// How many numbers a point keeps beside its argument at rest (numbers): its radius, its force, its pressure and the rate of that.
const BESIDE: usize = 4;

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

impl FrictionWork {
    /// The sum with that of a later part of a step.
    #[must_use]
    pub fn and(self, later: Self) -> Self {
        Self { taken: self.taken + later.taken, size: self.size + later.size, bound: self.bound.max(later.bound) }
    }
}

/// What friction remembers from one step to the next, by contact term; empty for one without friction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrictionMemory {
    /// What a law is at rest at the end of the last step, point after point: the entries of its argument, its radius, the
    /// force that resists a slip (0 where nothing presses or drags), the argument of its pressure (0 without one) and what
    /// that grows by in the step variable (0 where it is not known).
    pub rest: Vec<Vec<f64>>,
    /// The slip that points which stick have lost, three numbers a point (length).
    pub lost: Vec<Vec<f64>>,
}

/// What friction did in a step, or in a part of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrictionStep {
    /// What it took.
    pub work: FrictionWork,
    /// What the worst of the terms that forget where points stick has lost.
    pub creep: Option<Creep>,
}

/// The next values of states, by field.
pub type NextStates<'a> = [(usize, &'a [f64])];

impl FrictionMemory {
    /// What friction did from the state that this remembers to `u`, whose states become `next`; `None` for a scene without
    /// friction on displacements. Remembers the new state.
    pub fn pass(
        &mut self,
        system: &System,
        contact: &Contact,
        u: &[f64],
        next: &NextStates<'_>,
    ) -> Option<FrictionStep> {
        let n_terms = contact.terms().len();
        let is_first = self.rest.is_empty();
        self.rest.resize(n_terms, Vec::new());
        self.lost.resize(n_terms, Vec::new());
        let values = system.values_with(u, contact.active_set());
        let mut step: Option<FrictionStep> = None;
        for ((term, before), lost) in contact.terms().iter().zip(&mut self.rest).zip(&mut self.lost) {
            // a slip along faces that turn is no difference of displacements
            if term.moves() {
                continue;
            }
            let Some(pass) = Pass::new(term, system, values.view(), next) else { continue };
            let slips = pass.slips(if is_first { &[] } else { before });
            let start = if is_first { pass.unmoved() } else { std::mem::take(before) };
            let (work, rest) = pass.work(&slips, &start);
            let own = FrictionStep { work, creep: pass.creep(lost) };
            *before = rest;
            let all = step.get_or_insert_with(FrictionStep::default);
            all.work = all.work.and(own.work);
            all.creep = Creep::worse(all.creep.take(), own.creep);
        }
        step
    }

    /// True if it belongs to these laws.
    #[must_use]
    pub fn fits(&self, contact: &Contact) -> bool {
        self.rest.len() == self.lost.len() && (self.rest.is_empty() || self.rest.len() == contact.terms().len())
    }
}

/// What a step begins with at a point.
struct Begun<'a> {
    end: End<'a>,
    /// The argument of the pressure; 0 without one.
    pressing: f64,
    /// What it grew by in the step variable; 0 where that is not known.
    rate: f64,
}

/// A state after which nothing moves any more: the past is what was the present, states have their next values, and no
/// time goes by.
struct Rest {
    points: Vec<Point>,
    uniforms: Vec<f64>,
}

/// A term with friction at a state.
struct Pass<'a> {
    term: &'a ContactTerm,
    system: &'a System,
    values: FieldValues<'a>,
    /// The ball and its position among the projections.
    ball: &'a Projection,
    position: usize,
    points: Vec<Point>,
    /// `None` for a law that reads no past: it finds what it has left.
    rest: Option<Rest>,
    /// Of a law on the rate of slip what a slip that follows from the slopes of the argument is multiplied with to be that of
    /// the step.
    way: Option<f64>,
}

impl<'a> Pass<'a> {
    /// `None` for a term without friction, or whose force acts on no displacement that its friction depends on: the law of
    /// a multiplier, whose force stands in another term.
    fn new(term: &'a ContactTerm, system: &'a System, values: FieldValues<'a>, next: &NextStates<'_>) -> Option<Self> {
        let is_friction = |p: &Projection| p.kind == ProjectionKind::Ball && p.acts;
        let (position, ball) = term.projections.iter().enumerate().find(|(_, p)| is_friction(p))?;
        if term.on_cells() || !term.moves_something(system) {
            return None;
        }
        let data = term.as_written_near(system, values, AS_WRITTEN);
        let points = term.points_on(system, values, &data, term.law.uniforms());
        let rest = term.reads_past(system).then(|| term.rest(system, values, &data, next, ball));
        let mut pass = Self { term, system, values, ball, position, points, rest, way: None };
        pass.way = pass.way_of_rates();
        Some(pass)
    }

    /// Of a law whose argument has the rate of the slip, `c u` and what the scheme adds to it, and no slip: c times the
    /// increment. A rate over its slope in `u` is no slip but under backward differences of one step.
    fn way_of_rates(&self) -> Option<f64> {
        let slots = &self.term.law.law.inputs;
        let factor = self.term.law.law.prologue.slots.iter().find_map(|slot| match slot {
            UniformSlot::Rate(factor @ (RateFactor::Rate | RateFactor::Velocity)) => Some(*factor),
            _ => None,
        })?;
        let factor = self.term.window.rates.of(factor);
        let rates: Vec<(usize, usize)> = (slots.iter().enumerate())
            .filter_map(|(s, slot)| match slot {
                InputSlot::History(RateOrder::First, b) if is_displacement(&self.system.fields, b) => {
                    Some((s, self.term.present_of(b)?))
                }
                _ => None,
            })
            .collect();
        // what moves a displacement and leaves its rate
        let is_of_rates = !rates.is_empty()
            && self.changes_nothing(|point, motions, inputs| {
                motions.inputs.iter().for_each(|s| inputs[*s] = 0.0);
                for (history, now) in &rates {
                    inputs[*history] = point.inputs[*history] + factor * point.inputs[*now];
                }
            });
        is_of_rates.then_some(factor * self.term.window.increment)
    }

    /// Whether the argument at all points stays if `edit` changes what is read there.
    fn changes_nothing(&self, edit: impl Fn(&Point, &Motions, &mut Vec<f64>)) -> bool {
        let (mut change, mut size) = (0.0, 0.0);
        for point in &self.points {
            let Some(motions) = self.motions(point) else { continue };
            let mut edited = point.inputs.clone();
            edit(point, &motions, &mut edited);
            let [a, b] = [&edited, &point.inputs].map(|inputs| self.slip_of(inputs, self.term.law.uniforms()));
            change += a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>();
            let summands = motions.slope.row_iter().flat_map(|row| {
                let summand = |(slope, s): (&f64, &usize)| (slope * point.inputs[*s]).abs();
                row.iter().zip(&motions.inputs).map(summand).collect::<Vec<f64>>()
            });
            size += summands.sum::<f64>();
        }
        let mut sums = [change, size];
        self.system.team().sum(&mut sums);
        sums[0] <= NOTHING * sums[1]
    }

    fn argument<'p>(&self, outputs: &'p [f64]) -> &'p [f64] {
        &outputs[self.ball.output..][..self.ball.n]
    }

    fn radius(&self, point: usize) -> f64 {
        self.points[point].outputs[self.ball.output + self.ball.n]
    }

    /// The argument at a point without tractions.
    fn slip_of(&self, inputs: &[f64], uniforms: &[f64]) -> Vec<f64> {
        let without = self.term.without_tractions(self.system, inputs);
        self.argument(&self.term.outputs_of(&without, uniforms)).to_vec()
    }

    /// By point what slid in the step, in the measure of the argument; `before` what the law was at rest before, empty where
    /// nothing slid.
    fn slips(&self, before: &[f64]) -> Vec<Vec<f64>> {
        if self.way.is_some() || self.takes_increments() {
            // a law without a traction of its own, and without a memory of one, has no elastic part: it retains nothing
            let has_traction =
                |p: &Point| self.slip_of(&p.inputs, self.term.law.uniforms()) != self.argument(&p.outputs);
            let retains = self.points.iter().any(has_traction) || self.remembers();
            let of = |k: usize| {
                let x = self.argument(&self.points[k].outputs);
                if retains { beyond(x, self.radius(k)) } else { x.to_vec() }
            };
            return (0..self.points.len()).map(of).collect();
        }
        let of = |k: usize| {
            let mut slid = beyond(self.argument(&self.points[k].outputs), self.radius(k));
            if let Some(Begun { end, .. }) = self.begun(before, k) {
                slid.iter_mut().zip(beyond(end.argument, end.radius)).for_each(|(s, b)| *s -= b);
            }
            slid
        };
        (0..self.points.len()).map(of).collect()
    }

    /// Whether the argument is there at rest: a traction that is remembered, or the slip that it is elastic in.
    fn remembers(&self) -> bool {
        let size =
            |points: &[Point]| points.iter().flat_map(|p| self.argument(&p.outputs)).map(|x| x.abs()).sum::<f64>();
        let mut sums = [self.rest.as_ref().map_or(0.0, |rest| size(&rest.points)), size(&self.points)];
        self.system.team().sum(&mut sums);
        sums[0] > NOTHING * sums[1]
    }

    /// A point of what [`FrictionMemory::rest`] has of a term.
    fn begun<'r>(&self, rest: &'r [f64], k: usize) -> Option<Begun<'r>> {
        let n = self.ball.n;
        let (argument, others) = rest.get(k * (n + BESIDE)..(k + 1) * (n + BESIDE))?.split_at(n);
        let [radius, resists, pressing, rate] = *others else { return None };
        Some(Begun { end: End { argument, radius, resists }, pressing, rate })
    }

    /// True if the argument has the change of the displacements since the last step: what moves past and present alike does
    /// not change it.
    fn takes_increments(&self) -> bool {
        let term = self.term;
        let slots = &term.law.law.inputs;
        let past: Vec<(usize, usize)> = (slots.iter().enumerate())
            .filter_map(|(s, slot)| match slot {
                InputSlot::Previous(b) if is_displacement(&self.system.fields, b) => Some((s, term.present_of(b)?)),
                _ => None,
            })
            .collect();
        if past.is_empty() {
            return false;
        }
        // past and present move by what the present is
        self.changes_nothing(|point, motions, inputs| {
            motions.inputs.iter().for_each(|s| inputs[*s] = 0.0);
            past.iter().for_each(|(before, now)| inputs[*before] = point.inputs[*before] - point.inputs[*now]);
        })
    }

    fn motions(&self, point: &Point) -> Option<Motions> {
        self.term.motions_at(self.system, self.position, self.ball.n, &point.inputs)
    }

    /// Adds to what points that stick have lost, three numbers a point. `None` for a law that has lost nothing so far.
    fn creep(&self, lost: &mut Vec<f64>) -> Option<Creep> {
        // every rank has the law, so that all of them stay or go
        let rest = self.rest.as_ref().filter(|_| !self.term.reads_rates())?;
        lost.resize(3 * self.points.len(), 0.0);
        let steps: Vec<Option<[f64; 3]>> = (0..self.points.len()).map(|k| self.lost_at(k, rest)).collect();
        for (own, step) in lost.chunks_exact_mut(3).zip(&steps) {
            match step {
                Some(step) => own.iter_mut().zip(step).for_each(|(sum, x)| *sum += x),
                // what opens sticks anew where it touches
                None => own.fill(0.0),
            }
        }
        let team = self.system.team();
        if !team.any(lost.iter().any(|x| *x != 0.0)) {
            return None;
        }
        let mut sum = Sticking::default();
        let points = steps.iter().enumerate().zip(self.weights()).filter(|((k, _), _)| self.term.counts(*k));
        for ((k, step), weight) in points.filter_map(|((k, step), weight)| Some(((k, (*step)?), weight))) {
            let sticks = norm(self.argument(&self.points[k].outputs)) <= self.radius(k);
            let own = Lost { point: k, slip: norm(&lost[3 * k..][..3]), step: norm(&step) };
            sum.add(weight, self.moved(k), sticks.then_some(own));
        }
        let name = &self.system.terms[self.term.term].law.name;
        let position = |k: usize| self.term.sampled.domain.position(&self.system.mesh, k);
        sum.creep(name, self.deformed(), team, position)
    }

    /// The largest difference of the displacements of two points of one body, by component, of all ranks.
    fn deformed(&self) -> f64 {
        let mut largest = 0.0f64;
        let moves = |slot: &BasisSlot| is_displacement(&self.system.fields, slot);
        let slots = self.term.slopes.of_projection(self.position).map(|(_, s)| s.slot);
        let fields: BTreeSet<usize> = slots.filter(moves).map(|slot| slot.field.index()).collect();
        for field in fields {
            let n = self.system.fields[field].n_components;
            for component in 0..n {
                let own = self.values.current[field].iter().skip(component).step_by(n);
                let [low, high] =
                    own.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
                let [low, high] = self.system.team().range(low, high);
                largest = largest.max(high - low);
            }
        }
        largest
    }

    /// What a point has lost at the end of the step: nothing unless it sticks; `None` for one that is open.
    fn lost_at(&self, k: usize, rest: &Rest) -> Option<[f64; 3]> {
        let (point, quiet, radius) = (&self.points[k], &rest.points[k], self.radius(k));
        let (x, next) = (self.argument(&point.outputs), self.argument(&quiet.outputs));
        if radius.is_nan() || radius <= 0.0 {
            return None;
        }
        let change: Vec<f64> = x.iter().zip(next).map(|(x, next)| x - next).collect();
        if norm(x) > radius || norm(&change) <= NOTHING * norm(x) {
            return Some([0.0; 3]);
        }
        let before = self.slip_of(&point.inputs, self.term.law.uniforms());
        let left = self.slip_of(&quiet.inputs, &rest.uniforms);
        let is_forgotten = norm(&left) <= NOTHING * norm(&before);
        let lost = if is_forgotten { self.motion(point, &before) } else { None };
        Some(lost.filter(|lost| lost.iter().all(|x| x.is_finite())).unwrap_or_default())
    }

    /// The motion of the near side behind a part of the argument.
    fn motion(&self, point: &Point, x: &[f64]) -> Option<[f64; 3]> {
        self.term.motion(self.system, self.position, x, &self.term.slopes.at_point(&point.inputs))
    }

    /// How far the sides have moved against each other along the face.
    fn moved(&self, k: usize) -> f64 {
        let point = &self.points[k];
        let total = self.motions(point).map(|motions| motions.total(&point.inputs));
        let moved = total.and_then(|x| self.motion(point, x.as_slice()));
        moved.map_or(0.0, |moved| norm(&moved))
    }

    fn weights(&self) -> Vec<f64> {
        let mut weights = Vec::with_capacity(self.points.len());
        let (mesh, sampled) = (&self.system.mesh, &self.term.sampled);
        self.term.law.for_each_point(mesh, sampled, self.values, |_, _, _, weight, _| weights.push(weight));
        weights
    }
}

impl Motions {
    /// The part of the argument that the present displacements make: what has moved since the beginning.
    fn total(&self, inputs: &[f64]) -> DVector<f64> {
        &self.slope * DVector::from_iterator(self.inputs.len(), self.inputs.iter().map(|s| inputs[*s]))
    }
}

impl ContactTerm {
    /// True if the term has a force on a displacement that it reads.
    fn moves_something(&self, system: &System) -> bool {
        let tests = &system.terms[self.term].law.tests;
        self.law.law.inputs.iter().any(|slot| match slot {
            InputSlot::Field(b) => is_displacement(&system.fields, b) && tests.contains(b),
            _ => false,
        })
    }

    /// True if its law reads what was before: states, or displacements at the end of the last step.
    fn reads_past(&self, system: &System) -> bool {
        let is_state = |field: usize| system.fields.get(field).is_some_and(|f| f.kind == FieldKind::State);
        self.law.law.inputs.iter().any(|slot| match slot {
            InputSlot::Field(b) => is_state(b.field.index()),
            InputSlot::Previous(_) => true,
            _ => false,
        })
    }

    /// True if its law reads rates: what sticks may move then.
    fn reads_rates(&self) -> bool {
        self.law.law.inputs.iter().any(|slot| matches!(slot, InputSlot::History(..)))
    }

    /// The law at rest, on the branches `data`.
    fn rest(
        &self,
        system: &System,
        values: FieldValues<'_>,
        data: &TermBranches,
        next: &NextStates<'_>,
        ball: &Projection,
    ) -> Rest {
        let mut current: Vec<&[f64]> = values.current.to_vec();
        next.iter().for_each(|(field, values)| current[*field] = values);
        let past = &current[..system.fields.len()];
        let values = FieldValues { current: &current, previous: past, ..values };
        let uniforms = uniforms_at(&self.law.law.prologue, Window { increment: 0.0, ..self.window });
        let points = self.points_on(system, values, data, &uniforms);
        let is_finite = |p: &Point| p.outputs[ball.output..][..ball.n].iter().all(|x| x.is_finite());
        if points.iter().all(is_finite) {
            return Rest { points, uniforms };
        }
        // a law that divides by the increment stays with its own one
        let uniforms = self.law.uniforms().to_vec();
        Rest { points: self.points_on(system, values, data, &uniforms), uniforms }
    }
}

/// The part of an argument beyond the ball: x - P(x).
fn beyond(x: &[f64], radius: f64) -> Vec<f64> {
    let size = norm(x);
    if size <= radius {
        return vec![0.0; x.len()];
    }
    let kept = if radius > 0.0 { radius / size } else { 0.0 };
    x.iter().map(|x| (1.0 - kept) * x).collect()
}

/// The length of a vector, without overflow.
fn norm(v: &[f64]) -> f64 {
    v.iter().fold(0.0f64, |m, x| m.hypot(*x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_block::Block;

    /// What friction does where the floor of a square slides to each of some places in turn, pressed by an overlap of 0.1:
    /// the bound is 0.5.
    fn sliding(places: &[f64]) -> Vec<FrictionStep> {
        let block = Block::with_friction(1);
        let mut memory = FrictionMemory::default();
        let pass = |x: &f64| memory.pass(&block.system, &block.contact, &block.moved([*x, -0.1], [0.0; 2]), &[]);
        places.iter().map(pass).map(|step| step.expect("there is friction")).collect()
    }

    #[test]
    fn a_point_that_sticks_takes_no_energy() {
        let step = &sliding(&[0.04])[0];
        assert_eq!((step.work.taken, step.work.size), (0.0, 0.0));
        assert_eq!(step.creep, None);
    }

    #[test]
    fn friction_takes_the_bound_times_the_slip() {
        // of 0.3 an elastic slip of 0.05 is left
        let work = sliding(&[0.0, 0.3])[1].work;
        assert!((work.taken - 0.5 * 0.25).abs() < 1e-14 && work.size == work.taken, "{work:?}");
        assert!((work.bound - 0.5 * 0.3).abs() < 1e-14, "{work:?}");
    }

    #[test]
    fn friction_takes_half_of_it_where_the_bound_grows_from_nothing() {
        let work = sliding(&[0.3])[0].work;
        assert!((work.taken - 0.25 * 0.25).abs() < 1e-14, "{work:?}");
    }

    #[test]
    fn each_step_takes_what_slid_since_the_last() {
        let steps = sliding(&[0.3, 0.7]);
        assert!((steps[1].work.taken - 0.5 * 0.4).abs() < 1e-14, "{:?}", steps[1]);
    }

    #[test]
    fn a_law_on_the_total_slip_gives_energy_back_on_the_way_back() {
        let steps = sliding(&[0.7, 0.3]);
        assert!((steps[1].work.taken + 0.5 * 0.4).abs() < 1e-14, "{:?}", steps[1]);
        assert!((steps[1].work.size - 0.5 * 0.4).abs() < 1e-14);
    }

    #[test]
    fn works_of_parts_of_a_step_add_and_their_bound_is_the_larger() {
        let part = |taken: f64, bound: f64| FrictionWork { taken, size: taken.abs(), bound };
        let sum = part(2.0, 5.0).and(part(-0.5, 3.0));
        assert_eq!(sum, FrictionWork { taken: 1.5, size: 2.5, bound: 5.0 });
    }

    #[test]
    fn what_is_beyond_a_ball_ends_on_it() {
        assert_eq!(beyond(&[0.3, 0.4], 0.5), [0.0, 0.0], "on the border nothing is");
        let over = beyond(&[3.0, 4.0], 1.0);
        assert!((norm(&over) - 4.0).abs() < 1e-15 && (over[0] / over[1] - 0.75).abs() < 1e-15);
        assert_eq!(beyond(&[3.0, 4.0], -1.0), [3.0, 4.0], "a ball without a radius holds nothing");
    }

    #[test]
    fn lengths_neither_overflow_nor_underflow() {
        assert_eq!(norm(&[3e300, 4e300]), 5e300);
        assert!((norm(&[3e-300, 4e-300]) / 5e-300 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_memory_fits_the_laws_it_is_of() {
        let block = Block::with_friction(1);
        let of = |n: usize| FrictionMemory { rest: vec![Vec::new(); n], lost: vec![Vec::new(); n] };
        assert!(of(0).fits(&block.contact) && of(1).fits(&block.contact) && !of(2).fits(&block.contact));
        assert!(!FrictionMemory { rest: vec![Vec::new()], lost: Vec::new() }.fits(&block.contact));
    }
}
