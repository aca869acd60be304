//! What a contact law says of gap and traction, found from the arguments of its projections.
//!
//! The argument of a contact projection is `gamma g - s`: a gap times a stiffness, and the traction of a method that
//! has one (the stress of Nitsche's, the multiplier of an augmentation). With gradients and multipliers set to zero the
//! first part remains, and gamma is its slope in the displacement. So penetration, motion at points that stick and
//! tractions outside the cone are known without knowing the method. The slope is that of the length of the argument along the
//! displacement that changes it most, so that lengths do not depend on the axes. A second look (`careful.rs`) sees laws that
//! this is not true of.

use std::{cell::OnceCell, collections::BTreeMap};

use wfl_compiler::{
    Projection, ProjectionKind, interpret_lanes,
    ir::LANES,
    types::{BasisSlot, FieldKind, FieldOp, InputSlot, Side},
};

mod work;

use work::{Motion, STILL, works_along};

use super::{
    Contact, ContactTerm,
    alternation::{Alternation, PointGraph},
    careful::{Careful, gap_of},
    regularisation::AS_WRITTEN,
    slopes::{is_displacement, is_traction},
};
use wfl_discrete::assemble::{AssembledTerm, Bound, FieldValues, Workspace};
use wfl_discrete::field::Field;
use wfl_discrete::finite::largest;
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
    /// At some points the law has a normal of its own that turns with the bodies: there neither gaps nor tractions are
    /// known; found by a careful look alone.
    pub turns: bool,
    /// Pressures that alternate from point to point.
    pub alternates: Option<Alternation>,
    /// Overlap and sliding of points that stick (length) where the law is that of an elastic joint, which are neither; found
    /// by a careful look alone.
    pub strained: [f64; 2],
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

/// How contact is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// As if every law were one of contact without initial stresses, with the normal of the mesh.
    Quick,
    /// Careful: sees cohesion, initial stresses and normals that turn with the bodies. Costs several times as much.
    Careful,
}

/// A point slides if more than this part of its slip is beyond the friction bound: the larger part of the slip decides.
const MOSTLY: f64 = 0.5;
/// A traction along the face may leave the cone by this part of the pressure: it is made of the same stresses, which a mesh
/// of few faces a zone of contact has to a tenth. Beside a small friction bound that is much.
const BETWEEN: f64 = 0.1;
/// Roundoff of a difference of displacements and of the stresses beside it, in parts of the largest displacement: some
/// tens of operations, each rounded.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Overlap, or sliding of points that stick, beyond this part of the largest displacement (beside a common motion) may be that of an elastic joint:
/// what is below is told in any case, and what is looked at twice costs another evaluation of the law.
const STRAINED: f64 = 0.1;

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
    strained: [f64; 2],
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
    /// Without gradients the law has another normal: gap and traction are not known apart.
    turns: bool,
    /// What a mesh may leave of a traction along the face (in the unit of the argument).
    left: f64,
    /// A pressure whose force pulls.
    pulls: bool,
}

impl Violations {
    /// From the points that this rank has counted to those of all ranks.
    fn of_all(&mut self, team: &dyn Team) {
        let [overlaps, slips] = self.strained;
        let mut sizes = [self.penetration, self.drift, overlaps, slips];
        team.max(&mut sizes);
        let [penetration, drift, overlaps, slips] = sizes;
        (self.penetration, self.drift, self.strained) = (penetration, drift, [overlaps, slips]);
        let parts = [&mut self.pulled, &mut self.driven, &mut self.cone];
        let mut sums: Vec<f64> = parts.iter().flat_map(|share| [share.part, share.whole]).collect();
        team.sum(&mut sums);
        parts
            .into_iter()
            .zip(sums.as_chunks().0)
            .for_each(|(share, [part, whole])| *share = Share { part: *part, whole: *whole });
    }

    /// Ends a point: its overlap, and its sliding if it sticks.
    fn take_lengths(&mut self) -> [f64; 2] {
        [&mut self.penetration, &mut self.drift].map(std::mem::take)
    }

    /// Takes in what [`Self::take_lengths`] gave at the points; `is_elastic` where the law is that of an elastic joint.
    fn add_lengths(&mut self, lengths: &[[f64; 2]], is_elastic: &[bool]) {
        for (point, [overlap, slip]) in lengths.iter().enumerate() {
            if is_elastic.get(point) == Some(&true) {
                self.strained = [self.strained[0].max(*overlap), self.strained[1].max(*slip)];
            } else {
                (self.penetration, self.drift) = (self.penetration.max(*overlap), self.drift.max(*slip));
            }
        }
    }

    fn add_normal(&mut self, at: &Point<'_>) {
        if !at.turns {
            self.penetration = at.gap.iter().fold(self.penetration, |m, g| m.max(g / at.slope));
        }
        // one number that is positive is a pressure
        if matches!(at.x, [x] if *x > 0.0) {
            self.pulled.add(at.weight, at.pulls);
        }
    }

