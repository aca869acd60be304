//! Dense LU with partial pivoting, and dense Cholesky, in double or single precision.
//!
//! Promises: right-hand sides and sums are of double precision for both precisions of the factor; columns and rows are
//! scaled by powers of two first; memory is kept; the smallest pivot relative to its column is reported with its
//! unknown, and a vanishing one is an error. Does not check residuals: `checked` does.

use wfl_dense::sweeps::Diagonal;
use wfl_dense::{MatMut, MatRef, Par, Real, ReborrowMut, Work};

use super::SolveError;
use super::multifrontal::{Multifrontal, Panel};
use super::triangular_solve::Transpose;
use wfl_host::memory::{refused_by_the_system, zeros};

/// A pivot below so many roundoffs of its column is as good as zero.
const VANISHING_PIVOT: f64 = 9.0;

/// Numbers that factors are kept in.
pub(super) trait Number: Real {
    /// The panel of a front of a factor of these numbers.
    fn panel(factor: &Multifrontal, front: usize) -> &[Self];
}

impl Number for f64 {
    fn panel(factor: &Multifrontal, front: usize) -> &[Self] {
        match factor.panel(front) {
            Panel::Double(values) => values,
            Panel::Single(_) => panic!("the factor is of single precision"),
        }
    }
}

impl Number for f32 {
    fn panel(factor: &Multifrontal, front: usize) -> &[Self] {
        match factor.panel(front) {
            Panel::Single(values) => values,
            Panel::Double(_) => panic!("the factor is of double precision"),
        }
    }
}

/// What the matrix is known to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Nothing.
    General,
    /// Symmetric, perhaps positive definite: Cholesky is tried first. Only the lower half is read then.
    Symmetric,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Empty,
    Lu,
    Cholesky,
}

/// A reusable dense factorisation.
pub(super) struct Dense<T: Number = f64> {
    n: usize,
    /// The factor, by columns.
    values: Vec<T>,
    pivots: Vec<u32>,
    inverse: Vec<u32>,
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
    work: Vec<f64>,
    memory: Work,
    par: Par,
    state: State,
}

impl<T: Number> Dense<T> {
    pub(super) fn new(n: usize, threads: usize) -> Result<Self, SolveError> {
        let par = super::parallelism(threads, (n as f64).powi(3) / 3.0);
        let memory =
            Work::of_either::<T>(n, par).map_err(|_| refused_by_the_system(None, "work space of a dense factor"))?;
        let square = n.checked_mul(n).ok_or(SolveError::TooLarge { what: "a dense matrix" })?;
        Ok(Self {
            n,
            values: zeros(square, "a dense matrix")?,
            pivots: vec![0; n],
            inverse: vec![0; n],
            row_scale: vec![1.0; n],
            column_scale: vec![1.0; n],
            work: vec![0.0; n],
            memory,
            par,
            state: State::Empty,
        })
    }

    /// Of no unknowns.
    pub(super) fn empty() -> Self {
        Self {
            n: 0,
            values: Vec::new(),
            pivots: Vec::new(),
            inverse: Vec::new(),
            row_scale: Vec::new(),
            column_scale: Vec::new(),
            work: Vec::new(),
            memory: Work::empty(),
            par: Par::Seq,
            state: State::Lu,
        }
    }

    /// Fills the matrix (by columns, n x n) with `fill` and factors it. Returns the smallest pivot relative to the
    /// largest entry of its scaled column, and its unknown.
    pub(super) fn factor(&mut self, kind: Kind, fill: impl Fn(&mut [T])) -> Result<(f64, usize), SolveError> {
        self.state = State::Empty;
        if self.n == 0 {
            self.state = State::Lu;
            return Ok((1.0, 0));
        }
        fill(&mut self.values);
        if kind == Kind::Symmetric {
            if let Some(health) = self.cholesky() {
                self.state = State::Cholesky;
                return Ok(health);
            }
            fill(&mut self.values);
            self.mirror();
        }
        let health = self.lu()?;
        self.state = State::Lu;
        Ok(health)
    }

    /// Completes the upper half.
    fn mirror(&mut self) {
        let n = self.n;
        for column in 0..n {
            for row in column + 1..n {
                self.values[row * n + column] = self.values[column * n + row];
            }
        }
    }

