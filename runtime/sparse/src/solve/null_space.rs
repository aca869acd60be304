//! The null space of a singular matrix, for messages.
//!
//! Rows and columns are scaled so that their largest entries are 1 (Ruiz 2001), which removes differences of units: a
//! matrix that is singular then is singular, otherwise the smaller entries were lost to rounding. With B the scaled
//! matrix, inverse iteration on `BᵀB + δ² 1` finds directions of small `|B v|` for any symmetry of B. Their sizes are
//! taken from `B V` itself, so that the square does not lose digits. Promises: vectors that are orthonormal in scaled
//! unknowns; none for a matrix that is too large to be squared. Used only when a run ends.

use nalgebra::DMatrix;

use super::factorization::Factorization;
use super::llt::Llt;
use super::triangular_solve::Transpose;
use crate::csr::{Csr, PatternBuilder};

/// Vectors that are looked for at once.
const VECTORS: usize = 8;
/// Inverse iterations.
const ITERATIONS: usize = 4;
/// Rounds of scaling.
const ROUNDS: usize = 12;
/// Relative to the largest entry of the square: its rounding, with room for what a factor adds.
const SHIFT: f64 = 1e-13;
/// A direction is one of the null space if B makes less than this of it.
const NULL: f64 = 1e-10;
/// Products of entries in one row, summed, that are still squared.
const MOST_PRODUCTS: usize = 200_000_000;

/// What is undetermined.
#[derive(Clone, Debug, Default)]
pub struct NullSpace {
    /// Vectors in the unknowns of the matrix, one number a column.
    pub vectors: Vec<Vec<f64>>,
    /// The same in scaled unknowns, orthonormal.
    pub scaled: Vec<Vec<f64>>,
}

/// The largest entries of a matrix, in size.
#[derive(Clone, Debug, Default)]
pub struct LargestEntries {
    /// Of each row.
    pub rows: Vec<f64>,
    /// Of each column.
    pub columns: Vec<f64>,
}

