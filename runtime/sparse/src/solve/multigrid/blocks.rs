//! Matrices of blocks: one small dense block for each pair of coupled nodes.
//!
//! A block has as many rows and columns as the nodes have unknowns, stored row by row; vectors hold the unknowns of a
//! node side by side. One index serves a whole block, so that a product reads a third to a quarter of the bytes of a
//! matrix of single entries; where numbers are of single precision, half of that again.
//!
//! Promises: sums in one fixed order for any number of threads. Does not know what the unknowns mean.

use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

use rayon::prelude::*;
use wfl_host::memory::{TooMuchMemory, zeros};

/// Rows of blocks in one task of a thread.
pub(super) const ROWS_PER_TASK: usize = 256;

/// Numbers of single or double precision.
pub(super) trait Real:
    Copy
    + Default
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// The nearest number of this precision.
    fn of(value: f64) -> Self;
    /// In double precision.
    fn wide(self) -> f64;
    /// Several in double precision; `buffer` holds them where they are not stored as such.
    fn all_wide<'a>(values: &'a [Self], buffer: &'a mut Vec<f64>) -> &'a [f64];
}

impl Real for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }

    fn all_wide<'a>(values: &'a [Self], buffer: &'a mut Vec<f64>) -> &'a [f64] {
        buffer.clear();
        buffer.extend(values.iter().map(|value| f64::from(*value)));
        buffer
    }
}

impl Real for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }

    fn all_wide<'a>(values: &'a [Self], _buffer: &'a mut Vec<f64>) -> &'a [f64] {
        values
    }
}

/// Room for one row of blocks.
#[derive(Debug, Clone, Default)]
pub(super) struct RowBuffer {
    pub(super) columns: Vec<u32>,
    pub(super) values: Vec<f64>,
}

/// A square matrix that gives its rows of blocks in double precision.
pub(super) trait Rows: Sync {
    /// Unknowns of a node: rows and columns of a block.
    fn size(&self) -> usize;
    /// Number of nodes.
    fn n_nodes(&self) -> usize;
    /// Columns (increasing) and blocks of a row; `buffer` holds them where they are not stored as such.
    fn row<'a>(&'a self, node: usize, buffer: &'a mut RowBuffer) -> (&'a [u32], &'a [f64]);
}

/// A matrix of blocks.
#[derive(Debug, Clone)]
pub(super) struct Blocks<T> {
    /// Rows and columns of a block.
    pub(super) shape: [usize; 2],
    /// Number of columns of blocks.
    pub(super) n_cols: usize,
    pub(super) starts: Vec<usize>,
    pub(super) columns: Vec<u32>,
    pub(super) values: Vec<T>,
}

/// Calls a function that is generic over the shape of a block.
macro_rules! by_shape {
    ($shape:expr, $function:ident ( $($argument:expr),* )) => {
        match $shape {
            [1, 1] => $function::<1, 1, _, _>($($argument),*),
            [2, 2] => $function::<2, 2, _, _>($($argument),*),
            [2, 3] => $function::<2, 3, _, _>($($argument),*),
            [3, 3] => $function::<3, 3, _, _>($($argument),*),
            [3, 6] => $function::<3, 6, _, _>($($argument),*),
            [6, 6] => $function::<6, 6, _, _>($($argument),*),
            _ => unreachable!("blocks have one, two, three or six rows"),
        }
    };
}

impl<T: Real> Blocks<T> {
    /// Number of rows of blocks.
    pub(super) fn n_rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of unknowns by row.
    pub(super) fn n_unknowns(&self) -> usize {
        self.n_rows() * self.shape[0]
    }

    /// Bytes of indices and values.
    pub(super) fn bytes(&self) -> usize {
        8 * self.starts.len() + 4 * self.columns.len() + size_of::<T>() * self.values.len()
    }

    /// Columns and blocks of a row.
    pub(super) fn row_of(&self, row: usize) -> (&[u32], &[T]) {
        let size = self.shape[0] * self.shape[1];
        let (begin, end) = (self.starts[row], self.starts[row + 1]);
        (&self.columns[begin..end], &self.values[begin * size..end * size])
    }

    /// The block of a place in `columns`.
    pub(super) fn block(&self, place: usize) -> &[T] {
        let size = self.shape[0] * self.shape[1];
        &self.values[place * size..][..size]
    }