    fn add_tangential(&mut self, at: &Point<'_>, radius: f64, drives: impl FnOnce(&[f64]) -> Option<bool>) {
        // of sides that move as one the argument is what rounding leaves of the motion, and so is the bound
        if radius <= ROUNDING * self.moved * at.slope {
            return;
        }
        if at.turns {
            drives(at.x).into_iter().for_each(|drives| self.driven.add(at.weight, drives));
            return;
        }
        // where most of the slip is elastic its direction is that of an error of the mesh, as at a point that has stopped
        let slides = norm(at.x) - radius > MOSTLY * norm(at.gap);
        let slips = slides && norm(at.gap) > STILL * self.moved * at.slope;
        if norm(at.x) <= radius {
            self.drift = self.drift.max(norm(at.gap) / at.slope);
        }
        // friction resists what slides, and holds what sticks with the traction of the law
        let drives = drives(if slips { at.gap } else { at.x });
        drives.into_iter().for_each(|drives| self.driven.add(at.weight, drives));
        let traction = norm(&at.x.iter().zip(at.gap).map(|(x, g)| x - g).collect::<Vec<f64>>());
        self.cone.whole += at.weight * traction.max(radius);
        self.cone.part += at.weight * (traction - radius - at.left).max(0.0);
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

/// How far bodies have moved.
#[derive(Clone, Copy, Debug)]
pub struct Moved<'a> {
    /// By body its largest displacement, with those that it meets, on any rank; zero for what is no displacement.
    pub by_body: &'a [f64],
    /// The same beside a motion that all of them have in common.
    pub beside: &'a [f64],
    /// What is no more than rounding of positions.
    pub least: f64,
}

/// How far the bodies of a term have moved (lengths).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ways {
    /// The largest displacement.
    pub largest: f64,
    /// What overlap and sliding are compared with: of a law between two bodies what these do beside a motion that they have in
    /// common, else the largest displacement.
    pub compared: f64,
}

impl Moved<'_> {
    /// How far the bodies that a term acts on have moved, on any rank; none where that is rounding.
    fn of_term(&self, system: &System, term: usize) -> Option<Ways> {
        let is_vector = |field: usize| system.fields[field].n_components == system.mesh.dim();
        let between = is_between(system, term, |field| is_vector(field) && system.range(field).is_some());
        let term = &system.terms[term];
        let most = |by_body: &[f64]| {
            // where each field is one body, nobody has to look at dofs
            if by_body.len() == system.fields.len() {
                return largest(term.coupled_fields().map(|field| by_body[field.index()]));
            }
            let own = term.dofs().into_iter().map(|dof| by_body[system.body_of(dof as usize)]);
            system.team().largest(largest(own))
        };
        let largest = most(self.by_body);
        let compared = if between { most(self.beside) } else { largest };
        (largest > self.least).then_some(Ways { largest, compared })
    }
}

/// True if a term reads and moves what `moves` says of fields on both of its sides: what a law between two bodies does.
#[must_use]
pub fn is_between(system: &System, term: usize, moves: impl Fn(usize) -> bool) -> bool {
    let law = &system.terms[term].law;
    let slots = || law.tests.iter().chain(&law.trials);
    let has = |side: Side| slots().any(|t| t.side == side && moves(t.field.index()));
    has(Side::Here) && has(Side::There)
}

/// What each contact law leaves of gaps and friction cones at `u`, with the name of its term and how far its
/// bodies have moved; where they have not moved it is left out. A law that moves nothing itself is left out beside one that does, and
/// so are laws on cells, and laws that push nothing ([`ContactTerm::pushes`]). Of a law whose images follow the bodies it is
/// what their rays tell (`following.rs`).
#[must_use]
pub fn contact_gaps<'a>(
    system: &'a System,
    contact: &Contact,
    u: &[f64],
    moved: Moved<'_>,
    look: Look,
) -> Vec<(&'a str, Ways, ContactGaps)> {
    let values = system.values_with(u, contact.active_set());
    let some_act = contact.terms().iter().any(|term| term.acts_on_displacements(system));
    let counts = |t: &&ContactTerm| {
        let acts = if some_act { t.acts_on_displacements(system) } else { t.pushes(system) };
        acts && !t.on_cells()
    };
    let still = vec![0.0; if look == Look::Careful { u.len() } else { 0 }];
    let of = |t: &ContactTerm| {
        let (name, moved) = (system.terms[t.term].law.name.as_str(), moved.of_term(system, t.term)?);
        let data = t.as_written_near(system, values.view(), AS_WRITTEN);
        let mut current: Vec<&[f64]> = values.current.clone();
        data.stand_in(t.field, &mut current);
        let written = FieldValues { current: &current, ..values.view() };
        if t.moves() {
            return Some((name, moved, t.gaps_of_images(system, written)));
        }
        let careful = (look == Look::Careful).then(|| {
            let rest = system.values_with(&still, contact.active_set());
            t.look(system, written, rest.view())
        });
        Some((name, moved, t.gaps(system, written, moved, careful.as_ref())))
    };
    contact.terms().iter().filter(counts).filter_map(of).collect()
}

