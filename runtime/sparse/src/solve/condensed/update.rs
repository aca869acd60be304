//! A factored matrix of which some rows change.
//!
//! With the reference `A = 1 + M V`, E the columns of the identity at the rows that differ from it, and D the
//! differences of these rows of M,
//!
//! ```text
//! 1 + M' V = A + E D V       W = V A⁻¹ E       S = 1 + D W       (Sherman, Morrison, Woodbury)
//! (A + E D V)⁻¹ b = A⁻¹ (b - E S⁻¹ D V A⁻¹ b)
//! ```
//!
//! W has a column a changed row and is kept: rows that change again cost nothing but a new S, which is as small as their
//! number. V stands here for the flexibility and, for a dof without stiffness, for minus its own value.
//!
//! Promises: the same bytes for any number of threads; what is not finite is refused.
//! Does not decide when a reference has served its time: its owner does.

use std::sync::Arc;
use wfl_dense::{Accum, MatMut, MatRef};

use super::super::SolveError;
use super::super::dense::{Dense, Kind, Number};
use super::super::triangular_solve::Transpose;
use super::rows::{Flexibility, PARALLEL_VALUES, Rows, SHARE, Source, fill_products, share};
use crate::csr::{Csr, Pattern};
use wfl_host::memory::zeros;

/// Rows of S that one thread fills at a time.
const FILL_ROWS: usize = 12;
/// Of all rows, those that may have changed for the reference to serve on.
pub(super) const LARGEST_PART: f64 = 0.6;

/// See the module documentation.
pub(super) struct Update<T: Number> {
    /// The changed rows in the order in which they were seen to change, and the sizes of the groups that came at once.
    changed: Vec<u32>,
    sizes: Vec<usize>,
    is_changed: Vec<bool>,
    /// W, `(read + bare) x changed` by rows with room for more columns; those of `read` multiplied as V.
    columns: Vec<T>,
    /// Numbers in a row of W.
    stride: usize,
    /// D, `changed x dofs`.
    difference: Csr,
    /// By entry of D: row of V that it reads, those of bare dofs behind.
    places: Vec<u32>,
    /// Rows of V that D reads, increasing.
    read: Vec<u32>,
    /// Factor of `Sᵀ`.
    inner: Dense<T>,
    /// V times a vector, or a vector that V is multiplied with from the left.
    product: Vec<f64>,
    n_read: usize,
    n_loads: usize,
}

impl<T: Number> Update<T> {
    /// Of a system of `n` unknowns; nothing has changed yet.
    pub(super) fn new(n: usize) -> Self {
        Self {
            changed: Vec::new(),
            sizes: Vec::new(),
            is_changed: vec![false; n],
            columns: Vec::new(),
            stride: 0,
            difference: Csr::zeros(Arc::new(Pattern::empty(0, 0))),
            places: Vec::new(),
            read: Vec::new(),
            inner: Dense::empty(),
            product: Vec::new(),
            n_read: 0,
            n_loads: 0,
        }
    }

    pub(super) fn holds(&self, row: usize) -> bool {
        self.is_changed[row]
    }

    pub(super) fn n_rows(&self) -> usize {
        self.changed.len()
    }

    pub(super) fn groups(&self) -> Vec<Vec<u32>> {
        let mut rest = &self.changed[..];
        let mut take = |size: &usize| {
            let (group, others) = rest.split_at(*size);
            rest = others;
            group.to_vec()
        };
        self.sizes.iter().map(&mut take).collect()
    }

