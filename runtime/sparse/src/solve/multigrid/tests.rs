//! The iteration against solutions that are known.

use std::sync::Arc;

use super::blocks::{RowBuffer, Rows};
use super::nodes::NodeRows;
use super::*;
use crate::csr::{Csr, PatternBuilder};
use crate::index::NONE;
use crate::solve::problems::{BoxOptions, ElasticBox};
use crate::solve::{LinearSolver, SolveError, SolveReport, SolverOptions};

/// A cube of n cells a side, held at one end or free.
fn cube(n: usize, fix_low: bool) -> ElasticBox {
    ElasticBox::new(&BoxOptions { cells: [n, n, n], cut: None, fix_low, fix_high: false })
}

/// Rows that belong to nodes of three components, one after the other.
fn of_box(problem: &ElasticBox) -> NodeLayout {
    NodeLayout {
        components: 3,
        places: (0..problem.n() as u32).collect(),
        points: problem.coordinates.iter().step_by(3).copied().collect(),
        modes: NearNullSpace::RigidBody,
        frames: Vec::new(),
        interpolation: None,
    }
}

/// A smooth field with some roughness, by row.
fn wanted(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 37 + 11) % 19) as f64 / 7.0 - 1.2 + (i as f64 / n as f64)).collect()
}

fn times(a: &Csr, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; a.n_rows()];
    a.multiply(x, &mut y, 1);
    y
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Solves for a known solution; what is missed of it and the report.
fn solved(matrix: &Csr, layout: NodeLayout) -> (f64, SolveReport, Vec<usize>) {
    let mut solver = CheckedMultigrid::new(layout, SolverOptions::default());
    solver.factor(matrix).unwrap();
    let exact = wanted(matrix.n_rows());
    let mut x = vec![0.0; exact.len()];
    let report = solver.solve(&times(matrix, &exact), &mut x).unwrap();
    (difference(&x, &exact), report, solver.level_sizes().to_vec())
}

#[test]
fn iterations_hardly_grow_with_the_mesh() {
    let mut counts = Vec::new();
    for n in [10, 14, 18] {
        let problem = cube(n, true);
        let (missed, report, sizes) = solved(&problem.matrix, of_box(&problem));
        assert!(missed < 1e-10 && sizes.len() > 1, "{missed} {report:?} {sizes:?}");
        counts.push(report.krylov_iterations);
    }
    assert!(counts[2] <= counts[0] * 13 / 10 && counts[2] <= 20, "{counts:?}");
}

#[test]
fn a_small_matrix_is_its_own_coarsest_level() {
    let problem = cube(4, true);
    let (missed, report, sizes) = solved(&problem.matrix, of_box(&problem));
    assert!(missed < 1e-11 && report.krylov_iterations <= 3, "{missed} {report:?}");
    assert_eq!(sizes, [problem.n()]);
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let problem = cube(12, true);
    let b = times(&problem.matrix, &wanted(problem.n()));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = SolverOptions { threads, ..SolverOptions::default() };
            let mut solver = CheckedMultigrid::new(of_box(&problem), options);
            solver.take(Arc::new(problem.matrix.clone())).unwrap();
            let mut x = vec![0.0; b.len()];
            solver.solve(&b, &mut x).unwrap();
            x.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3));
}

