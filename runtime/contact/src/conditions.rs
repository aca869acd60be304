//! What a contact law says of gap and traction, found from the arguments of its projections.
//!
//! The argument of a contact projection is `gamma g - s`: a gap times a stiffness, and the traction of a method that
//! has one (the stress of Nitsche's, the multiplier of an augmentation). With gradients and multipliers set to zero the
//! first part remains, and gamma is its slope in the displacement. So penetration, motion at points that stick and
//! tractions outside the cone are known without knowing the method. Lengths are exact for normals along an axis, and
//! too large by at most the root of the dimension otherwise, because the slope is that of one component.

use std::collections::BTreeMap;

use wfl_compiler::{
    ProjectionKind, interpret_lanes,
    ir::LANES,
    types::{FieldKind, FieldOp, InputSlot},
};

use super::{Contact, ContactTerm, slopes::is_displacement};
use wfl_discrete::assemble::{Bound, FieldValues, Workspace};
use wfl_discrete::field::Field;
use wfl_discrete::system::System;
use wfl_host::team::Team;

/// The violations of the conditions of contact at the points of a term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactGaps {
    /// Overlap of the sides where the law is one of contact (length), the largest.
    pub penetration: f64,
    /// Sliding at points that stick (length), the largest.
    pub drift: f64,
    /// The traction of the method outside the friction cone, integrated over the points in contact, in parts of the
    /// integral of traction and radius there; `None` without friction, without contact, or for a method without a
    /// traction of its own.
    pub cone: Option<f64>,
    /// The part of the area where the sides press on each other on which the force of the term pulls; `None` where nothing
    /// presses.
    pub pulled: Option<f64>,
    /// The part of the area in contact on which friction drives what it should resist; `None` without contact.
    pub driven: Option<f64>,
    /// The faces on which the sides press on each other.
    pub pressed: PressedFaces,
}

/// Faces by how many of their points press.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PressedFaces {
    /// With a point that presses.
    pub some: usize,
    /// With no other points.
    pub whole: usize,
    /// All faces of the term.
    pub of: usize,
}

impl PressedFaces {
    /// From the faces that this rank has counted to those of all ranks.
    fn of_all(self, team: &dyn Team) -> Self {
        let mut counts = [self.some, self.whole, self.of].map(|n| n as u64);
        team.sum_words(&mut counts);
        let [some, whole, of] = counts.map(|n| usize::try_from(n).expect("a number of faces"));
        Self { some, whole, of }
    }

    /// True if the zone of contact covers no face: its size and its pressures are those of the points of a rule.
    #[must_use]
    pub fn are_too_large(&self) -> bool {
        self.some > 0 && self.whole == 0
    }
}

/// Work below this part of what it is if every component of a force resists has no sign.
const SIGNLESS: f64 = 1e-6;
/// The factor on friction of the law as it is written.
const AS_WRITTEN: f64 = 1.0;
/// A motion below this part of the largest displacement has no direction, and an overlap that the law resists is none.
const STILL: f64 = 1e-9;

/// An integral, and the part of it that is looked for.
#[derive(Clone, Copy, Default)]
struct Share {
    part: f64,
    whole: f64,
}

impl Share {
    fn add(&mut self, weight: f64, counts: bool) {
        self.whole += weight;
        self.part += if counts { weight } else { 0.0 };
    }

    fn value(self) -> Option<f64> {
        (self.whole > 0.0).then(|| self.part / self.whole)
    }
}

/// The violations found so far.
#[derive(Default)]
struct Violations {
    /// The largest displacement.
    moved: f64,
    penetration: f64,
    drift: f64,
    pulled: Share,
    driven: Share,
    cone: Share,
}

/// A projection at a point.
struct Point<'a> {
    /// Its argument, and the part of it that is a gap.
    x: &'a [f64],
    gap: &'a [f64],
    slope: f64,
    weight: f64,
}

impl Violations {
    /// From the points that this rank has counted to those of all ranks.
    fn of_all(&mut self, team: &dyn Team) {
        let mut sizes = [self.penetration, self.drift];
        team.max(&mut sizes);
        [self.penetration, self.drift] = sizes;
        let parts = [&mut self.pulled, &mut self.driven, &mut self.cone];
        let mut sums: Vec<f64> = parts.iter().flat_map(|share| [share.part, share.whole]).collect();
        team.sum(&mut sums);
        parts
            .into_iter()
            .zip(sums.as_chunks().0)
            .for_each(|(share, [part, whole])| *share = Share { part: *part, whole: *whole });
    }

    fn add_normal(&mut self, at: &Point<'_>, presses: bool, pulls: impl FnOnce() -> bool) {
        self.penetration = at.gap.iter().fold(self.penetration, |m, g| m.max(g / at.slope));
        if presses {
            self.pulled.add(at.weight, pulls());
        }
    }