    fn cholesky(&mut self) -> Option<(f64, usize)> {
        let n = self.n;
        for (i, diagonal) in self.work.iter_mut().enumerate() {
            *diagonal = self.values[i * n + i].wide();
        }
        let matrix = MatMut::from_column_major_slice_mut(&mut self.values, n, n);
        T::cholesky(matrix, self.par, &mut self.memory).ok()?;
        let pivot = |i: usize| self.values[i * n + i].wide();
        let ratios = (0..n).map(|i| (pivot(i) * pivot(i) / self.work[i], i));
        ratios.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|&(ratio, _)| ratio > VANISHING_PIVOT * T::ROUNDOFF)
    }

    fn lu(&mut self) -> Result<(f64, usize), SolveError> {
        let n = self.n;
        self.equilibrate();
        let matrix = MatMut::from_column_major_slice_mut(&mut self.values, n, n);
        T::lu(matrix, &mut self.pivots, &mut self.inverse, self.par, &mut self.memory);
        let mut smallest = (1.0, 0);
        for i in 0..n {
            // Scaled columns have largest entries of about 1.
            let pivot = self.values[i * n + i].wide().abs();
            if pivot.is_nan() || pivot <= VANISHING_PIVOT * T::ROUNDOFF {
                return Err(SolveError::VanishingPivot { dof: i, ratio: if pivot.is_nan() { 0.0 } else { pivot } });
            }
            if pivot < smallest.0 {
                smallest = (pivot, i);
            }
        }
        Ok(smallest)
    }

    /// Whether the determinant of the matrix is negative: an odd number of exchanged rows and negative pivots.
    pub(super) fn is_negative(&self) -> bool {
        let n = self.n;
        let negative = (0..n).filter(|i| self.values[i * n + i].wide() < 0.0).count();
        self.state == State::Lu && (negative % 2 == 1) != is_odd(&self.pivots)
    }

    /// True if the matrix is positive definite: it has a Cholesky factor.
    pub(super) fn is_definite(&self) -> bool {
        self.state == State::Cholesky
    }

    /// Scales rows, then columns, to largest entries of about 1.
    fn equilibrate(&mut self) {
        let n = self.n;
        self.row_scale.fill(0.0);
        for column in self.values.chunks_exact(n) {
            T::enlarge(column, &mut self.row_scale);
        }
        self.row_scale.iter_mut().for_each(|largest| *largest = super::scaling::power_of_two(1.0 / *largest));
        for (column, scale) in self.values.chunks_exact_mut(n).zip(&mut self.column_scale) {
            *scale = super::scaling::power_of_two(1.0 / T::largest_of_products(column, &self.row_scale));
            T::scale_by(column, &self.row_scale, *scale);
        }
    }

    /// Solves in place.
    ///
    /// # Panics
    /// Without a successful factorisation.
    pub(super) fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        let n = self.n;
        match (self.state, transpose) {
            (State::Empty, _) => panic!("a dense factor is used before it exists"),
            (State::Cholesky, _) => {
                T::lower_solve(&self.values, Diagonal::Stored, x, &mut []);
                T::lower_transposed_solve(&self.values, Diagonal::Stored, x, &[]);
            }
            (State::Lu, Transpose::No) => {
                for (value, &row) in self.work.iter_mut().zip(&self.pivots) {
                    *value = x[row as usize] * self.row_scale[row as usize];
                }
                T::lower_solve(&self.values, Diagonal::Unit, &mut self.work, &mut []);
                T::upper_solve(&self.values, n, &mut self.work);
                for ((out, value), scale) in x.iter_mut().zip(&self.work).zip(&self.column_scale) {
                    *out = value * scale;
                }
            }
            (State::Lu, Transpose::Yes) => {
                x.iter_mut().zip(&self.column_scale).for_each(|(value, scale)| *value *= scale);
                T::upper_transposed_solve(&self.values, n, x);
                T::lower_transposed_solve(&self.values, Diagonal::Unit, x, &[]);
                self.work.copy_from_slice(x);
                for (&value, &row) in self.work.iter().zip(&self.pivots) {
                    x[row as usize] = value * self.row_scale[row as usize];
                }
            }
        }
    }
}

impl<T: Number> Dense<T> {
    /// Solves the transposed system for many right-hand sides, n numbers each, in place and in the precision of the
    /// factor.
    ///
    /// # Panics
    /// Without a factor by LU.
    pub(super) fn solve_transposed_columns(&mut self, x: &mut [T]) {
        assert!(self.state == State::Lu, "a factor by LU");
        let n = self.n;
        for column in x.chunks_exact_mut(n) {
            for (value, scale) in column.iter_mut().zip(&self.column_scale) {
                *value = T::nearest(value.wide() * scale);
            }
        }
        let factor = MatRef::from_column_major_slice(&self.values, n, n);
        let width = x.len() / n;
        let mut columns = MatMut::from_column_major_slice_mut(x, n, width);
        let par =
            super::parallelism(if self.par == Par::Seq { 1 } else { self.par.degree() }, (n * n) as f64 * width as f64);
        T::solve_lower(factor.transpose(), columns.rb_mut(), par);
        T::solve_unit_upper(factor.transpose(), columns, par);
        let mut permuted = vec![T::default(); n];
        for column in x.chunks_exact_mut(n) {
            for (&value, &row) in column.iter().zip(&self.pivots) {
                permuted[row as usize] = T::nearest(value.wide() * self.row_scale[row as usize]);
            }
            column.copy_from_slice(&permuted);
        }
    }
}