    /// A copy of a matrix, its numbers rounded to this precision.
    ///
    /// # Errors
    /// [`TooMuchMemory`].
    pub(super) fn rounded(source: &dyn Rows) -> Result<Self, TooMuchMemory> {
        let (n, size) = (source.n_nodes(), source.size());
        let count = |buffer: &mut RowBuffer, row: usize| source.row(row, buffer).0.len();
        let fill = |buffer: &mut RowBuffer, row: usize, columns: &mut [u32], values: &mut [T]| {
            let (of_row, blocks) = source.row(row, buffer);
            columns.copy_from_slice(of_row);
            values.iter_mut().zip(blocks).for_each(|(slot, value)| *slot = T::of(*value));
        };
        Self::by_rows(n, [size, size], n, count, fill)
    }

    /// A matrix of so many rows, row by row, with `n_cols` columns of blocks: `count` says how many blocks a row has,
    /// `fill` writes their columns and values. What both need is kept by thread.
    ///
    /// # Errors
    /// [`TooMuchMemory`].
    pub(super) fn by_rows<B: Default>(
        n: usize,
        shape: [usize; 2],
        n_cols: usize,
        count: impl Fn(&mut B, usize) -> usize + Sync,
        fill: impl Fn(&mut B, usize, &mut [u32], &mut [T]) + Sync,
    ) -> Result<Self, TooMuchMemory> {
        let area = shape[0] * shape[1];
        let mut counts = vec![0u32; n];
        counts.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each_init(B::default, |buffer, (chunk, counts)| {
            for (offset, slot) in counts.iter_mut().enumerate() {
                *slot = count(buffer, chunk * ROWS_PER_TASK + offset) as u32;
            }
        });
        let mut starts = Vec::with_capacity(n + 1);
        starts.push(0usize);
        for count in &counts {
            starts.push(starts[starts.len() - 1] + *count as usize);
        }
        let mut columns: Vec<u32> = zeros(starts[n], "the multigrid preconditioner")?;
        let mut values: Vec<T> = zeros(starts[n] * area, "the multigrid preconditioner")?;
        let (mut columns_left, mut values_left) = (columns.as_mut_slice(), values.as_mut_slice());
        let mut tasks = Vec::with_capacity(n / ROWS_PER_TASK + 1);
        for first in (0..n).step_by(ROWS_PER_TASK) {
            let last = (first + ROWS_PER_TASK).min(n);
            let count = starts[last] - starts[first];
            let (own, rest) = columns_left.split_at_mut(count);
            columns_left = rest;
            let (own_values, rest) = values_left.split_at_mut(count * area);
            values_left = rest;
            tasks.push((first..last, own, own_values));
        }
        tasks.into_par_iter().for_each_init(B::default, |buffer, (rows, columns, values)| {
            let mut at = 0;
            for row in rows {
                let count = starts[row + 1] - starts[row];
                fill(buffer, row, &mut columns[at..][..count], &mut values[at * area..][..count * area]);
                at += count;
            }
        });
        Ok(Self { shape, n_cols, starts, columns, values })
    }

    /// For each row `then(row, A x, out)`, where `out` is the part of a vector that belongs to the row.
    pub(super) fn for_each_row<X: Real>(&self, x: &[X], out: &mut [X], then: impl Fn(usize, &[X], &mut [X]) + Sync) {
        by_shape!(self.shape, rows_times(self, x, out, &then));
    }
}

/// See [`Blocks::for_each_row`].
fn rows_times<const R: usize, const C: usize, T: Real, X: Real>(
    a: &Blocks<T>,
    x: &[X],
    out: &mut [X],
    then: &(impl Fn(usize, &[X], &mut [X]) + Sync),
) {
    let x = x.as_chunks::<C>().0;
    let task = |(chunk, out): (usize, &mut [X])| {
        for (offset, out) in out.as_chunks_mut::<R>().0.iter_mut().enumerate() {
            let row = chunk * ROWS_PER_TASK + offset;
            let (columns, values) = a.row_of(row);
            let mut sum = [X::default(); R];
            for (column, block) in columns.iter().zip(values.as_chunks::<C>().0.chunks_exact(R)) {
                let x = &x[*column as usize];
                for (sum, entries) in sum.iter_mut().zip(block) {
                    for (entry, x) in entries.iter().zip(x) {
                        *sum += X::of(entry.wide()) * *x;
                    }
                }
            }
            then(row, &sum, out);
        }
    };
    if a.n_rows() <= ROWS_PER_TASK || rayon::current_num_threads() == 1 {
        out.chunks_mut(R * ROWS_PER_TASK).enumerate().for_each(task);
    } else {
        out.par_chunks_mut(R * ROWS_PER_TASK).enumerate().for_each(task);
    }
}

impl<T: Real> Rows for Blocks<T> {
    fn size(&self) -> usize {
        self.shape[0]
    }