#[test]
fn a_free_body_is_singular_and_its_null_vector_a_rigid_motion() {
    for n in [4, 10] {
        let problem = cube(n, false);
        let mut solver = CheckedMultigrid::new(of_box(&problem), SolverOptions::default());
        let outcome = solver.factor(&problem.matrix);
        let Err(SolveError::Singular { mode, ratio, .. }) = outcome else {
            panic!("a free body of {n} cells a side must be singular: {outcome:?}");
        };
        // of a rigid motion u = a + b x r the strain energy vanishes, and it is linear along each axis
        assert!(ratio < 1e-13, "{ratio}");
        let along = |node: usize| mode.values()[3 * node];
        assert!((along(2) - 2.0 * along(1) + along(0)).abs() < 1e-9);
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_is_refused() {
    let problem = cube(10, true);
    let mut matrix = problem.matrix.clone();
    for row in 0..matrix.n_rows() {
        let shift = 0.05 * matrix.get(row, row);
        assert!(matrix.add_to(row, row, -shift));
    }
    let mut solver = CheckedMultigrid::new(of_box(&problem), SolverOptions::default());
    let mut x = vec![0.0; matrix.n_rows()];
    let outcome = solver.factor(&matrix).and_then(|()| solver.solve(&wanted(matrix.n_rows()), &mut x).map(|_| ()));
    assert!(matches!(outcome, Err(SolveError::NotPositiveDefinite { .. })), "{outcome:?}");
}

#[test]
fn an_unsymmetric_matrix_is_refused() {
    let problem = cube(4, true);
    let mut matrix = problem.matrix.clone();
    assert!(matrix.add_to(0, 3, 0.5));
    let mut solver = CheckedMultigrid::new(of_box(&problem), SolverOptions::default());
    assert!(matches!(solver.factor(&matrix), Err(SolveError::NotSymmetric { .. })));
}

/// Rows and columns of a matrix that are kept, in their order.
fn restricted(matrix: &Csr, kept: &[usize]) -> Csr {
    let mut number = vec![NONE; matrix.n_rows()];
    kept.iter().zip(0..).for_each(|(row, k)| number[*row] = k);
    let mut triplets = Vec::new();
    for row in kept {
        let (columns, values) = matrix.row(*row);
        let own = columns.iter().zip(values).filter(|(c, _)| number[**c as usize] != NONE);
        triplets.extend(own.map(|(c, v)| (number[*row], number[*c as usize], *v)));
    }
    Csr::from_triplets(kept.len(), kept.len(), &triplets).unwrap()
}

#[test]
fn rollers_along_axes_and_across_them_cost_no_iterations() {
    // a free cube whose lowest layer may only slide: along x for an axis, along a direction that is turned by 0.7 rad
    let problem = cube(10, false);
    let layer = 11 * 11;
    let (c, s) = (0.7f64.cos(), 0.7f64.sin());
    let axes = vec![vec![c, s, 0.0], vec![-s, c, 0.0], vec![0.0, 0.0, 1.0]];
    let mut turned = Vec::new();
    for row in 0..problem.n() {
        let (columns, values) = problem.matrix.row(row);
        for (column, value) in columns.iter().zip(values) {
            // by entry: rows of the turned block gather what the block holds
            let parts = |dof: usize| -> Vec<(usize, f64)> {
                let (node, component) = (dof / 3, dof % 3);
                if node >= layer {
                    return vec![(dof, 1.0)];
                }
                (0..3).map(|k| (3 * node + k, axes[k][component])).filter(|p| p.1 != 0.0).collect()
            };
            for (i, p) in parts(row) {
                for (j, q) in parts(*column as usize) {
                    turned.push((i as u32, j as u32, value * p * q));
                }
            }
        }
    }
    let turned = Csr::from_triplets(problem.n(), problem.n(), &turned).unwrap();
    // the first axis of each node of the layer is held, one node of it altogether, another one so that nothing turns
    let kept: Vec<usize> = (0..problem.n()).filter(|d| *d >= 3 * layer || d % 3 != 0 && *d > 2 && *d != 31).collect();
    let mut layout = of_box(&problem);
    layout.points.remove(0);
    layout.places = kept.iter().map(|d| *d as u32 - 3).collect();
    let straight = solved(&restricted(&problem.matrix, &kept), layout.clone());
    layout.frames = (0..layer as u32 - 1).map(|node| (node, axes.clone())).collect();
    let across = solved(&restricted(&turned, &kept), layout);
    assert!(straight.0 < 1e-9 && across.0 < 1e-9, "{straight:?} {across:?}");
    assert!(across.1.krylov_iterations <= straight.1.krylov_iterations + 3, "{straight:?} {across:?}");
}

/// The 7-point Laplacian on a grid of n³ points between zeros, with a factor on couplings along the first axis.
fn laplacian(n: usize, along_x: f64) -> (Csr, NodeLayout) {
    let id = |p: [usize; 3]| ((p[0] * n + p[1]) * n + p[2]) as u32;
    let mut builder = PatternBuilder::new(n * n * n, n * n * n);
    let mut entries = Vec::new();
    let mut points = Vec::new();
    for (x, y, z) in (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| (x, y, z)))) {
        let here = [x, y, z];
        points.push(here.map(|k| k as f64));
        entries.push((id(here), id(here), 2.0 * along_x + 4.0));
        for axis in 0..3 {
            let weight = if axis == 0 { along_x } else { 1.0 };
            for other in [here[axis].wrapping_sub(1), here[axis] + 1] {
                if other < n {
                    let mut there = here;
                    there[axis] = other;
                    entries.push((id(here), id(there), -weight));
                }
            }
        }
    }
    entries.iter().for_each(|(row, column, _)| builder.add_coupling(&[*row], &[*column]));
    let mut matrix = Csr::zeros(builder.build_shared().unwrap());
    entries.iter().for_each(|(row, column, value)| assert!(matrix.add_to(*row as usize, *column as usize, *value)));
    let layout = NodeLayout {
        components: 1,
        places: (0..(n * n * n) as u32).collect(),
        points,
        modes: NearNullSpace::Constants,
        frames: Vec::new(),
        interpolation: None,
    };
    (matrix, layout)
}

