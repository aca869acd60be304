//! Restarted GMRES (Saad and Schultz 1986).
//!
//! Promises: a restart begins with the true residual `‖b - A x‖₂`; fixed order of all sums; memory kept
//! between solves; the number of iterations whether or not they converged.
//! Has no preconditioner of its own: the operator comes with it. Does not check the solution: `checked` does.

use wfl_dense::sweeps::dot;

/// What an iteration did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outcome {
    pub(super) iterations: usize,
    pub(super) converged: bool,
}

/// Part of the reduction still needed that the rate so far must promise. Below one, because GMRES gets faster.
const PROMISE: f64 = 0.6;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    /// Largest 2-norm of the residual, in the unit of the right-hand side.
    pub(super) target: f64,
    /// Also the measure of hope: a first cycle that is not on its way to the target with so many is given up.
    pub(super) max_iterations: usize,
    /// From this iteration on the rate of convergence is looked at: a change of rank r shows no rate before.
    pub(super) trial_iterations: usize,
}

impl Limits {
    /// Whether the rate of convergence from `start` to `size` in `done` iterations cannot suffice.
    fn is_hopeless(&self, start: f64, size: f64, done: usize) -> bool {
        let gained = (start / size).ln() / done as f64 * self.max_iterations as f64;
        done >= self.trial_iterations && gained < PROMISE * (start / self.target).ln()
    }
}

/// Work space of GMRES with a basis of fixed size.
#[derive(Debug, Clone)]
pub(super) struct Gmres {
    restart: usize,
    basis: Vec<Vec<f64>>,
    /// Upper Hessenberg matrix after rotation, column after column.
    hessenberg: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    reduced: Vec<f64>,
}

impl Gmres {
    /// The basis grows up to `restart` vectors, each taken when first needed.
    pub(super) fn new(restart: usize) -> Self {
        Self { restart, basis: Vec::new(), hessenberg: Vec::new(), rotations: Vec::new(), reduced: Vec::new() }
    }

    /// Solves from x = 0; `multiply(x, y)` sets y = A x. What the recursion calls converged is: who uses the solution looks
    /// at its true residual, and that of a restart is one.
    pub(super) fn solve(
        &mut self,
        multiply: &mut dyn FnMut(&[f64], &mut [f64]),
        b: &[f64],
        x: &mut [f64],
        limits: Limits,
    ) -> Outcome {
        let mut iterations = 0;
        x.fill(0.0);
        self.vector(0, b.len());
        self.basis[0].copy_from_slice(b);
        loop {
            let size = norm(&self.basis[0]);
            if size <= limits.target {
                return Outcome { iterations, converged: true };
            }
            if iterations >= limits.max_iterations || !size.is_finite() {
                return Outcome { iterations, converged: false };
            }
            let before = iterations;
            iterations += self.cycle(multiply, size, limits, limits.max_iterations - iterations);
            self.add_correction(iterations - before, x);
            let reached = self.reduced[iterations - before].abs();
            // A direction in the null space of A reduces nothing, although the recursion may claim it.
            let is_singular = self.hessenberg.last().and_then(|column| column.last()) == Some(&0.0);
            if reached <= limits.target && !is_singular {
                return Outcome { iterations, converged: true };
            }
            if before == 0 && limits.is_hopeless(size, reached, iterations) {
                return Outcome { iterations, converged: false };
            }
            multiply(x, &mut self.basis[0]);
            self.basis[0].iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        }
    }

    /// One cycle from the residual in `basis[0]`; the number of directions found.
    fn cycle(
        &mut self,
        multiply: &mut dyn FnMut(&[f64], &mut [f64]),
        size: f64,
        limits: Limits,
        allowed: usize,
    ) -> usize {
        let n = self.basis[0].len();
        self.basis[0].iter_mut().for_each(|value| *value /= size);
        self.rotations.clear();
        self.hessenberg.clear();
        self.reduced.clear();
        self.reduced.push(size);
        for step in 0..self.restart.min(allowed) {
            self.vector(step + 1, n);
            let (done, rest) = self.basis.split_at_mut(step + 1);
            let next = &mut rest[0];
            multiply(&done[step], next);
            // Modified Gram-Schmidt, twice: the second pass keeps the basis orthogonal to rounding.
            let mut column = vec![0.0; step + 2];
            for _ in 0..2 {
                for (place, basis) in done.iter().enumerate() {
                    let part = dot(basis, next);
                    column[place] += part;
                    next.iter_mut().zip(basis).for_each(|(value, base)| *value -= part * base);
                }
            }
            let length = norm(next);
            column[step + 1] = length;
            if length > 0.0 {
                next.iter_mut().for_each(|value| *value /= length);
            }
            self.rotate(column);
            let reached = self.reduced[step + 1].abs();
            let is_over = reached <= limits.target || length == 0.0 || !length.is_finite();
            if is_over || limits.is_hopeless(size, reached, step + 1) {
                return step + 1;
            }
        }
        self.hessenberg.len()
    }

