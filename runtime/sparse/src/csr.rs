//! Sparse matrices in compressed row form.
//!
//! Promises: row-major order, columns of a row strictly increasing, sums in one fixed order for any number of threads,
//! and values that share their [`Pattern`] so that a matrix can be filled again without a new structure.
//! Does not solve, factor or order; see `solve`.

mod error;
mod pattern;
mod products;
mod restriction;

use std::sync::Arc;

use rayon::prelude::*;
use wfl_host::team::Team;

use crate::norm::largest;
pub use error::CsrError;
pub use pattern::{Pattern, PatternBuilder};
pub use products::{Outside, Rows, Whole, product_and_size, product_and_sizes};
pub use restriction::Restriction;

/// Rows handled by one parallel task of a product.
const ROWS_PER_TASK: usize = 1024;
/// Below this number of entries a product costs less than waking a second thread.
const PARALLEL_ENTRIES: usize = 100_000;

/// A sparse matrix: a shared [`Pattern`] and one value for each of its entries.
#[derive(Debug, Clone, PartialEq)]
pub struct Csr {
    pattern: Arc<Pattern>,
    values: Vec<f64>,
}

impl Csr {
    /// The zero matrix on a pattern.
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let values = vec![0.0; pattern.n_entries()];
        Self { pattern, values }
    }

    /// A matrix from a pattern and its values, in the order of the pattern.
    ///
    /// # Errors
    /// [`CsrError::Shape`] when there is not one value for each entry.
    pub fn new(pattern: Arc<Pattern>, values: Vec<f64>) -> Result<Self, CsrError> {
        if values.len() != pattern.n_entries() {
            return Err(CsrError::Shape {
                what: "values of a sparse matrix",
                expected: (pattern.n_entries(), 1),
                found: (values.len(), 1),
            });
        }
        Ok(Self { pattern, values })
    }

    /// The sum of (row, column, value) triplets, added in the order given.
    ///
    /// # Errors
    /// [`CsrError::Structure`] when an index lies outside the shape.
    pub fn from_triplets(n_rows: usize, n_cols: usize, triplets: &[(u32, u32, f64)]) -> Result<Self, CsrError> {
        let mut builder = PatternBuilder::new(n_rows, n_cols);
        for &(row, column, _) in triplets {
            builder.add_coupling(&[row], &[column]);
        }
        let mut matrix = Self::zeros(builder.build_shared()?);
        for &(row, column, value) in triplets {
            let place = matrix.pattern.position(row as usize, column as usize).expect("the builder added this entry");
            matrix.values[place] += value;
        }
        Ok(matrix)
    }

    /// The structure.
    #[inline]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Number of rows.
    #[inline]
    pub fn n_rows(&self) -> usize {
        self.pattern.n_rows()
    }

    /// Number of columns.
    #[inline]
    pub fn n_cols(&self) -> usize {
        self.pattern.n_cols()
    }

    /// Values in the order of the pattern.
    #[inline]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Values in the order of the pattern, to be changed.
    #[inline]
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The entry (row, column); zero when it is not stored.
    #[inline]
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.pattern.position(row, column).map_or(0.0, |place| self.values[place])
    }

    /// Columns and values of one row.
    #[inline]
    pub fn row(&self, row: usize) -> (&[u32], &[f64]) {
        let starts = self.pattern.row_starts();
        (self.pattern.row(row), &self.values[starts[row]..starts[row + 1]])
    }

    /// Adds `value` to a stored entry. Returns false, and does nothing, when the entry is not stored.
    #[must_use]
    #[inline]
    pub fn add_to(&mut self, row: usize, column: usize, value: f64) -> bool {
        match self.pattern.position(row, column) {
            Some(place) => {
                self.values[place] += value;
                true
            }
            None => false,
        }
    }

    /// Multiplies each row by a number.
    ///
    /// # Panics
    /// When there is not one number for each row.
    pub fn multiply_rows(&mut self, factors: &[f64]) {
        assert!(factors.len() == self.n_rows(), "one factor a row");
        let starts = self.pattern.row_starts();
        for (row, factor) in factors.iter().enumerate() {
            self.values[starts[row]..starts[row + 1]].iter_mut().for_each(|value| *value *= factor);
        }
    }

    /// `y = A x`. With `threads` above one, rows are shared out over rayon's current pool; the result is the same.
    ///
    /// # Panics
    /// When the lengths of `x` or `y` are not those of the matrix.
    pub fn multiply(&self, x: &[f64], y: &mut [f64], threads: usize) {
        self.rows_into(x, y, threads, |row, _| self.row_times(row, x));
    }

    /// `y = y + A x`, otherwise as [`Csr::multiply`].
    ///
    /// # Panics
    /// When the lengths of `x` or `y` are not those of the matrix.
    pub fn multiply_add(&self, x: &[f64], y: &mut [f64], threads: usize) {
        self.rows_into(x, y, threads, |row, before| before + self.row_times(row, x));
    }

    /// `y = y + Aᵀ x`, serial.
    ///
    /// # Panics
    /// When the lengths of `x` or `y` are not those of the matrix.
    pub fn multiply_transposed_add(&self, x: &[f64], y: &mut [f64]) {
        assert!(x.len() == self.n_rows() && y.len() == self.n_cols(), "lengths of a product");
        for (row, &factor) in x.iter().enumerate() {
            let (columns, values) = self.row(row);
            for (&column, &value) in columns.iter().zip(values) {
                y[column as usize] += value * factor;
            }
        }
    }

    fn rows_into(&self, x: &[f64], y: &mut [f64], threads: usize, value: impl Fn(usize, f64) -> f64 + Sync) {
        assert!(x.len() == self.n_cols() && y.len() == self.n_rows(), "lengths of a product");
        if threads > 1 && self.values.len() > PARALLEL_ENTRIES {
            y.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(chunk, part)| {
                for (offset, out) in part.iter_mut().enumerate() {
                    *out = value(chunk * ROWS_PER_TASK + offset, *out);
                }
            });
        } else {
            for (row, out) in y.iter_mut().enumerate() {
                *out = value(row, *out);
            }
        }
    }

    fn row_times(&self, row: usize, x: &[f64]) -> f64 {
        let (columns, values) = self.row(row);
        columns.iter().zip(values).map(|(&column, value)| value * x[column as usize]).sum()
    }

    /// The transposed matrix.
    pub fn transpose(&self) -> Csr {
        let (pattern, sources) = self.pattern.transpose();
        let values = sources.iter().map(|&source| self.values[source]).collect();
        Csr { pattern: Arc::new(pattern), values }
    }

    /// The sum of two matrices, on the union of their patterns.
    ///
    /// # Errors
    /// [`CsrError::Shape`] when the shapes differ.
    pub fn plus(&self, other: &Csr) -> Result<Csr, CsrError> {
        let mut sum = Csr::zeros(Arc::new(self.pattern.union(&other.pattern)?));
        for part in [self, other] {
            let places = part.pattern.positions_in(&sum.pattern).expect("the union holds both patterns");
            for (&place, value) in places.iter().zip(&part.values) {
                sum.values[place] += value;
            }
        }
        Ok(sum)
    }

    /// The matrix with the rows of all ranks of a team, each of which has the entries of other rows; made by all together.
    ///
    /// # Errors
    /// [`CsrError`] when the whole does not fit the index types.
    pub fn of_all(&self, team: &dyn Team) -> Result<Csr, CsrError> {
        let (starts, places) = self.places_of_all(team);
        let mut columns = vec![0u64; starts[self.n_rows()]];
        places.iter().zip(self.pattern.columns()).for_each(|(at, column)| columns[*at] = u64::from(*column));
        team.sum_words(&mut columns);
        let values = self.values_of_all(team);
        let columns = columns.into_iter().map(|column| u32::try_from(column).expect("one rank has each row")).collect();
        Csr::new(Arc::new(Pattern::new(self.n_rows(), self.n_cols(), starts, columns)?), values)
    }

    /// The values of [`Self::of_all`].
    pub fn values_of_all(&self, team: &dyn Team) -> Vec<f64> {
        if team.is_alone() {
            return self.values.clone();
        }
        let (starts, places) = self.places_of_all(team);
        let mut values = vec![0.0; starts[self.n_rows()]];
        places.iter().zip(&self.values).for_each(|(at, value)| values[*at] = *value);
        team.sum(&mut values);
        values
    }

    /// Takes the rows that this rank has from values of [`Self::of_all`]; false if there are too few or too many.
    pub fn take_own(&mut self, values: &[f64], team: &dyn Team) -> bool {
        let (starts, places) = self.places_of_all(team);
        let fits = values.len() == starts[self.n_rows()];
        if fits {
            places.iter().zip(&mut self.values).for_each(|(at, value)| *value = values[*at]);
        }
        fits
    }

    /// Row starts of the matrix of all ranks, and where the entries of this one stand there.
    fn places_of_all(&self, team: &dyn Team) -> (Vec<usize>, Vec<usize>) {
        let own = self.pattern.row_starts();
        let mut lengths: Vec<u64> = own.windows(2).map(|range| (range[1] - range[0]) as u64).collect();
        team.sum_words(&mut lengths);
        let mut starts = vec![0usize];
        for n in lengths {
            starts.push(starts[starts.len() - 1] + usize::try_from(n).expect("a number of entries"));
        }
        let rows = own.windows(2).zip(&starts);
        let places = rows.flat_map(|(range, start)| *start..*start + (range[1] - range[0])).collect();
        (starts, places)
    }

    /// Whether `|a_ij - a_ji| <= tolerance * sqrt(m_i m_j)` for all entries, with `m_i` the largest magnitude in row i (an
    /// entry that is not stored is zero).
    pub fn is_symmetric(&self, tolerance: f64) -> bool {
        self.n_rows() == self.n_cols() && self.first_asymmetry(tolerance, &|_| true).is_none()
    }

    /// The first entry (row, column) of a square matrix, in row order, that differs from the one across the diagonal by more
    /// than [`Self::is_symmetric`] allows, among rows and columns that count.
    pub fn first_asymmetry(&self, tolerance: f64, counts: &dyn Fn(usize) -> bool) -> Option<(usize, usize)> {
        let sizes = self.row_sizes();
        // rows come in order, and so do, in each row, the entries whose mirror images they hold: of a symmetric pattern the next one
        // is always the one that is looked for
        let starts = self.pattern.row_starts();
        let mut next = starts[..self.n_rows()].to_vec();
        for row in 0..self.n_rows() {
            let (columns, values) = self.row(row);
            for (&column, value) in columns.iter().zip(values) {
                let column = column as usize;
                let place = next[column];
                let is_mirrored = place < starts[column + 1] && self.pattern.columns()[place] as usize == row;
                let other = if is_mirrored {
                    next[column] += 1;
                    self.values[place]
                } else {
                    self.get(column, row)
                };
                // also what is no number
                let is_same = (value - other).abs() <= tolerance * sizes[row] * sizes[column];
                if !is_same && counts(row) && counts(column) {
                    return Some((row, column));
                }
            }
        }
        None
    }

    /// `(A + A') / 2`.
    ///
    /// # Errors
    /// [`CsrError::Shape`] unless square.
    pub fn symmetric_part(&self) -> Result<Self, CsrError> {
        if !self.pattern.is_symmetric() {
            let mut sum = self.plus(&self.transpose())?;
            sum.values.iter_mut().for_each(|value| *value *= 0.5);
            return Ok(sum);
        }
        // rows come in order, and so do the mirror images in each row
        let mut next = self.pattern.row_starts().to_vec();
        let mean = |(column, value): (&u32, &f64)| {
            let place = &mut next[*column as usize];
            *place += 1;
            0.5 * (value + self.values[*place - 1])
        };
        let values = self.pattern.columns().iter().zip(&self.values).map(mean).collect();
        Ok(Self { pattern: Arc::clone(&self.pattern), values })
    }

    /// By row the square root of its largest magnitude. Rounding of an entry that couples two unknowns is a part of what both
    /// are stiff: of unknowns in other units, such as a pressure beside a displacement, the largest entry of the matrix says
    /// nothing.
    pub fn row_sizes(&self) -> Vec<f64> {
        (0..self.n_rows()).map(|row| largest(self.row(row).1.iter().copied()).sqrt()).collect()
    }

    /// Largest magnitude of an entry; zero for a matrix without entries, not a number if an entry is none.
    pub fn max_abs(&self) -> f64 {
        largest(self.values.iter().copied())
    }

    /// Largest sum of magnitudes over a column.
    pub fn norm_1(&self) -> f64 {
        let mut sums = vec![0.0; self.n_cols()];
        for (&column, value) in self.pattern.columns().iter().zip(&self.values) {
            sums[column as usize] += value.abs();
        }
        largest(sums)
    }

    /// Largest sum of magnitudes over a row.
    pub fn norm_inf(&self) -> f64 {
        largest((0..self.n_rows()).map(|row| self.row(row).1.iter().map(|value| value.abs()).sum::<f64>()))
    }

    /// The first entry (row, column) in row order that is NaN or infinite.
    pub fn first_non_finite(&self) -> Option<(usize, usize)> {
        let place = self.values.iter().position(|value| !value.is_finite())?;
        let row = self.pattern.row_starts().partition_point(|&start| start <= place) - 1;
        Some((row, self.pattern.columns()[place] as usize))
    }
}

