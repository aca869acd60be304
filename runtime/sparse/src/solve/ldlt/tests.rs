//! Symmetric systems that are not definite: solutions against those that are known, signs against dense eigenvalues,
//! singular ones by their null vectors.

use nalgebra::{DMatrix, SymmetricEigen};

use super::super::problems::{BoxOptions, ElasticBox};
use super::super::{CheckedLdlt, LinearSolver, SolveError, SolverOptions};
use super::*;
use crate::csr::residual_compensated;

/// Numbers between -1 and 1 that look random.
fn number(k: usize) -> f64 {
    ((k + 1) as f64 * 0.618_033_988_749_894_9 * 7.0).sin()
}

fn sparse(dense: &DMatrix<f64>) -> Csr {
    let n = dense.nrows();
    let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|at| dense[*at] != 0.0);
    let triplets: Vec<(u32, u32, f64)> = all.map(|(i, j)| (i as u32, j as u32, dense[(i, j)])).collect();
    Csr::from_triplets(n, n, &triplets).unwrap()
}

fn wanted(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 37 + 11) % 19) as f64 / 7.0 - 1.2).collect()
}

fn times(a: &Csr, x: &[f64]) -> Vec<f64> {
    let mut b = vec![0.0; a.n_rows()];
    residual_compensated(&[a], &b.clone(), x, &mut b, 1);
    b.iter().map(|value| -value).collect()
}

/// Factors, and says what is left of a solution: the factor alone, without refinement.
fn error_of(factor: &mut Ldlt, a: &Csr, x: &[f64]) -> f64 {
    let mut found = times(a, x);
    factor.solve(Transpose::No, &mut found);
    let size = x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    found.iter().zip(x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
}

/// Factors a matrix with a solution to this many digits, and compares the signs of its eigenvalues.
fn check(dense: &DMatrix<f64>, points: Option<&[[f64; 3]]>, tolerance: f64, what: &str) -> Ldlt {
    let a = sparse(dense);
    let mut factor = Ldlt::analyze(a.pattern(), points, None, 1).unwrap();
    // twice: nothing may be left over from the first time
    for _ in 0..2 {
        factor.factor(&a).unwrap();
        assert!(!factor.uses_general, "{what}");
        let error = error_of(&mut factor, &a, &wanted(a.n_rows()));
        assert!(error < tolerance, "{what}: {error:e}");
    }
    let eigenvalues = SymmetricEigen::new(dense.clone()).eigenvalues;
    let negative = eigenvalues.iter().filter(|x| **x < 0.0).count();
    assert_eq!(factor.inertia().unwrap(), Inertia { positive: a.n_rows() - negative, negative, zero: 0 }, "{what}");
    assert_eq!(factor.is_negative(), Some(negative % 2 == 1), "{what}");
    factor
}

/// A band with some entries far from it, of both signs.
fn random(n: usize, seed: usize, width: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| {
        let (low, high) = (i.min(j), i.max(j));
        let is_there = high - low <= width || (high * 7 + low) % 23 == seed;
        if is_there { number(1000 * seed + 60 * low + high) } else { 0.0 }
    })
}

#[test]
fn random_matrices_are_solved_with_the_signs_of_their_eigenvalues() {
    for n in [1, 2, 3, 5, 20, 33, 60, 120] {
        for seed in 0..6 {
            check(&random(n, seed, 3), None, 1e-8, &format!("n = {n}, seed {seed}"));
        }
    }
}

#[test]
fn dense_matrices_need_more_than_one_block_of_columns() {
    for (n, seed) in [(31, 1), (32, 2), (33, 3), (64, 4), (97, 5), (130, 6)] {
        let mut a = DMatrix::from_fn(n, n, |i, j| number(1000 * seed + 70 * i.min(j) + i.max(j)));
        check(&a, None, 1e-9, &format!("n = {n}"));
        // without a diagonal no pivot is of one column at first
        a.fill_diagonal(0.0);
        check(&a, None, 1e-8, &format!("n = {n}, no diagonal"));
    }
}

#[test]
fn the_smallest_pivots_are_told_right() {
    check(&DMatrix::from_row_slice(1, 1, &[-3.0]), None, 1e-15, "one");
    check(&DMatrix::from_row_slice(2, 2, &[0.0, 2.0, 2.0, 0.0]), None, 1e-15, "two without a diagonal");
    check(&DMatrix::from_row_slice(2, 2, &[1e-9, 2.0, 2.0, -1e-9]), None, 1e-15, "two with a small one");
    check(&DMatrix::from_row_slice(2, 2, &[3.0, 2.0, 2.0, 1.0]), None, 1e-14, "two of which one will do");
}

