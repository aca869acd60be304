//! The block of a local tangent for one test component and one trial component, and its product in registers.
//!
//! Fluxes are arguments; how they are computed is not known here.

use pulp::Simd;

use crate::assemble::{
    basis::Operand,
    simd::{Lanes, fused, load, store},
};

/// Rows and columns of a product that are summed in registers at once.
pub(super) const TILE: usize = 4;

/// One test slot of a block.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) tests: Operand,
    /// Coefficient and trial functions.
    pub(super) entries: Vec<(usize, Operand)>,
}

/// All entries of one test component and one trial component.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) rows: Vec<Row>,
    pub(super) n_tests: usize,
    pub(super) n_trials: usize,
    /// Where its products stand in the local tangent: `start + i * n_trials + j`.
    pub(super) start: usize,
    /// Test and trial functions are the same and so are the sides: only `i <= j` is needed.
    pub(super) is_triangle: bool,
    /// Coefficient and integrals; empty if the entries differ from point to point.
    pub(super) sum: Vec<(usize, Operand)>,
}

/// Test functions times fluxes, summed over slots and points.
#[derive(Clone, Copy)]
pub(super) struct Product<'a> {
    pub(super) rows: &'a [Row],
    pub(super) n_tests: usize,
    pub(super) n_trials: usize,
    /// Only numbers on and above the diagonal are needed.
    pub(super) is_triangle: bool,
    pub(super) n_points: usize,
    pub(super) values: &'a [Lanes],
    pub(super) derivatives: &'a [Lanes],
    pub(super) flux: &'a [Lanes],
    /// Part of the vectors.
    pub(super) p: usize,
}

impl Product<'_> {
    #[inline(always)]
    pub(super) fn all<S: Simd>(self, simd: S, out: &mut [Lanes]) -> bool {
        let (m, n) = (self.n_tests, self.n_trials);
        let mut check = [simd.splat_f64s(0.0); TILE];
        let mut i = 0;
        while i < m {
            let rows = TILE.min(m - i);
            let mut j = if self.is_triangle { i } else { 0 };
            while j < n {
                let columns = TILE.min(n - j);
                match (rows, columns) {
                    (4, 4) => self.tile::<S, 4, 4>(simd, i, j, out, &mut check),
                    (4, 3) => self.tile::<S, 4, 3>(simd, i, j, out, &mut check),
                    (4, 2) => self.tile::<S, 4, 2>(simd, i, j, out, &mut check),
                    (4, _) => self.tile::<S, 4, 1>(simd, i, j, out, &mut check),
                    (3, 4) => self.tile::<S, 3, 4>(simd, i, j, out, &mut check),
                    (3, 3) => self.tile::<S, 3, 3>(simd, i, j, out, &mut check),
                    (3, 2) => self.tile::<S, 3, 2>(simd, i, j, out, &mut check),
                    (3, _) => self.tile::<S, 3, 1>(simd, i, j, out, &mut check),
                    (2, 4) => self.tile::<S, 2, 4>(simd, i, j, out, &mut check),
                    (2, 3) => self.tile::<S, 2, 3>(simd, i, j, out, &mut check),
                    (2, 2) => self.tile::<S, 2, 2>(simd, i, j, out, &mut check),
                    (2, _) => self.tile::<S, 2, 1>(simd, i, j, out, &mut check),
                    (_, 4) => self.tile::<S, 1, 4>(simd, i, j, out, &mut check),
                    (_, 3) => self.tile::<S, 1, 3>(simd, i, j, out, &mut check),
                    (_, 2) => self.tile::<S, 1, 2>(simd, i, j, out, &mut check),
                    _ => self.tile::<S, 1, 1>(simd, i, j, out, &mut check),
                }
                j += columns;
            }
            i += rows;
        }
        // infinite or not a number times zero is not a number
        check.into_iter().all(|sums| simd.reduce_sum_f64s(sums) == 0.0)
    }

    #[inline(always)]
    fn tile<S: Simd, const M: usize, const N: usize>(
        self,
        simd: S,
        i: usize,
        j: usize,
        out: &mut [Lanes],
        check: &mut [S::f64s; TILE],
    ) {
        let (n, p) = (self.n_trials, self.p);
        let mut sums = [[simd.splat_f64s(0.0); N]; M];
        for (r, row) in self.rows.iter().enumerate() {
            for q in 0..self.n_points {
                let tests = &row.tests.at(self.values, self.derivatives, q)[i..][..M];
                let flux = &self.flux[(r * self.n_points + q) * n + j..][..N];
                let mut right = [simd.splat_f64s(0.0); N];
                for (slot, from) in right.iter_mut().zip(flux) {
                    *slot = load::<S>(from, p);
                }
                for (sums, test) in sums.iter_mut().zip(tests) {
                    let left = load::<S>(test, p);
                    for (sum, right) in sums.iter_mut().zip(&right) {
                        *sum = fused(simd, *sum, left, *right);
                    }
                }
            }
        }
        let zero = simd.splat_f64s(0.0);
        for (k, sums) in sums.iter().enumerate() {
            let out = &mut out[(i + k) * n + j..][..N];
            for ((slot, sum), check) in out.iter_mut().zip(sums).zip(check.iter_mut()) {
                store::<S>(slot, p, *sum);
                *check = fused(simd, *check, *sum, zero);
            }
        }
    }
}
