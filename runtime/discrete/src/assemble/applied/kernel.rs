//! The action of a term on a batch of cells: derivatives at the points, the law, and back.
//!
//! With u at the nodes: G = Σ_k u_k dN_k in the reference cell, g = G J⁻¹, f = (entries of the law) g, F = w f J⁻ᵀ, and
//! r_k = Σ F dN_k over the points. Where functions are products, sums over k are taken direction by direction, at all points of a
//! batch before the law and behind it; else point by point, and all stays in registers but what the entries of the law mix.

use pulp::{Simd, WithSimd};

use crate::assemble::applied::{
    cells::{Cells, Functions, Law},
    number::Number,
    passes::{Grids, OnGrid},
};

/// A batch with its memory: nodal values, what comes out by node, and the numbers of points before and behind the law.
pub(super) struct Action<'a, T: Number> {
    pub(super) cells: &'a Cells<T>,
    pub(super) law: &'a Law<T>,
    pub(super) batch: usize,
    pub(super) local: &'a [T::Line],
    pub(super) out: &'a mut [T::Line],
    /// Before the law, of all points where some functions are products, with what they need; else of one.
    pub(super) grids: Grids<'a, T>,
    /// Zero where no entry makes something.
    pub(super) fluxes: &'a mut [T::Line],
}

/// What all functions share at a point.
struct Point<T: Number, S: Simd, const D: usize> {
    simd: S,
    q: usize,
    /// Part of the lines.
    p: usize,
    /// `[reference direction][direction]`
    inverse: [[T::Vector<S>; D]; D],
    weight: T::Vector<S>,
}

impl<T: Number> WithSimd for Action<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        match self.cells.dim {
            1 => self.all::<S, 1>(simd),
            2 => self.all::<S, 2>(simd),
            _ => self.all::<S, 3>(simd),
        }
    }
}

impl<T: Number> Action<'_, T> {
    #[inline(always)]
    fn all<S: Simd, const D: usize>(&mut self, simd: S) {
        let (cells, n) = (self.cells, self.cells.n_at_point);
        let zero = T::splat(simd, T::default());
        let on_grid = || cells.functions.iter().filter_map(|of| OnGrid::new(of, n, D));
        let step = if cells.has_grids() { n } else { 0 };
        for p in 0..T::parts::<S>() {
            self.out.iter_mut().for_each(|line| T::store::<S>(line, p, zero));
            on_grid().for_each(|field| field.to_points(simd, p, self.local, &mut self.grids));
            for q in 0..cells.n_points {
                let point = Point::<T, S, D>::new(simd, cells, [self.batch, q], p);
                let trials = &mut self.grids.at_points[q * step..][..n];
                for functions in &cells.functions {
                    match functions.n_components {
                        1 => point.evaluate::<1>(functions, self.local, trials),
                        2 => point.evaluate::<2>(functions, self.local, trials),
                        _ => point.evaluate::<3>(functions, self.local, trials),
                    }
                }
                law(self.law, [self.batch, cells.n_points], &point, trials, self.fluxes);
                for functions in &cells.functions {
                    match functions.n_components {
                        1 => point.integrate::<1>(functions, self.fluxes, trials, self.out),
                        2 => point.integrate::<2>(functions, self.fluxes, trials, self.out),
                        _ => point.integrate::<3>(functions, self.fluxes, trials, self.out),
                    }
                }
            }
            on_grid().for_each(|field| field.to_nodes(simd, p, &mut self.grids, self.out));
        }
    }
}

/// The entries of the law times the numbers of the trial slots at a point; `at` is the batch and how many points it has.
#[inline(always)]
fn law<T: Number, S: Simd, const D: usize>(
    law: &Law<T>,
    at: [usize; 2],
    point: &Point<T, S, D>,
    trials: &[T::Line],
    fluxes: &mut [T::Line],
) {
    let ([batch, n_points], simd, p, n) = (at, point.simd, point.p, law.n_stored);
    let place = if law.are_means { batch } else { batch * n_points + point.q };
    let stored = &law.coefficients[place * n..][..n];
    for row in &law.rows {
        let mut sum = T::splat(simd, T::default());
        for (trial, factor) in &row.even {
            let trial = T::load::<S>(&trials[usize::from(*trial)], p);
            sum = T::fused(simd, sum, T::splat(simd, *factor), trial);
        }
        for (trial, place) in &row.stored {
            let trial = T::load::<S>(&trials[usize::from(*trial)], p);
            sum = T::fused(simd, sum, T::load::<S>(&stored[usize::from(*place)], p), trial);
        }
        T::store::<S>(&mut fluxes[usize::from(row.test)], p, sum);
    }
}

impl<T: Number, S: Simd, const D: usize> Point<T, S, D> {
    /// Of part `p` of a batch, at a point: `[batch, point]`.
    #[inline(always)]
    fn new(simd: S, cells: &Cells<T>, at: [usize; 2], p: usize) -> Self {
        let ([batch, q], n) = (at, D * D + 1);
        let place = if cells.is_affine { batch } else { batch * cells.n_points + q };
        let map = &cells.maps[place * n..][..n];
        let mut inverse = [[T::splat(simd, T::default()); D]; D];
        for (row, lines) in inverse.iter_mut().zip(map.chunks_exact(D)) {
            for (slot, line) in row.iter_mut().zip(lines) {
                *slot = T::load::<S>(line, p);
            }
        }
        let measure = T::load::<S>(&map[D * D], p);
        let weight = T::times(simd, measure, T::splat(simd, cells.weights[q]));
        Self { simd, q, p, inverse, weight }
    }

