//! The inertia of a symmetric matrix: how many of its eigenvalues are negative, by the signs of the pivots of LDLᵀ
//! (Sylvester's law).
//!
//! Multifrontal, as the factors of this folder, with rows and columns scaled to entries of about 1. The columns of a front
//! are eliminated together where that is stable (Bunch and Kaufman 1977), one or two at a time with a threshold where it is
//! not, and those that have no pivot there, such as a multiplier whose displacements come later, wait for the parent (Duff
//! and Reid 1983). Promises: the same counts for the same matrix; memory is asked for first. Keeps no factor: what is solved
//! with is elsewhere.

use wfl_dense::{Accum, Indefinite, MatMut, MatRef, Par, Real};

use super::SolveError;
use super::null_space::equilibrated;
use super::symbolic::{INTERFACE, Symbolic};
use crate::csr::Csr;

/// A pivot is at least this part of the entries beside it (threshold pivoting): rounding grows by no more than one over it in
/// an elimination.
const THRESHOLD: f64 = 0.01;
/// Entries of a scaled matrix below this are rounding.
const NOTHING: f64 = 1e-14;

/// Signs of the eigenvalues of a symmetric matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inertia {
    /// Eigenvalues above zero.
    pub positive: usize,
    /// Eigenvalues below zero.
    pub negative: usize,
    /// Those that are rounding.
    pub zero: usize,
}

/// The inertia of a symmetric matrix, of which one half is read. `coordinates`, one point a dof, choose nested dissection.
///
/// # Errors
/// [`SolveError::TooMuchMemory`]; [`SolveError::Shape`] for a matrix that is not square.
pub fn inertia(matrix: &Csr, coordinates: Option<&[[f64; 3]]>) -> Result<Inertia, SolveError> {
    let (scaled, _) = equilibrated(matrix);
    let symbolic = Symbolic::new(scaled.pattern(), coordinates, &[])?;
    symbolic.claim(|_| true, 0)?;
    let mut waiting: Vec<Option<Contribution>> = (0..symbolic.n_fronts()).map(|_| None).collect();
    let mut places = vec![u32::MAX; scaled.n_rows()];
    let mut found = Inertia::default();
    for front in 0..symbolic.n_fronts() {
        let children = symbolic.children_of(front).iter().filter_map(|child| waiting[*child as usize].take()).collect();
        let mut dense = Front::assemble(&symbolic, front, scaled.values(), children, &mut places);
        dense.eliminate(&mut found);
        if symbolic.parents[front] == INTERFACE {
            found.zero += dense.candidates;
        } else {
            waiting[front] = Some(dense.contribution());
        }
    }
    Ok(found)
}

/// What a front leaves to its parent.
struct Contribution {
    /// Columns that wait for a pivot, then rows, in the order of elimination of the whole matrix.
    indices: Vec<u32>,
    /// How many of them wait.
    delayed: usize,
    /// A full symmetric matrix, by columns.
    values: Vec<f64>,
}

/// A dense symmetric matrix, full, by columns.
struct Front {
    indices: Vec<u32>,
    /// The first of them may be eliminated here.
    candidates: usize,
    values: Vec<f64>,
}

impl Front {
    fn assemble(
        symbolic: &Symbolic,
        front: usize,
        matrix: &[f64],
        children: Vec<Contribution>,
        places: &mut [u32],
    ) -> Self {
        let own = symbolic.columns[front]..symbolic.columns[front + 1];
        let mut indices: Vec<u32> = own.clone().collect();
        children.iter().for_each(|child| indices.extend_from_slice(&child.indices[..child.delayed]));
        let candidates = indices.len();
        indices.extend_from_slice(symbolic.rows_of(front));
        indices.iter().zip(0..).for_each(|(index, place)| places[*index as usize] = place);
        let n = indices.len();
        let mut values = vec![0.0; n * n];
        for (column, index) in own.enumerate() {
            for entry in symbolic.lower_entries(index as usize) {
                let row = places[symbolic.lower_rows[entry] as usize] as usize;
                let value = matrix[symbolic.lower_sources[entry] as usize];
                values[column * n + row] += value;
                if row != column {
                    values[row * n + column] += value;
                }
            }
        }
        for child in children {
            let own: Vec<usize> = child.indices.iter().map(|index| places[*index as usize] as usize).collect();
            for (column, source) in own.iter().zip(child.values.chunks_exact(own.len().max(1))) {
                own.iter().zip(source).for_each(|(row, value)| values[column * n + row] += value);
            }
        }
        Self { indices, candidates, values }
    }

    fn contribution(self) -> Contribution {
        Contribution { indices: self.indices, delayed: self.candidates, values: self.values }
    }