/// An arrow: all unknowns meet in the last ones.
#[test]
fn arrows_are_solved() {
    for n in [10, 80] {
        let arrow = DMatrix::from_fn(n, n, |i, j| {
            if i == j {
                number(i)
            } else if i.max(j) >= n - 2 {
                number(7 * i.min(j) + 3)
            } else {
                0.0
            }
        });
        check(&arrow, None, 1e-9, &format!("n = {n}"));
    }
}

/// Springs on the ground in a row, and multipliers that hold nodes or sums of two of them.
fn chain(springs: usize, multipliers: usize, is_first: bool) -> DMatrix<f64> {
    let n = springs + multipliers;
    let (shift, base) = if is_first { (multipliers, 0) } else { (0, springs) };
    let mut a = DMatrix::zeros(n, n);
    for i in 0..springs {
        a[(shift + i, shift + i)] = 2.0;
        if i > 0 {
            (a[(shift + i, shift + i - 1)], a[(shift + i - 1, shift + i)]) = (-1.0, -1.0);
        }
    }
    for k in 0..multipliers {
        for at in [k * springs / multipliers, (k * springs / multipliers + 1) % springs] {
            (a[(base + k, shift + at)], a[(shift + at, base + k)]) = (1.0, 1.0);
        }
    }
    a
}

#[test]
fn multipliers_are_solved_wherever_they_stand() {
    for (springs, multipliers) in [(30, 10), (40, 1), (150, 74)] {
        for is_first in [false, true] {
            let a = chain(springs, multipliers, is_first);
            let n = a.nrows();
            let what = format!("{springs} springs, {multipliers} multipliers");
            let factor = check(&a, None, 1e-10, &what);
            assert_eq!(factor.inertia().unwrap().negative, multipliers);
            // in the order in which they stand along a line, and from one end to the other
            let points: Vec<[f64; 3]> = (0..n).map(|i| [(i * 7 % n) as f64, 0.0, 0.0]).collect();
            check(&a, Some(&points), 1e-10, &what);
        }
    }
}

/// Flow on a grid: two velocities a node, a pressure in each cell that is the sum of what flows out of it. Within closed
/// groups of cells a constant pressure has no pivot.
fn flow(m: usize) -> (DMatrix<f64>, Vec<[f64; 3]>) {
    let n = m + 1;
    let is_inner = |i: usize, j: usize| (1..m).contains(&i) && (1..m).contains(&j);
    let mut points = Vec::new();
    let mut number_of = vec![[usize::MAX; 2]; n * n];
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| is_inner(*i, *j) || *i == m) {
        for component in 0..2 {
            number_of[i * n + j][component] = points.len();
            points.push([i as f64, j as f64, 0.0]);
        }
    }
    let first_pressure = points.len();
    points.extend((0..m * m).map(|c| [(c / m) as f64 + 0.5, (c % m) as f64 + 0.5, 0.0]));
    let mut a = DMatrix::zeros(points.len(), points.len());
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        for component in 0..2 {
            let own = number_of[i * n + j][component];
            if own == usize::MAX {
                continue;
            }
            a[(own, own)] = 4.0;
            for (p, q) in [(i + 1, j), (i, j + 1)].into_iter().filter(|(p, q)| *p < n && *q < n) {
                let other = number_of[p * n + q][component];
                if other != usize::MAX {
                    (a[(own, other)], a[(other, own)]) = (-1.0, -1.0);
                }
            }
        }
    }
    for cell in 0..m * m {
        for corner in 0..4 {
            let (di, dj) = (corner / 2, corner % 2);
            for (component, side) in [(0, di), (1, dj)] {
                let dof = number_of[(cell / m + di) * n + cell % m + dj][component];
                if dof != usize::MAX {
                    let value = if side == 1 { 0.5 } else { -0.5 };
                    (a[(first_pressure + cell, dof)], a[(dof, first_pressure + cell)]) = (value, value);
                }
            }
        }
    }
    // the pressure of every cell leaks a little: without, a checkerboard is undetermined
    (0..m * m).for_each(|cell| a[(first_pressure + cell, first_pressure + cell)] = -1e-3);
    (a, points)
}

#[test]
fn pressures_wait_for_velocities_that_come_later() {
    let (mut a, points) = flow(12);
    check(&a, Some(&points), 1e-9, "leaks");
    // no leak but in every other cell: closed groups have no pivot for a constant
    let first = points.iter().position(|point| point[0].fract() > 0.0).unwrap();
    for cell in 0..144 {
        a[(first + cell, first + cell)] = if (cell / 12 + cell % 12) % 2 == 0 { 0.0 } else { -1e-3 };
    }
    let factor = check(&a, Some(&points), 1e-9, "leaks in every other cell");
    assert!(factor.symmetric.as_ref().unwrap().is_moved, "some pressures had to wait");
}