impl ContactTerm {
    /// The violations at a state at which the bodies have moved so far; `values` has the branches of the law as written.
    fn gaps(&self, system: &System, values: FieldValues<'_>, ways: Ways, careful: Option<&Careful>) -> ContactGaps {
        let largest = self.stiffnesses(system, values);
        let fluxes = self.own_fluxes(system, values, careful);
        let motions = self.motions(system);
        let gap_motions = self.gap_motions(&motions);
        let mut found = Violations { moved: ways.largest, ..Violations::default() };
        let mut faces = FaceCount::new(self.counted_faces());
        let (mut point, mut pressures) = (0, Vec::new());
        let mut lengths = vec![[0.0; 2]; fluxes.len()];
        // laws with tractions of the bodies or multipliers are ones of contact
        let may_pull = careful.is_some() && !self.has_traction(&system.fields);
        let resists = OnceCell::new();
        let is_meant_to_pull = |point: usize| {
            let by_point = || self.resists_closing(system, values, fluxes.len(), ways.compared);
            may_pull && resists.get_or_init(by_point)[point]
        };
        self.arguments(system, values, |full, gap, slopes| {
            let Some((flux, weight)) = fluxes.get(point) else { return };
            point += 1;
            pressures.push((self.pressure(full, &largest), weight.abs()));
            if !self.counts(point - 1) {
                return;
            }
            let (mut presses, mut pressure) = (false, 0.0f64);
            let turns = careful.is_some_and(|careful| careful.turns[point - 1]);
            let each = self.projections.iter().enumerate().zip(&largest).zip(&motions);
            for (((k, p), slope), motions) in each.filter(|((_, s), _)| **s > 0.0) {
                let across: &[&[Motion]] = if p.kind == ProjectionKind::Ball { &gap_motions } else { &[] };
                let mut works_along = |direction: &[f64]| works_along(flux, motions, direction, &slopes(), across);
                let gap = gap_of(careful, point - 1, gap, p);
                let x = &full[p.output..][..p.n];
                let left = if careful.is_some() { BETWEEN * pressure } else { 0.0 };
                let presses_here = p.kind == ProjectionKind::HalfLine && matches!(x, [x] if *x > 0.0);
                let pulls = presses_here && works_along(&[1.0]) == Some(true);
                let at = Point { x, gap: &gap, slope: *slope, weight: weight.abs(), turns, left, pulls };
                match p.kind {
                    // a part of a friction bound is no gap, and what grows as the sides part is no contact
                    ProjectionKind::HalfLine if !p.acts || careful.is_some_and(|careful| !careful.closes[k]) => {}
                    // an attraction, or what weakens one, is no gap
                    ProjectionKind::HalfLine if pulls && is_meant_to_pull(point - 1) => {}
                    ProjectionKind::HalfLine => {
                        pressure = pressure.max(if p.n == 1 { at.x[0] } else { 0.0 });
                        presses |= p.n == 1 && at.x[0] > STILL * ways.largest * slope;
                        found.add_normal(&at);
                    }
                    ProjectionKind::Ball => {
                        found.add_tangential(&at, full[p.output + p.n], works_along);
                    }
                }
            }
            faces.add_point(presses);
            lengths[point - 1] = found.take_lengths();
        });
        let is_doubtful = |[a, b]: &[f64; 2]| careful.is_some() && a.max(*b) > STRAINED * ways.compared;
        let doubtful: Vec<bool> = lengths.iter().map(is_doubtful).collect();
        let scales = [ways.compared, careful.map_or(0.0, |careful| careful.initial)];
        found.add_lengths(&lengths, &self.elastic_joint(system, values, &doubtful, scales));
        let turns = careful.is_some_and(|careful| careful.turns.contains(&true));
        ContactGaps { turns: system.team().any(turns), ..self.of_all_ranks(system, found, faces.pressed, &pressures) }
    }

    /// What was found at the points of all ranks, but for normals that turn.
    fn of_all_ranks(
        &self,
        system: &System,
        mut found: Violations,
        faces: PressedFaces,
        pressures: &[(f64, f64)],
    ) -> ContactGaps {
        let faces = faces.of_all(system.team());
        found.of_all(system.team());
        ContactGaps {
            alternates: if faces.some > 0 { self.alternation(system, pressures) } else { None },
            pressed: faces,
            turns: false,
            penetration: found.penetration,
            drift: found.drift,
            strained: found.strained,
            pulled: found.pulled.value(),
            driven: found.driven.value(),
            cone: found.cone.value().filter(|_| self.has_friction() && self.has_traction(&system.fields)),
        }
    }

