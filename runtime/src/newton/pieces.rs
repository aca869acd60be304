//! Contact by pieces: the projections of a scene held on a branch while the unknowns move, then chosen anew.
//!
//! See `compiler/src/pieces.rs` for the reason. Each projection `t = P(x)` keeps a value `t` at every integration
//! point, the value of its held piece at the present unknowns. The next piece is that of `t + c (x - t)`; `c` is the
//! stiffness of the bodies over the slope of `x` in the displacement, so that the choice does not depend on the
//! penalty, Nitsche or augmentation parameter in `x`. Promises: nothing is remembered but the guides, which depend on
//! the order of the calls only. Does not decide when to stop or to give up: `newton/mod.rs` does.

mod coercivity;
mod compliance;
mod contact;
mod friction;
mod kinks;
mod watched;

pub use coercivity::Coercivity;
pub use contact::ContactGaps;
pub use friction::FrictionWork;
pub(crate) use kinks::{Kinks, Way, next_kinks};
pub(crate) use watched::search;
pub use watched::{Passed, Watched};

use wfl_compiler::{
    BALL_NUMBERS, Projection, ProjectionKind, interpret,
    ir::LANES,
    types::{FieldKind, FieldOp, InputSlot},
};

use crate::{
    assemble::{AssembledTerm, Bound, FieldValues, Workspace},
    csr::Csr,
    field::Field,
    mesh::Mesh,
    system::FIXED,
    value::{Sampled, Value},
};

/// The stiffness that the choice of pieces works with, in units of the nodal stiffness over the area of an entity.
/// Values from 0.1 to 3 serve alike (`docs/newton.md`).
const STIFFNESS_FACTOR: f64 = 1.0;
/// Where the nodal stiffness is more than this times what the bodies give way with to forces at random, some of their
/// directions are locked (nearly incompressible, a body far softer than the other): what they give way with counts then,
/// times a factor. In other bodies the ratio is from 2 to 40.
const LOCKED: f64 = 100.0;
const GIVING_WAY: f64 = 3.0;
/// After so many choices in a step the stiffness grows by a factor each time, up to a bound: what is left then are
/// directions of slip, which converge faster near the arguments as written.
const SETTLED_CHOICES: usize = 2;
const STIFFNESS_GROWTH: f64 = 3.0;
const LARGEST_GROWTH: f64 = 10.0;
/// Points at which the slope of an argument is sampled.
const SLOPE_POINTS: usize = 64;
/// Change of the displacement for that slope, over the size of an entity.
const SLOPE_STEP: f64 = 1e-3;
/// Below this `c` contact is stiff against the bodies.
const HARD: f64 = 0.1;
/// The stiffness of the layer between the sides while contact is soft, in units of that of the bodies.
const LAYER: f64 = 0.3;
/// Contact without a multiplier binds the stresses of the bodies where the terms on faces are this many times as stiff as
/// the bodies there while arguments are softer than the bodies by this factor.
const STIFF_FACES: f64 = 10.0;
const SOFT_ARGUMENTS: f64 = 100.0;
/// Part of the argument across the direction of slip that a point keeps which slides at twice its bound.
const ACROSS: f64 = 0.5;
/// Bounds of `c`.
const RATIO_RANGE: (f64, f64) = (1e-13, 1e13);

/// The held form of one term.
pub struct TermPieces {
    /// Position of the term in the system.
    pub term: usize,
    /// The term with its pieces held.
    pub held: AssembledTerm,
    /// The number of the field of its guides, behind those of the scene.
    pub field: usize,
    projections: Vec<Projection>,
    n_guides: usize,
    watch: Value,
    sampled: Sampled,
    /// By projection: `c`, and the slope of its argument in the displacement.
    ratios: Vec<f64>,
    slopes: Vec<f64>,
    /// Factor on `c` where it is below 1, and its inverse where it is above.
    growth: f64,
    /// Factor on the radius of balls: below 1 while friction is brought in step by step.
    friction: f64,
    /// Contact is so stiff against the bodies that making it soft for a while helps.
    hard: bool,
    /// Contact is so soft as written, and its linear part so stiff, that it binds the stresses of the bodies.
    binds: bool,
    /// Contact is soft for now.
    soft: bool,
    /// The stiffness of the bodies, force by displacement and area; 0 until it is known.
    stiffness: f64,
    /// Traction may exceed its bound by so much of that stiffness times what passes between the sides.
    overstress: f64,
}

