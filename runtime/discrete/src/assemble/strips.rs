//! Blocks of few test functions: the entries times trial functions stay in registers.
//!
//! Of a block a few columns are made at a time, all rows of them: at each point entries times trial functions first, then
//! all test functions times that, summed over slots and points in registers. Nothing is written but the result. Does not
//! know blocks of more than [`TILE`] test functions: where entries times trial functions serve more than one tile, they
//! are made once and read again (of eight test functions, two columns at a time took a fifth longer).

use pulp::Simd;

use crate::assemble::{
    block::{Row, TILE},
    simd::{Lanes, fused, load, store},
};

/// A block and what it is made from.
#[derive(Clone, Copy)]
pub(super) struct Strips<'a> {
    pub(super) rows: &'a [Row],
    pub(super) n_tests: usize,
    pub(super) n_trials: usize,
    /// Only numbers on and above the diagonal are needed.
    pub(super) is_triangle: bool,
    pub(super) values: &'a [Lanes],
    pub(super) derivatives: &'a [Lanes],
    /// Weighted entries of the law, `[point][entry]`.
    pub(super) coefficients: &'a [Lanes],
    pub(super) n_coefficients: usize,
    /// Part of the vectors.
    pub(super) p: usize,
}

impl Strips<'_> {
    /// False if a number is not finite.
    #[inline(always)]
    pub(super) fn all<S: Simd>(self, simd: S, out: &mut [Lanes]) -> bool {
        let (m, n) = (self.n_tests, self.n_trials);
        let mut check = [simd.splat_f64s(0.0); TILE];
        for j in (0..n).step_by(TILE) {
            let columns = TILE.min(n - j);
            let rows = if self.is_triangle { m.min(j + columns) } else { m };
            match (rows, columns) {
                (1, 1) => self.strip::<S, 1, 1>(simd, j, out, &mut check),
                (2, 1) => self.strip::<S, 2, 1>(simd, j, out, &mut check),
                (3, 1) => self.strip::<S, 3, 1>(simd, j, out, &mut check),
                (_, 1) => self.strip::<S, 4, 1>(simd, j, out, &mut check),
                (1, 2) => self.strip::<S, 1, 2>(simd, j, out, &mut check),
                (2, 2) => self.strip::<S, 2, 2>(simd, j, out, &mut check),
                (3, 2) => self.strip::<S, 3, 2>(simd, j, out, &mut check),
                (_, 2) => self.strip::<S, 4, 2>(simd, j, out, &mut check),
                (1, 3) => self.strip::<S, 1, 3>(simd, j, out, &mut check),
                (2, 3) => self.strip::<S, 2, 3>(simd, j, out, &mut check),
                (3, 3) => self.strip::<S, 3, 3>(simd, j, out, &mut check),
                (_, 3) => self.strip::<S, 4, 3>(simd, j, out, &mut check),
                (1, _) => self.strip::<S, 1, 4>(simd, j, out, &mut check),
                (2, _) => self.strip::<S, 2, 4>(simd, j, out, &mut check),
                (3, _) => self.strip::<S, 3, 4>(simd, j, out, &mut check),
                _ => self.strip::<S, 4, 4>(simd, j, out, &mut check),
            }
        }
        check.into_iter().all(|sums| simd.reduce_sum_f64s(sums) == 0.0)
    }

    /// Rows `0..M` of columns `j..j + N`.
    #[inline(always)]
    fn strip<S: Simd, const M: usize, const N: usize>(
        self,
        simd: S,
        j: usize,
        out: &mut [Lanes],
        check: &mut [S::f64s; TILE],
    ) {
        let zero = simd.splat_f64s(0.0);
        let mut sums = [[zero; N]; M];
        for row in self.rows {
            for (q, coefficients) in self.coefficients.chunks_exact(self.n_coefficients).enumerate() {
                let mut flux = [zero; N];
                for (coefficient, trials) in &row.entries {
                    let factor = load::<S>(&coefficients[*coefficient], self.p);
                    let trials = &trials.at(self.values, self.derivatives, q)[j..][..N];
                    for (slot, trial) in flux.iter_mut().zip(trials) {
                        *slot = fused(simd, *slot, factor, load::<S>(trial, self.p));
                    }
                }
                let tests = &row.tests.at(self.values, self.derivatives, q)[..M];
                for (sums, test) in sums.iter_mut().zip(tests) {
                    let test = load::<S>(test, self.p);
                    for (sum, flux) in sums.iter_mut().zip(&flux) {
                        *sum = fused(simd, *sum, test, *flux);
                    }
                }
            }
        }
        for (i, sums) in sums.iter().enumerate() {
            let out = &mut out[i * self.n_trials + j..][..N];
            for ((slot, sum), check) in out.iter_mut().zip(sums).zip(check.iter_mut()) {
                store::<S>(slot, self.p, *sum);
                // infinite or not a number times zero is not a number
                *check = fused(simd, *check, *sum, zero);
            }
        }
    }
}
