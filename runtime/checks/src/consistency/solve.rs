//! Contact states at a point, and the residuals of the equations there.

use nalgebra::{DMatrix, DVector};
use wfl_compiler::ProjectionKind;

use super::place::{Fluxes, Gradient, Place, State, Vector, root};

/// Strain of the bodies in the states that are tried: small beside 1 for laws of finite strain.
const STRAIN: f64 = 1e-3;
/// Steps to a state that satisfies the equations; they are linear up to the choice of the active set.
const STEPS: usize = 12;
/// What is differentiated, in parts of the sizes of a state: of a law that is not linear a difference misses a part of
/// this size, and rounding leaves ten digits of it.
const PART: f64 = 1e-6;
/// An initial gap that gradients change by less than this part of the overlap of a pressure is one that they do not
/// change: as large as the strain of the states that are tried.
const OPENS: f64 = 1e-3;
/// How far apart bodies are without contact, in units of the overlap of a pressure: so far that no law of contact acts,
/// and near enough for digits of both.
const FAR: f64 = 1e3;
/// What the forces there may differ by at twice the distance to be those of an initial stress, in parts of the pressure:
/// rounding at 1000 times the distance leaves 1e-13 of it, and forces that depend on the distance double.
const CONSTANT: f64 = 1e-9;
/// Doublings and halvings of a length between which an overlap is looked for: 18 orders of magnitude to both sides, so that
/// no unit of a stiffness falls beside.
const WIDEST: i32 = 60;
/// Equations left by no more than this, relative to the sizes of the state, are satisfied: what differences leave.
pub(super) const SATISFIED: f64 = 1e-6;

/// Sizes at a place, and where its contact closes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    /// The pressure of the states (stress).
    pub(super) pressure: f64,
    /// How far the first body is moved along its normal to touch (length).
    pub(super) touching: f64,
    /// The slope of the argument of contact as it moves on; positive where that closes (stress over length, or none where
    /// what is projected is a gap).
    pub(super) slope: f64,
    /// The displacement for which the law gives the pressure.
    length: f64,
    /// A motion of both bodies together.
    shift: f64,
    /// The largest of what is tested with stresses, and of the laws of multipliers, where the bodies press on each
    /// other, pull, are apart or overlap.
    stress: f64,
    law: f64,
    /// What the terms put on each body where they are far apart, without a displacement gradient: the other part of an
    /// initial stress that the terms of the bodies do not have (stress).
    pub(super) background: [Vector; 2],
    /// The gradients with which the bodies balance that: what they have without contact.
    free: [Gradient; 2],
    /// What has to be added to the displacement of the first body along the face so that nothing has slipped on it: an
    /// obstacle moves on its own.
    carried: Vector,
}

impl Sizes {
    /// The displacement for which the law gives the pressure.
    pub(super) fn length(&self) -> f64 {
        self.length
    }
}

/// What the equations leave, each in parts of what it is made of: forces of the traction, the others of their largest
/// size in states nearby.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Left {
    /// Of the balance of each body.
    pub balance: [f64; 2],
    /// Of what is tested with stresses of the test functions.
    pub stress: f64,
    /// Of the laws of multipliers.
    pub law: f64,
}

impl Left {
    /// The largest of all.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.balance[0].max(self.balance[1]).max(self.stress).max(self.law)
    }
}

/// A state of two bodies with a given traction.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub(super) state: State,
    /// On the first body.
    pub(super) traction: Vector,
}

fn scaled(v: &Vector, by: f64) -> Vector {
    v.map(|x| by * x)
}

fn sum(a: &Vector, b: &Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The overlap in which a force has grown by a pressure, whatever the law is written in: a line, a power, an exponential.
/// `step` is some length of the place. Where it never gets there, that of the straight line through the force at `step`;
/// `None` without any.
fn overlap_for(pressure: f64, step: f64, force: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let none = force(0.0)?;
    let first = force(step)? - none;
    let straight = pressure * step / first.abs();
    // the force of a law with a wrong sign grows the other way
    let grown = |by: f64| force(by).map(|f| (f - none) * first.signum()).filter(|f| f.is_finite());
    let is_line = first != 0.0 && grown(straight).is_some_and(|f| (f - pressure).abs() <= SATISFIED * pressure);
    if is_line {
        return Some(straight);
    }
    let halvings = (-WIDEST..=WIDEST).map(|k| step * f64::powi(2.0, k));
    let Some(found) = halvings.into_iter().find(|by| grown(*by).is_some_and(|f| f >= pressure)) else {
        return Some(straight).filter(|by| by.is_finite());
    };
    let (mut low, mut high) = (0.5 * found, found);
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (low + high);
        *(if grown(middle).is_some_and(|f| f >= pressure) { &mut high } else { &mut low }) = middle;
    }
    Some(high)
}