/// Rows and columns in units that are 1e24 apart.
#[test]
fn units_do_not_matter() {
    for seed in 0..4 {
        let scale = |i: usize| 10f64.powi((i * 7 % 25) as i32 - 12);
        let plain = chain(60, 20, seed % 2 == 0);
        let scaled = DMatrix::from_fn(80, 80, |i, j| plain[(i, j)] * scale(i) * scale(j));
        let (a, b) = (sparse(&plain), sparse(&scaled));
        let mut factor = Ldlt::analyze(b.pattern(), None, None, 1).unwrap();
        factor.factor(&b).unwrap();
        assert_eq!(factor.inertia().unwrap(), Inertia { positive: 60, negative: 20, zero: 0 });
        let x: Vec<f64> = wanted(80);
        let mut found: Vec<f64> = times(&a, &x).iter().enumerate().map(|(i, b)| b * scale(i)).collect();
        factor.solve(Transpose::Yes, &mut found);
        for (i, (found, x)) in found.iter().zip(&x).enumerate() {
            assert!((found * scale(i) - x).abs() < 1e-10 * (1.0 + x.abs()), "{i}: {found:e}");
        }
    }
}

/// A viscosity of 1e-9 is another unit of the pressure: the same factor, without a velocity that waits for its pressures.
#[test]
fn a_small_viscosity_fills_no_factor() {
    let (plain, points) = flow(12);
    let first = points.iter().position(|point| point[0].fract() > 0.0).unwrap();
    let size = |viscosity: f64| {
        let part = |i: usize, j: usize| match (i < first, j < first) {
            (true, true) => viscosity,
            (false, false) => 1.0 / viscosity,
            _ => 1.0,
        };
        let a = sparse(&DMatrix::from_fn(plain.nrows(), plain.nrows(), |i, j| plain[(i, j)] * part(i, j)));
        let mut factor = Ldlt::analyze(a.pattern(), Some(&points), None, 1).unwrap();
        factor.factor(&a).unwrap();
        let symmetric = factor.symmetric.as_ref().unwrap();
        let structure = symmetric.fronts.structure(&symmetric.symbolic);
        (0..structure.n_fronts()).map(|front| structure.operations(front)).sum::<f64>()
    };
    let plain_size = size(1.0);
    for viscosity in [1e3, 1e-3, 1e-6, 1e-9] {
        assert_eq!(size(viscosity), plain_size, "{viscosity}");
    }
}

#[test]
fn dependent_multipliers_are_named() {
    for copies in [1, 3] {
        let mut a = chain(60, 20, false);
        let n = a.nrows();
        a = a.resize(n + copies, n + copies, 0.0);
        for copy in 0..copies {
            for dof in 0..60 {
                let value = a[(65, dof)];
                (a[(n + copy, dof)], a[(dof, n + copy)]) = (value, value);
            }
        }
        let a = sparse(&a);
        let mut solver = CheckedLdlt::new(a.pattern(), None, None, SolverOptions::default()).unwrap();
        match solver.factor(&a) {
            Err(SolveError::Singular { mode, .. }) => {
                let dofs = mode.dofs_above(1e-6);
                assert!(dofs.iter().all(|dof| *dof == 65 || *dof >= 80), "{dofs:?}");
            }
            other => panic!("{other:?}"),
        }
    }
}

/// An elastic box with multipliers that hold its cut together: definite beside, and large enough for several tasks.
fn glued(cells: usize, stiff: f64) -> (Csr, Vec<[f64; 3]>) {
    let options = BoxOptions { cells: [cells; 3], cut: Some(cells / 2), fix_low: true, fix_high: false };
    let problem = ElasticBox::new(&options);
    let n = problem.n();
    let mut points = problem.coordinates.clone();
    let mut triplets = Vec::new();
    for (k, (here, there)) in problem.pairs.iter().enumerate() {
        let row = (n + k) as u32;
        points.push(problem.coordinates[*here as usize]);
        for (dof, value) in [(*here, stiff), (*there, -stiff)] {
            triplets.extend([(row, dof, value), (dof, row, value)]);
        }
    }
    let size = points.len();
    for row in 0..n {
        let (columns, values) = problem.matrix.row(row);
        triplets.extend(columns.iter().zip(values).map(|(c, v)| (row as u32, *c, *v)));
    }
    (Csr::from_triplets(size, size, &triplets).unwrap(), points)
}

