//! Scales of the unknowns and of the equations.
//!
//! Promises: powers of two, so that scaling is exact; 1 for a row or column without entries; no dependence on the
//! order of the unknowns.

use super::row_owners::RowOwners;
use crate::csr::Csr;

/// `s` such that the diagonal of `S A S` is about 1. An unknown without a diagonal entry (a multiplier) gets the scale
/// that makes the largest entry of its row about 1.
///
/// `diagonal` is that of the sum of the parts; of several ranks each has its rows of the parts, and copies of the diagonal.
pub(super) fn symmetric_scale(parts: &[&Csr], diagonal: &[f64], owners: Option<&RowOwners>) -> Vec<f64> {
    let mut scale: Vec<f64> = diagonal.iter().map(|value| power_of_two(1.0 / value.abs().sqrt())).collect();
    let without: Vec<usize> = (0..diagonal.len()).filter(|&dof| diagonal[dof] == 0.0).collect();
    let largest_of = |&dof: &usize| {
        let entries = parts.iter().flat_map(|part| {
            let (columns, values) = part.row(dof);
            columns.iter().zip(values)
        });
        entries.fold(0.0, |largest: f64, (&column, value)| {
            let column = column as usize;
            // Between two multipliers there is no scale to lean on.
            if diagonal[column] == 0.0 { largest } else { largest.max(value.abs() * scale[column]) }
        })
    };
    let largest: Vec<f64> = without.iter().map(largest_of).collect();
    without.iter().zip(largest).for_each(|(dof, largest)| scale[*dof] = power_of_two(1.0 / largest));
    if let Some(owners) = owners {
        owners.update(&mut scale);
    }
    scale
}

/// Rounds of [`evened`]: each halves the exponents of what rows differ by (Ruiz 2001).
const ROUNDS: usize = 5;
/// Largest entries of rows that are even enough: the threshold of pivots is far from both.
const EVEN: std::ops::Range<f64> = 0.2..5.0;

/// `s` such that the largest entries of the rows of `S T A S`, T A symmetric, are about 1, and where that can be those of the
/// diagonal; `row_factors` are those of T.
pub(super) fn evened(matrix: &Csr, row_factors: &[f64]) -> Vec<f64> {
    let mut scale = of_stiffness(matrix, row_factors);
    for _ in 0..ROUNDS {
        let largest = |row: usize| {
            let (columns, values) = matrix.row(row);
            let entries = columns.iter().zip(values);
            entries.fold(0.0, |most: f64, (column, value)| most.max(value.abs() * scale[*column as usize]))
                * (row_factors[row] * scale[row]).abs()
        };
        let sizes: Vec<f64> = (0..matrix.n_rows()).map(largest).collect();
        if sizes.iter().all(|size| *size == 0.0 || EVEN.contains(size)) {
            break;
        }
        scale.iter_mut().zip(sizes).filter(|(_, size)| *size > 0.0).for_each(|(scale, size)| *scale /= size.sqrt());
    }
    scale.into_iter().map(power_of_two).collect()
}

/// Scales that make the diagonal of `T A` about 1 in the rows of most unknowns, displacements or velocities, and the largest entry
/// beside these in the rows of others, pressures and multipliers, whose diagonal is zero or has the other sign. Even rows alone leave
/// a viscosity of 1e-6 that small beside the entries of the pressure: no velocity is a pivot of its own then, and the factor
/// fills up. 1 where there is no such majority: each unknown has another one to be a pivot with.
fn of_stiffness(matrix: &Csr, row_factors: &[f64]) -> Vec<f64> {
    let n = matrix.n_rows();
    let diagonal: Vec<f64> = (0..n).map(|row| row_factors[row] * matrix.get(row, row)).collect();
    let count = |sign: f64| diagonal.iter().filter(|d| sign * **d > 0.0).count();
    let sign = if count(1.0) >= count(-1.0) { 1.0 } else { -1.0 };
    if 2 * count(sign) <= n {
        return vec![1.0; n];
    }
    let is_stiff = |row: usize| sign * diagonal[row] > 0.0;
    let own = |row: usize| 1.0 / diagonal[row].abs().sqrt();
    let mut scale: Vec<f64> = (0..n).map(|row| if is_stiff(row) { own(row) } else { 0.0 }).collect();
    for row in (0..n).filter(|row| !is_stiff(*row)) {
        let (columns, values) = matrix.row(row);
        let beside = columns.iter().zip(values).filter(|(column, _)| is_stiff(**column as usize));
        let most = beside.fold(0.0, |most: f64, (column, value)| most.max(value.abs() * scale[*column as usize]));
        scale[row] = own(row).min(1.0 / (row_factors[row].abs() * most));
    }
    scale.iter_mut().filter(|s| !s.is_finite()).for_each(|s| *s = 1.0);
    scale
}

