//! Timings of the solvers on boxes with an interface; run with `--release -- --ignored --nocapture timings`.

use std::time::Instant;

use super::problems::{BoxOptions, Contact, ElasticBox};
use super::*;

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Faces in contact in step `step`: a front that moves over the interface.
fn pattern_of(step: usize, n: usize) -> impl Fn(usize, usize) -> bool {
    move |face, component| {
        let (row, column) = (face / n, face % n);
        // Up to step 9 single faces change, later whole rows of them.
        let edge = n / 2 + step / 10;
        component == 0 && row < n - 1 || component > 0 && (row < edge || row == edge && column < step)
    }
}

#[test]
#[ignore = "timings, for release builds"]
fn condensed_timings() {
    for (cells, kind) in [
        ([8, 8, 8], Contact::Penalty),
        ([8, 8, 8], Contact::Nitsche),
        ([8, 16, 16], Contact::Penalty),
        ([8, 16, 16], Contact::Nitsche),
        ([16, 32, 32], Contact::Penalty),
        ([16, 32, 32], Contact::Nitsche),
    ] {
        let problem = ElasticBox::new(&BoxOptions { cells, cut: Some(cells[0] / 2), fix_low: true, fix_high: false });
        let n = cells[1];
        for threads in [1, 2] {
            let options = SolverOptions { threads, ..SolverOptions::default() };
            let first = problem.contact(kind, 100.0, pattern_of(0, n));
            let start = Instant::now();
            let mut solver = CheckedCondensed::new(
                &problem.matrix,
                first.pattern(),
                Some(&problem.coordinates),
                &problem.pairs,
                options,
            )
            .unwrap();
            eprintln!("n {} threads {threads}: {}", problem.n(), solver.strategy());
            eprintln!("  set up {:.1} ms", milliseconds(start));
            let rhs: Vec<f64> = (0..problem.n()).map(|i| ((i % 7) as f64 - 3.0) * 1e-3).collect();
            let mut x = vec![0.0; problem.n()];
            for step in [0, 0, 1, 2, 5, 5, 35] {
                let changing = problem.contact(kind, 100.0, pattern_of(step, n));
                let start = Instant::now();
                solver.update(&changing).unwrap();
                let update = milliseconds(start);
                let start = Instant::now();
                let report = solver.solve(&rhs, &mut x).unwrap();
                eprintln!(
                    "  step {step}: update {update:.1} ms, solve {:.1} ms, iterations {}, refactored {}, refined {}, residual {:.1e}",
                    milliseconds(start),
                    report.krylov_iterations,
                    report.refactored,
                    report.refinements,
                    report.relative_residual
                );
            }
        }
    }
}

#[test]
#[ignore = "timing, for release builds"]
fn cholesky_timings() {
    for cells in [[8, 16, 16], [16, 32, 32]] {
        let problem = ElasticBox::new(&BoxOptions { cells, cut: None, fix_low: true, fix_high: false });
        let a = &problem.matrix;
        let start = Instant::now();
        let symbolic = super::symbolic::Symbolic::new(a.pattern(), Some(&problem.coordinates), &[]).unwrap();
        let fronts = 0..symbolic.n_fronts();
        let sizes = fronts.clone().map(|front| symbolic.sizes(front));
        eprintln!(
            "n {}: analysis {:.1} ms, {} fronts, {:.1e} values, {:.3e} multiplications",
            problem.n(),
            milliseconds(start),
            symbolic.n_fronts(),
            sizes.map(|(k, r)| (k * (k + r)) as f64).sum::<f64>(),
            fronts.map(|front| symbolic.operations(front)).sum::<f64>(),
        );
        let b = vec![1e-3; problem.n()];
        let mut x = b.clone();
        for threads in [1, 2] {
            let options = SolverOptions { threads, ..SolverOptions::default() };
            let mut solver = CheckedLlt::new(a.pattern(), Some(&problem.coordinates), options).unwrap();
            for _ in 0..2 {
                let start = Instant::now();
                solver.factor(a).unwrap();
                let factor = milliseconds(start);
                let start = Instant::now();
                solver.solve(&b, &mut x).unwrap();
                eprintln!("  threads {threads}: factor {factor:.1} ms, solve {:.1} ms", milliseconds(start));
            }
        }
    }
}