    fn add_tangential(&mut self, at: &Point<'_>, radius: f64, drives: impl FnOnce(&[f64]) -> bool) {
        if radius <= 0.0 {
            return;
        }
        let slips = norm(at.x) > radius && norm(at.gap) > STILL * self.moved * at.slope;
        if norm(at.x) <= radius {
            self.drift = self.drift.max(norm(at.gap) / at.slope);
        }
        // friction resists what slides, and holds what sticks with the traction of the law
        self.driven.add(at.weight, drives(if slips { at.gap } else { at.x }));
        let traction = norm(&at.x.iter().zip(at.gap).map(|(x, g)| x - g).collect::<Vec<f64>>());
        self.cone.whole += at.weight * traction.max(radius);
        self.cone.part += at.weight * (traction - radius).max(0.0);
    }
}

/// Counts the faces that press, point after point.
struct FaceCount<I> {
    /// The points of each face.
    sizes: I,
    /// Points of the present face that are to come, and those that have come and press or do not.
    left: usize,
    pressing: usize,
    open: usize,
    pressed: PressedFaces,
}

impl<I: Iterator<Item = usize>> FaceCount<I> {
    fn new(sizes: I) -> Self {
        Self { sizes, left: 0, pressing: 0, open: 0, pressed: PressedFaces::default() }
    }

    fn add_point(&mut self, presses: bool) {
        if self.left == 0 {
            (self.left, self.pressing, self.open) = (self.sizes.next().unwrap_or(1), 0, 0);
        }
        *if presses { &mut self.pressing } else { &mut self.open } += 1;
        self.left -= 1;
        if self.left == 0 {
            self.pressed.of += 1;
            self.pressed.some += usize::from(self.pressing > 0);
            self.pressed.whole += usize::from(self.pressing > 0 && self.open == 0);
        }
    }
}

/// A displacement that the argument of a projection depends on.
struct Motion {
    /// The slot of its test function.
    test: usize,
    /// The derivatives of the argument with respect to it: the position of the value, and the entry of the argument.
    slopes: Vec<(usize, usize)>,
}

/// What each contact law leaves of gaps and friction cones at `u`, whose largest displacement is `moved`, with the name
/// of its term. A law that moves nothing itself is left out beside one that does, and so are laws on cells.
#[must_use]
pub fn contact_gaps<'a>(system: &'a System, contact: &Contact, u: &[f64], moved: f64) -> Vec<(&'a str, ContactGaps)> {
    let values = system.values_with(u, contact.active_set());
    let some_act = contact.terms().iter().any(|term| term.acts_on_displacements(system));
    let counts = |t: &&ContactTerm| !t.on_cells() && (!some_act || t.acts_on_displacements(system));
    let of = |t: &ContactTerm| (system.terms[t.term].law.name.as_str(), t.gaps(system, values.view(), moved));
    contact.terms().iter().filter(counts).map(of).collect()
}

impl ContactTerm {
    /// The violations at a state whose largest displacement is `moved`; `values` has room for the branch data.
    fn gaps(&self, system: &System, values: FieldValues<'_>, moved: f64) -> ContactGaps {
        let mesh = &system.mesh;
        let data = self.as_written(system, values, AS_WRITTEN);
        let mut current: Vec<&[f64]> = values.current.to_vec();
        current[self.field] = &data;
        let values = FieldValues { current: &current, ..values };
        let largest = self.largest_slopes(system, values);
        let mut fluxes = Vec::new();
        let term = &system.terms[self.term];
        term.for_each_flux(mesh, values, |flux, weight| fluxes.push((flux.to_vec(), weight)));
        let mut fluxes = fluxes.iter();
        let motions = self.motions(system);
        let mut found = Violations { moved, ..Violations::default() };
        let mut faces = FaceCount::new(self.counted_faces());
        let mut point = 0;
        self.arguments(system, values, |full, gap, slopes| {
            let Some((flux, weight)) = fluxes.next() else { return };
            point += 1;
            if !self.counts(point - 1) {
                return;
            }
            let mut presses = false;
            let each = self.projections.iter().zip(&largest).zip(&motions);
            for ((p, slope), motions) in each.filter(|((_, s), _)| **s > 0.0) {
                let mut works_along = |direction: &[f64]| works_along(flux, motions, direction, &slopes());
                let at = Point {
                    x: &full[p.output..][..p.n],
                    gap: &gap[p.output..][..p.n],
                    slope: *slope,
                    weight: weight.abs(),
                };
                match p.kind {
                    // a part of a friction bound is no gap
                    ProjectionKind::HalfLine if !p.acts => {}
                    ProjectionKind::HalfLine => {
                        presses |= p.n == 1 && at.x[0] > STILL * moved * slope;
                        found.add_normal(&at, p.n == 1 && at.x[0] > 0.0, || works_along(&[1.0]));
                    }
                    ProjectionKind::Ball => {
                        found.add_tangential(&at, full[p.output + p.n], works_along);
                    }
                }
            }
            faces.add_point(presses);
        });
        let faces = faces.pressed.of_all(system.team());
        found.of_all(system.team());
        ContactGaps {
            pressed: faces,
            penetration: found.penetration,
            drift: found.drift,
            pulled: found.pulled.value(),
            driven: found.driven.value(),
            cone: found.cone.value().filter(|_| self.has_friction() && self.has_traction(&system.fields)),
        }
    }