/// Whether a permutation takes an odd number of exchanges: one less than the length of each of its cycles.
pub(super) fn is_odd(permutation: &[u32]) -> bool {
    let mut is_seen = vec![false; permutation.len()];
    let mut odd = false;
    for start in 0..permutation.len() {
        let mut at = start;
        while !std::mem::replace(&mut is_seen[at], true) {
            at = permutation[at] as usize;
            odd ^= at != start;
        }
    }
    odd
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_of_a_determinant_is_that_of_its_definition() {
        // by rows; determinants by hand: 5, -24, 1 (a cycle of three), -1 (one exchange of four), -2
        let cases: [(usize, Vec<f64>, bool); 5] = [
            (2, vec![2.0, 1.0, 1.0, 3.0], false),
            (3, vec![2.0, 0.0, 0.0, 0.0, -3.0, 0.0, 7.0, 0.0, 4.0], true),
            (3, vec![0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0], false),
            (4, vec![0., 1., 0., 0., 1., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.], true),
            (2, vec![1.0, 2.0, 3.0, 4.0], true),
        ];
        for (n, matrix, negative) in cases {
            let mut dense = Dense::<f64>::new(n, 1).expect("room");
            let fill = |values: &mut [f64]| (0..n * n).for_each(|k| values[(k % n) * n + k / n] = matrix[k]);
            dense.factor(Kind::General, fill).expect("regular");
            assert_eq!(dense.is_negative(), negative, "{matrix:?}");
        }
        let mut spd = Dense::<f64>::new(1, 1).expect("room");
        spd.factor(Kind::Symmetric, |values| values[0] = 2.0).expect("regular");
        assert!(!spd.is_negative());
    }

    #[test]
    fn both_forms_solve() {
        for n in [1, 2, 5, 40] {
            // Needs row exchanges, and its rows differ by factors up to 1e18.
            let size = |i: usize| 10f64.powi(i as i32 % 7 * 3);
            let entry = |i: usize, j: usize| if i == j { 1e-3 } else { (((i * 7 + j * 13) % 11) as f64 - 5.0) / 3.0 };
            let a: Vec<f64> = (0..n * n).map(|at| entry(at % n, at / n) * size(at % n)).collect();
            let mut dense = Dense::new(n, 1).unwrap();
            dense.factor(Kind::General, |values| values.copy_from_slice(&a)).unwrap();
            for transpose in [Transpose::No, Transpose::Yes] {
                let at = |i: usize, j: usize| if transpose == Transpose::No { a[j * n + i] } else { a[i * n + j] };
                let wanted = |j: usize| (1.0 + j as f64) / if transpose == Transpose::No { 1.0 } else { size(j) };
                let mut x: Vec<f64> = (0..n).map(|i| (0..n).map(|j| at(i, j) * wanted(j)).sum()).collect();
                dense.solve(transpose, &mut x);
                for (j, value) in x.iter().enumerate() {
                    assert!((value / wanted(j) - 1.0).abs() < 1e-8 * n as f64, "{n} {transpose:?} {x:?}");
                }
            }
        }
    }

    #[test]
    fn an_indefinite_symmetric_matrix_falls_back_to_lu() {
        let mut dense = Dense::new(2, 1).unwrap();
        dense.factor(Kind::Symmetric, |values| values.copy_from_slice(&[0.0, 1.0, f64::NAN, 0.0])).unwrap();
        assert_eq!(dense.state, State::Lu);
        let mut x = [3.0, 4.0];
        dense.solve(Transpose::No, &mut x);
        assert_eq!(x, [4.0, 3.0]);
        dense.factor(Kind::Symmetric, |values| values.copy_from_slice(&[4.0, 2.0, f64::NAN, 5.0])).unwrap();
        assert_eq!(dense.state, State::Cholesky);
        let mut x = [8.0, 8.0];
        dense.solve(Transpose::No, &mut x);
        assert!((x[0] - 1.5).abs() + (x[1] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_dependent_column_is_named() {
        let mut dense = Dense::new(3, 1).unwrap();
        let a = [1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 2.0, 4.0, 6.0];
        let outcome = dense.factor(Kind::General, |values| values.copy_from_slice(&a));
        assert!(matches!(outcome, Err(SolveError::VanishingPivot { dof: 2, .. })), "{outcome:?}");
    }
}
