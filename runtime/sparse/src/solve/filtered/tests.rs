//! The iteration on two elastic blocks with contact, against factors.

use std::sync::Arc;

use super::super::problems::{BoxOptions, Contact, ElasticBox};
use super::super::{
    CheckedLibrary, CheckedLu, Kept, LinearSolver, Linked, NearNullSpace, NodeLayout, SolveError, SolverOptions,
};
use super::*;
use crate::csr::{Csr, PatternBuilder};

/// Two blocks of n cells a side, held at both ends.
fn two_blocks(n: usize) -> ElasticBox {
    ElasticBox::new(&BoxOptions { cells: [n, n, n], cut: Some(n / 2), fix_low: true, fix_high: true })
}

/// The unknowns of a box by nodes; those behind them, of multipliers, go by nodes of the interface.
fn layout(problem: &ElasticBox, multipliers: &[[f64; 3]]) -> NodeLayout {
    let points = problem.coordinates.iter().step_by(3).chain(multipliers).copied().collect::<Vec<_>>();
    NodeLayout {
        components: 3,
        places: (0..3 * points.len() as u32).collect(),
        points,
        modes: NearNullSpace::RigidBody,
        frames: Vec::new(),
        interpolation: None,
    }
}

/// The equations of blocks with this changing part.
fn equations(problem: &ElasticBox, changing: &Csr) -> Arc<Equations> {
    let is_touched = |row: &u32| !changing.row(*row as usize).0.is_empty();
    let on_contact: Vec<u32> = (0..problem.n() as u32).filter(is_touched).collect();
    let traits = Traits { unknowns: problem.n(), on_contact: on_contact.len(), dimension: 3, ..Traits::default() };
    Arc::new(Equations {
        traits,
        constant: Arc::new(problem.matrix.clone()),
        changing: Arc::clone(changing.pattern()),
        layout: Some(layout(problem, &[])),
        multipliers: Vec::new(),
        on_contact,
        owners: None,
    })
}

fn solver(equations: &Arc<Equations>, threads: usize) -> CheckedLibrary {
    let options = SolverOptions { threads, ..SolverOptions::default() };
    let points = vec![[0.0; 3]; equations.n_rows()];
    CheckedLibrary::new(Linked(&FilteredMultigrid), equations, Symmetry::General, &points, options).unwrap()
}

fn load(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 37 + 11) % 19) as f64 / 7.0 - 1.2 + i as f64 / n as f64).collect()
}

/// Iterations to this residual, and the solution.
fn solved(solver: &mut CheckedLibrary, b: &[f64], tolerance: f64) -> (usize, Vec<f64>) {
    let mut x = vec![0.0; b.len()];
    let Ok(Kept::Solved(report)) = solver.solve_with_kept(b, &mut x, tolerance) else { panic!("no solution") };
    (report.krylov_iterations, x)
}

fn direct(a: &Csr, b: &[f64]) -> Vec<f64> {
    let mut solver = CheckedLu::new(a.pattern(), None, SolverOptions::default()).unwrap();
    solver.factor(a).unwrap();
    let mut x = vec![0.0; b.len()];
    solver.solve(b, &mut x).unwrap();
    x
}

/// Largest difference relative to the largest number.
fn difference(x: &[f64], wanted: &[f64]) -> f64 {
    let size = wanted.iter().fold(0.0f64, |size, w| size.max(w.abs()));
    x.iter().zip(wanted).fold(0.0f64, |d, (x, w)| d.max((x - w).abs())) / size
}

#[test]
fn contact_that_sticks_slides_and_opens_is_solved_as_with_a_factor() {
    let problem = two_blocks(8);
    let b = load(problem.n());
    for kind in [Contact::Penalty, Contact::Nitsche] {
        let first = problem.contact(kind, 50.0, |_, _| true);
        let mut solver = solver(&equations(&problem, &first), 1);
        for slips in [0, 3, 40, 64] {
            let changing = problem.contact(kind, 50.0, |face, c| c == 0 && face != 5 || face >= slips);
            solver.factor(&changing).unwrap();
            let (iterations, x) = solved(&mut solver, &b, 1e-11);
            let missed = difference(&x, &direct(&problem.matrix.plus(&changing).unwrap(), &b));
            assert!(missed < 1e-9 && iterations <= 80, "{kind:?}, {slips}: {missed:e}, {iterations}");
        }
        assert!(solver.describe().unwrap().contains("(unknowns by level: "), "{:?}", solver.describe());
    }
}

