//! X36, X37, X45, X57, X58: derivatives at 0, tangents without a Cholesky factor, rules of one point, precision and
//! threads of the solver.

use std::time::Instant;

use wfl_run::RunOptions;
use wfl_sparse::solve::Precision;

use super::{
    Benchmark, Case, Tolerance,
    common::{converged, or_failed},
    two_block::{NITSCHE, STICK, YOUNG},
};
use crate::{attempt, attempt_with, examples};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        id: "X36",
        title: "norms, unit vectors and roots at 0, where the first iteration is",
        origin: "the root by hand, or an error that says why",
        slow: false,
        open: None,
        run: at_zero,
    },
    Benchmark {
        id: "X37",
        title: "tangents that are indefinite, unsymmetric or have a zero diagonal",
        origin: "solutions by hand",
        slow: false,
        open: None,
        run: no_cholesky,
    },
    Benchmark {
        id: "X45",
        title: "one point on the faces of quadratic elements",
        origin: "a warning with both numbers; none without the statement",
        slow: false,
        open: None,
        run: one_point,
    },
    Benchmark {
        id: "X57",
        title: "factor of the contact matrix in single precision, residuals in double precision",
        origin: "the same run in double precision, gamma h/E = 1e-4 to 1e4: 1e-11 of the largest displacement",
        slow: false,
        open: None,
        run: single,
    },
    Benchmark {
        id: "X58",
        title: "1, 2, 3 and 7 threads",
        origin: "the same bits",
        slow: false,
        open: None,
        run: threads,
    },
];

/// Two scalars at every node of a square; `TERMS` couple them point by point, so that a constant solves them.
const POINTWISE: &str = "wfl 1
mesh box [0,0] to [1,1] cells [3,3] quad
unknown a : scalar Q1
unknown b : scalar Q1
solver newton with tol=1e-13
";

/// The largest distance of the fields from two constants.
fn distance(terms: &str, expected: [f64; 2]) -> Result<f64, String> {
    let tried = attempt(&examples(), format!("{POINTWISE}{terms}"), &[], &[]);
    let solved = tried.solved.ok_or(tried.messages).and_then(converged)?;
    let state = &solved.outcome.steps[0].state;
    let mut worst = 0.0f64;
    for (k, e) in expected.iter().enumerate() {
        for x in &state[solved.scene.system.range(k).ok_or("no dofs")?] {
            let gap = (x - e).abs();
            // NaN is kept: max would drop it
            worst = if gap > worst || gap.is_nan() { gap } else { worst };
        }
    }
    Ok(worst)
}

fn solution(what: &str, terms: &str, expected: [f64; 2]) -> Case {
    let made = distance(terms, expected);
    or_failed(what, made.map(|d| Case::new(what).compare("largest error", d, 1e-11, Tolerance::AtMost)))
}

fn at_zero() -> Vec<Case> {
    let root = 2f64.sqrt();
    let mut cases = vec![
        // a + |(a, a)| = 1
        solution(
            "norm",
            "term one on all : (a + Norm([a,a]) - 1)*Test_a\nterm two on all : b*Test_b\n",
            [1.0 / (1.0 + root), 0.0],
        ),
        // a + 1/sqrt(2) = 2 once a moves
        solution(
            "unit vector",
            "term one on all : (a + Normalized([a,a]).[1,0] - 2)*Test_a\nterm two on all : b*Test_b\n",
            [2.0 - 1.0 / root, 0.0],
        ),
        solution(
            "projection of 0 on a ball of radius 0",
            "term one on all : (a + Ball_projection([a,b], 0*a).[1,0] - 2)*Test_a\nterm two on all : b*Test_b\n",
            [2.0, 0.0],
        ),
    ];
    // the derivative is infinite there: 1, or an error
    for (what, f) in [("square root", "sqrt(a)"), ("power 1/2", "pow(a,0.5)")] {
        let terms = format!("term one on all : (a + {f} - 2)*Test_a\nterm two on all : b*Test_b\n");
        let honest = match distance(&terms, [1.0, 0.0]) {
            Ok(error) => error <= 1e-11,
            Err(message) => !message.is_empty(),
        };
        cases.push(Case::new(format!("{what}: right or an error")).require(honest, "claims a wrong solution"));
    }
    cases
}

fn no_cholesky() -> Vec<Case> {
    let pair = |p: &str, q: &str| format!("term one on all : ({p})*Test_a\nterm two on all : ({q})*Test_b\n");
    vec![
        solution("indefinite", &pair("a + 2*b - 5", "2*a + b - 4"), [1.0, 2.0]),
        solution("negative definite", &pair("-a + 3", "-b - 4"), [3.0, -4.0]),
        solution("zero diagonal", &pair("b - 2", "a - 1"), [1.0, 2.0]),
        solution("unsymmetric", &pair("a + 4*b - 9", "-4*a + b + 2"), [1.0, 2.0]),
        solution("skew", &pair("b - 2", "-a + 1"), [1.0, 2.0]),
        solution("indefinite and not linear", &pair("a^3 + 2*b - 5", "2*a + 0.1*b^3 - 2.8"), [1.0, 2.0]),
    ]
}

