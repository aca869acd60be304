//! The capacitance matrix `1 + M V` of a low-rank update, in double or single precision.
//!
//! Between two matrices few rows of M change: those of points that slip or open. The factor of an earlier matrix, the
//! reference, remains in use, and only a matrix of the number of changed rows is factored ([`Update`]).
//!
//! Promises: right-hand sides have double precision; the same bytes for any number of threads; memory is kept. Does not
//! know contact and bodies: M is given by rows, V by its values.

use super::super::SolveError;
use super::super::dense::{Dense, Kind, Number};
use super::super::triangular_solve::Transpose;
use super::rows::{Flexibility, PARALLEL_VALUES, Rows, SHARE, Source, fill_products, share};
use super::update::{LARGEST_PART, Update};

/// Rows of the dense matrix that are filled together.
const FILL_ROWS: usize = 48;
/// Numbers that differ by so many roundoffs of the largest of their row are the same.
const SAME: f64 = 4.0;
/// Smallest pivot, relative to its column, with which the changed rows are accepted; and in roundoffs.
const SMALLEST_UPDATED: f64 = 1e-6;
const SMALLEST_IN_ROUNDOFFS: f64 = 1e4;
/// See the module documentation; of one of two precisions.
pub(super) trait CapacitanceMatrix: Send {
    /// Factors the matrix of these rows, from the factor at hand where that is cheaper; the smallest pivot relative to
    /// its column, and its unknown.
    fn factor(&mut self, rows: Rows<'_>) -> Result<(f64, usize), SolveError>;

    /// Solves in place with the last factor.
    fn solve(&mut self, transpose: Transpose, w: &mut [f64]);

    /// `read = V loads`, for the rows of V; false where V is of single precision and nothing has been done.
    fn multiply_flexibility(&self, loads: &[f64], read: &mut [f64]) -> bool;

    /// Whether the determinant of the matrix factored last is negative.
    fn is_negative(&self) -> bool;

    /// Multiplications that the next factor will take.
    fn operations(&self, rows: Rows<'_>) -> f64;

    /// Gives up the factor that later ones start from; false if there is no later one.
    fn forget(&mut self) -> bool;

    /// What the factor at hand was made from.
    fn memory(&self) -> Reference;

    /// Makes the factor of these rows from what an earlier one was made from.
    fn recall(&mut self, rows: Rows<'_>, memory: &Reference) -> Result<(f64, usize), SolveError>;
}

/// What a factor was made from: the values of M in a whole factor, and the rows that have changed since, in groups.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reference {
    /// Values of M.
    pub values: Vec<f64>,
    /// Groups of rows, in the order in which they were seen to change.
    pub groups: Vec<Vec<u32>>,
    /// Whole factors made since such groups were last of use.
    pub whole: usize,
}

/// See the module documentation.
pub(super) struct Capacitance<T: Number> {
    /// V.
    v: Flexibility<T>,
    /// Factor of `(1 + M V)ᵀ` for the M of `reference`.
    dense: Dense<T>,
    reference: Vec<f64>,
    /// What has changed since.
    update: Option<Update<T>>,
    /// Whole factors made since an update was last worth it.
    whole: usize,
    threads: usize,
}

/// The next factor.
enum Next {
    Whole,
    /// With the columns of these rows added.
    Update(Vec<u32>),
}

impl<T: Number> Capacitance<T> {
    /// A system of `n` unknowns, with V (`read x loads`) and the power of two that its values have been multiplied with.
    pub(super) fn new(v: Flexibility<T>, n: usize, threads: usize) -> Result<Self, SolveError> {
        let dense = Dense::new(n, threads)?;
        Ok(Self { v, dense, reference: Vec::new(), update: None, whole: 0, threads })
    }

    /// Multiplications of a whole factor.
    fn whole_operations(rows: Rows<'_>) -> f64 {
        let n = rows.m.n_rows() as f64;
        n * n * n / 3.0 + rows.m.pattern().n_entries() as f64 * rows.n_loads as f64
    }

    /// What to do next, and its multiplications. Columns are paid for only once whole factors have cost as much: rows
    /// that change once and for all are not worth theirs.
    fn plan(&self, rows: Rows<'_>) -> (Next, f64) {
        let n = rows.m.n_rows();
        let whole = Self::whole_operations(rows);
        if self.reference.len() != rows.m.values().len() {
            return (Next::Whole, whole);
        }
        let known = |row: usize| self.update.as_ref().is_some_and(|u| u.holds(row));
        let before = self.update.as_ref().map_or(0, Update::n_rows);
        let new: Vec<u32> =
            (0..n).filter(|&row| !known(row) && self.has_changed(rows, row)).map(|r| r as u32).collect();
        let total = before + new.len();
        let columns = new.len() as f64 * n as f64 * (n + rows.n_read) as f64;
        let entries = total as f64 * rows.m.pattern().n_entries() as f64 / n as f64;
        let inner = (total as f64).powi(3) / 3.0 + entries * total as f64;
        if total as f64 > LARGEST_PART * n as f64 || columns + inner > (1 + self.whole) as f64 * whole {
            return (Next::Whole, whole);
        }
        (Next::Update(new), columns + inner)
    }

    /// Whether a row differs from that of the reference by more than rounding.
    fn has_changed(&self, rows: Rows<'_>, row: usize) -> bool {
        let starts = rows.m.pattern().row_starts();
        let range = starts[row]..starts[row + 1];
        let (old, new) = (&self.reference[range.clone()], &rows.m.values()[range]);
        if old == new {
            return false;
        }
        let size = old.iter().chain(new).fold(0.0f64, |size, value| size.max(value.abs()));
        old.iter().zip(new).any(|(old, new)| (old - new).abs() > SAME * T::ROUNDOFF * size)
    }

    fn factor_whole(&mut self, rows: Rows<'_>) -> Result<(f64, usize), SolveError> {
        self.update = None;
        self.reference.clear();
        let n = rows.m.n_rows();
        let (v, threads) = (&self.v, self.threads);
        let v = Source {
            values: &v.values,
            scale: v.scale,
            width: rows.n_loads,
            stride: rows.n_loads,
            n_rows: rows.n_read,
        };
        let fill_share = |(share, out): (usize, &mut [T])| {
            let first = share * FILL_ROWS;
            fill_products(rows, v, first, out, n);
            for (row, out) in (first..).zip(out.chunks_exact_mut(n)) {
                fill_rest(rows, row, out);
            }
        };
        let fill = |matrix: &mut [T]| share(threads, matrix, FILL_ROWS * n, fill_share);
        let pivot = self.dense.factor(Kind::General, fill)?;
        self.reference.extend_from_slice(rows.m.values());
        Ok(pivot)
    }

    /// The factor from the reference and the rows that have changed; an error where that would not be accurate.
    fn factor_update(&mut self, rows: Rows<'_>, new: &[u32]) -> Result<(f64, usize), SolveError> {
        let n = rows.m.n_rows();
        let update = self.update.get_or_insert_with(|| Update::new(n));
        if !new.is_empty() {
            update.extend(rows, &self.v, &mut self.dense, new, self.threads)?;
        }
        update.factor(rows, &self.reference, self.v.scale, self.threads)
    }
}

impl<T: Number> CapacitanceMatrix for Capacitance<T> {
    fn factor(&mut self, rows: Rows<'_>) -> Result<(f64, usize), SolveError> {
        if let (Next::Update(new), _) = self.plan(rows) {
            match self.factor_update(rows, &new) {
                Ok(pivot) if pivot.0 >= SMALLEST_UPDATED.max(SMALLEST_IN_ROUNDOFFS * T::ROUNDOFF) => {
                    self.whole = 0;
                    return Ok(pivot);
                }
                // Not accurate, or no room for its columns: a whole factor needs neither.
                _ => {}
            }
        }
        self.whole += 1;
        self.factor_whole(rows)
    }

    fn solve(&mut self, transpose: Transpose, w: &mut [f64]) {
        match &mut self.update {
            Some(update) => update.solve(transpose, &self.v, &mut self.dense, w, self.threads),
            None => self.dense.solve(transpose.flipped(), w),
        }
    }

    fn multiply_flexibility(&self, loads: &[f64], read: &mut [f64]) -> bool {
        if T::ROUNDOFF > f64::EPSILON {
            return false;
        }
        let share_out = |(share, read): (usize, &mut [f64])| {
            let n = loads.len();
            T::product_by_rows(&self.v.values[share * SHARE * n..][..read.len() * n], loads, read);
        };
        let threads = if self.v.values.len() > PARALLEL_VALUES { self.threads } else { 1 };
        share(threads, read, SHARE, share_out);
        read.iter_mut().for_each(|value| *value /= self.v.scale);
        true
    }

    fn is_negative(&self) -> bool {
        self.dense.is_negative() != self.update.as_ref().is_some_and(Update::is_negative)
    }

    fn operations(&self, rows: Rows<'_>) -> f64 {
        self.plan(rows).1
    }

    fn forget(&mut self) -> bool {
        let is_update = self.update.is_some();
        self.reference.clear();
        is_update
    }

    fn memory(&self) -> Reference {
        let groups = self.update.as_ref().map(Update::groups).unwrap_or_default();
        Reference { values: self.reference.clone(), groups, whole: self.whole }
    }

    fn recall(&mut self, rows: Rows<'_>, memory: &Reference) -> Result<(f64, usize), SolveError> {
        if memory.values.len() != rows.m.values().len() {
            return self.factor_whole(rows);
        }
        self.whole = memory.whole;
        let mut before = rows.m.clone();
        before.values_mut().copy_from_slice(&memory.values);
        let mut pivot = self.factor_whole(Rows { m: &before, ..rows })?;
        for group in &memory.groups {
            let update = self.update.get_or_insert_with(|| Update::new(rows.m.n_rows()));
            update.extend(rows, &self.v, &mut self.dense, group, self.threads)?;
        }
        if let Some(update) = &mut self.update {
            pivot = update.factor(rows, &self.reference, self.v.scale, self.threads)?;
        }
        Ok(pivot)
    }
}

/// What of a row of `1 + M V` does not come from V.
fn fill_rest<T: Number>(rows: Rows<'_>, row: usize, out: &mut [T]) {
    let bare = &mut out[rows.n_loads..];
    bare.fill(T::nearest(0.0));
    for (&column, value) in rows.m.row(row).0.iter().zip(rows.m.row(row).1) {
        if let Some(at) = (rows.place[column as usize] as usize).checked_sub(rows.n_read) {
            bare[at] = T::nearest(bare[at].wide() - value);
        }
    }
    if row < rows.n_loads {
        out[row] = T::nearest(out[row].wide() + 1.0);
    }
}
