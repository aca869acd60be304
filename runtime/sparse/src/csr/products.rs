//! Products of a matrix whose entries may be held in two places, with the sizes that their rounding is relative to.
//!
//! Promises: sums go over the columns of a row in their order, wherever the entries are, for any number of threads.

use rayon::prelude::*;

use super::{Csr, CsrError, PARALLEL_ENTRIES, PatternBuilder, ROWS_PER_TASK};
use crate::index::NONE;

/// The same rows of three vectors.
type RowsOfThree<'a> = ((&'a mut [f64], &'a mut [f64]), &'a mut [f64]);

/// A square matrix that is read row by row.
pub trait Rows: Sync {
    /// Number of rows.
    fn n_rows(&self) -> usize;

    /// Number of entries.
    fn n_entries(&self) -> usize;

    /// Hands over the columns and values of a row, in the order of the columns.
    fn for_each_in(&self, row: usize, take: impl FnMut(u32, f64));
}

impl Rows for Csr {
    fn n_rows(&self) -> usize {
        self.n_rows()
    }

    fn n_entries(&self) -> usize {
        self.values().len()
    }

    #[inline]
    fn for_each_in(&self, row: usize, mut take: impl FnMut(u32, f64)) {
        let (columns, values) = self.row(row);
        columns.iter().zip(values).for_each(|(column, value)| take(*column, *value));
    }
}

/// What a matrix has outside of another one, which holds its entries over some rows and columns, as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Outside {
    entries: Csr,
    /// By row where it is inside, or [`NONE`].
    inside: Vec<u32>,
    /// By row inside: where it is in the whole.
    whole: Vec<u32>,
}

impl Outside {
    /// Of a square matrix; `inside` says by row which row of the other matrix it is, increasing, or [`NONE`].
    ///
    /// # Errors
    /// [`CsrError`] where the rows outside do not fit the index types.
    pub fn new(matrix: &Csr, inside: &[u32]) -> Result<Self, CsrError> {
        let n = matrix.n_rows();
        let is_outside = |row: usize, column: u32| inside[row] == NONE || inside[column as usize] == NONE;
        let mut builder = PatternBuilder::new(n, matrix.n_cols());
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        for (row, number) in (0..n).zip(0u32..) {
            columns.clear();
            matrix.for_each_in(row, |column, value| {
                if is_outside(row, column) {
                    columns.push(column);
                    values.push(value);
                }
            });
            builder.add_coupling(&[number], &columns);
        }
        let entries = Csr::new(builder.build_shared()?, values)?;
        let whole = (0..).zip(inside).filter(|(_, inner)| **inner != NONE).map(|(row, _)| row).collect();
        Ok(Self { entries, inside: inside.to_vec(), whole })
    }

    /// The whole matrix, with what the other one holds.
    #[must_use]
    pub fn around<'a>(&'a self, inner: &'a Csr) -> Whole<'a> {
        Whole { outside: self, inner }
    }
}

/// A matrix of two parts.
#[derive(Clone, Copy, Debug)]
pub struct Whole<'a> {
    outside: &'a Outside,
    inner: &'a Csr,
}

impl Rows for Whole<'_> {
    fn n_rows(&self) -> usize {
        self.outside.inside.len()
    }

    fn n_entries(&self) -> usize {
        self.outside.entries.values().len() + self.inner.values().len()
    }

    #[inline]
    fn for_each_in(&self, row: usize, mut take: impl FnMut(u32, f64)) {
        let Outside { entries, inside, whole } = self.outside;
        let (columns, values) = entries.row(row);
        let mut others = columns.iter().copied().zip(values.iter().copied()).peekable();
        if inside[row] != NONE {
            self.inner.for_each_in(inside[row] as usize, |column, value| {
                let column = whole[column as usize];
                while let Some((before, value)) = others.next_if(|(other, _)| *other < column) {
                    take(before, value);
                }
                take(column, value);
            });
        }
        others.for_each(|(column, value)| take(column, value));
    }
}