    /// The forces of the term by test slot at every point, with its weight; to a careful look less what they are without its
    /// projections.
    fn own_fluxes(&self, system: &System, values: FieldValues<'_>, careful: Option<&Careful>) -> Vec<(Vec<f64>, f64)> {
        let (mut fluxes, term) = (Vec::new(), &system.terms[self.term]);
        term.for_each_flux(&system.mesh, values, |flux, weight| fluxes.push((flux.to_vec(), weight)));
        if let Some(careful) = careful {
            let own = fluxes.iter_mut().zip(&careful.open);
            own.for_each(|((flux, _), open)| flux.iter_mut().zip(open).for_each(|(f, open)| *f -= open));
        }
        fluxes
    }

    /// The zigzag of the pressures at the points, each with its weight. Made by all ranks together.
    fn alternation(&self, system: &System, pressures: &[(f64, f64)]) -> Option<Alternation> {
        let graph = self.graph.get_or_init(|| PointGraph::new(&system.mesh, &self.sampled.domain));
        graph.alternation(pressures, |point| self.counts(point), system.team())
    }

    /// What the first projection on a half line that acts gives at a point: the pressure.
    fn pressure(&self, full: &[f64], slopes: &[f64]) -> f64 {
        let acts = |(p, slope): &(&Projection, &f64)| {
            p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts && **slope > 0.0
        };
        self.projections.iter().zip(slopes).find(acts).map_or(0.0, |(p, _)| full[p.output].max(0.0))
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

    /// True if the force of a term acts on displacements, so that it can be judged by what it does to them. Where the
    /// argument depends on vectors of the space, these are the displacements: a heat that flows across a pressed face acts
    /// on a temperature that strains the bodies, too.
    fn acts_on_displacements(&self, system: &System) -> bool {
        let (dim, tests) = (system.mesh.dim(), &system.terms[self.term].law.tests);
        let moves = self.law.law.inputs.iter().filter_map(|slot| match slot {
            InputSlot::Field(b) if is_displacement(&system.fields, b) => Some(b),
            _ => None,
        });
        let is_vector = |b: &&BasisSlot| system.fields[b.field.index()].n_components == dim;
        let vectors = moves.clone().any(|b| is_vector(&b));
        moves.filter(|b| !vectors || is_vector(b)).any(|b| tests.contains(b))
    }

    /// True if the law is one of contact: its force acts on displacements that it reads, or it is the equation of a
    /// multiplier, of a field that is tested with values on faces alone. The aperture of a flow along a fault pushes
    /// nothing: its term is tested with gradients of the pressure.
    #[must_use]
    pub fn pushes(&self, system: &System) -> bool {
        if self.acts_on_displacements(system) {
            return true;
        }
        let is_multiplier = |f: usize| {
            let mut all = system.terms.iter().filter(|t| t.law.tests.iter().any(|s| s.field.index() == f));
            let alone = |t: &AssembledTerm| {
                !t.on_cells() && t.law.tests.iter().all(|s| s.field.index() != f || s.op == FieldOp::Value)
            };
            system.fields[f].kind == FieldKind::Multiplier || all.all(alone)
        };
        system.terms[self.term].law.tests.iter().any(|slot| is_multiplier(slot.field.index()))
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

    /// Of the motions of all projections those of the gaps.
    fn gap_motions<'m>(&self, motions: &'m [Vec<Motion>]) -> Vec<&'m [Motion]> {
        let is_gap = |p: &Projection| p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts;
        let of_gaps = self.projections.iter().zip(motions).filter(|(p, _)| is_gap(p));
        of_gaps.map(|(_, motions)| motions.as_slice()).collect()
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
        let sampled = self.sampled.at(&system.mesh, values.current);
        let bound = Bound { mesh: &system.mesh, domain: &sampled.domain, binding: &sampled.binding };
        let mut workspace = Workspace::default();
        let (n_in, n_out) = (law.inputs.len(), law.kernel.kernel().outputs.len());
        let mut scratch = Vec::new();
        let mut outputs = |inputs: &[[f64; LANES]]| {
            let mut out = vec![[0.0; LANES]; n_out];
            interpret_lanes(&law.kernel, self.law.uniforms(), inputs, &mut scratch, &mut out);
            out
        };
        for (g, group) in sampled.domain.groups.iter().enumerate() {
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

/// The length of a vector, without overflow.
fn norm(v: &[f64]) -> f64 {
    v.iter().fold(0.0f64, |m, x| m.hypot(*x))
}

#[cfg(test)]
mod tests;