impl TermPieces {
    /// Held pieces of the term at position `term`, guided by the values of field number `field`.
    #[must_use]
    pub fn new(
        term: usize,
        held: AssembledTerm,
        field: usize,
        projections: Vec<Projection>,
        n_guides: usize,
        (watch, sampled): (Value, Sampled),
    ) -> Self {
        let ratios = vec![1.0; projections.len()];
        let slopes = vec![0.0; projections.len()];
        Self {
            term,
            held,
            field,
            projections,
            n_guides,
            watch,
            sampled,
            ratios,
            slopes,
            growth: 1.0,
            friction: 1.0,
            hard: false,
            binds: false,
            soft: false,
            stiffness: 0.0,
            overstress: 0.0,
        }
    }

    /// Sets the step variable and its increment.
    pub fn set_step(&mut self, time: f64, increment: f64) {
        self.held.set_step(time, increment);
        self.watch.set_step(time, increment);
    }

    /// Fits `c` of each projection to the stiffness of the bodies: that of the linear terms (`bulk`, over the free
    /// dofs, and the place of each dof in it), or the `diagonal` of the cell terms, by dof.
    pub fn fit(
        &mut self,
        mesh: &Mesh,
        fields: &[Field],
        values: FieldValues<'_>,
        diagonal: &[f64],
        (bulk, free): (&Csr, &[u32]),
    ) {
        let dofs = self.held.dofs();
        let stiff: Vec<f64> = dofs.iter().map(|d| diagonal[*d as usize]).filter(|k| *k > 0.0).collect();
        let (area, size) = self.entity_size(mesh, values);
        if stiff.is_empty() || area <= 0.0 {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "a mean")]
        let mean = stiff.iter().sum::<f64>() / stiff.len() as f64;
        let places: Vec<u32> = dofs.iter().map(|d| free[*d as usize]).filter(|f| *f != FIXED).collect();
        let stiffness = match compliance::stiffness(bulk, &places) {
            Some(gives) if mean > LOCKED * gives => GIVING_WAY * gives,
            _ => STIFFNESS_FACTOR * mean,
        };
        let stiffness = stiffness / area;
        let slopes = self.slopes(mesh, fields, values, SLOPE_STEP * size);
        // without a multiplier the traction follows from displacements, and an argument is at least as stiff as it
        let largest = if self.has_multiplier(fields) { RATIO_RANGE.1 } else { 1.0 };
        for (ratio, slope) in self.ratios.iter_mut().zip(&slopes) {
            if *slope > 0.0 && stiffness.is_finite() {
                *ratio = (stiffness / slope).clamp(RATIO_RANGE.0, largest);
            }
        }
        self.hard = self.has_multiplier(fields) || self.ratios.iter().any(|c| *c < HARD);
        self.slopes = slopes;
        self.stiffness = if stiffness.is_finite() { stiffness } else { 0.0 };
        let cells: f64 = dofs.iter().filter(|d| free[**d as usize] != FIXED).map(|d| diagonal[*d as usize]).sum();
        let linear: f64 = places.iter().map(|f| bulk.get(*f as usize, *f as usize)).sum();
        self.binds = largest == 1.0 && linear > STIFF_FACES * cells && self.reach() > SOFT_ARGUMENTS;
    }

    /// The numbers that the choice of pieces depends on, beside the guides.
    #[must_use]
    pub fn memory(&self) -> Vec<f64> {
        let flags = [self.hard, self.binds].map(|f| f64::from(u8::from(f)));
        let numbers = [self.stiffness, self.growth, self.friction].into_iter().chain(flags);
        self.ratios.iter().chain(&self.slopes).copied().chain(numbers).collect()
    }

    /// Takes back numbers given by [`Self::memory`].
    pub fn recall(&mut self, memory: &[f64]) {
        if let [fitted @ .., stiffness, growth, friction, hard, binds] = memory
            && fitted.len() == 2 * self.ratios.len()
        {
            let (ratios, slopes) = fitted.split_at(self.ratios.len());
            self.ratios.copy_from_slice(ratios);
            self.slopes.copy_from_slice(slopes);
            (self.stiffness, self.growth, self.friction) = (*stiffness, *growth, *friction);
            (self.hard, self.binds) = (*hard > 0.5, *binds > 0.5);
        }
    }

    /// Sets the factor on the radius of balls; 1 is the law as written.
    pub fn set_friction(&mut self, factor: f64) {
        self.friction = factor;
    }

    /// True if friction, stiffness and bounds of contact are those of the law as written.
    pub(crate) fn is_as_written(&self) -> bool {
        self.friction == 1.0 && !self.soft && self.overstress == 0.0
    }

    /// True if some projection is on a ball.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.projections.iter().any(|p| p.kind == ProjectionKind::Ball)
    }

    /// Tells how often pieces were chosen in this step.
    pub fn chosen(&mut self, times: usize) {
        let exponent = i32::try_from(times.saturating_sub(SETTLED_CHOICES)).unwrap_or(i32::MAX);
        self.growth = STIFFNESS_GROWTH.powi(exponent).min(LARGEST_GROWTH);
    }

    /// True if the sides are so stiff against each other that making contact soft for a while helps.
    #[must_use]
    pub fn is_hard(&self) -> bool {
        self.hard
    }

    /// True if contact is so soft as written, and its linear part so stiff, that it binds the stresses of the bodies to
    /// its traction: Nitsche with theta = -1 far below E/h.
    #[must_use]
    pub fn binds_stresses(&self) -> bool {
        self.binds
    }

    /// The stiffness of the bodies over the largest slope of an argument in the displacement.
    #[must_use]
    pub fn reach(&self) -> f64 {
        let slope = self.slopes.iter().fold(0.0f64, |m, s| m.max(*s));
        if slope > 0.0 { self.stiffness / slope } else { 0.0 }
    }

    /// Makes contact soft or as written.
    pub fn set_soft(&mut self, soft: bool) {
        self.soft = soft;
    }

    /// Lets traction exceed its bound by this part of the stiffness of the bodies; 0 is the law as written. True if that
    /// is a change.
    pub fn set_overstress(&mut self, part: f64) -> bool {
        let changes = self.overstress != part;
        self.overstress = part;
        changes
    }

    fn has_multiplier(&self, fields: &[Field]) -> bool {
        self.held.coupled_fields().any(|f| fields[f.index()].kind == FieldKind::Multiplier)
    }

    /// Mean measure of an entity and its length.
    fn entity_size(&self, mesh: &Mesh, values: FieldValues<'_>) -> (f64, f64) {
        let mut total = 0.0;
        self.watch.for_each_point(mesh, &self.sampled, values, |_, _, _, weight, _| total += weight);
        let domain = &self.sampled.domain;
        let on_cells = domain.groups.iter().all(|g| g.tangents.is_none());
        let dimension = if on_cells { domain.dim } else { domain.dim.saturating_sub(1).max(1) };
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let area = total / domain.n_entities.max(1) as f64;
        #[expect(clippy::cast_precision_loss, reason = "1, 2 or 3")]
        let size = area.powf(1.0 / dimension as f64);
        (area, size)
    }

    /// By projection: the largest change of its argument when one displacement changes by 1, median of some points.
    fn slopes(&self, mesh: &Mesh, fields: &[Field], values: FieldValues<'_>, step: f64) -> Vec<f64> {
        let law = &self.watch.law;
        let moving: Vec<usize> = (0..law.inputs.len())
            .filter(|k| match law.inputs[*k] {
                // guides are numbered behind the fields
                InputSlot::Field(b) if b.op == FieldOp::Value => {
                    fields.get(b.field.index()).is_some_and(|f| f.kind == FieldKind::Unknown)
                }
                _ => false,
            })
            .collect();
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); self.projections.len()];
        let bound = Bound { mesh, domain: &self.sampled.domain, binding: &self.sampled.binding };
        let mut workspace = Workspace::default();
        let n_in = law.inputs.len();
        let n_out = law.kernel.kernel().outputs.len();
        let (mut scratch, mut base, mut changed) = (Vec::new(), vec![0.0; n_out], vec![0.0; n_out]);
        for (g, group) in self.sampled.domain.groups.iter().enumerate() {
            let stride = (group.n_batches() * group.n_points()).div_ceil(SLOPE_POINTS).max(1);
            for at in (0..group.n_batches() * group.n_points()).step_by(stride) {
                let (batch, q) = (at / group.n_points(), at % group.n_points());
                workspace.prepare(bound, g, batch, values);
                let mut inputs: Vec<f64> = (0..n_in).map(|s| workspace.inputs[(q * n_in + s) * LANES]).collect();
                interpret(&law.kernel, self.watch.uniforms(), &inputs, &mut scratch, &mut base);
                let mut largest = vec![0.0f64; self.projections.len()];
                for k in &moving {
                    let kept = inputs[*k];
                    inputs[*k] = kept + step;
                    interpret(&law.kernel, self.watch.uniforms(), &inputs, &mut scratch, &mut changed);
                    inputs[*k] = kept;
                    for (p, slot) in self.projections.iter().zip(&mut largest) {
                        let change = (p.output..p.output + p.n).map(|o| (changed[o] - base[o]).abs() / step);
                        *slot = change.fold(*slot, f64::max);
                    }
                }
                found.iter_mut().zip(largest).for_each(|(list, x)| list.push(x));
            }
        }
        found.into_iter().map(median).collect()
    }

    /// The pieces of the term as it is written at this state: a start without a past.
    ///
    /// Inner projections enter the radius of outer ones, so the watch is read as often as they can be nested.
    pub fn start(&self, mesh: &Mesh, values: FieldValues<'_>, guides: &mut Vec<f64>) {
        *guides = self.no_guides();
        for _ in 0..self.projections.len() {
            let mut current: Vec<&[f64]> = values.current.to_vec();
            current[self.field] = guides;
            let watched = self.watched(mesh, FieldValues { current: &current, ..values });
            let next = self.choose(&watched, guides, true);
            if next == *guides {
                break;
            }
            *guides = next;
        }
    }

    /// Ties points (closed and sticking) if the term as written is open everywhere and no point is further away than
    /// the mesh is large; the start of a scene in which contact closes. `moved` is how far the sides can come near each
    /// other by what is prescribed, in units of length: points further apart stay open, unless all are. True if it did.
    ///
    /// A tied zone that is too wide opens by about one ring of entities an iteration, so that it is worth to be near.
    pub fn tie(&self, mesh: &Mesh, values: FieldValues<'_>, guides: &mut [f64], moved: f64) -> bool {
        let (low, high) = mesh.bounds();
        let reach = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let half_lines =
            || self.projections.iter().zip(&self.slopes).filter(|(p, _)| p.acts && p.kind == ProjectionKind::HalfLine);
        let mut open = half_lines().next().is_some();
        let mut near = Vec::new();
        self.watch.for_each_point(mesh, &self.sampled, values, |_, _, _, _, out| {
            let within = |limit: f64| {
                let close =
                    |p: &Projection, slope: f64| out[p.output..][..p.n].iter().all(|x| *x < 0.0 && -x <= limit * slope);
                half_lines().all(|(p, slope)| close(p, *slope))
            };
            open &= within(reach);
            near.push(within(moved));
        });
        if open {
            let every = !near.contains(&true);
            for (point, _) in guides.chunks_exact_mut(self.n_guides).zip(&near).filter(|(_, near)| every || **near) {
                self.tie_point(point);
            }
        }
        open
    }

    /// Ties every point, wherever it is.
    pub(crate) fn tie_all(&self, guides: &mut [f64]) {
        guides.chunks_exact_mut(self.n_guides).for_each(|point| self.tie_point(point));
    }

    /// Lets every point slide, closed as it is: along the argument that is watched there, where that has a direction.
    pub(crate) fn slide_all(&self, watched: &Watched, guides: &mut [f64]) {
        for (guides, out) in guides.chunks_exact_mut(self.n_guides).zip(watched.points()) {
            for p in self.projections.iter().filter(|p| p.kind == ProjectionKind::Ball) {
                let x = &out[p.output..][..p.n];
                let length = x.iter().fold(0.0f64, |m, x| m.hypot(*x));
                let (numbers, along) = guides[p.guide..].split_at_mut(BALL_NUMBERS);
                (numbers[0], numbers[1], numbers[2]) = (0.0, ACROSS, 1.0);
                for (slot, x) in along.iter_mut().zip(x) {
                    *slot = if length > 0.0 && length.is_finite() { x / length } else { 0.0 };
                }
            }
        }
    }

    /// Closed and sticking.
    fn tie_point(&self, point: &mut [f64]) {
        for p in &self.projections {
            match p.kind {
                ProjectionKind::HalfLine => point[p.guide..][..p.n].fill(1.0),
                ProjectionKind::Ball => point[p.guide] = 1.0,
            }
        }
    }

    /// Writes the present softness and overstress into the guides, pieces as they are.
    pub fn write_softness(&self, guides: &mut [f64]) {
        for point in guides.chunks_exact_mut(self.n_guides) {
            for (k, p) in self.projections.iter().enumerate() {
                let at = match p.kind {
                    ProjectionKind::HalfLine => p.guide + p.n,
                    ProjectionKind::Ball => p.guide + 3,
                };
                point[at] = self.softness(k);
                point[at + 1] = self.beyond(k);
            }
        }
    }

    /// Points whose pieces differ: open or closed, stick or slip, slip against itself.
    #[must_use]
    pub fn differing(&self, a: &[f64], b: &[f64]) -> usize {
        let differs = |p: &Projection, a: &[f64], b: &[f64]| match p.kind {
            ProjectionKind::HalfLine => a[p.guide..][..p.n] != b[p.guide..][..p.n],
            ProjectionKind::Ball => {
                let along = BALL_NUMBERS + p.guide..BALL_NUMBERS + p.guide + p.n;
                let product: f64 = a[along.clone()].iter().zip(&b[along]).map(|(a, b)| a * b).sum();
                a[p.guide] != b[p.guide] || (a[p.guide] < 0.5 && product < 0.0)
            }
        };
        let points = a.chunks_exact(self.n_guides).zip(b.chunks_exact(self.n_guides));
        points.filter(|(a, b)| self.projections.iter().any(|p| differs(p, a, b))).count()
    }

    /// The pieces that follow from the held ones.
    #[must_use]
    pub fn follow(&self, watched: &Watched, guides: &[f64]) -> Vec<f64> {
        self.choose(watched, guides, false)
    }

    /// The law that watches the arguments of the projections, where it is read, and the projections.
    pub(crate) fn watched_laws(&self) -> (&Value, &Sampled, &[Projection]) {
        (&self.watch, &self.sampled, &self.projections)
    }

    /// True if a ball acts on faces: friction.
    pub(crate) fn has_ball(&self) -> bool {
        !self.held.on_cells() && self.projections.iter().any(|p| p.kind == ProjectionKind::Ball && p.acts)
    }

    /// Guides at an integration point.
    pub(crate) fn guides_at_a_point(&self) -> usize {
        self.n_guides
    }

    /// Guides before any piece is chosen.
    #[must_use]
    pub fn no_guides(&self) -> Vec<f64> {
        vec![0.0; self.n_points() * self.n_guides]
    }

    /// Numbers watched at a point.
    fn n_watched(&self) -> usize {
        self.watch.law.kernel.kernel().outputs.len()
    }

    fn n_points(&self) -> usize {
        self.sampled.domain.groups.iter().map(|g| g.entities.len() * g.n_points()).sum()
    }

    /// `c` of projection `k` at the present choice, for its argument less what softness takes.
    fn ratio(&self, k: usize) -> f64 {
        let ratio = match self.ratios[k] {
            c if c < 1.0 => (c * self.growth).min(1.0),
            c => (c / self.growth).max(1.0),
        };
        ratio / (1.0 - self.softness(k))
    }

    /// The part of the argument of projection `k` that softness takes.
    fn softness(&self, k: usize) -> f64 {
        if self.soft && self.slopes[k] > 0.0 { 1.0 / (1.0 + LAYER * self.ratios[k]) } else { 0.0 }
    }

    /// The part of the argument beyond its bound that overstress keeps in the value of projection `k`. What passes
    /// between the sides is what the value lacks of the argument, over its slope.
    fn beyond(&self, k: usize) -> f64 {
        let viscous = self.overstress * self.stiffness;
        if viscous > 0.0 && self.slopes[k] > 0.0 { viscous / (viscous + self.slopes[k]) } else { 0.0 }
    }

    /// Displacement by traction that `c` of projection `k` stands for; 1 where it does not depend on displacements.
    fn flexibility(&self, k: usize) -> f64 {
        let stiffness = self.ratios[k] * self.slopes[k];
        if stiffness > 0.0 { 1.0 / stiffness } else { 1.0 }
    }

    fn choose(&self, watched: &Watched, guides: &[f64], as_written: bool) -> Vec<f64> {
        let mut next = guides.to_vec();
        let mut x = Vec::new();
        for (guides, out) in next.chunks_exact_mut(self.n_guides).zip(watched.points()) {
            for (j, p) in self.projections.iter().enumerate() {
                let ratio = if as_written { 1.0 } else { self.ratio(j) };
                let softness = if as_written { 0.0 } else { self.softness(j) };
                x.clear();
                x.extend(out[p.output..][..p.n].iter().map(|x| (1.0 - softness) * x));
                match p.kind {
                    ProjectionKind::HalfLine => {
                        let t = &out[p.output + p.n..][..p.n];
                        for k in 0..p.n {
                            let y = if as_written { x[k] } else { t[k] + ratio * (x[k] - t[k]) };
                            guides[p.guide + k] = f64::from(u8::from(y >= 0.0));
                        }
                        guides[p.guide + p.n] = softness;
                        guides[p.guide + p.n + 1] = if as_written { 0.0 } else { self.beyond(j) };
                    }
                    ProjectionKind::Ball => {
                        let radius = self.friction * out[p.output + p.n];
                        let t = if as_written { &x[..] } else { &out[p.output + p.n + 1..][..p.n] };
                        let guides = &mut guides[p.guide..][..BALL_NUMBERS + p.n];
                        ball(&x, t, radius, ratio, guides);
                        guides[2] = self.friction;
                        guides[3] = softness;
                        guides[4] = if as_written { 0.0 } else { self.beyond(j) };
                    }
                }
            }
        }
        next
    }
}

