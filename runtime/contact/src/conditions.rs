//! What a contact law says of gap and traction, found from the arguments of its projections.
//!
//! The argument of a contact projection is `gamma g - s`: a gap times a stiffness, and the traction of a method that
//! has one (the stress of Nitsche's, the multiplier of an augmentation). With gradients and multipliers set to zero the
//! first part remains, and gamma is its slope in the displacement. So penetration, motion at points that stick and
//! tractions outside the cone are known without knowing the method. Lengths are exact for normals along an axis, and
//! too large by at most the root of the dimension otherwise, because the slope is that of one component.

use wfl_compiler::{
    Projection, ProjectionKind, interpret_lanes,
    ir::LANES,
    types::{FieldKind, FieldOp, InputSlot},
};

use super::{Contact, ContactTerm, scaling::SLOPE_STEP};
use wfl_discrete::assemble::{Bound, FieldValues, Workspace};
use wfl_discrete::field::Field;
use wfl_discrete::system::System;

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
}

/// Work below this part of what it is if every component of a force resists has no sign.
const SIGNLESS: f64 = 1e-6;
/// The factor on friction of the law as it is written.
const AS_WRITTEN: f64 = 1.0;
/// A motion below this part of the largest displacement has no direction.
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

/// What the force of a term does at a point.
struct PointForce<'a> {
    flux: &'a [f64],
    /// Inputs of the law that are displacements, with their test slots.
    moves: &'a [(usize, usize)],
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
        let (_, size) = self.entity_size(mesh, values);
        let slopes = self.slopes(system, values, SLOPE_STEP * size);
        let mut fluxes = Vec::new();
        let term = &system.terms[self.term];
        term.for_each_flux(mesh, values, |flux, weight| fluxes.push((flux.to_vec(), weight)));
        let mut fluxes = fluxes.iter();
        let moves = self.moves(system);
        let mut found = Violations { moved, ..Violations::default() };
        self.arguments(system, values, SLOPE_STEP * size, |full, gap, probe| {
            let Some((flux, weight)) = fluxes.next() else { return };
            let force = PointForce { flux, moves: &moves };
            for (p, slope) in self.projections.iter().zip(&slopes).filter(|(_, s)| **s > 0.0) {
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
                        found.add_normal(&at, p.n == 1 && at.x[0] > 0.0, || force.works_along(p, &[1.0], probe));
                    }
                    ProjectionKind::Ball => {
                        found.add_tangential(&at, full[p.output + p.n], |direction| {
                            force.works_along(p, direction, probe)
                        });
                    }
                }
            }
        });
        ContactGaps {
            penetration: found.penetration,
            drift: found.drift,
            pulled: found.pulled.value(),
            driven: found.driven.value(),
            cone: found.cone.value().filter(|_| self.has_friction() && self.has_traction(&system.fields)),
        }
    }

    /// True if the force of a term acts on displacements, so that it can be judged by what it does to them.
    fn acts_on_displacements(&self, system: &System) -> bool {
        !self.moves(system).is_empty()
    }

    /// True if the projections read more than displacements: gradients or multipliers.
    fn has_traction(&self, fields: &[Field]) -> bool {
        self.law.law.inputs.iter().any(|slot| is_traction(fields, slot))
    }

    /// Inputs of the law that are displacements, with the test slot of the term whose flux is the force on them.
    fn moves(&self, system: &System) -> Vec<(usize, usize)> {
        let tests = &system.terms[self.term].law.tests;
        let slots = self.law.law.inputs.iter().enumerate();
        slots
            .filter_map(|(s, slot)| match slot {
                InputSlot::Field(b) if b.op == FieldOp::Value && !is_traction(&system.fields, slot) => {
                    Some((s, tests.iter().position(|t| t == b)?))
                }
                _ => None,
            })
            .collect()
    }

    /// What the law gives at every point: as they are, without gradients and multipliers, and the latter after a
    /// change of one input by `step`, ahead or behind.
    fn arguments(
        &self,
        system: &System,
        values: FieldValues<'_>,
        step: f64,
        mut f: impl FnMut(&[f64], &[f64], &mut dyn FnMut(usize, bool) -> Vec<f64>),
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
                        let full = outputs(inputs);
                        let mut inputs = inputs.to_vec();
                        let tractions = inputs.iter_mut().zip(&traction).filter(|(_, t)| **t);
                        tractions.for_each(|(x, _)| *x = [0.0; LANES]);
                        Outputs { full, gap: outputs(&inputs), inputs, changed: vec![[None, None]; n_in] }
                    })
                    .collect();
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    let own = |all: &[[f64; LANES]]| -> Vec<f64> { all.iter().map(|values| values[lane]).collect() };
                    for Outputs { full, gap, inputs, changed } in &mut points {
                        f(&own(full), &own(gap), &mut |slot, ahead| {
                            let known = changed[slot][usize::from(ahead)].get_or_insert_with(|| {
                                let kept = inputs[slot];
                                inputs[slot] = kept.map(|x| if ahead { x + step } else { x - step });
                                let found = outputs(inputs);
                                inputs[slot] = kept;
                                found
                            });
                            own(known)
                        });
                    }
                }
            }
        }
    }
}

/// What the law gives at one point of all entities of a batch.
struct Outputs {
    full: Vec<[f64; LANES]>,
    gap: Vec<[f64; LANES]>,
    /// Without gradients and multipliers.
    inputs: Vec<[f64; LANES]>,
    /// After a change of an input, behind and ahead, as soon as somebody has asked for it.
    changed: Vec<[Option<Vec<[f64; LANES]>>; 2]>,
}

impl PointForce<'_> {
    /// True if the force works as the argument `p` moves along `direction`, in place of resisting.
    fn works_along(&self, p: &Projection, direction: &[f64], probe: &mut dyn FnMut(usize, bool) -> Vec<f64>) -> bool {
        let (mut resisted, mut size) = (0.0f64, 0.0f64);
        for (slot, test) in self.moves {
            let (ahead, behind) = (probe(*slot, true), probe(*slot, false));
            let along = |v: &[f64]| v[p.output..][..p.n].iter().zip(direction).map(|(a, b)| a * b).sum::<f64>();
            let work = self.flux[*test] * (along(&ahead) - along(&behind));
            resisted += work;
            size += work.abs();
        }
        resisted < -SIGNLESS * size
    }
}

/// True for what is no displacement: a gradient or a multiplier of the scene.
fn is_traction(fields: &[Field], slot: &InputSlot) -> bool {
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
