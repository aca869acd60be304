//! Every solver against every kind of system: the right solution or the right error.

use std::sync::Arc;

use super::problems::{BoxOptions, ElasticBox};
use super::*;
use crate::csr::{Pattern, PatternBuilder, residual_compensated};

type Build = fn(&Csr, SolverOptions) -> Result<Box<dyn LinearSolver>, SolveError>;

/// Solvers for any matrix.
const GENERAL: [(&str, Build); 6] = [
    ("lu", |a, options| Ok(Box::new(CheckedLu::new(a.pattern(), None, options)?))),
    ("ldlt", |a, options| Ok(Box::new(CheckedLdlt::new(a.pattern(), None, None, options)?))),
    ("dense", |a, options| Ok(Box::new(CheckedDense::new(a.pattern(), options)?))),
    ("condensed dense", |a, options| condensed(a, options, |n_changing, _| Elimination::Dense { n_changing })),
    ("condensed forces", |a, options| {
        condensed(a, options, |n_changing, n_forces| Elimination::Woodbury { n_changing, n_forces, single: false })
    }),
    ("condensed fronts", |a, options| condensed(a, options, |n_changing, _| Elimination::Fronts { n_changing })),
];

/// Nothing is constant: everything changes.
fn condensed(
    a: &Csr,
    options: SolverOptions,
    choose: fn(usize, usize) -> Elimination,
) -> Result<Box<dyn LinearSolver>, SolveError> {
    let empty = Csr::zeros(Arc::new(Pattern::empty(a.n_rows(), a.n_cols())));
    Ok(Box::new(CheckedCondensed::with_choice(&empty, a.pattern(), None, &[], options, choose)?))
}

/// Solvers for symmetric positive definite matrices.
const DEFINITE: [(&str, Build); 1] = [("llt", |a, options| Ok(Box::new(CheckedLlt::new(a.pattern(), None, options)?)))];

fn all() -> impl Iterator<Item = (&'static str, Build)> {
    GENERAL.into_iter().chain(DEFINITE)
}

fn solve(build: Build, a: &Csr, b: &[f64], options: SolverOptions) -> Result<(Vec<f64>, SolveReport), SolveError> {
    let mut solver = build(a, options)?;
    solver.factor(a)?;
    let mut x = vec![f64::NAN; b.len()];
    let report = solver.solve(b, &mut x)?;
    Ok((x, report))
}

fn extended() -> SolverOptions {
    SolverOptions { extended_residual: true, ..SolverOptions::default() }
}

fn wanted(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 37 + 11) % 19) as f64 / 7.0 - 1.2).collect()
}

fn times(a: &Csr, x: &[f64]) -> Vec<f64> {
    let mut b = vec![0.0; a.n_rows()];
    residual_compensated(&[a], &b.clone(), x, &mut b, 1);
    b.iter().map(|value| -value).collect()
}

/// The 5-point Laplacian on an m x m grid; `fixed` keeps the boundary values.
fn laplacian(m: usize, fixed: bool) -> Csr {
    let mut triplets = Vec::new();
    let at = |i: usize, j: usize| (i * m + j) as u32;
    for i in 0..m {
        for j in 0..m {
            if fixed {
                let border = [i, j].iter().map(|&k| usize::from(k == 0) + usize::from(k == m - 1)).sum::<usize>();
                triplets.push((at(i, j), at(i, j), border as f64));
            }
            for (p, q) in [(i + 1, j), (i, j + 1)] {
                if p < m && q < m {
                    let (a, b) = (at(i, j), at(p, q));
                    triplets.extend([(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)]);
                }
            }
        }
    }
    Csr::from_triplets(m * m, m * m, &triplets).unwrap()
}

/// D A D with scales from 1e-12 to 1e12.
fn badly_scaled(a: &Csr) -> Csr {
    let scale = |i: usize| 10f64.powi((i * 7 % 25) as i32 - 12);
    let mut out = a.clone();
    for row in 0..a.n_rows() {
        let starts = a.pattern().row_starts();
        for place in starts[row]..starts[row + 1] {
            out.values_mut()[place] *= scale(row) * scale(a.pattern().columns()[place] as usize);
        }
    }
    out
}

fn close(name: &str, x: &[f64], wanted: &[f64], tolerance: f64) {
    for (dof, (x, w)) in x.iter().zip(wanted).enumerate() {
        assert!((x - w).abs() <= tolerance * (1.0 + w.abs()), "{name}, dof {dof}: {x} instead of {w}");
    }
}