    /// Adds the columns of W of these rows.
    pub(super) fn extend(
        &mut self,
        rows: Rows<'_>,
        v: &Flexibility<T>,
        reference: &mut Dense<T>,
        new: &[u32],
        threads: usize,
    ) -> Result<(), SolveError> {
        let n = rows.m.n_rows();
        let (n_read, n_loads, old, k) = (rows.n_read, rows.n_loads, self.changed.len(), new.len());
        let n_places = n_read + n - n_loads;
        let mut solved = zeros::<T>(n * k, "the flexibility of changed rows")?;
        for (column, &row) in solved.chunks_exact_mut(n).zip(new) {
            column[row as usize] = T::nearest(1.0);
        }
        reference.solve_transposed_columns(&mut solved);
        let mut added = zeros::<T>(n_read * k, "the flexibility of changed rows")?;
        let par = super::super::parallelism(threads, (n_read * n_loads) as f64 * k as f64);
        let forces = MatRef::from_column_major_slice(&solved, n, k).subrows(0, n_loads);
        let flexibility = MatRef::from_row_major_slice(&v.values, n_read, n_loads);
        let target = MatMut::from_row_major_slice_mut(&mut added, n_read, k);
        T::product(target, Accum::Replace, flexibility, forces, T::nearest(1.0), par);
        if solved.iter().chain(&added).any(|value| !value.wide().is_finite()) {
            return Err(SolveError::Internal { what: "the flexibility of changed rows" });
        }
        self.make_room(n_places, old, old + k)?;
        for (place, target) in self.columns.chunks_exact_mut(self.stride).enumerate() {
            let target = &mut target[old..old + k];
            if place < n_read {
                target.copy_from_slice(&added[place * k..][..k]);
            } else {
                let bare = place - n_read + n_loads;
                target.iter_mut().zip(solved.chunks_exact(n)).for_each(|(t, w)| *t = T::nearest(-w[bare].wide()));
            }
        }
        new.iter().for_each(|&row| self.is_changed[row as usize] = true);
        self.changed.extend_from_slice(new);
        self.sizes.push(k);
        self.inner = Dense::new(self.changed.len(), threads)?;
        (self.n_read, self.n_loads) = (n_read, n_loads);
        self.product = vec![0.0; n_places];
        self.read_rows(rows)
    }

    /// Room for so many columns of W, and more where the `old` ones have to be moved for that.
    fn make_room(&mut self, n_places: usize, old: usize, needed: usize) -> Result<(), SolveError> {
        if needed <= self.stride {
            return Ok(());
        }
        let most = (LARGEST_PART * self.is_changed.len() as f64) as usize;
        let stride = (needed + needed / 2).min(most).max(needed);
        let mut columns = zeros::<T>(n_places * stride, "the flexibility of changed rows")?;
        for (target, source) in columns.chunks_exact_mut(stride).zip(self.columns.chunks_exact(self.stride.max(1))) {
            target[..old].copy_from_slice(&source[..old]);
        }
        (self.columns, self.stride) = (columns, stride);
        Ok(())
    }

    /// The structure of D.
    fn read_rows(&mut self, rows: Rows<'_>) -> Result<(), SolveError> {
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for &row in &self.changed {
            columns.extend_from_slice(rows.m.row(row as usize).0);
            starts.push(columns.len());
        }
        self.places = columns.iter().map(|&column| rows.place[column as usize]).collect();
        let mut is_read = vec![false; self.n_read];
        for &place in self.places.iter().filter(|&&place| (place as usize) < self.n_read) {
            is_read[place as usize] = true;
        }
        self.read = (0..self.n_read as u32).filter(|&place| is_read[place as usize]).collect();
        let pattern = Pattern::new(self.changed.len(), rows.m.n_cols(), starts, columns)?;
        self.difference = Csr::zeros(Arc::new(pattern));
        Ok(())
    }

    /// Factors S for these rows; the smallest pivot relative to its column, and its unknown.
    pub(super) fn factor(
        &mut self,
        rows: Rows<'_>,
        reference: &[f64],
        scale: f64,
        threads: usize,
    ) -> Result<(f64, usize), SolveError> {
        let (n, starts) = (self.changed.len(), rows.m.pattern().row_starts());
        let entries = self.changed.iter().flat_map(|&row| starts[row as usize]..starts[row as usize + 1]);
        for (value, entry) in self.difference.values_mut().iter_mut().zip(entries) {
            *value = rows.m.values()[entry] - reference[entry];
        }
        let source = Source { values: &self.columns, scale, width: n, stride: self.stride, n_rows: self.product.len() };
        let changed = Rows { m: &self.difference, ..rows };
        let fill_share = |(share, out): (usize, &mut [T])| {
            let first = share * FILL_ROWS;
            fill_products(changed, source, first, out, n);
            for (row, out) in (first..).zip(out.chunks_exact_mut(n)) {
                out[row] = T::nearest(out[row].wide() + 1.0);
            }
        };
        let fill = |matrix: &mut [T]| share(threads, matrix, FILL_ROWS * n, fill_share);
        let (ratio, row) = self.inner.factor(Kind::General, fill)?;
        Ok((ratio, self.changed.get(row).map_or(0, |&row| row as usize)))
    }

