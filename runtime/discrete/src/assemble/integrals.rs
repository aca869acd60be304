//! Integrals of products of two functions, for the blocks of a tangent whose entries are the same at all points.
//!
//! Such a block is a sum of entries times integrals of a test function times a trial function, and the same integrals
//! serve many blocks: the nine products of derivatives are those of all pairs of components of an elastic law. Chosen
//! where it costs fewer multiplications.

use pulp::Simd;

use crate::assemble::{
    basis::Operand,
    block::{Block, Product, Row},
    entries::{Coefficient, Entries},
    simd::{Lanes, load, parts, store},
};

/// The integral of every test function times every trial function.
#[derive(Clone, Debug)]
pub(super) struct Integral {
    /// The test functions; no entries.
    row: [Row; 1],
    trials: Operand,
    n_tests: usize,
    n_trials: usize,
    start: usize,
    /// Where the transposed numbers go; `start` itself if both functions are the same.
    transposed: Option<usize>,
}

impl Integral {
    /// Multiplications at each point.
    fn cost(&self) -> usize {
        let all = self.n_tests * self.n_trials;
        if self.is_symmetric() { all.div_ceil(2) } else { all }
    }

    fn is_symmetric(&self) -> bool {
        self.transposed == Some(self.start)
    }

    /// Where the integral of these functions stands, if this one or its transpose is it.
    fn holds(&mut self, tests: Operand, trials: Operand, end: &mut usize) -> Option<usize> {
        if (self.row[0].tests, self.trials) == (tests, trials) {
            return Some(self.start);
        }
        if (self.row[0].tests, self.trials) != (trials, tests) {
            return None;
        }
        Some(*self.transposed.get_or_insert_with(|| {
            *end += self.n_tests * self.n_trials;
            *end - self.n_tests * self.n_trials
        }))
    }
}

/// Turns the blocks whose entries are the same at all points into sums of integrals, where that is cheaper. Returns the
/// integrals and how many numbers they are.
pub(super) fn share(blocks: &mut [Block], entries: &Entries, n_points: usize) -> (Vec<Integral>, usize) {
    let is_even = |block: &Block| {
        let coefficients = block.rows.iter().flat_map(|row| &row.entries);
        coefficients.clone().all(|(c, _)| !matches!(entries.coefficients[*c], Coefficient::Output(_)))
    };
    let (mut integrals, mut end) = (Vec::<Integral>::new(), 0);
    let (mut apart, mut together) = (0, 0);
    let mut sums: Vec<(usize, Vec<(usize, Operand)>)> = Vec::new();
    for (b, block) in blocks.iter().enumerate().filter(|(_, block)| is_even(block)) {
        let size = block.n_tests * block.n_trials;
        let in_use = if block.is_triangle { size.div_ceil(2) } else { size };
        apart += block.rows.len() * n_points * in_use;
        let mut sum = Vec::new();
        for row in &block.rows {
            for (coefficient, trials) in &row.entries {
                apart += n_points * block.n_trials;
                together += size;
                let found = integrals.iter_mut().find_map(|i| i.holds(row.tests, *trials, &mut end));
                let start = found.unwrap_or_else(|| {
                    let start = end;
                    end += size;
                    integrals.push(Integral {
                        row: [Row { tests: row.tests, entries: Vec::new() }],
                        trials: *trials,
                        n_tests: block.n_tests,
                        n_trials: block.n_trials,
                        start,
                        transposed: (row.tests == *trials).then_some(start),
                    });
                    start
                });
                sum.push((*coefficient, Operand { is_value: false, start, step: 0, n: size }));
            }
        }
        sums.push((b, sum));
    }
    together += integrals.iter().map(|i| n_points * (i.cost() + i.n_trials)).sum::<usize>();
    if together >= apart {
        return (Vec::new(), 0);
    }
    for (b, sum) in sums {
        blocks[b].sum = sum;
    }
    integrals.sort_by_key(|i| (i.trials.is_value, i.trials.start));
    (integrals, end)
}

/// What integrals are made from.
#[derive(Clone, Copy)]
pub(super) struct Sources<'a> {
    pub(super) weights: &'a [Lanes],
    pub(super) values: &'a [Lanes],
    pub(super) derivatives: &'a [Lanes],
}

impl Sources<'_> {
    /// Makes all integrals of a batch. `flux` is memory.
    #[inline(always)]
    pub(super) fn integrate<S: Simd>(self, simd: S, integrals: &[Integral], flux: &mut [Lanes], out: &mut [Lanes]) {
        let mut weighed = None;
        for integral in integrals {
            let n = integral.n_trials;
            if weighed != Some(integral.trials) {
                for (q, (weight, flux)) in self.weights.iter().zip(flux.chunks_exact_mut(n)).enumerate() {
                    let trials = integral.trials.at(self.values, self.derivatives, q);
                    for (slot, trial) in flux.iter_mut().zip(trials) {
                        for p in 0..parts::<S>() {
                            store::<S>(slot, p, simd.mul_f64s(load::<S>(weight, p), load::<S>(trial, p)));
                        }
                    }
                }
                weighed = Some(integral.trials);
            }
            let size = integral.n_tests * n;
            for p in 0..parts::<S>() {
                let product = Product {
                    rows: &integral.row,
                    n_tests: integral.n_tests,
                    n_trials: n,
                    is_triangle: integral.is_symmetric(),
                    n_points: self.weights.len(),
                    values: self.values,
                    derivatives: self.derivatives,
                    flux,
                    p,
                };
                product.all::<S>(simd, &mut out[integral.start..][..size]);
            }
            if let Some(transposed) = integral.transposed {
                for i in 0..integral.n_tests {
                    for j in if integral.is_symmetric() { i + 1 } else { 0 }..n {
                        out[transposed + j * integral.n_tests + i] = out[integral.start + i * n + j];
                    }
                }
            }
        }
    }
}