#[test]
fn good_systems_are_solved() {
    let a = laplacian(13, true);
    let b = times(&a, &wanted(169));
    for (name, build) in all() {
        let (x, report) = solve(build, &a, &b, SolverOptions::default()).unwrap();
        close(name, &x, &wanted(169), 1e-12);
        assert!(report.relative_residual < 1e-13, "{name}: {report:?}");
    }
}

#[test]
fn unsymmetric_systems_are_solved() {
    let mut a = laplacian(9, true);
    for row in 0..81 {
        for column in row + 1..81 {
            let _ = a.add_to(row, column, 0.4);
        }
    }
    let b = times(&a, &wanted(81));
    for (name, build) in GENERAL {
        let (x, _) = solve(build, &a, &b, SolverOptions::default()).unwrap();
        close(name, &x, &wanted(81), 1e-11);
    }
    let error = solve(DEFINITE[0].1, &a, &b, SolverOptions::default()).unwrap_err();
    assert!(matches!(error, SolveError::NotSymmetric { row: 0, column: 1, .. }), "{error}");
}

#[test]
fn badly_scaled_systems_are_solved_in_every_component() {
    let a = badly_scaled(&laplacian(8, true));
    let x_wanted: Vec<f64> =
        wanted(64).iter().enumerate().map(|(i, w)| w * 10f64.powi(12 - (i * 7 % 25) as i32)).collect();
    let b = times(&a, &x_wanted);
    for (name, build) in all() {
        let (x, _) = solve(build, &a, &b, extended()).unwrap_or_else(|error| panic!("{name}: {error}"));
        for (x, w) in x.iter().zip(&x_wanted) {
            assert!((x - w).abs() <= 1e-9 * w.abs(), "{name}: {x:e} instead of {w:e}");
        }
    }
}

#[test]
fn a_row_without_values_is_named() {
    let mut a = laplacian(5, true);
    for other in 0..25 {
        for (row, column) in [(7, other), (other, 7)] {
            let value = a.get(row, column);
            let _ = a.add_to(row, column, -value);
        }
    }
    for (name, build) in all() {
        match solve(build, &a, &[1.0; 25], SolverOptions::default()) {
            Err(SolveError::Singular { dof: 7, mode, .. }) => assert_eq!(mode.dofs_above(0.5), [7], "{name}"),
            other => panic!("{name}: {other:?}"),
        }
    }
}

#[test]
fn a_neumann_laplacian_is_singular_with_the_constant_mode() {
    for m in [2, 9, 30] {
        let a = laplacian(m, false);
        for (name, build) in all() {
            if name.ends_with("dense") && m > 20 {
                continue;
            }
            match solve(build, &a, &wanted(m * m), SolverOptions::default()) {
                Err(SolveError::Singular { mode, .. }) => {
                    assert_eq!(mode.dofs_above(0.999).len(), m * m, "{name}: {mode:?}");
                }
                other => panic!("{name} {m}: {other:?}"),
            }
        }
    }
}

#[test]
fn a_floating_body_is_found() {
    // Two bodies that do not touch; only the first is held.
    let options = BoxOptions { cells: [4, 2, 2], cut: Some(2), fix_low: true, fix_high: false };
    let problem = ElasticBox::new(&options);
    let a = &problem.matrix;
    let is_there = |dof: u32| dof >= problem.pairs[0].1;
    for (name, build) in all() {
        match solve(build, a, &vec![1.0; a.n_rows()], SolverOptions::default()) {
            Err(SolveError::Singular { dof, mode, ratio }) => {
                assert!(is_there(dof as u32) && ratio < 1e-14, "{name}");
                assert!(mode.dofs_above(1e-6).into_iter().all(is_there), "{name}");
            }
            other => panic!("{name}: {:?}", other.map(|(_, report)| report)),
        }
    }
}

#[test]
fn indefinite_matrices_are_refused_by_cholesky_and_solved_by_the_rest() {
    let mut a = laplacian(6, true);
    assert!(a.add_to(14, 14, -9.0));
    let b = times(&a, &wanted(36));
    let error = solve(DEFINITE[0].1, &a, &b, SolverOptions::default()).unwrap_err();
    match error {
        SolveError::NotPositiveDefinite { pivot, .. } => assert!(pivot < -0.1, "{pivot}"),
        other => panic!("{other:?}"),
    }
    for (name, build) in GENERAL {
        close(name, &solve(build, &a, &b, SolverOptions::default()).unwrap().0, &wanted(36), 1e-11);
    }
}