    /// Eliminates what has a pivot here; what is left is the front without it.
    fn eliminate(&mut self, found: &mut Inertia) {
        if self.candidates == 0 || self.together(found) {
            return;
        }
        let (n, mut done) = (self.indices.len(), 0);
        while done < self.candidates {
            match self.pivot(done) {
                Some(Pivot::One(at)) => {
                    self.swap(done, at);
                    found.count(self.values[done * n + done]);
                    self.eliminate_one(done);
                    done += 1;
                }
                Some(Pivot::Two(first, second)) => {
                    self.swap(done, first);
                    self.swap(done + 1, if second == done { first } else { second });
                    let [a, b, c] = self.block(done, done + 1);
                    // a determinant below zero: one eigenvalue of each sign
                    if a * c < b * b {
                        (found.positive, found.negative) = (found.positive + 1, found.negative + 1);
                    } else {
                        (0..2).for_each(|_| found.count(a));
                    }
                    self.eliminate_two(done);
                    done += 2;
                }
                None => break,
            }
        }
        self.keep_from(done);
        self.candidates -= done;
    }

    /// Eliminates all candidates at once; false, with nothing changed, where that is not stable.
    fn together(&mut self, found: &mut Inertia) -> bool {
        let (n, k) = (self.indices.len(), self.candidates);
        let r = n - k;
        let whole = MatRef::from_column_major_slice(&self.values, n, n);
        let Some(mut factor) = Indefinite::new(whole.submatrix(0, 0, k, k), r) else { return false };
        let Some(own) = signs(&factor.pivots()) else { return false };
        let mut beside = whole.submatrix(0, k, k, r).to_owned();
        factor.solve(beside.as_mut());
        let is_stable = (0..r).all(|j| (0..k).all(|i| beside[(i, j)].abs() <= 1.0 / THRESHOLD));
        if !is_stable {
            return false;
        }
        let below = whole.submatrix(k, 0, r, k).to_owned();
        self.keep_from(k);
        let target = MatMut::from_column_major_slice_mut(&mut self.values, r, r);
        f64::product(target, Accum::Add, below.as_ref(), beside.as_ref(), -1.0, Par::Seq);
        self.candidates = 0;
        found.positive += own.positive;
        found.negative += own.negative;
        true
    }

    /// The first pivot, from the place `done` on, that the threshold allows.
    fn pivot(&self, done: usize) -> Option<Pivot> {
        let n = self.indices.len();
        let sizes = |column: usize, without: usize| {
            let entries = self.values[column * n..(column + 1) * n].iter().enumerate().skip(done);
            entries.filter(move |(row, _)| *row != column && *row != without).map(|(row, value)| (row, value.abs()))
        };
        let largest = |column: usize, without: usize| sizes(column, without).fold(0.0, |m: f64, (_, x)| m.max(x));
        for column in done..self.candidates {
            let own = self.values[column * n + column].abs();
            if own > NOTHING && own >= THRESHOLD * largest(column, column) {
                return Some(Pivot::One(column));
            }
            let beside = sizes(column, column).filter(|(row, _)| *row < self.candidates);
            let Some((other, _)) = beside.reduce(|a, b| if b.1 > a.1 { b } else { a }) else { continue };
            let [a, b, c] = self.block(column, other);
            let determinant = (a * c - b * b).abs();
            let (x, y) = (largest(column, other), largest(other, column));
            let within = |first: f64, second: f64| first.abs() * x + second.abs() * y <= determinant / THRESHOLD;
            if determinant > NOTHING * NOTHING && within(c, b) && within(b, a) {
                return Some(Pivot::Two(column, other));
            }
        }
        None
    }

    /// The entries of a block of two: both on the diagonal, and between them the one beside it.
    fn block(&self, first: usize, second: usize) -> [f64; 3] {
        let n = self.indices.len();
        [self.values[first * n + first], self.values[first * n + second], self.values[second * n + second]]
    }

    fn swap(&mut self, a: usize, b: usize) {
        if a == b {
            return;
        }
        let n = self.indices.len();
        self.indices.swap(a, b);
        (0..n).for_each(|row| self.values.swap(a * n + row, b * n + row));
        self.values.chunks_exact_mut(n).for_each(|column| column.swap(a, b));
    }

    fn eliminate_one(&mut self, at: usize) {
        let n = self.indices.len();
        let (head, rest) = self.values.split_at_mut((at + 1) * n);
        let (pivot, column) = (head[at * n + at], &head[at * n..]);
        for (target, beside) in rest.chunks_exact_mut(n).zip(&column[at + 1..]) {
            let factor = beside / pivot;
            if factor != 0.0 {
                target[at + 1..].iter_mut().zip(&column[at + 1..]).for_each(|(t, c)| *t -= factor * c);
            }
        }
    }

    fn eliminate_two(&mut self, at: usize) {
        let n = self.indices.len();
        let [a, b, c] = self.block(at, at + 1);
        let determinant = a * c - b * b;
        let (head, rest) = self.values.split_at_mut((at + 2) * n);
        let (first, second) = head[at * n..].split_at(n);
        for (k, target) in rest.chunks_exact_mut(n).enumerate() {
            let (x, y) = (first[at + 2 + k], second[at + 2 + k]);
            let (p, q) = ((c * x - b * y) / determinant, (a * y - b * x) / determinant);
            let sources = first[at + 2..].iter().zip(&second[at + 2..]);
            target[at + 2..].iter_mut().zip(sources).for_each(|(t, (f, s))| *t -= p * f + q * s);
        }
    }