#[test]
fn the_number_of_iterations_depends_neither_on_the_stiffness_of_contact_nor_on_the_mesh() {
    // E = 1: gamma h / E from 1 to 1000
    for kind in [Contact::Penalty, Contact::Nitsche] {
        let counts = [12, 16].map(|n| {
            let problem = two_blocks(n);
            let b = load(problem.n());
            [1.0, 10.0, 100.0, 1000.0].map(|stiffness| {
                let gamma = stiffness * n as f64;
                let first = problem.contact(kind, gamma, |_, _| true);
                let mut solver = solver(&equations(&problem, &first), 1);
                solver.factor(&first).unwrap();
                solver.factor(&problem.contact(kind, gamma, |face, c| c == 0 || face % 3 != 0)).unwrap();
                solved(&mut solver, &b, 1e-8).0
            })
        });
        for [soft, stiff @ ..] in &counts {
            let (least, most) = (stiff.iter().min().unwrap(), stiff.iter().max().unwrap());
            assert!(10 * most <= 12 * least && soft <= most && *most <= 20, "{kind:?}: {counts:?}");
        }
        let most = counts.map(|counts| counts.into_iter().max().unwrap());
        assert!(10 * most[1] <= 13 * most[0], "{kind:?}: {counts:?}");
    }
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads_nor_on_earlier_matrices() {
    let problem = two_blocks(10);
    let b = load(problem.n());
    let of = |slips: usize| problem.contact(Contact::Nitsche, 50.0, |face, c| c == 0 || face >= slips);
    let first = of(0);
    let equations = equations(&problem, &first);
    let run = |threads: usize, earlier: &[usize]| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut solver = solver(&equations, threads);
            for slips in earlier {
                solver.factor(&of(*slips)).unwrap();
                solved(&mut solver, &b, 1e-6);
            }
            solver.factor(&of(30)).unwrap();
            let (iterations, x) = solved(&mut solver, &b, 1e-9);
            (iterations, x.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
        })
    };
    let one = run(1, &[]);
    assert!([2, 3, 7].iter().all(|threads| run(*threads, &[]) == one));
    assert!(run(2, &[0, 60]) == one, "levels and filter are those of the matrix at hand");
}

/// Tangents of bodies that stiffen, each with its part of terms on faces.
fn tangent(problem: &ElasticBox, stiffness: f64, on_faces: &Csr) -> Arc<Csr> {
    let mut body = problem.matrix.clone();
    body.values_mut().iter_mut().for_each(|value| *value *= stiffness);
    Arc::new(body.plus(on_faces).unwrap())
}

fn of_tangents(problem: &ElasticBox, on_faces: &Csr, threads: usize) -> CheckedContact {
    let is_touched = |row: &u32| !on_faces.row(*row as usize).0.is_empty();
    let rows = (0..problem.n() as u32).filter(is_touched).collect();
    let of = OnContact { layout: layout(problem, &[]), multipliers: Vec::new(), rows, at_times: Vec::new() };
    CheckedContact::new(of, SolverOptions { threads, ..SolverOptions::default() })
}

#[test]
fn tangents_of_bodies_with_contact_are_solved_as_with_a_factor_with_levels_of_their_own_or_of_an_earlier_one() {
    let problem = two_blocks(8);
    let b = load(problem.n());
    for kind in [Contact::Penalty, Contact::Nitsche] {
        let first = problem.contact(kind, 50.0, |_, _| true);
        let mut solver = of_tangents(&problem, &first, 1);
        let mut x = vec![0.0; problem.n()];
        for (slips, stiffness) in [(0, 1.0), (3, 1.1), (40, 1.3), (64, 0.8)] {
            let on_faces = problem.contact(kind, 50.0, |face, c| c == 0 && face != 5 || face >= slips);
            let matrix = tangent(&problem, stiffness, &on_faces);
            if !solver.keep_levels(&matrix, &on_faces).unwrap() {
                solver.take(&matrix, &on_faces).unwrap();
            }
            let report = solver.solve_until(&b, &mut x, 1e-11).unwrap();
            let missed = difference(&x, &direct(&matrix, &b));
            let n = report.krylov_iterations;
            assert!(missed < 1e-9 && n <= 80, "{kind:?}, {slips}: {missed:e}, {n}");
            assert!(solver.level_sizes().len() > 1, "{:?}", solver.level_sizes());
        }
    }
}

