//! The longest stable step of central differences on a lumped mass, by Lanczos' method; the stiffness and the damping by products.
//!
//! Sources: T. J. R. Hughes, The Finite Element Method (1987), 9.1; the limit with damping that lags by half a step,
//! h^2 w^2/4 + h c/2 < 1, is that of T. Belytschko, W. K. Liu, B. Moran, Nonlinear Finite Elements (2000), 6.2.
//! Promises: no matrix of the linear terms is assembled; the rates of the system are left zero.

use wfl_compiler::{Class, types::RateOrder};
use wfl_sparse::csr::Csr;

use crate::{
    assemble::AssembledTerm,
    lumped::{Lumped, ROUNDED, rest, sum},
    system::{Branches, InRates, System, SystemError},
    window::Window,
};

/// The longest stable step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLimit {
    /// Its length; infinite where nothing has stiffness.
    pub step: f64,
    /// How often the terms were evaluated for it.
    pub evaluations: usize,
}

/// The longest stable step counts as found where the highest frequency is known to this part of its square.
const RESOLVED: f64 = 1e-4;
/// Most applications of the stiffness for it: the highest frequencies of a mesh of equal cells lie close together, and the
/// bound that is then told is still a safe one.
const MOST: usize = 400;

/// What the growth of a power iteration is multiplied by: it comes near the largest eigenvalue slowly.
const UNSYMMETRIC: f64 = 1.05;
impl Lumped {
    /// The longest stable step of central differences at the state `u`: 2/w without damping beside the diagonal. The rates
    /// of the system are left zero; several ranks find it together.
    ///
    /// # Errors
    /// [`SystemError`] where the system cannot be evaluated at `u`.
    pub fn longest_step(&self, system: &mut System, u: &[f64], window: Window) -> Result<StepLimit, SystemError> {
        let mut evaluations = 0;
        let stiffness = Operator::stiffness(system, u, window)?;
        let squared = self.largest_eigenvalue(system, &stiffness, &mut evaluations)?;
        let damping = Operator::lagging(self, system, u, window)?;
        let lagged = match damping.is_nothing(system) {
            true => 0.0,
            false => self.largest_eigenvalue(system, &damping, &mut evaluations)?.max(0.0),
        };
        rest(system, window);
        let step = if squared > 0.0 {
            let ratio = 0.5 * lagged / squared.sqrt();
            2.0 / squared.sqrt() * ((ratio * ratio + 1.0).sqrt() - ratio)
        } else if lagged > 0.0 {
            2.0 / lagged
        } else {
            f64::INFINITY
        };
        Ok(StepLimit { step, evaluations })
    }

    /// An upper bound of the largest eigenvalue of a symmetric operator over the mass, by Lanczos' method: the largest Ritz
    /// value and the size of its residual. Of an operator that is not symmetric the largest growth in a power iteration,
    /// with [`UNSYMMETRIC`].
    fn largest_eigenvalue(
        &self,
        system: &mut System,
        operator: &Operator,
        evaluations: &mut usize,
    ) -> Result<f64, SystemError> {
        let roots: Vec<f64> = system.numbering.free_dofs.iter().map(|d| self.mass[*d as usize].sqrt()).collect();
        let n = roots.len();
        let symmetric = system.is_symmetric();
        let times = |system: &mut System, q: &[f64]| {
            let x: Vec<f64> = q.iter().zip(&roots).map(|(q, m)| q / m).collect();
            let mut y = operator.apply(system, self, &x)?;
            y.iter_mut().zip(&roots).for_each(|(y, m)| *y /= m);
            Ok::<_, SystemError>(y)
        };
        let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut q = start_vector(n);
        let (mut before, mut found) = (vec![0.0; n], 0.0);
        for _ in 0..MOST.min(n) {
            let mut y = times(system, &q)?;
            *evaluations += 1;
            let along = dot(&q, &y);
            if !symmetric {
                let size = dot(&y, &y).sqrt();
                if size == 0.0 {
                    break;
                }
                found = UNSYMMETRIC * size;
                y.iter_mut().for_each(|y| *y /= size);
                q = y;
                continue;
            }
            let last = beside.last().copied().unwrap_or(0.0);
            for ((y, q), b) in y.iter_mut().zip(&q).zip(&before) {
                *y -= along * q + last * b;
            }
            let size = dot(&y, &y).sqrt();
            diagonal.push(along);
            let (value, end) = largest_of_tridiagonal(&diagonal, &beside);
            found = value + size * end;
            let spread = diagonal.iter().chain(&beside).fold(0.0f64, |a, b| a.max(b.abs()));
            if size * end <= RESOLVED * value || size <= ROUNDED * spread {
                break;
            }
            beside.push(size);
            y.iter_mut().for_each(|y| *y /= size);
            before = std::mem::replace(&mut q, y);
        }
        Ok(found)
    }
}

