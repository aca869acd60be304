//! Linear systems of the fault scenes: set-up, solutions while the contact changes, growth with the number of unknowns.
//!
//! `cargo bench -p wfl-run --bench solve` measures with criterion; `-- --table` prints whole runs of the three
//! methods by size, `-- --growth` those of one method on five sizes with fitted exponents. Runs have one thread and a
//! process each, so that the largest memory is that of one size; times are processor times, which other programs on the
//! machine disturb least.

#[path = "../common/clock.rs"]
mod clock;
#[path = "../common/scene.rs"]
mod common;
mod fault;

use std::{
    io::Write as _,
    process::{Command, ExitCode},
};

use criterion::{Criterion, SamplingMode};
use wfl_sparse::solve::{CheckedLlt, LinearSolver, SolverOptions};

use fault::{Alternating, Cost};

const METHODS: [&str; 3] = ["nitsche", "penalty", "augmented_lagrangian"];
/// Meshes of one shape, cells twice as long across the fault as along it.
const SIZES: [[usize; 3]; 6] = [[4, 8, 8], [6, 12, 12], [8, 16, 16], [10, 20, 20], [12, 24, 24], [16, 32, 32]];
/// Meshes of the goals.
const GOALS: [[usize; 3]; 4] = [[8, 8, 8], [8, 16, 16], [16, 16, 16], [16, 32, 32]];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let asks = |word: &str| words.iter().any(|w| w == word);
    let others: Vec<&str> = words.iter().map(String::as_str).filter(|w| !w.starts_with("--")).collect();
    let done = if asks("--one") {
        one(&others)
    } else if asks("--table") {
        table(others.first().copied().unwrap_or_default())
    } else if asks("--growth") {
        growth(others.first().copied().unwrap_or(METHODS[0]))
    } else {
        measure()
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: {e}");
            ExitCode::FAILURE
        }
    }
}

fn measure() -> Result<(), String> {
    let mut criterion = Criterion::default().configure_from_args();
    for cells in [GOALS[0], GOALS[1]] {
        for threads in [1, 2] {
            let pool = clock::pool(threads)?;
            for method in METHODS {
                let mut solver = pool.install(|| Alternating::new(method, cells, threads))?;
                let mut group = criterion.benchmark_group(format!("{method} {cells:?}, {threads} threads"));
                group.sample_size(10).sampling_mode(SamplingMode::Flat);
                group.bench_function("set-up", |b| b.iter(|| pool.install(|| solver.set_up())));
                for (name, tolerance) in [("another tangent, to rounding", 0.0), ("another tangent, to 1e-4", 1e-4)] {
                    group.bench_function(name, |b| b.iter(|| pool.install(|| solver.next(tolerance))));
                }
                if method == METHODS[0] {
                    let bulk = solver.bulk().clone();
                    let options = SolverOptions { threads, ..SolverOptions::default() };
                    let mut llt = CheckedLlt::new(bulk.pattern(), None, options).map_err(|e| e.to_string())?;
                    group.bench_function("bulk alone, LLT", |b| b.iter(|| pool.install(|| llt.factor(&bulk))));
                }
                group.finish();
            }
        }
    }
    criterion.final_summary();
    Ok(())
}

/// One run, for the process that asked for it.
fn one(words: &[&str]) -> Result<(), String> {
    let [method, cells @ ..] = words else { return Err("a method and cells are needed".to_owned()) };
    let cells: Vec<usize> = cells.iter().filter_map(|word| word.parse().ok()).collect();
    let cells = <[usize; 3]>::try_from(cells).map_err(|_| "three numbers of cells are needed")?;
    let cost = clock::pool(1)?.install(|| Cost::measure(method, cells))?;
    say(&cost.to_line())
}

/// One run in a process of its own.
fn cost(method: &str, cells: [usize; 3]) -> Result<Cost, String> {
    let this = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut command = Command::new(this);
    command.arg("--one").arg(method).args(cells.map(|c| c.to_string()));
    let output = command.output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Cost::from_line(&String::from_utf8_lossy(&output.stdout))
}

fn say(line: &str) -> Result<(), String> {
    writeln!(std::io::stdout().lock(), "{line}").map_err(|e| e.to_string())
}

const HEAD: &str =
    "| method | cells | unknowns | set-up s | iteration s | iterations | Krylov | factorisations | run s | memory MB |
|---|---|---|---|---|---|---|---|---|---|";

fn row(method: &str, [x, y, z]: [usize; 3], c: Cost) -> Result<(), String> {
    say(&format!(
        "| {method} | {x}x{y}x{z} | {} | {:.3} | {:.4} | {} | {} | {} | {:.2} | {:.0} |",
        c.unknowns,
        c.set_up,
        c.iteration,
        c.iterations,
        c.krylov,
        c.factorisations,
        c.seconds,
        c.memory / 1e6
    ))
}

/// Runs whose method or size holds the word.
fn table(wanted: &str) -> Result<(), String> {
    say(HEAD)?;
    for cells in GOALS {
        for method in METHODS {
            if format!("{method} {}x{}x{}", cells[0], cells[1], cells[2]).contains(wanted) {
                row(method, cells, cost(method, cells)?)?;
            }
        }
    }
    Ok(())
}

/// One of the numbers of a run.
type Part = fn(&Cost) -> f64;

/// Runs on all sizes, and the powers of the number of unknowns that fit.
fn growth(method: &str) -> Result<(), String> {
    say(HEAD)?;
    let mut costs = Vec::new();
    for cells in SIZES {
        let c = cost(method, cells)?;
        row(method, cells, c)?;
        costs.push(c);
    }
    say("")?;
    let parts: [(&str, Part); 4] = [
        ("set-up", |c| c.set_up),
        ("an iteration after the first", |c| c.iteration),
        ("whole run", |c| c.seconds),
        ("memory", |c| c.memory),
    ];
    for (name, part) in parts {
        say(&format!("{name}: n^{:.2}", exponent(costs.iter().map(|c| (c.unknowns, part(c))))))?;
    }
    Ok(())
}

/// Slope of the straight line through the logarithms, by least squares.
fn exponent(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let logs: Vec<(f64, f64)> = points.map(|(n, value)| (n.ln(), value.ln())).collect();
    let mean = |part: &dyn Fn(&(f64, f64)) -> f64| logs.iter().map(part).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x) * (p.0 - x))
}
