//! Assembly of the tangent into an allocated sparse matrix, nine cases, one and two threads.
//!
//! `cargo bench -p wfl-run --bench assembly` measures with criterion; `-- --table` prints a table within seconds: the
//! best of several passes, thousand entities per second, the goal on one thread, and the ratio of two threads to one. Its
//! times are processor times of the busiest thread, which other programs on the machine disturb least.

mod cases;
#[path = "../common/clock.rs"]
mod clock;
#[path = "../common/scene.rs"]
mod common;

use std::{
    io::Write as _,
    process::ExitCode,
    time::{Duration, Instant},
};

use criterion::{Criterion, Throughput};

use cases::{CASES, Problem};
use clock::{pool, processor_time};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let done = if words.iter().any(|w| w == "--table") {
        table(words.iter().find(|w| !w.starts_with("--")).map_or("", String::as_str))
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
    let pools = [pool(1)?, pool(2)?];
    for case in &CASES {
        let mut problem = Problem::new(case)?;
        let mut group = criterion.benchmark_group(case.name);
        group.throughput(Throughput::Elements(problem.n_entities() as u64));
        for pool in &pools {
            let name = format!("{} threads", pool.current_num_threads());
            group.bench_function(format!("tangent, {name}"), |b| b.iter(|| pool.install(|| problem.assemble())));
            group.bench_function(format!("residual, {name}"), |b| {
                b.iter(|| pool.install(|| problem.assemble_residual()));
            });
        }
        group.finish();
    }
    criterion.final_summary();
    Ok(())
}

/// Best time of several passes within about half a second.
fn best(pool: &rayon::ThreadPool, problem: &mut Problem) -> Result<f64, String> {
    pool.install(|| {
        problem.assemble()?;
        let (start, mut best) = (Instant::now(), f64::INFINITY);
        while start.elapsed() < Duration::from_millis(500) {
            let pass = Instant::now();
            problem.assemble()?;
            best = best.min(pass.elapsed().as_secs_f64());
        }
        Ok(best)
    })
}

/// Seconds of processor time that the busiest thread of the pool spends on a pass, the best of several rounds: what other
/// programs on the machine take away does not count. Time by the clock where the system does not tell.
fn busy(pool: &rayon::ThreadPool, problem: &mut Problem) -> Result<f64, String> {
    let mut best = best(pool, problem)?;
    let times = || pool.broadcast(|_| processor_time()).into_iter().collect::<Option<Vec<Duration>>>();
    for _ in 0..ROUNDS {
        let Some(before) = times() else { return Ok(best) };
        let (mut passes, mut spent) = (0.0, Duration::ZERO);
        while spent < ROUND {
            pool.install(|| problem.assemble())?;
            passes += 1.0;
            let after = times().unwrap_or_default();
            spent = before.iter().zip(&after).map(|(b, a)| a.saturating_sub(*b)).max().unwrap_or(ROUND);
        }
        best = best.min(spent.as_secs_f64() / passes);
    }
    Ok(best)
}

const ROUNDS: usize = 3;
/// Long against the ticks in which systems count.
const ROUND: Duration = Duration::from_millis(150);

fn table(wanted: &str) -> Result<(), String> {
    let pools = [pool(1)?, pool(2)?];
    let mut out = std::io::stdout().lock();
    let mut line = |text: String| writeln!(out, "{text}").map_err(|e| e.to_string());
    line("| case | 1 thread, 1000/s | goal | of goal | 2 threads | ratio | sum of magnitudes | law |".to_owned())?;
    line("|---|---|---|---|---|---|---|---|".to_owned())?;
    for case in CASES.iter().filter(|c| c.name.contains(wanted)) {
        let mut problem = Problem::new(case)?;
        let n = problem.n_entities() as f64 / 1000.0;
        let (one, two) = (n / busy(&pools[0], &mut problem)?, n / busy(&pools[1], &mut problem)?);
        line(format!(
            "| {} | {one:.0} | {} | {:.2} | {two:.0} | {:.2} | {:.15e} | {} |",
            case.name,
            case.goal,
            one / case.goal,
            two / one,
            problem.checksum(),
            problem.summary()
        ))?;
    }
    Ok(())
}