/// `r = b - (A + B + ...) x`, and `m_i = |b_i| + Σ |a_ij x_j|`: the scale against which it is judged row by row.
///
/// # Panics
/// When a length does not fit.
pub fn residual_and_size(parts: &[&Csr], b: &[f64], x: &[f64], r: &mut [f64], m: &mut [f64], threads: usize) {
    let n = b.len();
    assert!(r.len() == n && m.len() == n && parts.iter().all(|part| part.n_rows() == n && part.n_cols() == x.len()));
    let row_pair = |row: usize| {
        let (mut residual, mut size) = (b[row], b[row].abs());
        for part in parts {
            let (columns, values) = part.row(row);
            let (mut sum, mut absolute) = (0.0, 0.0);
            for (&column, value) in columns.iter().zip(values) {
                let product = value * x[column as usize];
                sum += product;
                absolute += product.abs();
            }
            residual -= sum;
            size += absolute;
        }
        (residual, size)
    };
    let share = |(chunk, (r, m)): (usize, (&mut [f64], &mut [f64]))| {
        for (offset, (r, m)) in r.iter_mut().zip(m).enumerate() {
            (*r, *m) = row_pair(chunk * ROWS_PER_TASK + offset);
        }
    };
    let entries: usize = parts.iter().map(|part| part.values.len()).sum();
    if threads > 1 && entries > PARALLEL_ENTRIES {
        r.par_chunks_mut(ROWS_PER_TASK).zip(m.par_chunks_mut(ROWS_PER_TASK)).enumerate().for_each(share);
    } else {
        r.chunks_mut(ROWS_PER_TASK).zip(m.chunks_mut(ROWS_PER_TASK)).enumerate().for_each(share);
    }
}