/// The derivative of the equations in the unknowns, or in the velocities without what steps solve for.
pub(crate) struct Operator {
    /// That of the terms that are not linear, over the free dofs; `None` where they do not count.
    changing: Option<Csr>,
    /// The linear terms where nothing has moved and nothing moves, by dof in the axes of the scene: the rows of this rank.
    at_rest: Vec<f64>,
    /// Of the velocities.
    of_rates: bool,
    /// Linear terms count.
    linear: bool,
}

impl Operator {
    fn stiffness(system: &mut System, u: &[f64], window: Window) -> Result<Self, SystemError> {
        Self::of(system, u, window, [false, true])
    }

    /// The damping that acts half a step late.
    fn lagging(lumped: &Lumped, system: &mut System, u: &[f64], window: Window) -> Result<Self, SystemError> {
        Self::of(system, u, window, [true, !lumped.couples])
    }

    /// The damping of linear terms beside the diagonal. The rates of the system are left zero.
    pub(crate) fn linear_damping(system: &mut System, window: Window) -> Result<Self, SystemError> {
        rest(system, window);
        let mut this = Self { changing: None, at_rest: Vec::new(), of_rates: true, linear: true };
        this.at_rest = this.linear(system, &vec![0.0; system.numbering.n_dofs])?;
        Ok(this)
    }

    fn of(system: &mut System, u: &[f64], window: Window, [of_rates, linear]: [bool; 2]) -> Result<Self, SystemError> {
        rest(system, window);
        let changing = if of_rates {
            let changes = |k: &usize| system.terms[*k].law.class > Class::Linear;
            let terms: Vec<usize> = (0..system.terms.len()).filter(changes).collect();
            let branches = Branches::AsWritten;
            let damping =
                system.matrix_of_rates(InRates { order: RateOrder::First, terms: &terms, at: u, branches })?;
            system.over_free(&damping)?
        } else {
            let mut tangent = system.new_tangent();
            system.tangent(u, Branches::AsWritten, &mut tangent)?;
            tangent.changing
        };
        let mut this = Self { changing: Some(changing), at_rest: Vec::new(), of_rates, linear };
        this.at_rest = this.linear(system, &vec![0.0; system.numbering.n_dofs])?;
        Ok(this)
    }

    /// True if no term has it.
    fn is_nothing(&self, system: &System) -> bool {
        let is_zero = self.changing.iter().flat_map(Csr::values).all(|v| *v == 0.0);
        system.team().all(is_zero) && !system.terms.iter().any(|t| self.takes(t))
    }

    fn takes(&self, term: &AssembledTerm) -> bool {
        self.linear && term.law.class <= Class::Linear && (!self.of_rates || term.law.reads_rates(RateOrder::First))
    }

    /// The linear terms at displacements, or velocities, by dof in the axes of the scene.
    fn linear(&self, system: &mut System, moved: &[f64]) -> Result<Vec<f64>, SystemError> {
        let zero = vec![0.0; moved.len()];
        if !self.of_rates {
            return sum(system, moved, &|t| self.takes(t));
        }
        let take = |system: &mut System, first: &[f64]| {
            if let Some(rates) = system.rates_mut() {
                rates.take(first, &zero);
            }
        };
        take(system, moved);
        let found = sum(system, &zero, &|t| self.takes(t));
        take(system, &zero);
        found
    }

    /// The linear terms times a vector by dof in the axes of the scene, over the free dofs: the rows of this rank.
    pub(crate) fn over_free(&self, system: &mut System, moved: &[f64]) -> Result<Vec<f64>, SystemError> {
        let mut all = self.linear(system, moved)?;
        all.iter_mut().zip(&self.at_rest).for_each(|(a, b)| *a -= b);
        system.numbering.turn(&mut all);
        let mut y = Vec::new();
        system.numbering.gather(&all, &mut y);
        Ok(y)
    }

