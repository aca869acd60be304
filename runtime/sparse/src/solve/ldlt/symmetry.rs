//! Whether a matrix is symmetric once the rows of each group of unknowns are multiplied by one number.
//!
//! Equations of one field often have another sign or another unit than the coupling across the diagonal: a balance of fluid
//! that is divided by the time step, a condition of incompressibility with a plus. With T the diagonal of those numbers T A
//! is symmetric, and `A x = b` has the solution of `T A x = T b`.
//!
//! Promises: one pass over the entries that finds T, one that looks at all pairs of entries and ends at the first that
//! differ. Does not scale and does not factor.

use crate::csr::Csr;
use crate::norm::largest;

/// Asymmetry that rounding in assembly explains, relative to the larger one of two entries.
const ASYMMETRY: f64 = 1e-10;
/// The same where laws and cells cancel, relative to what both unknowns are stiff. No more: beside a stiffness of 1e20 a
/// coupling of 1 is one.
const CANCELLED: f64 = 1e-13;

/// Pairs between groups that are looked at first for T: as a rule they hold what all others say, too.
const FIRST: usize = 1 << 14;

/// The number of each row that makes a square matrix symmetric, 1 for the first row of a component; `None` where there is
/// none. `groups` has the group of each row, from zero; without it all rows are one.
pub fn symmetrising(matrix: &Csr, groups: Option<&[u32]>) -> Option<Vec<f64>> {
    let largest_entries: Vec<f64> =
        (0..matrix.n_rows()).map(|row| largest(matrix.row(row).1.iter().copied())).collect();
    let Some(groups) = groups else {
        return symmetric_with(matrix, &largest_entries, vec![1.0; matrix.n_rows()]);
    };
    let by_row = |factors: Vec<f64>| groups.iter().map(|group| factors[*group as usize]).collect();
    let with = |most: usize| {
        let factors = group_factors(matrix, groups, most)?;
        symmetric_with(matrix, &largest_entries, by_row(factors))
    };
    with(FIRST).or_else(|| with(usize::MAX))
}

/// These factors of rows, if a matrix is symmetric with them.
fn symmetric_with(matrix: &Csr, largest_entries: &[f64], by_row: Vec<f64>) -> Option<Vec<f64>> {
    // rounding of an entry that couples two unknowns is a part of what both are stiff
    let sizes: Vec<f64> =
        by_row.iter().zip(largest_entries).map(|(factor, size)| (factor.abs() * size).sqrt()).collect();
    let mut is_symmetric = true;
    pairs(matrix, |row, column, value, transposed| {
        let difference = by_row[row] * value - by_row[column] * transposed;
        let larger = (by_row[row] * value).abs().max((by_row[column] * transposed).abs());
        // not true for what is no number
        is_symmetric = difference.abs() <= ASYMMETRY * larger + CANCELLED * sizes[row] * sizes[column];
        is_symmetric
    });
    is_symmetric.then_some(by_row)
}

/// By group the number of its rows, from the largest entries between two groups, of no more than `most` pairs between them.
fn group_factors(matrix: &Csr, groups: &[u32], most: usize) -> Option<Vec<f64>> {
    let n = groups.iter().max().map_or(0, |last| *last as usize + 1);
    // by pairs of groups the largest entry above the diagonal between them, and the one across
    let (mut largest, mut seen) = (vec![(0.0f64, 0.0f64); n * n], 0);
    pairs(matrix, |row, column, value, transposed| {
        let (a, b) = (groups[row] as usize, groups[column] as usize);
        if a != b {
            let (place, entry) =
                if a < b { (a * n + b, (value, transposed)) } else { (b * n + a, (transposed, value)) };
            if entry.0.abs() > largest[place].0.abs() {
                largest[place] = entry;
            }
            seen += 1;
        }
        seen < most
    });
    let mut factors = vec![0.0; n];
    for first in 0..n {
        if factors[first] != 0.0 {
            continue;
        }
        factors[first] = 1.0;
        let mut open = vec![first];
        while let Some(group) = open.pop() {
            for other in 0..n {
                let (value, transposed) = match group < other {
                    true => largest[group * n + other],
                    false => {
                        let (a, b) = largest[other * n + group];
                        (b, a)
                    }
                };
                if factors[other] == 0.0 && value != 0.0 && transposed != 0.0 {
                    let factor = factors[group] * value / transposed;
                    // rounding is no unit
                    factors[other] = if (factor - 1.0).abs() < ASYMMETRY { 1.0 } else { factor };
                    open.push(other);
                }
            }
        }
    }
    factors.iter().all(|factor| factor.is_finite() && *factor != 0.0).then_some(factors)
}

