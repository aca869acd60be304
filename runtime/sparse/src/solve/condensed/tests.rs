//! The condensed solver against direct solves of the sum.

use super::super::problems::{BoxOptions, Contact, ElasticBox};
use super::super::{CheckedLu, LinearSolver};
use super::*;

/// A method from the numbers of changing dofs and of forces.
type Choice = fn(usize, usize) -> Elimination;

const DENSE: Choice = |n_changing, _| Elimination::Dense { n_changing };
const FRONTS: Choice = |n_changing, _| Elimination::Fronts { n_changing };
const FORCES: Choice = |n_changing, n_forces| Elimination::Woodbury { n_changing, n_forces, single: false };
/// All methods, Woodbury in both precisions.
const METHODS: [(Choice, Precision); 4] =
    [(DENSE, Precision::Auto), (FRONTS, Precision::Auto), (FORCES, Precision::Double), (FORCES, Precision::Mixed)];

fn options(precision: Precision) -> SolverOptions {
    SolverOptions { precision, ..SolverOptions::default() }
}

fn two_blocks(n: usize) -> ElasticBox {
    ElasticBox::new(&BoxOptions { cells: [4, n, n], cut: Some(2), fix_low: true, fix_high: false })
}

fn load(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 5) % 11) as f64 - 4.5).collect()
}

fn direct(a: &Csr, b: &[f64]) -> Vec<f64> {
    let mut solver = CheckedLu::new(a.pattern(), None, SolverOptions::default()).unwrap();
    solver.factor(a).unwrap();
    let mut x = vec![0.0; b.len()];
    solver.solve(b, &mut x).unwrap();
    x
}

fn close(x: &[f64], wanted: &[f64], tolerance: f64) {
    let size = wanted.iter().fold(0.0f64, |size, w| size.max(w.abs()));
    for (x, w) in x.iter().zip(wanted) {
        assert!((x - w).abs() <= tolerance * size, "{x} instead of {w}, largest {size}");
    }
}

/// Solves with every kind of contact and each of its changes in turn; the iterations made with older factors.
fn follow(problem: &ElasticBox, kind: Contact, slips: &[usize], method: Choice) -> usize {
    let b = load(problem.n());
    // The stiffness grows a little each time: what an older factor is good for.
    let part = |(step, &slip): (usize, &usize)| {
        problem.contact(kind, 50.0 * (1.0 + 1e-5 * step as f64), move |face, c| c == 0 || face >= slip)
    };
    let parts: Vec<Csr> = slips.iter().enumerate().map(part).collect();
    let (points, options) = (Some(&problem.coordinates[..]), SolverOptions::default());
    let pattern = parts[0].pattern();
    let mut solver =
        CheckedCondensed::with_choice(&problem.matrix, pattern, points, &problem.pairs, options, method).unwrap();
    let mut x = vec![0.0; b.len()];
    let mut iterations = 0;
    for changing in &parts {
        solver.update(changing).unwrap();
        let made_at_once = solver.take_factorisations();
        let report = solver.solve(&b, &mut x).unwrap();
        iterations += report.krylov_iterations;
        // An older factor that serves is not a new one.
        assert_eq!(solver.take_factorisations(), usize::from(report.refactored));
        assert!(made_at_once == 0 || report.krylov_iterations == 0 && !report.refactored);
        close(&x, &direct(&problem.matrix.plus(changing).unwrap(), &b), 1e-7);
    }
    iterations
}

#[test]
fn every_update_gives_the_solution_of_the_sum() {
    let problem = two_blocks(5);
    for kind in [Contact::Penalty, Contact::Nitsche] {
        // All faces in contact, single faces slip, many slip, and back.
        let slips = [0, 1, 2, 20, 20, 1, 0];
        for (method, name) in [(DENSE, "dense"), (FRONTS, "fronts")] {
            assert!(follow(&problem, kind, &slips, method) > 0, "{name}: an older factor was never used");
        }
        // Few forces may be factored faster than anything is tried.
        follow(&problem, kind, &slips, FORCES);
    }
    assert!(follow(&two_blocks(13), Contact::Penalty, &[0, 1, 1], FORCES) > 0, "an older factor was never used");
}