#[test]
fn a_scalar_field_needs_few_iterations_also_where_it_is_stiff_along_one_axis() {
    for (stiffness, most) in [(1.0, 22), (1e4, 22), (1e-4, 22)] {
        let (matrix, layout) = laplacian(20, stiffness);
        let (missed, report, sizes) = solved(&matrix, layout);
        assert!(missed < 1e-9, "{stiffness} {missed} {report:?}");
        assert!(report.krylov_iterations <= most, "{stiffness} {report:?} {sizes:?}");
        // lines and planes of strong couplings make groups that are large enough, too
        assert!(sizes[1] <= sizes[0] * 3 / 10, "{stiffness} {sizes:?}");
    }
}

#[test]
fn a_given_interpolation_makes_the_first_coarser_level() {
    let n = 17;
    let (matrix, mut layout) = laplacian(n, 1.0);
    // points with odd coordinates alone are coarse; those between have the mean of their neighbours, zero outside
    let (mut starts, mut weights) = (vec![0], Vec::new());
    for point in 0..n * n * n {
        let here = [point / (n * n), point / n % n, point % n];
        let mut list = vec![([0usize; 3], 1.0)];
        for axis in 0..3 {
            list = list
                .into_iter()
                .flat_map(|(at, weight)| {
                    let ends = if here[axis] % 2 == 1 {
                        vec![(here[axis], 1.0)]
                    } else {
                        vec![(here[axis].wrapping_sub(1), 0.5), (here[axis] + 1, 0.5)]
                    };
                    ends.into_iter().filter(|end| end.0 < n).map(move |(place, part)| {
                        let mut at = at;
                        at[axis] = place;
                        (at, weight * part)
                    })
                })
                .collect();
        }
        weights.extend(list.iter().map(|(p, weight)| (((p[0] * n + p[1]) * n + p[2]) as u32, *weight)));
        starts.push(weights.len());
    }
    layout.interpolation = Some(Interpolation { starts, weights });
    let (missed, report, sizes) = solved(&matrix, layout);
    assert_eq!(sizes[1], 8 * 8 * 8);
    assert!(missed < 1e-10 && report.krylov_iterations <= 15, "{missed} {report:?} {sizes:?}");
}

/// Rows of a matrix in one part are copied where whole nodes couple alike, those of two parts are summed entry by entry; a node of
/// which a component is prescribed has neighbours of both kinds.
#[test]
fn blocks_that_are_copied_are_those_that_are_summed() {
    let problem = cube(3, true);
    for left_out in [None, Some(31)] {
        let kept: Vec<usize> = (0..problem.n()).filter(|row| Some(*row) != left_out).collect();
        let matrix = restricted(&problem.matrix, &kept);
        let layout = NodeLayout { places: kept.iter().map(|row| *row as u32).collect(), ..of_box(&problem) };
        let mut nothing = matrix.clone();
        nothing.values_mut().fill(0.0);
        let (alone, both) = ([&matrix], [&matrix, &nothing]);
        let (copied, summed) = (NodeRows::new(&alone, &layout), NodeRows::new(&both, &layout));
        let (mut a, mut b) = (RowBuffer::default(), RowBuffer::default());
        for node in 0..copied.n_nodes() {
            assert_eq!(copied.row(node, &mut a), summed.row(node, &mut b), "node {node} without {left_out:?}");
        }
    }
}

#[test]
fn a_layout_that_does_not_fit_is_refused() {
    let problem = cube(4, true);
    let mut outside = of_box(&problem);
    outside.points.pop();
    let mut mixed = of_box(&problem);
    mixed.places.swap(0, 1);
    let mut short = of_box(&problem);
    short.places.pop();
    for layout in [outside, mixed, short] {
        let mut solver = CheckedMultigrid::new(layout, SolverOptions::default());
        assert!(matches!(solver.factor(&problem.matrix), Err(SolveError::Shape { .. })));
    }
}