    /// The numbers of points of the faces that this rank counts.
    fn counted_faces(&self) -> impl Iterator<Item = usize> + '_ {
        let sizes = self.sampled.domain.groups.iter().flat_map(|g| g.entities.iter().map(|_| g.n_points()));
        let mut end = 0;
        sizes.filter(move |n_points| {
            end += n_points;
            self.counts(end - n_points)
        })
    }

    /// True if the force of a term acts on displacements, so that it can be judged by what it does to them.
    fn acts_on_displacements(&self, system: &System) -> bool {
        let tests = &system.terms[self.term].law.tests;
        self.law.law.inputs.iter().any(|slot| match slot {
            InputSlot::Field(b) => is_displacement(&system.fields, b) && tests.contains(b),
            _ => false,
        })
    }

    /// True if the projections read more than displacements: gradients or multipliers.
    fn has_traction(&self, fields: &[Field]) -> bool {
        self.law.law.inputs.iter().any(|slot| is_traction(fields, slot))
    }

    /// By projection: the displacements that its argument depends on and that the force of the term acts on.
    fn motions(&self, system: &System) -> Vec<Vec<Motion>> {
        let tests = &system.terms[self.term].law.tests;
        let of = |projection: usize| {
            let mut motions: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
            for (at, slope) in self.slopes.of_projection(projection) {
                if is_displacement(&system.fields, &slope.slot)
                    && let Some(test) = tests.iter().position(|t| *t == slope.slot)
                {
                    motions.entry(test).or_default().push((at, slope.entry));
                }
            }
            motions.into_iter().map(|(test, slopes)| Motion { test, slopes }).collect()
        };
        (0..self.projections.len()).map(of).collect()
    }

    /// Calls `f` at every point with what the law gives there, with the same without gradients and multipliers, and
    /// with a function for the derivatives of the arguments.
    fn arguments(
        &self,
        system: &System,
        values: FieldValues<'_>,
        mut f: impl FnMut(&[f64], &[f64], &mut dyn FnMut() -> Vec<f64>),
    ) {
        let law = &self.law.law;
        let traction: Vec<bool> = law.inputs.iter().map(|s| is_traction(&system.fields, s)).collect();
        let bound = Bound { mesh: &system.mesh, domain: &self.sampled.domain, binding: &self.sampled.binding };
        let mut workspace = Workspace::default();
        let (n_in, n_out) = (law.inputs.len(), law.kernel.kernel().outputs.len());
        let mut scratch = Vec::new();
        let mut outputs = |inputs: &[[f64; LANES]]| {
            let mut out = vec![[0.0; LANES]; n_out];
            interpret_lanes(&law.kernel, self.law.uniforms(), inputs, &mut scratch, &mut out);
            out
        };
        for (g, group) in self.sampled.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(bound, g, batch, values);
                let points = workspace.inputs.as_chunks::<LANES>().0.chunks_exact(n_in.max(1)).take(group.n_points());
                let mut points: Vec<Outputs> = points
                    .map(|inputs| {
                        let mut without = inputs.to_vec();
                        let tractions = without.iter_mut().zip(&traction).filter(|(_, t)| **t);
                        tractions.for_each(|(x, _)| *x = [0.0; LANES]);
                        Outputs { inputs, full: outputs(inputs), gap: outputs(&without), slopes: None }
                    })
                    .collect();
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    let own = |all: &[[f64; LANES]]| -> Vec<f64> { all.iter().map(|values| values[lane]).collect() };
                    for Outputs { inputs, full, gap, slopes } in &mut points {
                        f(&own(full), &own(gap), &mut || own(slopes.get_or_insert_with(|| self.slopes.at(inputs))));
                    }
                }
            }
        }
    }
}

/// What the law gives at one point of all entities of a batch.
struct Outputs<'a> {
    inputs: &'a [[f64; LANES]],
    full: Vec<[f64; LANES]>,
    /// Without gradients and multipliers.
    gap: Vec<[f64; LANES]>,
    /// The derivatives of the arguments, as soon as somebody has asked for them.
    slopes: Option<Vec<[f64; LANES]>>,
}

/// True if a force works as an argument moves along `direction`, in place of resisting.
fn works_along(flux: &[f64], motions: &[Motion], direction: &[f64], slopes: &[f64]) -> bool {
    let (mut resisted, mut size) = (0.0f64, 0.0f64);
    for Motion { test, slopes: places } in motions {
        let along: f64 = places.iter().map(|(at, entry)| direction[*entry] * slopes[*at]).sum();
        let work = flux[*test] * along;
        resisted += work;
        size += work.abs();
    }
    resisted < -SIGNLESS * size
}

/// True for what is no displacement: a gradient or a multiplier of the scene.
pub(super) fn is_traction(fields: &[Field], slot: &InputSlot) -> bool {
    match slot {
        InputSlot::Field(b) if b.field.index() < fields.len() => {
            b.op != FieldOp::Value || fields[b.field.index()].kind == FieldKind::Multiplier
        }
        _ => false,
    }
}

/// The length of a vector, without overflow.
fn norm(v: &[f64]) -> f64 {
    v.iter().fold(0.0f64, |m, x| m.hypot(*x))
}
