//! Lagrange elements on the pyramid, degrees 1 and 2.
//!
//! With `w = 1 - z`, `a = x/w`, `b = y/w` the space of degree k is spanned by `w^m a^i b^j` for `i, j <= m <= k`: it has the
//! polynomials of total degree k, is `Q_k` on the base and `P_k` on each triangle (Bergot, Cohen, Durufle, J. Sci. Comput.
//! 42, 2010). The functions of degree 1 are those of `cell/pyramid.rs`; `x y/(1 - z)` is the one that is no polynomial.
//! Derivatives: `d/dx` lowers m and i by one with the factor i, `d/dy` m and j with j, `d/dz` m with `i + j - m`. At the
//! apex second derivatives of degree 1 do not exist, and count as zero. Local order: lexicographic, x fastest, then y.

use super::{
    entity::entities,
    point_of,
    table::{DofEntity, Lattice, Table},
};
use crate::cell::{CellKind, pyramid::collapsed};

/// Nearer to the apex than this (height over that of the pyramid) second derivatives have no digit left.
const AT_APEX: f64 = 1e-12;

/// Places and entities of the dofs.
pub(super) fn dofs(kind: CellKind, degree: usize) -> (Vec<[u8; 4]>, Vec<DofEntity>) {
    let k = u8::try_from(degree).expect("degrees are at most 3");
    let layer = |z: u8| (0..=k - z).flat_map(move |y| (0..=k - z).map(move |x| [x, y, z, 0]));
    let places: Vec<[u8; 4]> = (0..=k).flat_map(layer).collect();
    let points: Vec<[f64; 3]> = places.iter().map(|p| point_of(kind, degree, p)).collect();
    let entities = entities(kind, degree, &points);
    (places, entities)
}

/// The exponents (m, i, j) of the spanning functions.
fn powers(degree: usize) -> Vec<[i32; 3]> {
    let k = i32::try_from(degree).expect("degrees are at most 3");
    (0..=k).flat_map(|m| (0..=m).flat_map(move |j| (0..=m).map(move |i| [m, i, j]))).collect()
}

/// `w^m a^i b^j`; zero for the negative powers that have no value at the apex.
fn term([m, i, j]: [i32; 3], [w, a, b]: [f64; 3]) -> f64 {
    if m < 0 && w.abs() < AT_APEX {
        return 0.0;
    }
    let power = |x: f64, n: i32| (0..n.abs()).fold(1.0, |p, _| if n < 0 { p / x } else { p * x });
    power(w, m) * power(a, i) * power(b, j)
}

/// The derivative of a spanning function in direction `d`: its factor and the function.
fn derived([m, i, j]: [i32; 3], d: usize) -> (f64, [i32; 3]) {
    let (factor, next) = match d {
        0 => (i, [m - 1, i - 1, j]),
        1 => (j, [m - 1, i, j - 1]),
        _ => (i + j - m, [m - 1, i, j]),
    };
    (f64::from(factor), next)
}

/// `coefficients[dof * n + k]` of spanning function `k` in the function of `dof`: the inverse of the matrix of their values
/// at the nodes. They are whole numbers, to which rounding brings back what elimination left.
pub(super) fn coefficients(degree: usize, points: &[[f64; 3]]) -> Vec<f64> {
    let n = points.len();
    if degree == 0 {
        return vec![1.0];
    }
    let powers = powers(degree);
    // values of the functions at the nodes, beside the identity: rows are nodes
    let row = |(k, point): (usize, &[f64; 3])| -> Vec<f64> {
        let values = powers.iter().map(|p| term(*p, collapsed(*point)));
        values.chain((0..n).map(|c| f64::from(u8::from(c == k)))).collect()
    };
    let mut rows: Vec<Vec<f64>> = points.iter().enumerate().map(row).collect();
    for column in 0..n {
        let size = |r: &usize| rows[*r][column].abs();
        let pivot = (column..n).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(column);
        rows.swap(column, pivot);
        let scale = 1.0 / rows[column][column];
        rows[column].iter_mut().for_each(|x| *x *= scale);
        let own = rows[column].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(r, _)| *r != column) {
            let factor = row[column];
            row.iter_mut().zip(&own).for_each(|(x, y)| *x -= factor * y);
        }
    }
    (0..n).flat_map(|dof| rows.iter().map(move |row| row[n + dof].round()).collect::<Vec<_>>()).collect()
}

/// Appends the entries of one point to `table`.
pub(super) fn tabulate(lattice: &Lattice, point: &[f64; 3], derivatives: usize, table: &mut Table) {
    if lattice.degree == 0 {
        table.values.push(1.0);
        table.gradients.extend([0.0; 3].iter().take(if derivatives > 0 { 3 } else { 0 }));
        table.hessians.extend([0.0; 9].iter().take(if derivatives > 1 { 9 } else { 0 }));
        return;
    }
    let (powers, at) = (powers(lattice.degree), collapsed(*point));
    for of_dof in lattice.coefficients.chunks_exact(powers.len()) {
        let sum = |f: &dyn Fn([i32; 3]) -> f64| of_dof.iter().zip(&powers).map(|(c, p)| c * f(*p)).sum::<f64>();
        table.values.push(sum(&|p| term(p, at)));
        let slope = |p: [i32; 3], d: usize| {
            let (factor, next) = derived(p, d);
            if factor == 0.0 { 0.0 } else { factor * term(next, at) }
        };
        for d in 0..if derivatives > 0 { 3 } else { 0 } {
            table.gradients.push(sum(&|p| slope(p, d)));
        }
        for (d, e) in (0..9).map(|k| (k / 3, k % 3)).take(if derivatives > 1 { 9 } else { 0 }) {
            table.hessians.push(sum(&|p| {
                let (factor, next) = derived(p, d);
                if factor == 0.0 { 0.0 } else { factor * slope(next, e) }
            }));
        }
    }
}
