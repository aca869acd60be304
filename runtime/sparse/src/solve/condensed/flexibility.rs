//! The flexibility: displacements of some dofs under many unit loads, columns of `K⁻¹` restricted to rows.
//!
//! Promises: the same bytes for any number of threads; work on the fronts above loads and displacements alone.
//! Loads that are near each other in the order of elimination share their fronts: the caller sorts them so.

use rayon::prelude::*;
use wfl_dense::{Accum, MatMut, MatRef, Par, ReborrowMut};

use super::super::SolveError;
use super::super::dense::Number;
use super::super::multifrontal::Multifrontal;
use super::super::scaling::power_of_two;
use super::super::symbolic::{INTERFACE, Symbolic};
use super::rows::Flexibility;
use crate::index::NONE;
use wfl_host::memory::zeros;

/// Loads that go through the fronts together: enough for the dense kernels, few enough for the cache.
const BLOCK: usize = 64;
/// Blocks whose displacements are kept before they are sorted in. Fixed, so that memory is bounded for any number of threads.
const WAVE: usize = 8;

/// A unit load on a dof, and an opposite one on another (or [`NONE`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Load {
    pub(super) here: u32,
    pub(super) there: u32,
}

/// The factored matrix and the fronts that matter.
pub(super) struct FactoredBulk<'a> {
    pub(super) symbolic: &'a Symbolic,
    pub(super) factor: &'a Multifrontal,
    /// Fronts that own a loaded dof or one whose displacement is wanted, and all above them.
    pub(super) members: &'a [bool],
}

impl FactoredBulk<'_> {
    /// Displacements of `rows` (dofs) under the loads, `rows x loads` by rows, times the power of two that comes with them:
    /// it brings the largest of the first loads to 1, so that single precision can hold them.
    ///
    /// All in the precision that the factor is of, which must be that of the displacements.
    pub(super) fn flexibility<T: Number>(
        &self,
        loads: &[Load],
        rows: &[u32],
        threads: usize,
    ) -> Result<Flexibility<T>, SolveError> {
        let n = loads.len();
        let mut scale = 1.0;
        let mut displacements = zeros(rows.len() * n, "the flexibility of the dofs that change")?;
        let blocks: Vec<&[Load]> = loads.chunks(BLOCK).collect();
        let mut first = 0;
        for wave in blocks.chunks(WAVE) {
            let work = |block: &&[Load]| self.block(block, rows);
            let parts: Vec<Vec<T>> =
                if threads > 1 { wave.par_iter().map(work).collect() } else { wave.iter().map(work).collect() };
            if first == 0 {
                let largest = parts.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.wide().abs()));
                scale = if largest > 0.0 { power_of_two(1.0 / largest) } else { 1.0 };
            }
            for (part, block) in parts.iter().zip(wave) {
                for (row, values) in part.chunks_exact(block.len()).enumerate() {
                    let displacements = &mut displacements[row * n + first..][..block.len()];
                    displacements
                        .iter_mut()
                        .zip(values)
                        .for_each(|(displacement, value)| *displacement = T::nearest(value.wide() * scale));
                }
                first += block.len();
            }
        }
        Ok(Flexibility { values: displacements, scale: scale / self.factor.scale() })
    }

    fn block<T: Number>(&self, loads: &[Load], rows: &[u32]) -> Vec<T> {
        let symbolic = self.symbolic;
        let (n, width) = (symbolic.n_eliminated(), loads.len());
        let inverse = symbolic.ordering.inverse();
        let mut x = vec![T::default(); n * width];
        let mut is_loaded = vec![false; symbolic.n_fronts()];
        for (column, load) in loads.iter().enumerate() {
            for (dof, sign) in [(load.here, 1.0), (load.there, -1.0)].into_iter().filter(|(dof, _)| *dof != NONE) {
                let place = inverse[dof as usize];
                x[column * n + place as usize] = T::nearest(sign);
                is_loaded[symbolic.columns.partition_point(|&column| column <= place) - 1] = true;
            }
        }
        let mut work = Vec::new();
        for front in 0..symbolic.n_fronts() {
            if is_loaded[front] {
                self.forward(front, &mut x, width, &mut work);
                if symbolic.parents[front] != INTERFACE {
                    is_loaded[symbolic.parents[front] as usize] = true;
                }
            }
        }
        for front in (0..symbolic.n_fronts()).rev().filter(|&front| self.members[front]) {
            self.backward(front, &mut x, width, &mut work);
        }
        let places = rows.iter().map(|&dof| inverse[dof as usize] as usize);
        places.flat_map(|place| (0..width).map(move |column| (column, place))).map(|(c, p)| x[c * n + p]).collect()
    }

    fn forward<T: Number>(&self, front: usize, x: &mut [T], width: usize, work: &mut Vec<T>) {
        let (k, r) = self.symbolic.sizes(front);
        let (n, first) = (self.symbolic.n_eliminated(), self.symbolic.columns[front] as usize);
        let (top, bottom) = MatRef::from_column_major_slice(T::panel(self.factor, front), k + r, k).split_at_row(k);
        let mut own = columns_of(x, n, first, k, width);
        T::solve_lower(top, own.rb_mut(), Par::Seq);
        if r == 0 {
            return;
        }
        work.resize(r * width, T::default());
        let below = MatMut::from_column_major_slice_mut(&mut work[..r * width], r, width);
        T::product(below, Accum::Replace, bottom, own.as_ref(), T::nearest(1.0), Par::Seq);
        for (column, values) in work[..r * width].chunks_exact(r).enumerate() {
            let target = &mut x[column * n..(column + 1) * n];
            for (&row, value) in self.symbolic.rows_of(front).iter().zip(values) {
                target[row as usize] -= *value;
            }
        }
    }

    fn backward<T: Number>(&self, front: usize, x: &mut [T], width: usize, work: &mut Vec<T>) {
        let (k, r) = self.symbolic.sizes(front);
        let (n, first) = (self.symbolic.n_eliminated(), self.symbolic.columns[front] as usize);
        let (top, bottom) = MatRef::from_column_major_slice(T::panel(self.factor, front), k + r, k).split_at_row(k);
        work.resize(r * width, T::default());
        if r > 0 {
            for (column, values) in work[..r * width].chunks_exact_mut(r).enumerate() {
                let source = &x[column * n..(column + 1) * n];
                for (&row, value) in self.symbolic.rows_of(front).iter().zip(values) {
                    *value = source[row as usize];
                }
            }
        }
        let mut own = columns_of(x, n, first, k, width);
        if r > 0 {
            let below = MatRef::from_column_major_slice(&work[..r * width], r, width);
            T::product(own.rb_mut(), Accum::Add, bottom.transpose(), below, T::nearest(-1.0), Par::Seq);
        }
        T::solve_upper(top.transpose(), own, Par::Seq);
    }
}

/// Rows `first..first + k` of an `n x width` matrix by columns.
fn columns_of<T: Number>(x: &mut [T], n: usize, first: usize, k: usize, width: usize) -> MatMut<'_, T> {
    let end = first + (width - 1) * n + k;
    MatMut::from_column_major_slice_with_stride_mut(&mut x[first..end], k, width, n)
}