    /// Whether the determinant of S is negative: that of A times it is that of the changed matrix (Sylvester).
    pub(super) fn is_negative(&self) -> bool {
        self.inner.is_negative()
    }

    /// Solves in place.
    pub(super) fn solve(
        &mut self,
        transpose: Transpose,
        v: &Flexibility<T>,
        reference: &mut Dense<T>,
        b: &mut [f64],
        threads: usize,
    ) {
        let mut w = b.to_vec();
        reference.solve(transpose.flipped(), &mut w);
        match transpose {
            Transpose::No => {
                self.multiply(v, &w, threads);
                let entries = self.places.iter().map(|&place| self.product[place as usize]);
                let terms: Vec<f64> = self.difference.values().iter().zip(entries).map(|(d, x)| d * x).collect();
                let starts = self.difference.pattern().row_starts();
                let mut z: Vec<f64> = starts.windows(2).map(|range| terms[range[0]..range[1]].iter().sum()).collect();
                self.inner.solve(Transpose::Yes, &mut z);
                self.changed.iter().zip(&z).for_each(|(&row, z)| b[row as usize] -= z);
            }
            Transpose::Yes => {
                let mut z: Vec<f64> = self.changed.iter().map(|&row| w[row as usize]).collect();
                self.inner.solve(Transpose::No, &mut z);
                self.multiply_transposed(v, &z, b);
            }
        }
        reference.solve(transpose.flipped(), b);
    }

    /// `product = V w` where D reads it.
    fn multiply(&mut self, v: &Flexibility<T>, w: &[f64], threads: usize) {
        let n = self.n_loads;
        let (read, bare) = self.product.split_at_mut(self.n_read);
        bare.iter_mut().zip(&w[n..]).for_each(|(value, w)| *value = -w);
        let mut products = vec![0.0; self.read.len()];
        let places = &self.read;
        let work = |(share, mut products): (usize, &mut [f64])| {
            let places = &places[share * SHARE..][..products.len()];
            // Rows that lie one behind the other are taken together.
            for run in places.chunk_by(|a, b| a + 1 == *b) {
                let (own, rest) = products.split_at_mut(run.len());
                T::product_by_rows(&v.values[run[0] as usize * n..][..run.len() * n], &w[..n], own);
                products = rest;
            }
        };
        let threads = if places.len() * n > PARALLEL_VALUES { threads } else { 1 };
        share(threads, &mut products, SHARE, work);
        places.iter().zip(&products).for_each(|(&place, product)| read[place as usize] = product / v.scale);
    }

    /// `b = b - (D V)ᵀ z`.
    fn multiply_transposed(&mut self, v: &Flexibility<T>, z: &[f64], b: &mut [f64]) {
        let n = self.n_loads;
        self.product.fill(0.0);
        let starts = self.difference.pattern().row_starts();
        for (range, z) in starts.windows(2).zip(z) {
            let entries = self.places[range[0]..range[1]].iter().zip(&self.difference.values()[range[0]..range[1]]);
            entries.for_each(|(&place, d)| self.product[place as usize] += d * z);
        }
        let (read, bare) = self.product.split_at(self.n_read);
        b[n..].iter_mut().zip(bare).for_each(|(b, product)| *b += product);
        for &place in &self.read {
            let factor = read[place as usize] / v.scale;
            let values = &v.values[place as usize * n..][..n];
            b.iter_mut().zip(values).for_each(|(b, value)| *b -= factor * value.wide());
        }
    }
}