/// Each pair of entries across the diagonal, the one above it first, zero where there is none, until `look` says no.
fn pairs(matrix: &Csr, mut look: impl FnMut(usize, usize, f64, f64) -> bool) {
    let (pattern, values) = (matrix.pattern(), matrix.values());
    let (starts, columns) = (pattern.row_starts(), pattern.columns());
    // entries left of the diagonal are met in the order of their columns
    let mut next: Vec<usize> = starts[..matrix.n_rows()].to_vec();
    for row in 0..matrix.n_rows() {
        // those that have no entry across
        while next[row] < starts[row + 1] && (columns[next[row]] as usize) < row {
            let place = next[row];
            if !look(columns[place] as usize, row, 0.0, values[place]) {
                return;
            }
            next[row] += 1;
        }
        let place = next[row];
        let is_diagonal = place < starts[row + 1] && columns[place] as usize == row;
        for place in place + usize::from(is_diagonal)..starts[row + 1] {
            let column = columns[place] as usize;
            let other = &mut next[column];
            while *other < starts[column + 1] && (columns[*other] as usize) < row {
                if !look(columns[*other] as usize, column, 0.0, values[*other]) {
                    return;
                }
                *other += 1;
            }
            let transposed = if *other < starts[column + 1] && columns[*other] as usize == row {
                *other += 1;
                values[*other - 1]
            } else {
                0.0
            };
            if !look(row, column, values[place], transposed) {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(n: usize, entries: &[(u32, u32, f64)]) -> Csr {
        Csr::from_triplets(n, n, entries).unwrap()
    }

    #[test]
    fn a_symmetric_matrix_needs_no_factors() {
        let a = matrix(3, &[(0, 0, 2.0), (0, 2, 1.0), (2, 0, 1.0), (1, 1, 3.0)]);
        assert_eq!(symmetrising(&a, None), Some(vec![1.0; 3]));
        assert_eq!(symmetrising(&a, Some(&[0, 0, 1])), Some(vec![1.0; 3]));
    }

    #[test]
    fn entries_without_a_partner_are_seen() {
        for entry in [(0, 2, 1.0), (2, 0, 1.0), (2, 1, 1.0), (1, 2, 1.0)] {
            let a = matrix(3, &[(0, 0, 2.0), (1, 1, 3.0), (2, 2, 1.0), entry]);
            assert_eq!(symmetrising(&a, None), None, "{entry:?}");
            let zero = matrix(3, &[(0, 0, 2.0), (1, 1, 3.0), (2, 2, 1.0), (entry.0, entry.1, 0.0)]);
            assert!(symmetrising(&zero, None).is_some(), "{entry:?}");
        }
    }

    #[test]
    fn groups_take_the_number_that_makes_them_symmetric() {
        // two displacements, two pressures whose balance has another sign and another unit
        let entries = [
            (0, 0, 4.0),
            (1, 1, 5.0),
            (0, 1, 1.0),
            (1, 0, 1.0),
            (0, 2, 3.0),
            (2, 0, -0.75),
            (1, 3, -2.0),
            (3, 1, 0.5),
            (2, 3, 7.0),
            (3, 2, 7.0),
        ];
        let a = matrix(4, &entries);
        assert_eq!(symmetrising(&a, Some(&[0, 0, 1, 1])), Some(vec![1.0, 1.0, -4.0, -4.0]));
        assert_eq!(symmetrising(&a, None), None);
        let other = matrix(4, &[&entries[..], &[(1, 2, 1.0), (2, 1, 1.0)]].concat());
        assert_eq!(symmetrising(&other, Some(&[0, 0, 1, 1])), None);
    }
}