    /// Applies the old rotations to a new column, and a new one that clears its last entry.
    fn rotate(&mut self, mut column: Vec<f64>) {
        for (i, &(c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
        }
        let last = self.rotations.len();
        let length = (column[last] * column[last] + column[last + 1] * column[last + 1]).sqrt();
        let (c, s) = if length > 0.0 { (column[last] / length, column[last + 1] / length) } else { (1.0, 0.0) };
        column[last] = length;
        column.pop();
        let before = self.reduced[last];
        self.reduced[last] = c * before;
        self.reduced.push(-s * before);
        self.rotations.push((c, s));
        self.hessenberg.push(column);
    }

    fn add_correction(&mut self, directions: usize, x: &mut [f64]) {
        let mut factors = self.reduced[..directions].to_vec();
        for i in (0..directions).rev() {
            let diagonal = self.hessenberg[i][i];
            factors[i] = if diagonal == 0.0 { 0.0 } else { factors[i] / diagonal };
            for j in 0..i {
                factors[j] -= self.hessenberg[i][j] * factors[i];
            }
        }
        for (factor, direction) in factors.iter().zip(&self.basis) {
            x.iter_mut().zip(direction).for_each(|(value, step)| *value += factor * step);
        }
    }

    /// Makes room for basis vector `place`.
    fn vector(&mut self, place: usize, n: usize) {
        while self.basis.len() <= place {
            self.basis.push(Vec::new());
        }
        self.basis[place].resize(n, 0.0);
    }
}

fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// When [`gmres`] stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Largest 2-norm of the residual, in parts of that of the right-hand side.
    pub reduction: f64,
    /// Directions that are kept.
    pub restart: usize,
    /// Most iterations.
    pub iterations: usize,
}

/// Solves A x = b from x = 0; `multiply(x, y)` sets y = A x. Whether the residual came so far.
pub fn gmres(multiply: &mut dyn FnMut(&[f64], &mut [f64]), b: &[f64], x: &mut [f64], stop: Stop) -> bool {
    let Stop { reduction, restart, iterations } = stop;
    let limits = Limits { target: reduction * norm(b), max_iterations: iterations, trial_iterations: iterations };
    Gmres::new(restart).solve(multiply, b, x, limits).converged
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 1-D Laplacian of n unknowns plus an upwind term.
    fn laplacian(advection: f64) -> impl Fn(&[f64], &mut [f64]) {
        move |x, y| {
            let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
            for (i, out) in y.iter_mut().enumerate() {
                *out = 2.0 * x[i] - (1.0 + advection) * at(i.wrapping_sub(1)) - (1.0 - advection) * at(i + 1);
            }
        }
    }

    #[test]
    fn gmres_solves_an_unsymmetric_system_exactly_after_n_steps() {
        let a = laplacian(0.7);
        let wanted: Vec<f64> = (0..20).map(|i| (i % 3) as f64 - 0.5).collect();
        let mut b = vec![0.0; 20];
        a(&wanted, &mut b);
        for restart in [30, 7] {
            let mut x = vec![0.0; 20];
            let limits = Limits { target: 1e-12, max_iterations: 2000, trial_iterations: 2000 };
            let outcome = Gmres::new(restart).solve(&mut |x, y| a(x, y), &b, &mut x, limits);
            assert!(outcome.converged && (restart < 20 || outcome.iterations <= 21), "{outcome:?}");
            assert!(x.iter().zip(&wanted).all(|(x, w)| (x - w).abs() < 1e-9), "{x:?}");
        }
    }

    #[test]
    fn two_eigenvalues_need_two_steps() {
        let mut x = vec![0.0; 4];
        let limits = Limits { target: 1e-13, max_iterations: 10, trial_iterations: 5 };
        let mut scale = |x: &[f64], y: &mut [f64]| (0..4).for_each(|i| y[i] = x[i] * [2.0, 4.0, 4.0, 2.0][i]);
        let outcome = Gmres::new(5).solve(&mut scale, &[2.0, 4.0, 8.0, 6.0], &mut x, limits);
        assert_eq!((outcome.iterations, outcome.converged), (2, true));
        assert!(x.iter().zip([1.0, 1.0, 2.0, 3.0]).all(|(x, w)| (x - w).abs() < 1e-14), "{x:?}");
        let stuck = Gmres::new(2).solve(&mut |_, y| y.fill(0.0), &[1.0], &mut [0.0], limits);
        assert!(!stuck.converged && stuck.iterations <= 10);
    }
}