    /// Values and derivatives of a field of N components; of one on a grid the derivatives in the reference cell stand there.
    #[inline(always)]
    fn evaluate<const N: usize>(&self, of: &Functions<T>, local: &[T::Line], trials: &mut [T::Line]) {
        let (simd, p, n) = (self.simd, self.p, of.n_nodes);
        let zero = T::splat(simd, T::default());
        let nodes = &local[of.first..][..n * N];
        if of.reads.gradients {
            let out = &mut trials[of.gradient_at..][..N * D];
            let mut sums = [[zero; D]; N];
            if of.lines.is_some() {
                for (d, lines) in out.chunks_exact(N).enumerate() {
                    sums.iter_mut().zip(lines).for_each(|(sums, line)| sums[d] = T::load::<S>(line, p));
                }
            } else {
                let table = &of.gradients[self.q * n * D..][..n * D];
                for (node, row) in nodes.chunks_exact(N).zip(table.chunks_exact(D)) {
                    for (sums, line) in sums.iter_mut().zip(node) {
                        let u = T::load::<S>(line, p);
                        for (sum, slope) in sums.iter_mut().zip(row) {
                            *sum = T::fused(simd, *sum, u, T::splat(simd, *slope));
                        }
                    }
                }
            }
            for (i, lines) in out.chunks_exact_mut(N).enumerate() {
                for (sums, line) in sums.iter().zip(lines) {
                    let mut along = T::times(simd, sums[0], self.inverse[0][i]);
                    for d in 1..D {
                        along = T::fused(simd, along, sums[d], self.inverse[d][i]);
                    }
                    T::store::<S>(line, p, along);
                }
            }
        }
        if !of.values.is_empty() {
            let mut sums = [zero; N];
            for (node, value) in nodes.chunks_exact(N).zip(&of.values[self.q * n..][..n]) {
                for (sum, line) in sums.iter_mut().zip(node) {
                    *sum = T::fused(simd, *sum, T::load::<S>(line, p), T::splat(simd, *value));
                }
            }
            let out = &mut trials[of.value_at..][..N];
            out.iter_mut().zip(sums).for_each(|(line, sum)| T::store::<S>(line, p, sum));
        }
    }

    /// Adds what the fluxes do at the nodes; of a field on a grid what they are in the reference cell takes the place of the trials.
    #[inline(always)]
    fn integrate<const N: usize>(
        &self,
        of: &Functions<T>,
        fluxes: &[T::Line],
        trials: &mut [T::Line],
        out: &mut [T::Line],
    ) {
        let (simd, p, n) = (self.simd, self.p, of.n_nodes);
        let zero = T::splat(simd, T::default());
        let nodes = &mut out[of.first..][..n * N];
        if of.reads.gradients {
            let along = self.in_reference::<N>(of, fluxes);
            if of.lines.is_some() {
                for (d, lines) in trials[of.gradient_at..][..N * D].chunks_exact_mut(N).enumerate() {
                    along.iter().zip(lines).for_each(|(along, line)| T::store::<S>(line, p, along[d]));
                }
            } else {
                let table = &of.gradients[self.q * n * D..][..n * D];
                for (node, row) in nodes.chunks_exact_mut(N).zip(table.chunks_exact(D)) {
                    for (line, along) in node.iter_mut().zip(&along) {
                        let mut sum = T::load::<S>(line, p);
                        for (along, slope) in along.iter().zip(row) {
                            sum = T::fused(simd, sum, *along, T::splat(simd, *slope));
                        }
                        T::store::<S>(line, p, sum);
                    }
                }
            }
        }
        if of.reads.values {
            let mut weighed = [zero; N];
            for (slot, line) in weighed.iter_mut().zip(&fluxes[of.value_at..][..N]) {
                *slot = T::times(simd, T::load::<S>(line, p), self.weight);
            }
            if of.lines.is_some() {
                let all = weighed.iter().zip(&mut trials[of.value_at..][..N]);
                all.for_each(|(flux, line)| T::store::<S>(line, p, *flux));
            } else {
                for (node, value) in nodes.chunks_exact_mut(N).zip(&of.values[self.q * n..][..n]) {
                    for (line, flux) in node.iter_mut().zip(&weighed) {
                        let sum = T::fused(simd, T::load::<S>(line, p), *flux, T::splat(simd, *value));
                        T::store::<S>(line, p, sum);
                    }
                }
            }
        }
    }

    /// Fluxes of the derivatives in the reference cell, times the weight.
    #[inline(always)]
    fn in_reference<const N: usize>(&self, of: &Functions<T>, fluxes: &[T::Line]) -> [[T::Vector<S>; D]; N] {
        let zero = T::splat(self.simd, T::default());
        let from = &fluxes[of.gradient_at..][..N * D];
        let mut along = [[zero; D]; N];
        for (c, along) in along.iter_mut().enumerate() {
            for (slot, inverse) in along.iter_mut().zip(&self.inverse) {
                let mut sum = zero;
                for (lines, entry) in from.chunks_exact(N).zip(inverse) {
                    sum = T::fused(self.simd, sum, T::load::<S>(&lines[c], self.p), *entry);
                }
                *slot = T::times(self.simd, sum, self.weight);
            }
        }
        along
    }
}