#[test]
fn threads_and_repetition_do_not_change_a_byte() {
    let (a, points) = glued(8, 1.0);
    let b = times(&a, &wanted(a.n_rows()));
    let runs = [1, 2, 3, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = SolverOptions { threads, ..SolverOptions::default() };
            let mut solver = CheckedLdlt::new(a.pattern(), Some(&points), None, options).unwrap();
            [0, 1].map(|_| {
                solver.factor(&a).unwrap();
                let mut x = vec![0.0; b.len()];
                let report = solver.solve(&b, &mut x).unwrap();
                assert!(!report.refactored, "LU");
                (solver.inertia(), report, x.into_iter().map(f64::to_bits).collect::<Vec<_>>())
            })
        })
    });
    assert!(runs.iter().flatten().all(|run| *run == runs[0][0]));
    let multipliers =
        a.n_rows() - ElasticBox::new(&BoxOptions { cells: [8; 3], cut: Some(4), fix_low: true, fix_high: false }).n();
    assert_eq!(runs[0][0].0.unwrap().negative, multipliers);
}

#[test]
fn a_body_that_floats_behind_its_multipliers_is_found() {
    let (mut a, points) = glued(4, 1.0);
    // without the multipliers the second half is not held
    let n = a.n_rows();
    let first = n - 75;
    for row in first..n {
        let held: Vec<u32> = a.row(row).0.to_vec();
        for column in held.into_iter().map(|column| column as usize) {
            let value = a.get(row, column);
            assert!(a.add_to(row, column, -value) && a.add_to(column, row, -value));
        }
        let unit = Csr::from_triplets(n, n, &[(row as u32, row as u32, -1.0)]).unwrap();
        a = a.plus(&unit).unwrap();
    }
    let mut solver = CheckedLdlt::new(a.pattern(), Some(&points), None, SolverOptions::default()).unwrap();
    match solver.factor(&a) {
        Err(SolveError::Singular { mode, .. }) => {
            let least = points.iter().enumerate().filter(|(dof, _)| mode.values()[*dof].abs() > 1e-6);
            assert!(least.map(|(_, point)| point[0]).fold(f64::INFINITY, f64::min) >= 0.5);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_not_symmetric_is_solved_by_lu() {
    let mut dense = chain(30, 10, false);
    dense[(3, 4)] += 0.25;
    let a = sparse(&dense);
    let mut factor = Ldlt::analyze(a.pattern(), None, None, 1).unwrap();
    factor.factor(&a).unwrap();
    assert!(factor.uses_general && factor.inertia().is_none());
    assert!(error_of(&mut factor, &a, &wanted(40)) < 1e-10);
    // and the next one by its own
    let a = sparse(&chain(30, 10, false));
    factor.factor(&a).unwrap();
    assert!(!factor.uses_general && error_of(&mut factor, &a, &wanted(40)) < 1e-10);
}

/// Balances of fluid in another unit and of another sign than what couples them.
#[test]
fn equations_of_a_group_may_have_a_factor() {
    let plain = chain(60, 20, false);
    let factor_of = |row: usize| if row < 60 { 1.0 } else { -3e-3 };
    let a = sparse(&DMatrix::from_fn(80, 80, |i, j| factor_of(i) * plain[(i, j)]));
    let groups: Vec<u32> = (0..80).map(|i| u32::from(i >= 60)).collect();
    let mut factor = Ldlt::analyze(a.pattern(), None, Some(&groups), 1).unwrap();
    factor.factor(&a).unwrap();
    assert!(!factor.uses_general && factor.inertia().is_none());
    assert_eq!(factor.is_negative(), Some(a_determinant_is_negative(&plain)), "20 rows have another sign");
    assert!(error_of(&mut factor, &a, &wanted(80)) < 1e-10);
    let transposed = a.transpose();
    let x = wanted(80);
    let mut found = times(&transposed, &x);
    factor.solve(Transpose::Yes, &mut found);
    for (found, x) in found.iter().zip(&x) {
        assert!((found - x).abs() < 1e-9 * (1.0 + x.abs()), "{found} {x}");
    }
    let mut alone = Ldlt::analyze(a.pattern(), None, None, 1).unwrap();
    alone.factor(&a).unwrap();
    assert!(alone.uses_general, "without groups it is not symmetric");
}

fn a_determinant_is_negative(a: &DMatrix<f64>) -> bool {
    a.clone().lu().determinant() < 0.0
}
