//! The dense matrix `1 + M V` of the forces, in double or single precision.
//!
//! Promises: right-hand sides are of double precision; the same bytes for any number of threads; memory is kept.
//! Does not know of forces and bodies: M is given by rows, V by its values.

use rayon::prelude::*;

use super::super::SolveError;
use super::super::dense::{Dense, Kind, Number};
use super::super::kernels::{TOGETHER, combine, product_by_rows};
use super::super::sweep::Form;
use crate::csr::Csr;

/// Values of V from which a product is shared among threads, and rows in one share.
const PARALLEL_VALUES: usize = 1 << 20;
const SHARE: usize = 128;
/// Rows and columns of the dense matrix that are filled together: what they read of V stays in the cache.
const FILL_ROWS: usize = 48;
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

/// See the module documentation; of one of two precisions.
pub(super) trait SmallSystem: Send {
    /// Fills and factors; the smallest pivot relative to its column, and its unknown.
    fn factor(&mut self, rows: Rows<'_>) -> Result<(f64, usize), SolveError>;

    /// Solves in place with the last factor.
    fn solve(&mut self, form: Form, w: &mut [f64]);

    /// `read = V loads`; false where V is of single precision and nothing has been done.
    fn answers(&self, loads: &[f64], read: &mut [f64]) -> bool;
}

impl<T: Number> Small<T> {
    /// A system of `n` unknowns, with V and the power of two that its values have been multiplied with.
    pub(super) fn new((responses, scale): (Vec<T>, f64), n: usize, threads: usize) -> Result<Self, SolveError> {
        Ok(Self { responses, scale, dense: Dense::new(n, threads)?, threads })
    }
}

/// See the module documentation.
pub(super) struct Small<T: Number> {
    /// V, `read x loads` by rows.
    responses: Vec<T>,
    /// Its values are those of V times this power of two.
    scale: f64,
    /// Factor of `(1 + M V)ᵀ`.
    dense: Dense<T>,
    threads: usize,
}

impl<T: Number> SmallSystem for Small<T> {
    fn factor(&mut self, rows: Rows<'_>) -> Result<(f64, usize), SolveError> {
        let n = rows.m.n_rows();
        let (responses, scale, threads) = (&self.responses, self.scale, self.threads);
        let fill_share = |(share, out): (usize, &mut [T])| {
            let first = share * FILL_ROWS;
            fill_products(rows, (responses, scale), first, out);
            for (row, out) in (first..).zip(out.chunks_exact_mut(n)) {
                fill_rest(rows, row, out);
            }
        };
        let fill = |matrix: &mut [T]| {
            if threads > 1 {
                matrix.par_chunks_mut(FILL_ROWS * n).enumerate().for_each(fill_share);
            } else {
                matrix.chunks_mut(FILL_ROWS * n).enumerate().for_each(fill_share);
            }
        };
        self.dense.factor(Kind::General, fill)
    }

    fn solve(&mut self, form: Form, w: &mut [f64]) {
        let form = match form {
            Form::Plain => Form::Transposed,
            Form::Transposed => Form::Plain,
        };
        self.dense.solve(form, w);
    }

    fn answers(&self, loads: &[f64], read: &mut [f64]) -> bool {
        if T::ROUNDOFF > f64::EPSILON {
            return false;
        }
        if self.threads > 1 && self.responses.len() > PARALLEL_VALUES {
            let n = loads.len();
            let shares = read.par_chunks_mut(SHARE).zip(self.responses.par_chunks(SHARE * n));
            shares.for_each(|(read, v)| product_by_rows(v, loads, read));
        } else {
            product_by_rows(&self.responses, loads, read);
        }
        read.iter_mut().for_each(|value| *value /= self.scale);
        true
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

/// Rows of `M V`, those of M from `first` on, into rows of `out` with room for the bare dofs behind. Neighbouring rows
/// that read the same dofs (the components of a node) are made together: each value of V is loaded once for all.
fn fill_products<T: Number>(rows: Rows<'_>, (v, scale): (&[T], f64), first: usize, out: &mut [T]) {
    let Rows { m, place, n_read, n_loads: width } = rows;
    let n = m.n_rows();
    let last = first + out.len() / n;
    let mut starts = vec![first];
    for row in first + 1..last {
        let group = starts[starts.len() - 1];
        if row - group == TOGETHER || m.row(row).0 != m.row(group).0 {
            starts.push(row);
        }
    }
    starts.push(last);
    let (mut factors, mut answers) = (Vec::new(), Vec::new());
    for columns in (0..width).step_by(FILL_COLUMNS).map(|column| column..width.min(column + FILL_COLUMNS)) {
        for group in starts.windows(2) {
            factors.clear();
            answers.clear();
            for (k, &column) in m.row(group[0]).0.iter().enumerate() {
                let at = place[column as usize] as usize;
                let mut all = [T::nearest(0.0); TOGETHER];
                (group[0]..group[1])
                    .zip(&mut all)
                    .for_each(|(row, factor)| *factor = T::nearest(m.row(row).1[k] / scale));
                if at < n_read && all.iter().any(|factor| factor.wide() != 0.0) {
                    factors.push(all);
                    answers.push(&v[at * width..][columns.clone()]);
                }
            }
            let mut targets = out[(group[0] - first) * n..(group[1] - first) * n].chunks_exact_mut(n);
            let targets: [&mut [T]; TOGETHER] =
                std::array::from_fn(|_| targets.next().map_or(&mut [][..], |row| &mut row[columns.clone()]));
            combine(&factors, &answers, targets);
        }
    }
}
