//! Rows of M, the flexibility V that they read, and products of the two.
//!
//! Promises: the same bytes for any number of threads. Does not factor.

use rayon::prelude::*;

use super::super::dense::Number;
use crate::csr::Csr;
use wfl_dense::sweeps::TOGETHER;

/// Values of V from which a product is shared among threads, and rows in one share.
pub(super) const PARALLEL_VALUES: usize = 1 << 20;
pub(super) const SHARE: usize = 128;
/// Columns of a product that are filled together: what they read of V stays in the cache.
const FILL_COLUMNS: usize = 480;

/// M by rows, and where its columns stand: by dof a row of V, or behind the last one a dof without stiffness.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub(super) m: &'a Csr,
    pub(super) place: &'a [u32],
    /// Rows of V.
    pub(super) n_read: usize,
    /// Columns of V; the first of the unknowns.
    pub(super) n_loads: usize,
}

/// The flexibility V, `read x loads` by rows, with the power of two that its values have been multiplied with.
pub(super) struct Flexibility<T> {
    pub(super) values: Vec<T>,
    pub(super) scale: f64,
}

/// Does something to each chunk, with its number.
pub(super) fn share<T: Send>(
    threads: usize,
    values: &mut [T],
    chunk: usize,
    work: impl Fn((usize, &mut [T])) + Sync + Send,
) {
    if threads > 1 {
        values.par_chunks_mut(chunk).enumerate().for_each(work);
    } else {
        values.chunks_mut(chunk).enumerate().for_each(work);
    }
}

/// Rows that products are made of.
#[derive(Clone, Copy)]
pub(super) struct Source<'a, T> {
    /// By rows.
    pub(super) values: &'a [T],
    /// What the rows of dofs with stiffness have been multiplied with.
    pub(super) scale: f64,
    pub(super) width: usize,
    /// Numbers from one row to the next.
    pub(super) stride: usize,
    /// The rows there are; what M reads behind them is left out.
    pub(super) n_rows: usize,
}

/// Rows of the product of M with a source, those of M from `first` on, into the beginnings of the rows of `out`, which
/// have `stride` numbers. Neighbouring rows that read the same dofs (the components of a node) are made together: each
/// value of the source is loaded once for all.
pub(super) fn fill_products<T: Number>(
    rows: Rows<'_>,
    Source { values: v, scale, width, stride: step, n_rows }: Source<'_, T>,
    first: usize,
    out: &mut [T],
    stride: usize,
) {
    let Rows { m, place, n_read, .. } = rows;
    let last = first + out.len() / stride;
    let mut starts = vec![first];
    for row in first + 1..last {
        let group = starts[starts.len() - 1];
        if row - group == TOGETHER || m.row(row).0 != m.row(group).0 {
            starts.push(row);
        }
    }
    starts.push(last);
    let (mut factors, mut vectors) = (Vec::new(), Vec::new());
    for columns in (0..width).step_by(FILL_COLUMNS).map(|column| column..width.min(column + FILL_COLUMNS)) {
        for group in starts.windows(2) {
            factors.clear();
            vectors.clear();
            for (k, &column) in m.row(group[0]).0.iter().enumerate() {
                let at = place[column as usize] as usize;
                let mut all = [T::nearest(0.0); TOGETHER];
                let unit = if at < n_read { scale } else { 1.0 };
                (group[0]..group[1])
                    .zip(&mut all)
                    .for_each(|(row, factor)| *factor = T::nearest(m.row(row).1[k] / unit));
                if at < n_rows && all.iter().any(|factor| factor.wide() != 0.0) {
                    factors.push(all);
                    vectors.push(&v[at * step..][columns.clone()]);
                }
            }
            let mut targets = out[(group[0] - first) * stride..(group[1] - first) * stride].chunks_exact_mut(stride);
            let targets: [&mut [T]; TOGETHER] =
                std::array::from_fn(|_| targets.next().map_or(&mut [][..], |row| &mut row[columns.clone()]));
            T::combine(&factors, &vectors, targets);
        }
    }
}