    fn n_nodes(&self) -> usize {
        self.n_rows()
    }

    fn row<'a>(&'a self, node: usize, buffer: &'a mut RowBuffer) -> (&'a [u32], &'a [f64]) {
        let (columns, values) = self.row_of(node);
        (columns, T::all_wide(values, &mut buffer.values))
    }
}

/// A prolongation, and where the blocks of each of its columns are.
#[derive(Debug, Clone)]
pub(super) struct Transfer<T> {
    pub(super) down: Blocks<T>,
    /// By column of blocks: the rows that have a block there and its place.
    pub(super) starts: Vec<usize>,
    pub(super) rows: Vec<[u32; 2]>,
}

impl<T: Real> Transfer<T> {
    /// Takes a prolongation from `down.n_cols` coarse nodes.
    pub(super) fn new(down: Blocks<T>) -> Self {
        let mut starts = vec![0usize; down.n_cols + 1];
        for column in &down.columns {
            starts[*column as usize + 1] += 1;
        }
        for column in 0..down.n_cols {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut rows = vec![[0u32; 2]; down.columns.len()];
        for row in 0..down.n_rows() {
            for place in down.starts[row]..down.starts[row + 1] {
                let slot = &mut next[down.columns[place] as usize];
                rows[*slot] = [row as u32, place as u32];
                *slot += 1;
            }
        }
        Self { down, starts, rows }
    }

    /// The same in another precision.
    pub(super) fn rounded<U: Real>(self) -> Transfer<U> {
        let Self { down, starts, rows } = self;
        let values = down.values.iter().map(|value| U::of(value.wide())).collect();
        let down =
            Blocks { shape: down.shape, n_cols: down.n_cols, starts: down.starts, columns: down.columns, values };
        Transfer { down, starts, rows }
    }

    /// Bytes of indices and values.
    pub(super) fn bytes(&self) -> usize {
        self.down.bytes() + 8 * self.starts.len() + 8 * self.rows.len()
    }

    /// Rows that have a block in a column, each with the place of the block.
    pub(super) fn column(&self, column: usize) -> &[[u32; 2]] {
        &self.rows[self.starts[column]..self.starts[column + 1]]
    }

    /// `coarse = Pᵀ fine`.
    pub(super) fn restrict(&self, fine: &[T], coarse: &mut [f64]) {
        by_shape!(self.down.shape, restrict_rows(self, fine, coarse));
    }

    /// `fine = fine + P coarse`.
    pub(super) fn prolong_add(&self, coarse: &[f64], fine: &mut [T]) {
        by_shape!(self.down.shape, prolong_rows(self, coarse, fine));
    }
}

fn restrict_rows<const R: usize, const C: usize, T: Real, X: Real>(
    transfer: &Transfer<T>,
    fine: &[T],
    coarse: &mut [X],
) {
    let fine = fine.as_chunks::<R>().0;
    coarse.par_chunks_mut(C * ROWS_PER_TASK).enumerate().for_each(|(chunk, out)| {
        for (offset, out) in out.as_chunks_mut::<C>().0.iter_mut().enumerate() {
            let mut sum = [0.0f64; C];
            for [row, place] in transfer.column(chunk * ROWS_PER_TASK + offset) {
                let block = transfer.down.block(*place as usize).as_chunks::<C>().0;
                for (entries, x) in block.iter().zip(&fine[*row as usize]) {
                    for (sum, entry) in sum.iter_mut().zip(entries) {
                        *sum += entry.wide() * x.wide();
                    }
                }
            }
            *out = sum.map(X::of);
        }
    });
}

fn prolong_rows<const R: usize, const C: usize, T: Real, X: Real>(
    transfer: &Transfer<T>,
    coarse: &[X],
    fine: &mut [T],
) {
    let coarse = coarse.as_chunks::<C>().0;
    fine.par_chunks_mut(R * ROWS_PER_TASK).enumerate().for_each(|(chunk, out)| {
        for (offset, out) in out.as_chunks_mut::<R>().0.iter_mut().enumerate() {
            let (columns, values) = transfer.down.row_of(chunk * ROWS_PER_TASK + offset);
            let mut sum = out.map(Real::wide);
            for (column, block) in columns.iter().zip(values.as_chunks::<C>().0.chunks_exact(R)) {
                let x = &coarse[*column as usize];
                for (sum, entries) in sum.iter_mut().zip(block) {
                    for (entry, x) in entries.iter().zip(x) {
                        *sum += entry.wide() * x.wide();
                    }
                }
            }
            *out = sum.map(T::of);
        }
    });
}