/// `p = A d` with its sizes `s_i = Σ |a_ij d_j|`, in one pass over the matrix: `outs` are p and s.
///
/// # Panics
/// When a length does not fit.
pub fn product_and_size(a: &impl Rows, d: &[f64], outs: [&mut [f64]; 2], threads: usize) {
    let [p, s] = outs;
    assert_eq!([p.len(), s.len(), d.len()], [a.n_rows(); 3]);
    let share = |(chunk, (p, s)): (usize, (&mut [f64], &mut [f64]))| {
        for (offset, (p, s)) in p.iter_mut().zip(s).enumerate() {
            let (mut sum, mut size) = (0.0, 0.0);
            a.for_each_in(chunk * ROWS_PER_TASK + offset, |column, value| {
                let product = value * d[column as usize];
                sum += product;
                size += product.abs();
            });
            (*p, *s) = (sum, size);
        }
    };
    if threads > 1 && a.n_entries() > PARALLEL_ENTRIES {
        p.par_chunks_mut(ROWS_PER_TASK).zip(s.par_chunks_mut(ROWS_PER_TASK)).enumerate().for_each(share);
    } else {
        p.chunks_mut(ROWS_PER_TASK).zip(s.chunks_mut(ROWS_PER_TASK)).enumerate().for_each(share);
    }
}

/// The same, and the sizes `t_i = Σ |a_ij x_j|` of another vector: `outs` are p, s and t.
///
/// # Panics
/// When a length does not fit.
pub fn product_and_sizes(a: &impl Rows, d: &[f64], x: &[f64], outs: [&mut [f64]; 3], threads: usize) {
    let [p, s, t] = outs;
    assert_eq!([p.len(), s.len(), t.len(), d.len(), x.len()], [a.n_rows(); 5]);
    let share = |(chunk, ((p, s), t)): (usize, RowsOfThree<'_>)| {
        for (offset, ((p, s), t)) in p.iter_mut().zip(s).zip(t).enumerate() {
            let (mut sum, mut size, mut other) = (0.0, 0.0, 0.0);
            a.for_each_in(chunk * ROWS_PER_TASK + offset, |column, value| {
                let product = value * d[column as usize];
                sum += product;
                size += product.abs();
                other += (value * x[column as usize]).abs();
            });
            (*p, *s, *t) = (sum, size, other);
        }
    };
    if threads > 1 && a.n_entries() > PARALLEL_ENTRIES {
        let s = s.par_chunks_mut(ROWS_PER_TASK);
        p.par_chunks_mut(ROWS_PER_TASK).zip(s).zip(t.par_chunks_mut(ROWS_PER_TASK)).enumerate().for_each(share);
    } else {
        let s = s.chunks_mut(ROWS_PER_TASK);
        p.chunks_mut(ROWS_PER_TASK).zip(s).zip(t.chunks_mut(ROWS_PER_TASK)).enumerate().for_each(share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csr::Restriction;

    #[test]
    fn a_matrix_of_two_parts_has_the_products_of_the_whole_to_the_last_bit() {
        let n = 40u32;
        let entry = |i: u32, k: u32| (i, (i * 7 + k * k * 11) % n, 1.0 / f64::from(i + 3 * k + 1));
        let triplets: Vec<_> = (0..n).flat_map(|i| (0..6).map(move |k| entry(i, k))).collect();
        let matrix = Csr::from_triplets(n as usize, n as usize, &triplets).expect("a matrix");
        // every third one is outside
        let mut next = 0..;
        let inside: Vec<u32> = (0..n).map(|i| if i % 3 == 1 { NONE } else { next.next().expect("endless") }).collect();
        let n_inside = inside.iter().filter(|inner| **inner != NONE).count();
        let inner = Restriction::new(matrix.pattern(), &inside, n_inside).expect("a part").apply(&matrix);
        let outside = Outside::new(&matrix, &inside).expect("the rest");
        let whole = outside.around(&inner);
        assert_eq!(whole.n_entries(), matrix.values().len());
        let d: Vec<f64> = (0..n).map(|i| f64::from(i % 17) - 8.3).collect();
        let x: Vec<f64> = d.iter().map(|d| d * d + 0.1).collect();
        let zeros = || [(); 3].map(|()| vec![0.0; n as usize]);
        let (mut one, mut other) = (zeros(), zeros());
        product_and_sizes(&matrix, &d, &x, one.each_mut().map(|v| v.as_mut_slice()), 1);
        product_and_sizes(&whole, &d, &x, other.each_mut().map(|v| v.as_mut_slice()), 2);
        assert_eq!(one, other);
        let [p, s, _] = &mut other;
        product_and_size(&whole, &d, [p, s], 1);
        assert_eq!(one[..2], other[..2]);
    }
}