#[test]
fn the_pivot_of_a_matrix_that_is_not_positive_definite_is_its_schur_complement() {
    // The last pivot of [4 2; 2 -3] is -3 - 2 * 2 / 4 = -4 in the one order, 4 + 4 / 3 in the other.
    let a = Csr::from_triplets(2, 2, &[(0, 0, 4.0), (0, 1, 2.0), (1, 0, 2.0), (1, 1, -3.0)]).unwrap();
    match solve(DEFINITE[0].1, &a, &[1.0; 2], SolverOptions::default()) {
        Err(SolveError::NotPositiveDefinite { dof: 1, pivot }) => {
            assert!((pivot + 4.0).abs() < 1e-14 || (pivot + 3.0).abs() < 1e-14, "{pivot}");
        }
        other => panic!("{other:?}"),
    }
}

/// [A Bᵀ; B 0] with sums over neighbours as constraints, multipliers numbered first or last.
fn saddle_point(m: usize, multipliers_first: bool) -> Csr {
    let a = laplacian(m, true);
    let (n, p) = (m * m, m);
    let (shift, base) = if multipliers_first { (p, 0) } else { (0, n) };
    let mut triplets = Vec::new();
    for row in 0..n {
        let (columns, values) = a.row(row);
        triplets.extend(columns.iter().zip(values).map(|(&c, &v)| ((row + shift) as u32, c + shift as u32, v)));
    }
    for constraint in 0..p {
        for k in 0..2 {
            let (row, column) = ((base + constraint) as u32, (constraint * m + k + shift) as u32);
            triplets.extend([(row, column, 1.0), (column, row, 1.0)]);
        }
    }
    Csr::from_triplets(n + p, n + p, &triplets).unwrap()
}