/// The piece of a ball projection: `s, k, -, -, e` from the argument `x`, the value `t`, the radius and `c`.
///
/// Of `t + dt = P(y) + P'(y) (dy)`, y = t + c (x - t), solved for t + dt: the part of t across y drops out, because y
/// has none.
fn ball(x: &[f64], t: &[f64], radius: f64, ratio: f64, guides: &mut [f64]) {
    let (numbers, along) = guides.split_at_mut(BALL_NUMBERS);
    for (k, y) in along.iter_mut().enumerate() {
        *y = t[k] + ratio * (x[k] - t[k]);
    }
    let largest = along.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    let reduced = if largest > 0.0 { along.iter().map(|y| (y / largest).powi(2)).sum::<f64>().sqrt() } else { 0.0 };
    let stick = radius >= 0.0 && (largest == 0.0 || reduced <= radius / largest);
    numbers[0] = f64::from(u8::from(stick));
    numbers[1] = 0.0;
    if largest > 0.0 {
        along.iter_mut().for_each(|y| *y = *y / largest / reduced);
    }
    if stick || radius <= 0.0 {
        return;
    }
    let k0 = radius / largest / reduced;
    numbers[1] = ratio * k0 / (1.0 - k0 + ratio * k0);
}

fn median(mut list: Vec<f64>) -> f64 {
    list.sort_by(f64::total_cmp);
    list.get(list.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(x: &[f64], radius: f64, guides: &[f64]) -> Vec<f64> {
        let n = x.len();
        let e = &guides[BALL_NUMBERS..];
        if guides[0] > 0.5 {
            return x.to_vec();
        }
        let along: f64 = x.iter().zip(e).map(|(x, e)| x * e).sum();
        (0..n).map(|k| radius * e[k] + guides[1] * (x[k] - along * e[k])).collect()
    }

    fn projection(x: &[f64], radius: f64) -> Vec<f64> {
        let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let factor = if norm <= radius { 1.0 } else { radius / norm };
        x.iter().map(|x| factor * x).collect()
    }

    fn piece(x: &[f64], t: &[f64], radius: f64, ratio: f64) -> Vec<f64> {
        let mut guides = vec![0.0; BALL_NUMBERS + x.len()];
        ball(x, t, radius, ratio, &mut guides);
        guides
    }

    fn gap(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    const STATES: [([f64; 3], f64); 4] =
        [([3.0, -4.0, 1.0], 2.0), ([0.3, 0.1, -0.2], 2.0), ([0.0, 2.0, 0.1], 0.5), ([-7.0, 0.0, 0.0], 6.9)];

    #[test]
    fn a_settled_projection_keeps_its_value_for_every_ratio() {
        for (x, radius) in STATES {
            let t = projection(&x, radius);
            for ratio in [1e-8, 1e-3, 1.0, 20.0, 1e6] {
                let guides = piece(&x, &t, radius, ratio);
                assert!(gap(&value(&x, radius, &guides), &t) < 1e-14, "{x:?} {ratio}");
            }
        }
    }

    #[test]
    fn a_settled_piece_is_the_tangent_of_the_projection() {
        for (x, radius) in STATES {
            let t = projection(&x, radius);
            for ratio in [1e-3, 1.0, 50.0] {
                let guides = piece(&x, &t, radius, ratio);
                let moved = |s: f64| [x[0] + 2.0 * s, x[1] - s, x[2] + 3.0 * s];
                let error = |s: f64| gap(&value(&moved(s), radius, &guides), &projection(&moved(s), radius));
                assert!(error(1e-4) < 1e-6 && error(1e-5) < 1e-8, "{x:?} {ratio}: second order");
            }
        }
    }

    #[test]
    fn a_piece_solves_the_linearised_equation() {
        // t = P(t + c (x - t)) about a state that is not settled: the exact derivative of P makes the residual of the
        // linear equation vanish
        let (x, t, radius, ratio) = ([3.0, 1.0], [0.4, -0.9], 1.0, 0.3);
        let guides = piece(&x, &t, radius, ratio);
        let y: Vec<f64> = (0..2).map(|k| t[k] + ratio * (x[k] - t[k])).collect();
        let found = value(&x, radius, &guides);
        let step: Vec<f64> = (0..2).map(|k| found[k] - t[k]).collect();
        let along = |s: f64| -> Vec<f64> { (0..2).map(|k| y[k] + s * (1.0 - ratio) * step[k]).collect() };
        let (a, b) = (projection(&along(1e-6), radius), projection(&along(-1e-6), radius));
        let base = projection(&y, radius);
        for k in 0..2 {
            let linear = base[k] + (a[k] - b[k]) / 2e-6;
            assert!((found[k] - linear).abs() < 1e-8, "entry {k}: {} against {linear}", found[k]);
        }
    }

    #[test]
    fn an_open_or_resting_point_has_a_piece() {
        let open = piece(&[1.0, 0.0], &[0.0, 0.0], 0.0, 0.1);
        assert_eq!(value(&[1.0, 0.0], 0.0, &open), [0.0, 0.0]);
        let rest = piece(&[0.0, 0.0], &[0.0, 0.0], 0.0, 0.1);
        assert!(rest[0] > 0.5, "the tie sticks");
        assert_eq!(value(&[0.0, 0.0], -1.0, &piece(&[0.0, 0.0], &[0.0, 0.0], -1.0, 1.0)), [0.0, 0.0]);
        let tiny = piece(&[3e-320, 0.0], &[0.0, 0.0], 1e-321, 1.0);
        assert!(tiny.iter().all(|g| g.is_finite()));
    }
}