#[test]
fn tangents_with_contact_have_the_same_bits_for_any_number_of_threads() {
    let problem = two_blocks(10);
    let b = load(problem.n());
    let of = |slips: usize| problem.contact(Contact::Nitsche, 50.0, |face, c| c == 0 || face >= slips);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut solver = of_tangents(&problem, &of(0), threads);
            let mut x = vec![0.0; problem.n()];
            solver.take(&tangent(&problem, 1.0, &of(0)), &of(0)).unwrap();
            solver.solve_until(&b, &mut x, 1e-6).unwrap();
            assert!(solver.keep_levels(&tangent(&problem, 1.2, &of(30)), &of(30)).unwrap());
            let iterations = solver.solve_until(&b, &mut x, 1e-9).unwrap().krylov_iterations;
            (iterations, x.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
        })
    };
    let one = run(1);
    assert!([2, 3, 7].iter().all(|threads| run(*threads) == one));
}

#[test]
fn bodies_that_are_not_positive_definite_have_no_levels() {
    let problem = two_blocks(6);
    let on_faces = problem.contact(Contact::Nitsche, 50.0, |_, _| true);
    let mut solver = of_tangents(&problem, &on_faces, 1);
    let outcome = solver.take(&tangent(&problem, -1.0, &on_faces), &on_faces);
    assert!(matches!(outcome, Err(SolveError::NotPositiveDefinite { .. })), "{outcome:?}");
    let mut x = vec![0.0; problem.n()];
    let outcome = solver.solve_until(&load(problem.n()), &mut x, 1e-8);
    assert!(matches!(outcome, Err(SolveError::NotFactored)), "{outcome:?}");
}

/// Ties of the two sides of the interface as the pressures of a flow are told: rows without a place.
#[test]
fn a_motion_and_a_pressure_are_solved_as_with_a_factor_with_the_same_bits_for_any_number_of_threads() {
    let problem = two_blocks(8);
    let (equations, ties) = with_multipliers(&problem, |_| true);
    let matrix = Arc::new(equations.constant.plus(&ties).unwrap());
    let mut places = equations.layout.clone().unwrap();
    equations.multipliers.iter().for_each(|row| places.places[*row as usize] = crate::index::NONE);
    let b = load(matrix.n_rows());
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut solver = CheckedSaddle::new(places.clone(), SolverOptions { threads, ..SolverOptions::default() });
            solver.take(&matrix).unwrap();
            let mut x = vec![0.0; b.len()];
            let report = solver.solve_until(&b, &mut x, 1e-11).unwrap();
            (report.krylov_iterations, x)
        })
    };
    let (iterations, x) = run(1);
    let missed = difference(&x, &direct(&matrix, &b));
    assert!(missed < 1e-8 && iterations <= 120, "{missed:e}, {iterations}");
    assert!([2, 3, 7].iter().all(|threads| run(*threads) == (iterations, x.clone())));
}