#[test]
fn saddle_points_are_solved() {
    for multipliers_first in [false, true] {
        let a = saddle_point(11, multipliers_first);
        let x_wanted = wanted(a.n_rows());
        let b = times(&a, &x_wanted);
        for (name, build) in GENERAL {
            let (x, report) = solve(build, &a, &b, SolverOptions::default()).unwrap();
            close(name, &x, &x_wanted, 1e-10);
            assert!(report.relative_residual < 1e-13, "{name}: {report:?}");
        }
        let error = solve(DEFINITE[0].1, &a, &b, SolverOptions::default()).unwrap_err();
        assert!(matches!(error, SolveError::NotPositiveDefinite { .. }), "{error}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_named() {
    let good = laplacian(4, true);
    for poison in [f64::NAN, f64::INFINITY] {
        let mut a = good.clone();
        assert!(a.add_to(5, 6, poison) && a.add_to(6, 5, poison));
        for (name, build) in all() {
            let error = solve(build, &a, &[1.0; 16], SolverOptions::default()).unwrap_err();
            assert_eq!(error, SolveError::NonFiniteMatrix { row: 5, column: 6 }, "{name}");
            let mut b = [1.0; 16];
            b[9] = poison;
            let error = solve(build, &good, &b, SolverOptions::default()).unwrap_err();
            assert_eq!(error, SolveError::NonFiniteRightHandSide { dof: 9 }, "{name}");
        }
    }
}

#[test]
fn the_smallest_systems_work() {
    let one = Csr::from_triplets(1, 1, &[(0, 0, 4.0)]).unwrap();
    let none = Csr::from_triplets(0, 0, &[]).unwrap();
    for (name, build) in all() {
        assert_eq!(solve(build, &one, &[2.0], SolverOptions::default()).unwrap().0, [0.5], "{name}");
        assert!(solve(build, &none, &[], SolverOptions::default()).unwrap().0.is_empty(), "{name}");
        let (x, report) = solve(build, &one, &[0.0], SolverOptions::default()).unwrap();
        assert_eq!((x[0], report.relative_residual), (0.0, 0.0), "{name}");
        let mut solver = build(&one, SolverOptions::default()).unwrap();
        assert_eq!(solver.solve(&[1.0], &mut [0.0]), Err(SolveError::NotFactored), "{name}");
        solver.factor(&one).unwrap();
        assert!(matches!(solver.solve(&[1.0; 2], &mut [0.0]), Err(SolveError::Shape { .. })), "{name}");
    }
}

#[test]
fn threads_and_repetition_do_not_change_a_byte() {
    // Large enough for parallel tasks, parallel kernels and parallel triangular solves.
    let options = BoxOptions { cells: [12, 12, 12], cut: None, fix_low: true, fix_high: false };
    let problem = ElasticBox::new(&options);
    let a = &problem.matrix;
    let b = wanted(a.n_rows());
    let build = |threads: usize| -> [Box<dyn LinearSolver>; 2] {
        let (points, options) = (Some(&problem.coordinates[..]), SolverOptions { threads, ..SolverOptions::default() });
        [
            Box::new(CheckedLlt::new(a.pattern(), points, options).unwrap()),
            Box::new(CheckedLu::new(a.pattern(), points, options).unwrap()),
        ]
    };
    let runs = [1, 1, 2, 3].map(|threads| {
        build(threads).map(|mut solver| {
            solver.factor(a).unwrap();
            let mut x = vec![0.0; b.len()];
            let report = solver.solve(&b, &mut x).unwrap();
            (report, x.into_iter().map(f64::to_bits).collect::<Vec<_>>())
        })
    });
    assert!(runs.iter().all(|run| *run == runs[0]));
}

#[test]
fn a_second_matrix_on_the_pattern_is_solved_too() {
    let a = laplacian(7, true);
    let mut twice = a.clone();
    twice.values_mut().iter_mut().for_each(|value| *value *= 2.0);
    for (name, build) in all() {
        let mut solver = build(&a, SolverOptions::default()).unwrap();
        let mut x = vec![0.0; 49];
        for (matrix, factor) in [(&a, 1.0), (&twice, 2.0), (&laplacian(7, false), 0.0), (&a, 1.0)] {
            let outcome = solver.factor(matrix).and_then(|()| solver.solve(&times(&a, &wanted(49)), &mut x));
            if factor == 0.0 {
                assert!(matches!(outcome, Err(SolveError::Singular { .. })), "{name}: {outcome:?}");
                continue;
            }
            outcome.unwrap();
            x.iter_mut().for_each(|value| *value *= factor);
            close(name, &x, &wanted(49), 1e-12);
        }
        let outside = Csr::from_triplets(49, 49, &[(0, 48, 1.0)]).unwrap();
        assert!(solver.factor(&outside).is_err(), "{name}");
    }
}

#[test]
fn condition_estimates_are_right_within_a_factor() {
    // Hilbert matrix of order 6: condition number 2.907e7 in the 1-norm (Higham, Accuracy and Stability, ch. 28).
    let mut triplets = Vec::new();
    for i in 0..6u32 {
        triplets.extend((0..6u32).map(|j| (i, j, 1.0 / f64::from(i + j + 1))));
    }
    let a = Csr::from_triplets(6, 6, &triplets).unwrap();
    for (name, build) in all() {
        let mut solver = build(&a, SolverOptions::default()).unwrap();
        solver.factor(&a).unwrap();
        let estimate = solver.condition_estimate().unwrap();
        assert!((0.9..1.01).contains(&(estimate / 2.907e7)), "{name}: {estimate:e}");
    }
}

#[test]
fn refinement_in_double_double_gives_all_digits() {
    // Condition about 1e13 for the Hilbert matrix of order 10.
    let mut triplets = Vec::new();
    for i in 0..10u32 {
        // Integers: the matrix is exact in double precision.
        triplets.extend((0..10u32).map(|j| (i, j, (232_792_560 / (i + j + 1)) as f64)));
    }
    let a = Csr::from_triplets(10, 10, &triplets).unwrap();
    let b = times(&a, &[1.0; 10]);
    for (name, build) in all() {
        let (plain, _) = solve(build, &a, &b, SolverOptions::default()).unwrap();
        let (refined, report) = solve(build, &a, &b, extended()).unwrap();
        let error = |x: &[f64]| x.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max);
        assert!(error(&plain) > 1e-8, "{name}: {:e}", error(&plain));
        assert!(error(&refined) < 1e-13 && report.refinements > 0, "{name}: {:e}", error(&refined));
    }
}

#[test]
fn stiff_penalties_are_not_called_singular() {
    // Two unit springs in a row, joined by one that is stiffer by 1e12.
    let g = 1e12;
    let a = Csr::from_triplets(2, 2, &[(0, 0, 1.0 + g), (0, 1, -g), (1, 0, -g), (1, 1, g)]).unwrap();
    for (name, build) in all() {
        let (x, _) = solve(build, &a, &[0.0, 1.0], extended()).unwrap_or_else(|error| panic!("{name}: {error}"));
        // The rounding of 1 + g leaves 1 exact, so the displacement is 1 and 1 + 1/g.
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 1.0 - 1.0 / g).abs() < 1e-12, "{name}: {x:?}");
    }
}