/// `(r, c)` such that the largest entries of the columns, and nearly those of the rows, of `R A C` are about 1: rows
/// first, then columns, as in LAPACK's geequ. Of several ranks each has its rows of the matrix.
pub(super) fn equilibration(matrix: &Csr, owners: Option<&RowOwners>) -> (Vec<f64>, Vec<f64>) {
    let mut rows = vec![1.0; matrix.n_rows()];
    let mut largest_in_column = vec![0.0f64; matrix.n_cols()];
    for (row, scale) in rows.iter_mut().enumerate() {
        let (places, values) = matrix.row(row);
        *scale = power_of_two(1.0 / values.iter().fold(0.0, |largest: f64, value| value.abs().max(largest)));
        for (&column, value) in places.iter().zip(values) {
            let largest = &mut largest_in_column[column as usize];
            *largest = (value * *scale).abs().max(*largest);
        }
    }
    if let Some(owners) = owners {
        owners.halo.largest_at_owners(&*owners.team, &mut largest_in_column);
        owners.update(&mut largest_in_column);
    }
    let columns = largest_in_column.into_iter().map(|largest| power_of_two(1.0 / largest)).collect();
    (rows, columns)
}

/// The nearest power of two in the logarithm, 1 for what has none.
pub(super) fn power_of_two(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    // The exponent of value * sqrt(2), rounded down; subnormal scales are cut off.
    let exponent = ((value * std::f64::consts::SQRT_2).to_bits() >> 52) as i64 - 1023;
    f64::from_bits(((exponent.clamp(-1000, 1000) + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagonal(a: &Csr) -> Vec<f64> {
        (0..a.n_rows()).map(|dof| a.get(dof, dof)).collect()
    }

    #[test]
    fn scales_are_powers_of_two_near_the_value() {
        for (value, wanted) in [(1.0, 1.0), (3.0, 4.0), (2.7, 2.0), (0.2, 0.25), (0.0, 1.0), (f64::INFINITY, 1.0)] {
            assert_eq!(power_of_two(value), wanted, "{value}");
        }
    }

    #[test]
    fn a_badly_scaled_matrix_becomes_even() {
        let d = [1e-12, 1.0, 1e9, 1e3];
        let mut triplets = Vec::new();
        for i in 0..4u32 {
            for j in 0..4u32 {
                let value = if i == j { 2.0 } else { -0.5 };
                triplets.push((i, j, value * d[i as usize] * d[j as usize]));
            }
        }
        let a = Csr::from_triplets(4, 4, &triplets).unwrap();
        let s = symmetric_scale(&[&a], &diagonal(&a), None);
        let (r, c) = equilibration(&a, None);
        for i in 0..4 {
            let entry = s[i] * a.get(i, i) * s[i];
            assert!((0.4..2.5).contains(&entry), "{entry}");
            let row = (0..4).map(|j| (r[i] * a.get(i, j) * c[j]).abs()).fold(0.0, f64::max);
            assert!((0.2..4.0).contains(&row), "{row}");
        }
    }

    #[test]
    fn an_even_matrix_has_largest_entries_of_one() {
        let d = [1e-12, 1.0, 1e9, 1e3];
        let at = |i: usize, j: usize| if i == j && i == 1 { 0.0 } else { d[i] * d[j] * (1.0 + (i + j) as f64 / 7.0) };
        let triplets: Vec<_> = (0..16).map(|k| ((k / 4) as u32, (k % 4) as u32, at(k / 4, k % 4))).collect();
        let a = Csr::from_triplets(4, 4, &triplets).unwrap();
        let s = evened(&a, &[1.0; 4]);
        for i in 0..4 {
            let row = (0..4).map(|j| (s[i] * a.get(i, j) * s[j]).abs()).fold(0.0, f64::max);
            assert!((0.2..5.0).contains(&row), "{row}");
        }
    }

    #[test]
    fn a_multiplier_takes_the_scale_of_its_row() {
        let a = Csr::from_triplets(2, 2, &[(0, 0, 4e8), (0, 1, 1.0), (1, 0, 1.0)]).unwrap();
        let s = symmetric_scale(&[&a], &diagonal(&a), None);
        assert!((0.4..2.5).contains(&(s[1] * s[0])), "{s:?}");
    }
}