/// Blocks whose sides are held together by forces at the nodes of the interface, unknowns of their own: without an entry on
/// the diagonal where the sides stick, and with `λ = 0` where they do not.
fn with_multipliers(problem: &ElasticBox, sticks: impl Fn(usize) -> bool) -> (Arc<Equations>, Csr) {
    let n = problem.n();
    let all = (n + problem.pairs.len()) as u32;
    let rows: Vec<u32> = (n as u32..all).collect();
    let mut builder = PatternBuilder::new(all as usize, all as usize);
    for (row, &(here, there)) in rows.iter().zip(&problem.pairs) {
        builder.add_element(&[*row, here, there]);
    }
    let mut changing = Csr::zeros(builder.build_shared().unwrap());
    for ((k, row), &(here, there)) in rows.iter().enumerate().zip(&problem.pairs) {
        let force = problem.h * problem.h;
        for (dof, sign) in [(here, force), (there, -force)] {
            assert!(changing.add_to(dof as usize, *row as usize, sign));
            assert!(!sticks(k) || changing.add_to(*row as usize, dof as usize, sign));
        }
        assert!(sticks(k) || changing.add_to(*row as usize, *row as usize, -force));
    }
    let bulk: Vec<(u32, u32, f64)> = (0..n as u32)
        .flat_map(|row| {
            let (columns, values) = problem.matrix.row(row as usize);
            columns.iter().zip(values).map(move |(column, value)| (row, *column, *value))
        })
        .collect();
    let constant = Csr::from_triplets(all as usize, all as usize, &bulk).unwrap();
    let points: Vec<[f64; 3]> =
        problem.pairs.iter().step_by(3).map(|pair| problem.coordinates[pair.0 as usize]).collect();
    let mut on_contact: Vec<u32> = problem.interface.iter().copied().chain(rows.iter().copied()).collect();
    on_contact.sort_unstable();
    let equations = Equations {
        traits: Traits { unknowns: all as usize, on_contact: on_contact.len(), dimension: 3, ..Traits::default() },
        constant: Arc::new(constant),
        changing: Arc::clone(changing.pattern()),
        layout: Some(layout(problem, &points)),
        multipliers: rows,
        on_contact,
        owners: None,
    };
    (Arc::new(equations), changing)
}

#[test]
fn multipliers_are_unknowns_of_contact() {
    let problem = two_blocks(8);
    for opens in [usize::MAX, 7, 2] {
        let (equations, changing) = with_multipliers(&problem, |k| k % opens != 1);
        let b = load(equations.n_rows());
        let mut solver = solver(&equations, 1);
        solver.factor(&changing).unwrap();
        let (iterations, x) = solved(&mut solver, &b, 1e-11);
        let missed = difference(&x, &direct(&equations.constant.plus(&changing).unwrap(), &b));
        assert!(missed < 1e-8 && iterations <= 90, "{opens}: {missed:e}, {iterations}");
    }
}

#[test]
fn a_block_that_contact_alone_holds_is_solved() {
    let options = BoxOptions { cells: [8, 8, 8], cut: Some(4), fix_low: true, fix_high: false };
    let problem = ElasticBox::new(&options);
    let changing = problem.contact(Contact::Penalty, 800.0, |_, _| true);
    let equations = equations(&problem, &changing);
    let b = load(problem.n());
    let mut solver = solver(&equations, 1);
    solver.factor(&changing).unwrap();
    let (iterations, x) = solved(&mut solver, &b, 1e-11);
    let missed = difference(&x, &direct(&problem.matrix.plus(&changing).unwrap(), &b));
    assert!(missed < 1e-8 && iterations <= 90, "{missed:e}, {iterations}");
}

#[test]
fn a_block_that_nothing_holds_is_singular() {
    let options = BoxOptions { cells: [6, 6, 6], cut: Some(3), fix_low: true, fix_high: false };
    let problem = ElasticBox::new(&options);
    let changing = problem.contact(Contact::Penalty, 50.0, |_, c| c == 0);
    let equations = equations(&problem, &changing);
    let mut solver = solver(&equations, 1);
    let mut x = vec![0.0; problem.n()];
    let outcome = solver.factor(&changing).and_then(|()| solver.solve(&load(problem.n()), &mut x));
    assert!(matches!(outcome, Err(SolveError::Singular { .. })), "{outcome:?}");
}

#[test]
fn what_cannot_be_told_by_nodes_is_refused() {
    let problem = two_blocks(4);
    let changing = problem.contact(Contact::Penalty, 50.0, |_, _| true);
    let mut equations = (*equations(&problem, &changing)).clone();
    equations.layout = None;
    equations.traits.obstacle = Some("some unknowns follow others".to_owned());
    let Err(SolveError::Library { text }) =
        FilteredMultigrid.engine(&Arc::new(equations), Symmetry::General).map(|_| ())
    else {
        panic!("it must be refused")
    };
    assert_eq!(text, "no multigrid: some unknowns follow others");
}