    /// Drops what stands before a place.
    fn keep_from(&mut self, at: usize) {
        let n = self.indices.len();
        let mut kept = Vec::with_capacity((n - at) * (n - at));
        self.values.chunks_exact(n).skip(at).for_each(|column| kept.extend_from_slice(&column[at..]));
        self.values = kept;
        self.indices.drain(..at);
    }
}

/// The signs of a block diagonal matrix with blocks of one and two: its entries on the diagonal and below. `None` where a
/// block is rounding.
fn signs(pivots: &[[f64; 2]]) -> Option<Inertia> {
    let (mut found, mut at) = (Inertia::default(), 0);
    while let Some(&[a, b]) = pivots.get(at) {
        let block = pivots.get(at + 1).filter(|_| b != 0.0);
        if let Some([c, _]) = block {
            let determinant = a * c - b * b;
            if determinant.is_nan() || determinant.abs() <= NOTHING * b * b {
                return None;
            }
            if determinant < 0.0 {
                (found.positive, found.negative) = (found.positive + 1, found.negative + 1);
            } else {
                (0..2).for_each(|_| found.count(a));
            }
        } else if a.is_nan() || a.abs() <= NOTHING {
            return None;
        } else {
            found.count(a);
        }
        at += 1 + usize::from(block.is_some());
    }
    Some(found)
}

/// A pivot of one column or of two.
#[derive(Clone, Copy)]
enum Pivot {
    One(usize),
    Two(usize, usize),
}

impl Inertia {
    fn count(&mut self, pivot: f64) {
        if pivot > 0.0 { self.positive += 1 } else { self.negative += 1 }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, SymmetricEigen};

    use super::*;

    /// Numbers between -1 and 1 that look random.
    fn number(k: usize) -> f64 {
        ((k + 1) as f64 * 0.618_033_988_749_894_9 * 7.0).sin()
    }

    fn of(dense: &DMatrix<f64>) -> (Inertia, Inertia) {
        let n = dense.nrows();
        let triplets: Vec<(u32, u32, f64)> = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .filter(|(i, j)| dense[(*i, *j)] != 0.0)
            .map(|(i, j)| (i as u32, j as u32, dense[(i, j)]))
            .collect();
        let sparse = Csr::from_triplets(n, n, &triplets).unwrap();
        let eigenvalues = SymmetricEigen::new(dense.clone()).eigenvalues;
        let negative = eigenvalues.iter().filter(|x| **x < 0.0).count();
        (inertia(&sparse, None).unwrap(), Inertia { positive: n - negative, negative, zero: 0 })
    }

    #[test]
    fn signs_are_those_of_the_eigenvalues() {
        for n in [1, 2, 5, 20, 60] {
            for seed in 0..10 {
                let band = DMatrix::from_fn(n, n, |i, j| {
                    let (low, high) = (i.min(j), i.max(j));
                    if high - low <= 3 || (high + low) % 17 == seed {
                        number(100 * seed + 60 * low + high)
                    } else {
                        0.0
                    }
                });
                let (found, exact) = of(&band);
                assert_eq!(found, exact, "n = {n}, seed {seed}");
            }
        }
    }

    /// A chain of springs with multipliers between its nodes: their own entries are zero, so that each waits for a
    /// displacement.
    #[test]
    fn multipliers_are_counted_as_negative() {
        for (springs, multipliers) in [(30, 10), (12, 12), (40, 1)] {
            let n = springs + multipliers;
            let mut matrix = DMatrix::zeros(n, n);
            for i in 0..springs {
                matrix[(i, i)] = 2.0;
                if i > 0 {
                    (matrix[(i, i - 1)], matrix[(i - 1, i)]) = (-1.0, -1.0);
                }
            }
            for k in 0..multipliers {
                let at = k * springs / multipliers;
                (matrix[(springs + k, at)], matrix[(at, springs + k)]) = (1.0, 1.0);
            }
            let (found, exact) = of(&matrix);
            assert_eq!(found, exact);
            assert_eq!(found.negative, multipliers);
        }
    }

    #[test]
    fn units_do_not_matter_and_a_null_vector_is_counted() {
        let mut matrix = DMatrix::zeros(4, 4);
        for (at, stiffness) in [(0, 1e-9), (2, 1e12)] {
            (matrix[(at, at)], matrix[(at + 1, at + 1)]) = (stiffness, stiffness);
            (matrix[(at, at + 1)], matrix[(at + 1, at)]) = (-stiffness, -stiffness);
        }
        matrix[(0, 0)] = -3e-9;
        let triplets: Vec<(u32, u32, f64)> =
            (0..16).map(|k| (k / 4, k % 4, matrix[(k as usize / 4, k as usize % 4)])).filter(|t| t.2 != 0.0).collect();
        let found = inertia(&Csr::from_triplets(4, 4, &triplets).unwrap(), None).unwrap();
        assert_eq!(found, Inertia { positive: 2, negative: 1, zero: 1 });
    }
}