#[test]
fn a_pattern_must_be_square() {
    let pattern = PatternBuilder::new(2, 3).build_shared().unwrap();
    for outcome in [
        CheckedLlt::new(&pattern, None, SolverOptions::default()).err(),
        CheckedLu::new(&pattern, None, SolverOptions::default()).err(),
        CheckedLdlt::new(&pattern, None, None, SolverOptions::default()).err(),
        CheckedDense::new(&pattern, SolverOptions::default()).err(),
    ] {
        assert!(matches!(outcome, Some(SolveError::Shape { .. })), "{outcome:?}");
    }
}

/// A box with the stiffness of each dof changed by up to `part` of itself.
fn changed(a: &Csr, part: f64) -> Csr {
    let diagonal: Vec<_> = (0..a.n_rows())
        .map(|dof| (dof as u32, dof as u32, part * ((dof * 7 % 13) as f64 / 12.0) * a.get(dof, dof)))
        .collect();
    a.plus(&Csr::from_triplets(a.n_rows(), a.n_rows(), &diagonal).unwrap()).unwrap()
}

#[test]
fn the_factor_of_a_near_matrix_solves_to_the_tolerance_and_that_of_another_one_says_that_it_does_not() {
    let problem = ElasticBox::new(&BoxOptions { cells: [18, 18, 18], cut: None, fix_low: true, fix_high: false });
    let (a, points) = (&problem.matrix, Some(&problem.coordinates[..]));
    let options = SolverOptions::default();
    let doors: [Box<dyn LinearSolver>; 2] = [
        Box::new(CheckedLlt::new(a.pattern(), points, options).unwrap()),
        Box::new(CheckedLu::new(a.pattern(), points, options).unwrap()),
    ];
    for mut solver in doors {
        // small beside the lowest eigenvalues, too
        let near = changed(a, 5e-4);
        let solution = wanted(a.n_rows());
        let b = times(&near, &solution);
        let mut x = vec![0.0; b.len()];
        assert!(!solver.keep_factor(&near).unwrap(), "there is no factor yet");
        solver.factor(a).unwrap();
        assert!(solver.keep_factor(&near).unwrap());
        assert!(
            matches!(solver.solve(&b, &mut x), Err(SolveError::NotFactored)),
            "the factor is not that of the matrix"
        );
        let Ok(Kept::Solved(report)) = solver.solve_with_kept(&b, &mut x, 1e-6) else { panic!("a near matrix") };
        assert!((1..15).contains(&report.krylov_iterations), "{report:?}");
        let left = times(&near, &x).iter().zip(&b).map(|(y, b)| (y - b).powi(2)).sum::<f64>().sqrt();
        assert!(left <= 1e-5 * b.iter().map(|b| b * b).sum::<f64>().sqrt(), "{left:e}");

        solver.factor(a).unwrap();
        let far = changed(a, 1e4);
        assert!(solver.keep_factor(&far).unwrap());
        assert!(matches!(solver.solve_with_kept(&b, &mut x, 1e-10), Ok(Kept::Useless(matrix)) if *matrix == far));
        assert!(!solver.keep_factor(&near).unwrap(), "a factor that came to nothing is not tried again");
        solver.factor(a).unwrap();
        solver.expire();
        assert!(!solver.keep_factor(&near).unwrap());
    }
}

#[test]
fn a_pivot_is_told_where_its_value_is_known() {
    let told = |pivot| SolveError::NotPositiveDefinite { dof: 7, pivot }.to_string();
    assert_eq!(told(-2.0), "the matrix is not positive definite: pivot -2.000e0 at dof 7");
    assert_eq!(told(f64::NAN), "the matrix is not positive definite");
}

#[test]
fn an_elimination_says_how_many_forces_on_how_many_dofs() {
    let told = |single| Elimination::Woodbury { n_changing: 644, n_forces: 322, single }.to_string();
    let words = "constant bulk factored once, capacitance matrix of 322 forces on 644 changing dofs";
    assert_eq!([told(false), told(true)], [words.to_owned(), format!("{words}, factors of single precision")]);
}