/// The null space of a square matrix; `None` if it is too large, or if its square cannot be factored. `coordinates` are
/// the positions of its unknowns, for the ordering of that square.
#[must_use]
pub fn null_space(matrix: &Csr, coordinates: Option<&[[f64; 3]]>, threads: usize) -> Option<NullSpace> {
    let n = matrix.n_rows();
    let products: usize = (0..n).map(|row| matrix.row(row).0.len().pow(2)).sum();
    if n == 0 || products > MOST_PRODUCTS || matrix.first_non_finite().is_some() {
        return None;
    }
    let (scaled, column_scale) = equilibrated(matrix);
    let square = squared(&scaled)?;
    let mut solver = Llt::analyze(square.pattern(), coordinates, threads).ok()?;
    solver.factor(&square).ok()?;
    let count = VECTORS.min(n);
    #[expect(clippy::cast_precision_loss, reason = "fixed numbers, orthogonal to nothing in particular")]
    let start = |k: usize, dof: usize| ((dof * (2 * k + 1) + k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
    let mut vectors: Vec<Vec<f64>> = (0..count).map(|k| (0..n).map(|dof| start(k, dof)).collect()).collect();
    for _ in 0..ITERATIONS {
        vectors.iter_mut().for_each(|v| solver.solve(Transpose::No, v));
        orthonormal(&mut vectors);
    }
    let met: Vec<Vec<f64>> = vectors
        .iter()
        .map(|v| {
            let mut met = vec![0.0; n];
            scaled.multiply(v, &mut met, threads);
            met
        })
        .collect();
    let found = triangular(met).svd(false, true);
    let right = found.v_t?;
    let small = (0..count).filter(|k| found.singular_values[*k] <= NULL);
    let combined = |k: usize| -> Vec<f64> {
        (0..n).map(|dof| (0..count).map(|j| right[(k, j)] * vectors[j][dof]).sum()).collect()
    };
    let scaled: Vec<Vec<f64>> = small.map(combined).collect();
    let unscaled = |v: &Vec<f64>| v.iter().zip(&column_scale).map(|(x, s)| x * s).collect();
    Some(NullSpace { vectors: scaled.iter().map(unscaled).collect(), scaled })
}

/// The largest entries of rows and columns.
#[must_use]
pub fn largest_entries(matrix: &Csr) -> LargestEntries {
    let (mut rows, mut columns) = (vec![0.0f64; matrix.n_rows()], vec![0.0f64; matrix.n_cols()]);
    for (row, size) in rows.iter_mut().enumerate() {
        let (list, values) = matrix.row(row);
        for (column, value) in list.iter().zip(values) {
            *size = size.max(value.abs());
            columns[*column as usize] = columns[*column as usize].max(value.abs());
        }
    }
    LargestEntries { rows, columns }
}

/// The matrix with rows and columns scaled to largest entries of 1, and the scale of the columns.
pub(super) fn equilibrated(matrix: &Csr) -> (Csr, Vec<f64>) {
    let mut scaled = matrix.clone();
    let mut scale = vec![1.0; matrix.n_cols()];
    let factor = |size: &f64| if *size > 0.0 { 1.0 / size.sqrt() } else { 1.0 };
    for _ in 0..ROUNDS {
        let LargestEntries { rows, columns } = largest_entries(&scaled);
        let (rows, columns): (Vec<f64>, Vec<f64>) =
            (rows.iter().map(factor).collect(), columns.iter().map(factor).collect());
        let pattern = scaled.pattern().clone();
        let values = scaled.values_mut();
        for (row, by) in rows.iter().enumerate() {
            for place in pattern.row_starts()[row]..pattern.row_starts()[row + 1] {
                values[place] *= by * columns[pattern.columns()[place] as usize];
            }
        }
        scale.iter_mut().zip(&columns).for_each(|(s, c)| *s *= c);
    }
    (scaled, scale)
}

/// `BᵀB + δ² 1`.
fn squared(b: &Csr) -> Option<Csr> {
    let mut builder = PatternBuilder::new(b.n_cols(), b.n_cols());
    (0..b.n_rows()).for_each(|row| builder.add_element(b.row(row).0));
    builder.add_diagonal();
    let mut square = Csr::zeros(builder.build_shared().ok()?);
    for row in 0..b.n_rows() {
        let (columns, values) = b.row(row);
        for (i, a) in columns.iter().zip(values) {
            for (j, b) in columns.iter().zip(values) {
                if !square.add_to(*i as usize, *j as usize, a * b) {
                    return None;
                }
            }
        }
    }
    let shift = SHIFT * square.max_abs();
    let shift = if shift > 0.0 { shift } else { 1.0 };
    let all = (0..b.n_cols()).all(|dof| square.add_to(dof, dof, shift));
    all.then_some(square)
}

/// Gram and Schmidt, each column after the others, twice.
fn orthonormal(vectors: &mut [Vec<f64>]) {
    for k in 0..vectors.len() {
        let (done, rest) = vectors.split_at_mut(k);
        let own = &mut rest[0];
        for _ in 0..2 {
            for unit in done.iter() {
                let part = dot(unit, own);
                own.iter_mut().zip(unit).for_each(|(x, u)| *x -= part * u);
            }
            let length = dot(own, own).sqrt();
            if length > 0.0 {
                own.iter_mut().for_each(|x| *x /= length);
            }
        }
    }
}

/// The triangular factor R (n x n) of a matrix given by its n columns of one length (Gram and Schmidt, one column after
/// the other).
#[must_use]
pub fn triangular(mut columns: Vec<Vec<f64>>) -> DMatrix<f64> {
    let n = columns.len();
    let mut factor = DMatrix::zeros(n, n);
    for i in 0..n {
        let (done, rest) = columns.split_at_mut(i);
        let column = &mut rest[0];
        for (j, unit) in done.iter().enumerate() {
            let part = dot(unit, column);
            factor[(j, i)] = part;
            column.iter_mut().zip(unit).for_each(|(x, u)| *x -= part * u);
        }
        let length = dot(column, column).sqrt();
        factor[(i, i)] = length;
        if length > 0.0 {
            column.iter_mut().for_each(|x| *x /= length);
        }
    }
    factor
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dofs 0 and 1 are a spring on the ground, 2 and 3 one that floats in units of 1e12.
    #[test]
    fn a_null_vector_is_found_in_any_unit() {
        let big = 1e12;
        let triplets = [(0, 0, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)];
        let floating = [(2, 2, big), (2, 3, -big), (3, 2, -big), (3, 3, big)];
        let all: Vec<(u32, u32, f64)> = triplets.into_iter().chain(floating).collect();
        let matrix = Csr::from_triplets(4, 4, &all).unwrap();
        let found = null_space(&matrix, None, 1).unwrap();
        assert_eq!(found.vectors.len(), 1);
        let v = &found.vectors[0];
        assert!(v[0].abs() < 1e-9 * v[2].abs() && (v[2] - v[3]).abs() < 1e-9 * v[2].abs(), "{v:?}");
    }

    /// Rows of sizes 1e30 apart are no null space; a zero equation is one for any column.
    #[test]
    fn rows_far_apart_are_not_singular() {
        let matrix = Csr::from_triplets(2, 2, &[(0, 0, 1e30), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 1.0)]).unwrap();
        let found = null_space(&matrix, None, 1).unwrap();
        assert!(found.vectors.is_empty() && largest_entries(&matrix).rows[0] == 1e30);
        let matrix = Csr::from_triplets(2, 2, &[(0, 0, 1.0), (0, 1, 3.0)]).unwrap();
        let found = null_space(&matrix, None, 1).unwrap();
        assert_eq!((found.vectors.len(), largest_entries(&matrix).rows[1]), (1, 0.0));
    }
}