impl Place<'_> {
    /// `None` where no projection closes as the bodies come together.
    pub(super) fn sizes(&self) -> Option<Sizes> {
        let step = STRAIN * self.size;
        let at = |by: f64, free: &[Gradient; 2]| {
            let mut state = self.rest();
            state.bodies[0].value = scaled(&self.normal, by);
            state.bodies[0].before = state.bodies[0].value;
            state.bodies.iter_mut().zip(free).for_each(|(body, free)| body.gradient = *free);
            state
        };
        let still = [[0.0; 9]; 2];
        let argument = |by: f64, free: &[Gradient; 2]| self.contact_argument(&at(by, free));
        let (rest, ahead) = (argument(0.0, &still)?, argument(step, &still)?);
        let slope = (ahead - rest) / step;
        if !(slope.is_finite() && slope != 0.0) {
            return None;
        }
        let pressure = STRAIN * self.stiffness()?;
        // along the normal of an obstacle that curves the gap is no line
        let way =
            |free: &[Gradient; 2]| Some(root(step, |by| argument(by, free)).unwrap_or(-argument(0.0, free)? / slope));
        let touching = way(&still)?;
        let pushes =
            |by: f64| Some(dot(&self.fluxes(&at(slope.signum() * by + touching, &still))?.force[0], &self.normal));
        let length = overlap_for(pressure, step, pushes).unwrap_or(pressure / slope.abs());
        let apart = |gap: f64| Some(self.fluxes(&at(-slope.signum() * gap * length + touching, &still))?.force);
        let (near, far) = (apart(FAR)?, apart(2.0 * FAR)?);
        let stays = near.iter().zip(&far).all(|(a, b)| {
            let change = sum(a, &scaled(b, -1.0));
            dot(&change, &change).sqrt() <= CONSTANT * pressure
        });
        let background = if stays { near } else { [[0.0; 3]; 2] };
        let mut free = still;
        for (body, free) in free.iter_mut().enumerate().take(if self.has_two_bodies() { 2 } else { 1 }) {
            *free = self.gradient(body, &[0.0; 3], &scaled(&background[body], -1.0), &[0.0; 9])?;
        }
        // bodies without contact: their stress may depend on nothing but what they started with
        let touching = way(&free)?;
        let (shift, carried) = ((STRAIN * self.size).min(length), [0.0; 3]);
        let mut sizes =
            Sizes { pressure, touching, slope, length, shift, stress: 0.0, law: 0.0, background, free, carried };
        sizes.carried = self.carried(&sizes)?;
        self.measure(&mut sizes)?;
        Some(sizes)
    }

    /// The motion along the face for which the argument of the first ball vanishes between bodies that touch without
    /// traction; zero where there is none, or where it already does.
    fn carried(&self, sizes: &Sizes) -> Option<Vector> {
        let none = [0.0; 3];
        let state = self.trial(sizes, &none, &none, &none)?.state;
        let argument = |by: &Vector| {
            let mut state = state.clone();
            state.bodies[0].value = sum(&state.bodies[0].value, by);
            let mut found = None;
            self.projections(&state, |p, out| {
                if p.kind == ProjectionKind::Ball {
                    found.get_or_insert_with(|| DVector::from_column_slice(&out[p.output..][..p.n]));
                }
            });
            found
        };
        let Some(rest) = argument(&none) else { return Some(none) };
        let step = sizes.length();
        let mut slope = DMatrix::zeros(rest.len(), 3);
        for k in 0..self.dim {
            let mut by = none;
            by[k] = step;
            // along the face alone
            let by = sum(&by, &scaled(&self.normal, -dot(&by, &self.normal)));
            slope.set_column(k, &((argument(&by)? - &rest) / step));
        }
        if rest.amax().is_nan() || rest.amax() <= SATISFIED * step * slope.amax() {
            return Some(none);
        }
        let Ok(inverse) = slope.clone().pseudo_inverse(1e-9 * slope.amax()) else { return Some(none) };
        let moved = -(inverse * &rest);
        let moved = [moved[0], moved[1], moved[2]];
        let moved = sum(&moved, &scaled(&self.normal, -dot(&moved, &self.normal)));
        let is_still = argument(&moved)?.amax() <= OPENS * rest.amax();
        Some(if is_still && moved.iter().all(|x| x.is_finite()) { moved } else { none })
    }

    /// True if the argument of contact follows a state on the faces, as a gap that wears does.
    pub(super) fn gap_has_state(&self, sizes: &Sizes, state: &State) -> bool {
        let mut other = state.clone();
        other.memory = sizes.length();
        self.contact_argument(&other) != self.contact_argument(state)
    }

    /// What the terms do beside what they do to bodies that are far apart.
    pub(super) fn contact_fluxes(&self, sizes: &Sizes, state: &State) -> Option<Fluxes> {
        let mut fluxes = self.fluxes(state)?;
        let all = fluxes.force.iter_mut().zip(&sizes.background);
        all.for_each(|(force, background)| *force = sum(force, &scaled(background, -1.0)));
        Some(fluxes)
    }

    /// The argument of the half line that acts.
    fn contact_argument(&self, state: &State) -> Option<f64> {
        self.contact_arguments(state).get(self.law).copied()
    }

    /// True if bodies without traction touch where those without displacement do, as far as that matters: where the gap
    /// before is wider than the overlap of the states, and depends on gradients, a gradient alone opens or closes it.
    pub(super) fn touches(&self, sizes: &Sizes) -> Option<bool> {
        let free = self.trial(sizes, &[0.0; 3], &[0.0; 3], &[0.0; 3])?;
        let argument = self.contact_argument(&free.state)?;
        // the argument may be a stress or a gap
        let overlap = (sizes.slope * sizes.length).abs();
        Some(sizes.touching.abs() <= sizes.length || argument.abs() <= OPENS * overlap)
    }

    /// The radius of the ball of friction, and how many balls there are.
    pub(super) fn radius(&self, state: &State) -> (f64, usize) {
        let (mut radius, mut n) = (0.0, 0);
        self.projections(state, |p, out| {
            if p.kind == ProjectionKind::Ball {
                if n == 0 {
                    radius = out[p.output + p.n];
                }
                n += 1;
            }
        });
        (radius, n)
    }

    /// True if contact (or friction) reads stresses of the bodies or multipliers: then it means to carry them.
    pub(super) fn reads_traction(&self, trial: &Trial, kind: ProjectionKind) -> bool {
        let arguments = |state: &State| {
            let mut all = Vec::new();
            self.projections(state, |p, out| {
                if p.kind == kind {
                    all.extend_from_slice(&out[p.output..][..p.n]);
                }
            });
            all
        };
        let mut other = trial.state.clone();
        for body in &mut other.bodies {
            body.gradient.iter_mut().for_each(|g| *g = -*g);
        }
        let stresses = arguments(&trial.state) != arguments(&other);
        other = trial.state.clone();
        other
            .multipliers
            .iter_mut()
            .for_each(|m| *m += trial.traction.iter().fold(1e-300, |s, t| f64::max(s, t.abs())));
        stresses || arguments(&trial.state) != arguments(&other)
    }

    /// A direction in the plane of the face that lies along no axis of it.
    pub(super) fn along(&self) -> Option<Vector> {
        if self.dim < 2 {
            return None;
        }
        let start = if self.dim == 2 { [0.6, 0.8, 0.0] } else { [0.48, 0.6, 0.64] };
        let candidates = [start, [start[1], -start[0], start[2]]];
        let inside = |v: &Vector| sum(v, &scaled(&self.normal, -dot(v, &self.normal)));
        let longest = candidates.iter().map(inside).max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))?;
        Some(scaled(&longest, 1.0 / dot(&longest, &longest).sqrt()))
    }

    /// Bodies with this traction on the first one, displaced by `jump` from touching; `slid` of it since the previous
    /// step. Stresses that the face does not see differ.
    pub(super) fn trial(&self, sizes: &Sizes, traction: &Vector, jump: &Vector, slid: &Vector) -> Option<Trial> {
        let mut state = self.rest();
        let shift = [1.0, -0.7, 0.4].map(|x| sizes.shift * x);
        let opposite = scaled(traction, -1.0);
        let bodies = if self.has_two_bodies() { 2 } else { 1 };
        let common = if bodies == 2 { self.in_space(&shift) } else { [0.0; 3] };
        state.bodies.iter_mut().take(bodies).for_each(|body| body.value = common);
        let first = &mut state.bodies[0].value;
        *first = sum(&sum(first, &scaled(&self.normal, sizes.touching)), jump);
        for body in &mut state.bodies {
            body.before = body.value;
        }
        state.bodies[0].before = sum(&state.bodies[0].before, &scaled(slid, -1.0));
        state.bodies[0].value = sum(&state.bodies[0].value, &sizes.carried);
        for body in 0..bodies {
            let (sign, own) = if body == 0 { (1.0, traction) } else { (-0.6, &opposite) };
            let own = &sum(own, &scaled(&sizes.background[body], -1.0));
            let mut start = sizes.free[body];
            for (k, g) in start.iter_mut().enumerate().take(self.dim * self.dim) {
                *g += STRAIN * sign * [0.3, -0.5, 0.7, 0.2, -0.4, 0.6, -0.1, 0.8, -0.3][k];
            }
            state.bodies[body].gradient = self.gradient(body, &state.bodies[body].value, own, &start)?;
        }
        Some(Trial { state, traction: *traction })
    }

    fn in_space(&self, v: &Vector) -> Vector {
        let mut out = *v;
        out[self.dim..].fill(0.0);
        out
    }

    /// The sizes of what is tested with stresses and multipliers.
    fn measure(&self, sizes: &mut Sizes) -> Option<()> {
        let pressure = sizes.pressure;
        let trial = self.trial(sizes, &scaled(&self.normal, -pressure), &[0.0; 3], &[0.0; 3])?;
        for (stress, gap, multiplier) in
            [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 0.0, 1.0), (1.0, 0.0, -1.0)]
        {
            let mut state = trial.state.clone();
            state.bodies.iter_mut().flat_map(|b| &mut b.gradient).for_each(|g| *g *= stress);
            state.bodies[0].value = sum(&state.bodies[0].value, &scaled(&self.normal, gap * sizes.length()));
            state.multipliers.iter_mut().for_each(|m| *m = multiplier * pressure);
            let found = self.fluxes(&state)?;
            sizes.stress = found.stress.iter().flatten().fold(sizes.stress, |m, x| m.max(x.abs()));
            sizes.law = found.law.iter().fold(sizes.law, |m, x| m.max(x.abs()));
        }
        Some(())
    }

    /// The equations, each divided by its size: balance of both bodies, stresses, laws.
    fn equations(&self, sizes: &Sizes, trial: &Trial, state: &State) -> Option<Vec<f64>> {
        let Fluxes { force, stress, law } = self.contact_fluxes(sizes, state)?;
        let mut left = Vec::new();
        for (body, sign) in [(0, 1.0), (1, -1.0)] {
            let known = body == 0 || self.has_two_bodies();
            left.extend((0..3).map(|k| {
                let own = if known { sign * trial.traction[k] + force[body][k] } else { 0.0 };
                own / sizes.pressure
            }));
        }
        let by = |size: f64| move |x: &f64| if size > 0.0 { x / size } else { 0.0 };
        left.extend(stress.iter().flatten().map(by(sizes.stress)));
        left.extend(law.iter().map(by(sizes.law)));
        Some(left)
    }

    /// What the equations leave of a state.
    pub(super) fn left(&self, sizes: &Sizes, trial: &Trial, state: &State) -> Option<Left> {
        let all = self.equations(sizes, trial, state)?;
        let largest = |part: &[f64]| part.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        Some(Left {
            balance: [largest(&all[..3]), largest(&all[3..6])],
            stress: largest(&all[6..24]),
            law: largest(&all[24..]),
        })
    }

    /// The state with the multipliers that leave the least, and with the displacement of the first body, where that moves:
    /// `start` is where it is tried from.
    pub(super) fn best(&self, sizes: &Sizes, trial: &Trial, start: Option<&Vector>) -> Option<(State, Left)> {
        let mut best: Option<(State, Left)> = None;
        for signs in 0..1usize << self.multipliers().count() {
            let mut state = trial.state.clone();
            state.multipliers = self.first_multipliers(trial, signs);
            let free = state.multipliers.len() + start.map_or(0, |_| self.dim);
            if let Some(start) = start {
                state.bodies[0].value = sum(&state.bodies[0].value, start);
            }
            let Some(found) = self.improved(sizes, trial, state, free) else { continue };
            if best.as_ref().is_none_or(|b| found.1.largest() < b.1.largest()) {
                best = Some(found);
            }
        }
        best
    }

    /// Multipliers in the units of tractions: vectors are the traction, numbers the pressure, one sign or the other.
    fn first_multipliers(&self, trial: &Trial, signs: usize) -> Vec<f64> {
        let normal = dot(&trial.traction, &self.normal);
        let of = |(k, n): (usize, usize)| {
            let sign = if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
            (0..n).map(move |i| sign * if n == self.dim { trial.traction[i] } else { normal })
        };
        self.multipliers().enumerate().flat_map(of).collect()
    }

    /// Gauss's and Newton's method on so many free numbers.
    fn improved(&self, sizes: &Sizes, trial: &Trial, mut state: State, free: usize) -> Option<(State, Left)> {
        let mut best = (state.clone(), self.left(sizes, trial, &state)?);
        for _ in 0..STEPS {
            if free == 0 || best.1.largest() <= SATISFIED * SATISFIED {
                break;
            }
            let base = self.equations(sizes, trial, &state)?;
            let mut slope = DMatrix::zeros(base.len(), free);
            for k in 0..free {
                let step = PART * self.unit(sizes, &state, k);
                let (mut ahead, mut behind) = (state.clone(), state.clone());
                *self.number(&mut ahead, k) += step;
                *self.number(&mut behind, k) -= step;
                let (ahead, behind) = (self.equations(sizes, trial, &ahead)?, self.equations(sizes, trial, &behind)?);
                for i in 0..base.len() {
                    slope[(i, k)] = (ahead[i] - behind[i]) / (2.0 * PART);
                }
            }
            let inverse = slope.clone().pseudo_inverse(1e-9 * slope.amax()).ok()?;
            let change = inverse * DVector::from_vec(base);
            for k in 0..free {
                let unit = self.unit(sizes, &state, k);
                *self.number(&mut state, k) -= change[k] * unit;
            }
            let left = self.left(sizes, trial, &state)?;
            if left.largest() < best.1.largest() {
                best = (state.clone(), left);
            }
        }
        Some(best)
    }

    /// What number `k` is measured in: multipliers first, then the displacement of the first body.
    fn unit(&self, sizes: &Sizes, state: &State, k: usize) -> f64 {
        if k < state.multipliers.len() { sizes.pressure } else { sizes.length() }
    }

    fn number<'s>(&self, state: &'s mut State, k: usize) -> &'s mut f64 {
        let n = state.multipliers.len();
        if k < n { &mut state.multipliers[k] } else { &mut state.bodies[0].value[k - n] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_overlap_is_found_for_every_law_and_unit() {
        for unit in [1e-12, 1.0, 1e15] {
            for (law, overlap) in [
                (&(|g: f64| 1e7 * g) as &dyn Fn(f64) -> f64, 3e-7),
                (&|g: f64| 1e5 * g * g * g, 3e-5_f64.cbrt()),
                (&|g: f64| 1e9 * g.powf(1.5), 3e-9_f64.powf(2.0 / 3.0)),
                (&|g: f64| (g / 1e-4).exp_m1(), 1e-4 * 4.0_f64.ln()),
                (&|g: f64| -2.0 * g, 1.5),
            ] {
                let found = overlap_for(3.0 * unit, 1e-3, |g| Some(unit * law(g.max(0.0)))).expect("an overlap");
                assert!((found / overlap - 1.0).abs() < 1e-9, "{found} for {overlap}");
            }
        }
        assert_eq!(overlap_for(1.0, 1e-3, |_| Some(5.0)), None, "nothing grows");
        assert!(overlap_for(1.0, 1e-3, |g| Some(g.min(0.1))).is_some(), "a bounded law has that of its first part");
    }
}