#[test]
fn the_same_part_again_costs_no_iteration() {
    let problem = two_blocks(4);
    let changing = problem.contact(Contact::Nitsche, 50.0, |_, _| true);
    let b = load(problem.n());
    let options = SolverOptions::default();
    let mut solver = CheckedCondensed::new(&problem.matrix, changing.pattern(), None, &[], options).unwrap();
    let (mut x, mut y) = (vec![0.0; b.len()], vec![0.0; b.len()]);
    solver.update(&changing).unwrap();
    let first = solver.solve(&b, &mut x).unwrap();
    solver.update(&changing).unwrap();
    let second = solver.solve(&b, &mut y).unwrap();
    assert_eq!((first, &x), (second, &y));
    assert_eq!((second.krylov_iterations, second.refactored), (0, false));
}

#[test]
fn threads_do_not_change_a_byte() {
    let problem = two_blocks(9);
    let b = load(problem.n());
    for (method, precision) in METHODS {
        let runs = [1, 2].map(|threads| {
            let options = SolverOptions { threads, ..options(precision) };
            let first = problem.contact(Contact::Nitsche, 50.0, |_, _| true);
            let (pattern, points) = (first.pattern(), Some(&problem.coordinates[..]));
            let mut solver =
                CheckedCondensed::with_choice(&problem.matrix, pattern, points, &problem.pairs, options, method)
                    .unwrap();
            let mut x = vec![0.0; b.len()];
            [3, 4, 30].map(|slip| {
                solver.update(&problem.contact(Contact::Nitsche, 50.0, |face, c| c == 0 || face > slip)).unwrap();
                let report = solver.solve(&b, &mut x).unwrap();
                (report, x.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
            })
        });
        assert!(runs[0] == runs[1]);
    }
}

#[test]
fn a_body_without_contact_is_named() {
    let problem = two_blocks(3);
    let open = problem.contact(Contact::Nitsche, 50.0, |_, _| false);
    let sliding = problem.contact(Contact::Nitsche, 50.0, |_, c| c == 0);
    let closed = problem.contact(Contact::Nitsche, 50.0, |_, _| true);
    let is_there = |dof: u32| dof >= problem.pairs[0].1;
    let b = load(problem.n());
    let mut x = vec![0.0; b.len()];
    for (method, precision) in METHODS {
        let points = Some(&problem.coordinates[..]);
        let options = options(precision);
        let mut solver =
            CheckedCondensed::with_choice(&problem.matrix, open.pattern(), points, &problem.pairs, options, method)
                .unwrap();
        for changing in [&open, &sliding] {
            // With a factor at hand or without.
            for before in [None, Some(&closed)] {
                if let Some(before) = before {
                    solver.update(before).unwrap();
                    solver.solve(&b, &mut x).unwrap();
                }
                match solver.update(changing).and_then(|()| solver.solve(&b, &mut x)) {
                    Err(SolveError::Singular { dof, mode, .. }) => {
                        assert!(is_there(dof as u32) && mode.dofs_above(1e-5).into_iter().all(is_there));
                    }
                    other => panic!("{other:?}"),
                }
                assert_eq!(solver.solve(&b, &mut x), Err(SolveError::NotFactored));
            }
        }
    }
}

#[test]
fn a_bulk_that_nothing_holds_is_refused_at_once() {
    let problem = two_blocks(3);
    let nothing = Arc::new(Pattern::empty(problem.n(), problem.n()));
    let outcome = CheckedCondensed::new(&problem.matrix, &nothing, None, &[], SolverOptions::default());
    match outcome.map(|_| ()) {
        Err(SolveError::Singular { mode, .. }) => {
            assert!(mode.dofs_above(1e-5).into_iter().all(|dof| dof >= problem.pairs[0].1));
        }
        // Rounding may leave a tiny positive pivot: then the first update says so.
        Ok(()) => {
            let mut solver =
                CheckedCondensed::new(&problem.matrix, &nothing, None, &[], SolverOptions::default()).unwrap();
            let error = solver.update(&Csr::zeros(nothing)).unwrap_err();
            assert!(matches!(error, SolveError::Singular { .. }), "{error}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn multipliers_without_bulk_are_solved() {
    // Held on one side alone a body cannot stand alone, and there is no capacitance matrix.
    for fix_high in [false, true] {
        let options = BoxOptions { cells: [4, 4, 4], cut: Some(2), fix_low: true, fix_high };
        solve_with_multipliers(&ElasticBox::new(&options), fix_high);
    }
}

fn solve_with_multipliers(problem: &ElasticBox, has_forces: bool) {
    const FREE: usize = 4;
    let (n, m) = (problem.n(), problem.pairs.len());
    // Numbered first, so that nothing helps the pivots.
    let mut bulk = Vec::new();
    for row in 0..n {
        let (columns, values) = problem.matrix.row(row);
        bulk.extend(columns.iter().zip(values).map(|(&c, &v)| ((row + m) as u32, c + m as u32, v)));
    }
    let bulk = Csr::from_triplets(n + m, n + m, &bulk).unwrap();
    let mut ties = Vec::new();
    for (row, &(here, there)) in (0..).zip(&problem.pairs) {
        for (dof, sign) in [(here, 1.0), (there, -1.0)] {
            ties.extend([(row, dof + m as u32, sign), (dof + m as u32, row, sign)]);
        }
        ties.push((row, row, 0.0));
    }
    let ties = Csr::from_triplets(n + m, n + m, &ties).unwrap();
    // Some pairs are free, and their multipliers known.
    let mut some = ties.clone();
    for row in 0..FREE {
        let range = ties.pattern().row_starts()[row]..ties.pattern().row_starts()[row + 1];
        some.values_mut()[range].fill(0.0);
        assert!(some.add_to(row, row, 1.0));
    }
    let points: Vec<[f64; 3]> =
        problem.pairs.iter().map(|&(here, _)| here as usize).chain(0..n).map(|dof| problem.coordinates[dof]).collect();
    let b = load(n + m);
    let mut x = vec![0.0; n + m];
    for (method, precision) in METHODS {
        let options = options(precision);
        let mut solver =
            CheckedCondensed::with_choice(&bulk, ties.pattern(), Some(&points), &[], options, method).unwrap();
        solver.update(&ties).unwrap();
        solver.solve(&b, &mut x).unwrap();
        for (row, &(here, there)) in problem.pairs.iter().enumerate() {
            let jump = x[here as usize + m] - x[there as usize + m];
            assert!((jump - b[row]).abs() < 1e-8, "{jump} instead of {}", b[row]);
        }
        solver.update(&some).unwrap();
        solver.solve(&b, &mut x).unwrap();
        for (row, &(here, there)) in problem.pairs.iter().enumerate() {
            let found = if row < FREE { x[row] } else { x[here as usize + m] - x[there as usize + m] };
            assert!((found - b[row]).abs() < 1e-8, "{found} instead of {}", b[row]);
        }
        close(&x, &direct(&bulk.plus(&some).unwrap(), &b), 1e-9);
        let mut fresh =
            CheckedCondensed::with_choice(&bulk, ties.pattern(), Some(&points), &[], options, method).unwrap();
        fresh.update(&some).unwrap();
        // The transposed system, too.
        let condition = solver.condition_estimate().unwrap();
        assert!((condition / fresh.condition_estimate().unwrap() - 1.0).abs() < 1e-3);
        let (mut transposed, mut wanted) = (b.clone(), b.clone());
        solver.engine.solve(Transpose::Yes, &mut transposed);
        fresh.engine.solve(Transpose::Yes, &mut wanted);
        close(&transposed, &wanted, if precision == Precision::Mixed { 1e-4 } else { 1e-9 });
        let is_update = !solver.memory().reference.groups.is_empty();
        assert!(is_update == (has_forces && matches!(solver.elimination(), Elimination::Woodbury { .. })));
    }
}

/// A saddle point of n unknowns and m conditions has n positive and m negative eigenvalues; a condition that is given
/// up for a multiplier that is known takes the sign of its diagonal instead.
#[test]
fn the_sign_of_the_determinant_is_that_of_its_inertia() {
    for (fix_high, cells) in [(false, 3), (true, 3), (true, 4)] {
        let problem = ElasticBox::new(&BoxOptions { cells: [4, cells, cells], cut: Some(2), fix_low: true, fix_high });
        let (n, m) = (problem.n(), problem.pairs.len());
        let mut ties = Vec::new();
        for (row, &(here, there)) in (n as u32..).zip(&problem.pairs) {
            ties.extend([(here, 1.0), (there, -1.0)].into_iter().flat_map(|(d, s)| [(row, d, s), (d, row, s)]));
            ties.push((row, row, 0.0));
        }
        let ties = Csr::from_triplets(n + m, n + m, &ties).unwrap();
        // one condition after the other is given up, the diagonals by turns of both signs
        let given_up = |count: usize| {
            let mut some = ties.clone();
            for row in n..n + count {
                let range = ties.pattern().row_starts()[row]..ties.pattern().row_starts()[row + 1];
                some.values_mut()[range].fill(0.0);
                assert!(some.add_to(row, row, if row % 2 == 0 { 1.0 } else { -1.0 }));
            }
            let negative = m - count + (n..n + count).filter(|row| row % 2 == 1).count();
            (some, negative % 2 == 1)
        };
        let bulk: Vec<_> = (0..n)
            .flat_map(|row| {
                let (columns, values) = problem.matrix.row(row);
                columns.iter().zip(values).map(move |(&c, &v)| (row as u32, c, v))
            })
            .collect();
        let bulk = Csr::from_triplets(n + m, n + m, &bulk).unwrap();
        for (method, precision) in METHODS {
            let make = || CheckedCondensed::with_choice(&bulk, ties.pattern(), None, &[], options(precision), method);
            let mut solver = make().unwrap();
            assert_eq!(solver.is_negative(), None, "there is no factor yet");
            for count in [0, 1, 2, 5, 1] {
                let (some, expected) = given_up(count);
                assert_eq!(solver.sign_with(&some).unwrap(), Some(expected), "{count} of {m}");
                let mut fresh = make().unwrap();
                assert_eq!(fresh.sign_with(&some).unwrap(), Some(expected), "{count} of {m}, at once");
                let mut whole = CheckedLu::new(bulk.plus(&some).unwrap().pattern(), None, options(precision)).unwrap();
                whole.factor(&bulk.plus(&some).unwrap()).unwrap();
                assert!(whole.is_negative().is_none_or(|found| found == expected), "{count} of {m}, whole");
            }
        }
    }
}

/// Both bodies stand alone, so that there is a capacitance matrix; its rows at the faces `slip(face)` change with the
/// step.
fn sliding(problem: &ElasticBox, kind: Contact, step: usize, slips: impl Fn(usize) -> bool) -> Csr {
    let mut sticking = problem.contact(kind, 50.0, |_, _| true);
    let slipping = problem.contact(kind, 50.0, move |face, c| c == 0 || !slips(face));
    // Where points slip the matrix keeps changing.
    let values = sticking.values_mut().iter_mut().zip(slipping.values());
    values.filter(|(stick, slip)| stick != slip).for_each(|(stick, slip)| *stick = slip * (1.0 + 1e-3 * step as f64));
    sticking
}

#[test]
fn few_changed_rows_start_from_the_factor_before() {
    let problem = ElasticBox::new(&BoxOptions { cells: [4, 9, 9], cut: Some(2), fix_low: true, fix_high: true });
    let b = load(problem.n());
    for precision in [Precision::Double, Precision::Mixed] {
        for kind in [Contact::Penalty, Contact::Nitsche] {
            // A few faces slide, then more, then others; at last all do.
            let slips = |step: usize, face: usize| match step {
                0 => false,
                1..=3 => face < 8,
                4..=5 => face < 14,
                6..=7 => (4..18).contains(&face),
                _ => true,
            };
            let parts: Vec<Csr> = (0..11).map(|step| sliding(&problem, kind, step, |face| slips(step, face))).collect();
            let (points, options) = (Some(&problem.coordinates[..]), options(precision));
            let new = || {
                let pattern = parts[0].pattern();
                CheckedCondensed::with_choice(&problem.matrix, pattern, points, &problem.pairs, options, FORCES)
                    .unwrap()
            };
            let groups = |solver: &CheckedCondensed| solver.memory().reference.groups.len();
            let solve = |solver: &mut CheckedCondensed, part: &Csr| {
                let mut x = vec![0.0; b.len()];
                solver.update(part).unwrap();
                let report = solver.solve(&b, &mut x).unwrap();
                (report, x)
            };
            let mut solver = new();
            let mut seen = Vec::new();
            for (step, part) in parts.iter().enumerate() {
                // What a solver remembers makes another one go on with the same bits.
                let mut other = new();
                let knows = step == 0 || other.recall(part.pattern(), &solver.memory()).unwrap();
                let (report, x) = solve(&mut solver, part);
                assert!(knows && (step == 0 || solve(&mut other, part) == (report, x.clone())), "{kind:?} {step}");
                close(&x, &direct(&problem.matrix.plus(part).unwrap(), &b), 1e-9);
                seen.push(groups(&solver));
                // The transposed system, too.
                let condition = solver.condition_estimate().unwrap();
                let mut fresh = new();
                fresh.update(part).unwrap();
                assert!((condition / fresh.condition_estimate().unwrap() - 1.0).abs() < 1e-3, "{kind:?} {step}");
            }
            assert!(seen[0] == 0 && seen[1] == 1 && seen[5] >= 2 && seen[10] == 0, "{precision:?} {kind:?} {seen:?}");
        }
    }
}

#[test]
fn entries_outside_the_pattern_are_refused() {
    let problem = two_blocks(2);
    let changing = problem.contact(Contact::Penalty, 1.0, |_, _| true);
    let options = SolverOptions::default();
    let mut solver = CheckedCondensed::new(&problem.matrix, changing.pattern(), None, &[], options).unwrap();
    let outside = Csr::from_triplets(problem.n(), problem.n(), &[(0, 1, 1.0)]).unwrap();
    assert_eq!(solver.update(&outside), Err(SolveError::OutsidePattern { row: 0, column: 1 }));
    let dof = problem.interface[0];
    let inside = Csr::from_triplets(problem.n(), problem.n(), &[(dof, dof, f64::NAN)]).unwrap();
    let place = dof as usize;
    assert_eq!(solver.update(&inside), Err(SolveError::NonFiniteMatrix { row: place, column: place }));
}

#[test]
fn a_factor_of_single_precision_gives_the_same_solutions() {
    // Both bodies stand alone: otherwise there is no capacitance matrix.
    let problem = ElasticBox::new(&BoxOptions { cells: [4, 5, 5], cut: Some(2), fix_low: true, fix_high: true });
    let b = load(problem.n());
    let is_single =
        |solver: &CheckedCondensed| matches!(solver.elimination(), Elimination::Woodbury { single: true, .. });
    // With the last unit of stress no number of the matrix and of its inverse is one of single precision.
    for (kind, gamma, unit) in [
        (Contact::Penalty, 1e-3, 1.0),
        (Contact::Penalty, 1e12, 1.0),
        (Contact::Nitsche, 50.0, 1.0),
        (Contact::Nitsche, 1e6, 1e60),
        (Contact::Nitsche, 50.0, 1e120),
    ] {
        let parts = [0, 1, 20].map(|slip| {
            let mut part = problem.contact(kind, gamma, move |face, c| c == 0 || face >= slip);
            part.values_mut().iter_mut().for_each(|value| *value *= unit);
            part
        });
        let mut bulk = problem.matrix.clone();
        bulk.values_mut().iter_mut().for_each(|value| *value *= unit);
        let (points, options) = (Some(&problem.coordinates[..]), options(Precision::Mixed));
        let pattern = parts[0].pattern();
        let mut solver =
            CheckedCondensed::with_choice(&bulk, pattern, points, &problem.pairs, options, FORCES).unwrap();
        let follow = |solver: &mut CheckedCondensed| {
            for changing in &parts {
                let mut x = vec![0.0; b.len()];
                solver.update(changing).unwrap();
                let report = solver.solve(&b, &mut x).unwrap();
                assert!(report.relative_residual < 1e-12, "{report:?}");
                // No solver knows more digits than the condition leaves.
                close(&x, &direct(&bulk.plus(changing).unwrap(), &b), 1e-9f64.max(1e-16 * gamma));
            }
        };
        follow(&mut solver);
        assert!(is_single(&solver), "{kind:?} {gamma:e}");
        solver.engine.set_single(false, &bulk).unwrap();
        follow(&mut solver);
        assert!(!is_single(&solver));
    }
}