/// `r = b - (A + B + ...) x`, each row summed in double-double and rounded once at the end.
///
/// The error of an entry is about `1e-16 |r_i| + 1e-32 Σ |a_ij x_j|`, so the residual of a nearly exact solution still
/// has correct digits. Exact products by fused multiply-add, sums after Knuth (TwoSum).
///
/// # Panics
/// When a length does not fit.
pub fn residual_compensated(parts: &[&Csr], b: &[f64], x: &[f64], r: &mut [f64], threads: usize) {
    assert!(b.len() == r.len() && parts.iter().all(|part| part.n_rows() == r.len() && part.n_cols() == x.len()));
    let row_residual = |row: usize| {
        let (mut high, mut low) = (b[row], 0.0);
        for part in parts {
            let (columns, values) = part.row(row);
            for (&column, &value) in columns.iter().zip(values) {
                let factor = -x[column as usize];
                let product = value * factor;
                let sum = high + product;
                let back = sum - high;
                low += value.mul_add(factor, -product) + ((high - (sum - back)) + (product - back));
                high = sum;
            }
        }
        high + low
    };
    let entries: usize = parts.iter().map(|part| part.values.len()).sum();
    if threads > 1 && entries > PARALLEL_ENTRIES {
        r.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(chunk, part)| {
            for (offset, out) in part.iter_mut().enumerate() {
                *out = row_residual(chunk * ROWS_PER_TASK + offset);
            }
        });
    } else {
        for (row, out) in r.iter_mut().enumerate() {
            *out = row_residual(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Csr {
        Csr::from_triplets(3, 3, &[(0, 0, 2.0), (0, 2, -1.0), (1, 1, 3.0), (2, 0, 4.0), (2, 2, 5.0), (0, 0, 0.5)])
            .unwrap()
    }

    #[test]
    fn products_match_hand_computation() {
        let a = sample();
        let mut y = vec![1.0; 3];
        a.multiply(&[1.0, 2.0, 3.0], &mut y, 1);
        assert_eq!(y, [-0.5, 6.0, 19.0]);
        a.multiply_transposed_add(&[1.0, 0.0, 1.0], &mut y);
        assert_eq!(y, [6.0, 6.0, 23.0]);
        let (mut left, mut size) = ([0.0; 3], [0.0; 3]);
        residual_and_size(&[&a], &[1.0, -1.0, 0.0], &[1.0, -2.0, 3.0], &mut left, &mut size, 1);
        assert_eq!((left, size), ([1.5, 5.0, -19.0], [6.5, 7.0, 19.0]));
        assert_eq!(a.transpose().get(0, 2), 4.0);
        assert_eq!((a.norm_1(), a.norm_inf(), a.max_abs()), (6.5, 9.0, 5.0));
        assert!(!a.is_symmetric(0.1) && a.plus(&a.transpose()).unwrap().is_symmetric(0.0));
    }

    #[test]
    fn the_symmetric_part_is_the_mean_with_the_transpose() {
        let whole = sample();
        let lacking = Csr::from_triplets(3, 3, &[(0, 1, 4.0), (2, 0, 4.0), (2, 2, 5.0)]).unwrap();
        assert!(whole.pattern().is_symmetric() && !lacking.pattern().is_symmetric());
        for a in [whole, lacking] {
            let part = a.symmetric_part().unwrap();
            assert!((0..9).all(|k| part.get(k / 3, k % 3) == 0.5 * (a.get(k / 3, k % 3) + a.get(k % 3, k / 3))));
        }
    }

    /// A stiff unknown beside a soft one, which couple with opposite signs: in other units the matrix is not symmetric
    /// either.
    #[test]
    fn symmetry_does_not_depend_on_units() {
        for unit in [1e-12, 1e-6, 1.0, 1e6] {
            let coupled = |sign: f64| {
                let entries = [(0, 0, 1e6), (0, 1, unit), (1, 0, sign * unit), (1, 1, unit * unit)];
                Csr::from_triplets(2, 2, &entries).unwrap()
            };
            assert!(coupled(1.0).is_symmetric(1e-9) && !coupled(-1.0).is_symmetric(1e-9), "{unit}");
        }
    }

    #[test]
    fn compensated_residual_survives_cancellation() {
        // b - A x = 1e-20 exactly, lost in plain arithmetic.
        let a = Csr::from_triplets(1, 3, &[(0, 0, 1e10), (0, 1, 1.0), (0, 2, 1e10)]).unwrap();
        let x = [1e10, 1.0, -1e10];
        let b = [1.0 + 1e-15];
        let mut plain = [0.0];
        residual_and_size(&[&a], &b, &x, &mut plain, &mut [0.0], 1);
        let mut compensated = [0.0];
        residual_compensated(&[&a], &b, &x, &mut compensated, 1);
        assert_ne!(plain[0], b[0] - 1.0);
        assert_eq!(compensated[0], b[0] - 1.0);
    }

    #[test]
    fn threads_do_not_change_a_product() {
        let n = 30_000u32;
        let triplets: Vec<_> = (0..n)
            .flat_map(|i| (0..5u32).map(move |k| (i, (i * 7 + k * k * 101) % n, 1.0 / f64::from(i + 3 * k + 1))))
            .collect();
        let a = Csr::from_triplets(n as usize, n as usize, &triplets).unwrap();
        assert!(a.values().len() > PARALLEL_ENTRIES);
        let x: Vec<f64> = (0..n).map(|i| f64::from(i % 17) - 8.3).collect();
        let (mut one, mut two) = (vec![0.0; n as usize], vec![0.0; n as usize]);
        a.multiply(&x, &mut one, 1);
        a.multiply(&x, &mut two, 2);
        assert_eq!(one, two);
        residual_compensated(&[&a], &x, &x, &mut one, 1);
        residual_compensated(&[&a], &x, &x, &mut two, 2);
        assert_eq!(one, two);
    }

    #[test]
    fn a_non_finite_entry_is_named() {
        let mut a = sample();
        assert_eq!(a.first_non_finite(), None);
        let place = a.pattern().position(2, 0).unwrap();
        a.values_mut()[place] = f64::NAN;
        assert_eq!(a.first_non_finite(), Some((2, 0)));
        assert!(!a.add_to(1, 0, 1.0));
    }
}