fn one_point() -> Vec<Case> {
    let case = |(element, degree, words): (&str, &str, Option<&str>)| {
        let what = format!("{element}{degree}");
        let law = format!("{NITSCHE}{degree}");
        let tried = STICK.attempt(&law, 16.0 * YOUNG, 0.0, &[("vector Q1", format!("vector {element}"))]);
        let told = words.map_or(!tried.messages.contains("W506"), |w| tried.messages.contains(w));
        Case::new(what.trim_end().replace('\n', ", ")).require(told, tried.messages)
    };
    [
        ("Q2", "\nquadrature on fault degree 1\n", Some("1 points a face for the 9 nodes of degree 2")),
        ("Q1", "\nquadrature on fault degree 1\n", Some("1 points a face for the 4 nodes of degree 1")),
        ("Q2", "\nquadrature on fault degree 4\n", None),
        ("Q2", "\n", None),
    ]
    .map(case)
    .to_vec()
}

/// Penalty touches so few dofs here that the forces have no matrix of their own.
fn single() -> Vec<Case> {
    let steps = [("0 to 9.5 by 0.5", "5 to 6 by 0.5".to_owned())];
    let folder = examples().join("fault");
    let run = |file: &str, gamma: f64, precision: Precision| -> Result<Vec<f64>, String> {
        let text = std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string())?;
        let options = RunOptions { precision, ..RunOptions::without_files(1, Instant::now()) };
        let tried = attempt_with(&options, &folder, text, &steps, &[("gamma", gamma)]);
        let solved = tried.solved.ok_or(tried.messages).and_then(converged)?;
        let bodies = [0, 1].map(|field| solved.scene.system.range(field).unwrap_or_default());
        let states = solved.outcome.steps.iter().flat_map(|s| bodies.iter().flat_map(|body| &s.state[body.clone()]));
        Ok(states.copied().collect())
    };
    let case = |file: &str, gamma: f64, what: &str| {
        let double = run(file, gamma, Precision::Double)?;
        let mixed = run(file, gamma, Precision::Mixed)?;
        let size = double.iter().fold(0.0f64, |size, x| size.max(x.abs()));
        let differences = double.iter().zip(&mixed).map(|(a, b)| (a - b).abs() / size);
        let worst = differences.fold(0.0f64, |worst, d| if d > worst || d.is_nan() { d } else { worst });
        let made = Case::new(what).require(double != mixed, "no factor of single precision was used");
        Ok(made.compare("largest difference of displacements", worst, 1e-11, Tolerance::AtMost))
    };
    let settings = [5.0, 1e3, 1e5, 5e8].map(|gamma| ("nitsche.wfl", gamma));
    settings
        .into_iter()
        .chain([("augmented_lagrangian.wfl", 1e5)])
        .map(|(file, gamma)| {
            let what = format!("{file}, gamma h/E = {:.0e}", gamma * 0.5 / 25_000.0);
            or_failed(&what, case(file, gamma, &what))
        })
        .collect()
}

fn threads() -> Vec<Case> {
    let files = ["nitsche.wfl", "penalty.wfl", "augmented_lagrangian.wfl"];
    let steps = [("0 to 9.5 by 0.5", "8 to 9 by 0.5".to_owned())];
    let folder = examples().join("fault");
    let run = |file: &str, threads: usize| -> Result<Vec<Vec<f64>>, String> {
        let text = std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string())?;
        let options = RunOptions::without_files(threads, Instant::now());
        let tried = attempt_with(&options, &folder, text, &steps, &[]);
        let solved = tried.solved.ok_or(tried.messages).and_then(converged)?;
        Ok(solved.outcome.steps.into_iter().map(|s| s.state).collect())
    };
    let case = |file: &str| {
        let alone = run(file, 1)?;
        let mut case = Case::new(file);
        for threads in [2, 3, 7] {
            let other = run(file, threads)?;
            let bits = |steps: &[Vec<f64>]| steps.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
            let (a, b) = (bits(&alone), bits(&other));
            let different = a.iter().zip(&b).filter(|(a, b)| a != b).count() + a.len().abs_diff(b.len());
            let label = format!("{threads} threads: unknowns of {} with other bits", a.len());
            case = case.compare(label, different as f64, 0.0, Tolerance::AtMost);
        }
        Ok(case)
    };
    files.map(|file| or_failed(file, case(file))).to_vec()
}