    /// The operator times a vector over the free dofs.
    pub(crate) fn apply(&self, system: &mut System, lumped: &Lumped, x: &[f64]) -> Result<Vec<f64>, SystemError> {
        let zero = vec![0.0; system.numbering.n_dofs];
        let mut moved = zero.clone();
        system.numbering.advance(&zero, x, 1.0, &mut moved);
        let mut y = self.over_free(system, &moved)?;
        if let Some(changing) = &self.changing {
            changing.multiply_add(x, &mut y, rayon::current_num_threads());
        }
        // of several ranks each has found its rows
        if let Some(owners) = system.owners() {
            owners.update(&mut y);
        }
        if self.of_rates && self.linear {
            for ((y, x), d) in y.iter_mut().zip(x).zip(&system.numbering.free_dofs) {
                *y -= lumped.damping[*d as usize] * x;
            }
        }
        Ok(y)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A vector of length 1 with a part in every direction, the same in every run.
fn start_vector(n: usize) -> Vec<f64> {
    let mut word = 0x9e37_79b9_7f4a_7c15u64;
    let mut next = || {
        word ^= word << 13;
        word ^= word >> 7;
        word ^= word << 17;
        #[expect(clippy::cast_precision_loss, reason = "53 bits")]
        let x = (word >> 11) as f64 / (1u64 << 53) as f64;
        x - 0.5
    };
    let mut v: Vec<f64> = (0..n).map(|_| next()).collect();
    let size = dot(&v, &v).sqrt();
    v.iter_mut().for_each(|x| *x /= size);
    v
}

/// The largest eigenvalue of a symmetric tridiagonal matrix, and the size of the last entry of its unit eigenvector.
fn largest_of_tridiagonal(diagonal: &[f64], beside: &[f64]) -> (f64, f64) {
    let n = diagonal.len();
    let off = |k: usize| if k == 0 { 0.0 } else { beside[k - 1].abs() };
    let radius = |k: usize| off(k) + beside.get(k).map_or(0.0, |b| b.abs());
    let disc = |sign: f64| (0..n).map(move |k| diagonal[k] + sign * radius(k));
    let (mut low, mut high) = (disc(-1.0).fold(f64::INFINITY, f64::min), disc(1.0).fold(f64::NEG_INFINITY, f64::max));
    // all eigenvalues lie below x where the pivots of x - T are positive
    let is_above = |x: f64| {
        let mut pivot = 1.0;
        (0..n).all(|k| {
            pivot = x - diagonal[k] - if k == 0 { 0.0 } else { off(k) * off(k) / pivot };
            pivot > 0.0
        })
    };
    while high - low > 4.0 * f64::EPSILON * high.abs().max(low.abs()) {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if is_above(middle) { high = middle } else { low = middle }
    }
    // of the eigenvector each entry follows from the two before it; the last row closes it
    let mut vector = vec![1.0; n];
    for k in 1..n {
        let before = if k > 1 { off(k - 1) * vector[k - 2] } else { 0.0 };
        vector[k] = ((high - diagonal[k - 1]) * vector[k - 1] - before) / off(k);
        if vector[k].abs() > 1e100 {
            vector[..=k].iter_mut().for_each(|x| *x *= 1e-100);
        }
    }
    let size = dot(&vector, &vector).sqrt();
    (high, vector[n - 1].abs() / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_eigenvalue_of_a_tridiagonal_matrix_has_its_closed_form() {
        // second differences of n points: 2 - 2 cos(pi k/(n + 1)), with the eigenvector sin(pi k j/(n + 1))
        for n in [1usize, 2, 5, 40] {
            let (value, end) = largest_of_tridiagonal(&vec![2.0; n], &vec![-1.0; n - 1]);
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let angle = std::f64::consts::PI * n as f64 / (n as f64 + 1.0);
            assert!((value - (2.0 - 2.0 * angle.cos())).abs() < 1e-13, "{n}: {value}");
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let entry = (2.0 / (n as f64 + 1.0)).sqrt() * (angle * n as f64).sin().abs();
            assert!((end - entry).abs() < 1e-6, "{n}: {end} {entry}");
        }
    }
}
