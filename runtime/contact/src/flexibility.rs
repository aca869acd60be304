//! How stiff bodies are against forces at some of their dofs, from their matrix and a few of its products.
//!
//! The diagonal of a matrix says little of that where some directions are much stiffer than others: in a nearly
//! incompressible body it is that of a change of volume, while the body gives way at the stiffness of shear. What
//! counts is the diagonal of the inverse; its mean over n dofs is b.K⁻¹b/n for a random vector b of signs (Hutchinson
//! 1990). Conjugate gradients from zero give that number from below, and after m products nothing that is further away
//! than m cells takes part: the stiffness of the surroundings, not that of the whole structure.
//!
//! Promises: the same number in every run. Does not solve anything.

use wfl_host::team::{Alone, Team};
use wfl_sparse::{csr::Csr, solve::RowOwners};

/// Most products with the matrix, and the part of what was found below which one more is not worth it: two digits are enough of
/// a stiffness that branches are chosen with.
const PRODUCTS: usize = 60;
const SMALL: f64 = 5e-3;

/// The stiffness (force by displacement) of `matrix` at `dofs`: the inverse of the mean of the diagonal of its inverse.
/// `None` where that is no positive number, as it is not for an indefinite matrix. Of several ranks each has its rows of
/// the matrix, and gives the dofs among them.
pub(super) fn stiffness(matrix: &Csr, dofs: &[u32], owners: Option<&RowOwners>) -> Option<f64> {
    let team: &dyn Team = owners.map_or(&Alone, |owners| &*owners.team);
    let n = matrix.n_rows();
    let inverse = |d: usize| Some(matrix.get(d, d)).filter(|k| *k > 0.0).map_or(0.0, |k| 1.0 / k);
    let inverse: Vec<f64> = (0..n).map(inverse).collect();
    let mut residual = vec![0.0; n];
    let mut count = 0usize;
    for dof in dofs.iter().map(|d| *d as usize).filter(|d| inverse[*d] > 0.0) {
        residual[dof] = sign(owners.map_or(dof as u64, |owners| owners.number(dof)));
        count += 1;
    }
    let count = team.count(count);
    // over the rows of all ranks: one of the vectors is zero in those of others
    let dot = |a: &[f64], b: &[f64]| team.total(a.iter().zip(b).map(|(a, b)| a * b).sum());
    let scaled = |r: &[f64]| -> Vec<f64> { r.iter().zip(&inverse).map(|(r, d)| r * d).collect() };
    let mut direction = scaled(&residual);
    let mut size = dot(&residual, &direction);
    let (mut found, mut product) = (0.0, vec![0.0; n]);
    for _ in 0..PRODUCTS {
        // exact after as many products as there are different stiffnesses
        if size == 0.0 {
            break;
        }
        if let Some(owners) = owners {
            owners.update(&mut direction);
        }
        matrix.multiply(&direction, &mut product, 1);
        let curvature = dot(&direction, &product);
        if curvature <= 0.0 || curvature.is_nan() {
            return None;
        }
        let step = size / curvature;
        // what this step adds to b.x
        found += step * size;
        if step * size < SMALL * found {
            break;
        }
        residual.iter_mut().zip(&product).for_each(|(r, q)| *r -= step * q);
        let next = scaled(&residual);
        let next_size = dot(&residual, &next);
        let turn = next_size / size;
        direction.iter_mut().zip(&next).for_each(|(d, z)| *d = z + turn * *d);
        size = next_size;
    }
    #[expect(clippy::cast_precision_loss, reason = "a mean")]
    let stiffness = count as f64 / found;
    (stiffness > 0.0 && stiffness.is_finite()).then_some(stiffness)
}

/// A sign that looks random, the same for the same dof (the mixing of SplitMix64, Steele et al. 2014).
fn sign(dof: u64) -> f64 {
    let mut z = dof.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use wfl_sparse::csr::Pattern;

    fn tridiagonal(n: usize, diagonal: impl Fn(usize) -> f64, beside: f64) -> Csr {
        let columns = |i: usize| i.saturating_sub(1)..(i + 2).min(n);
        let starts = (0..=n).map(|i| (0..i).map(|r| columns(r).len()).sum()).collect();
        let all = (0..n).flat_map(|i| columns(i).map(|c| c as u32)).collect();
        let mut matrix = Csr::zeros(Arc::new(Pattern::new(n, n, starts, all).unwrap()));
        for i in 0..n {
            for c in columns(i) {
                assert!(matrix.add_to(i, c, if c == i { diagonal(i) } else { beside }));
            }
        }
        matrix
    }

    #[test]
    fn without_coupling_it_is_the_harmonic_mean_of_the_diagonal() {
        let matrix = tridiagonal(4, |i| [2.0, 1e6, 4.0, 1.0][i], 0.0);
        let found = stiffness(&matrix, &[0, 1, 2], None).unwrap();
        assert!((found - 3.0 / (0.5 + 1e-6 + 0.25)).abs() < 1e-9 * found, "{found}");
    }

    #[test]
    fn at_the_end_of_a_chain_of_springs_it_is_that_of_the_chain() {
        // ten springs of stiffness 1 in series, fixed at one end: 1/10 at the other, 2 on the diagonal
        let matrix = tridiagonal(10, |i| if i == 9 { 1.0 } else { 2.0 }, -1.0);
        let found = stiffness(&matrix, &[9], None).unwrap();
        assert!((found - 0.1).abs() < 1e-10, "{found}");
    }

    #[test]
    fn an_indefinite_matrix_has_none() {
        assert_eq!(stiffness(&tridiagonal(6, |_| 1.0, -1.0), &[0, 1, 2, 3, 4, 5], None), None);
        assert_eq!(stiffness(&tridiagonal(3, |_| 0.0, 0.0), &[0, 1], None), None);
    }
}
