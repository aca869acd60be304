//! Runs the verification suite and writes `docs/verification.md`. Names after the command run only those
//! identifiers and print their cases.

use std::{path::Path, process::ExitCode, time::Instant};

use wfl_tests::verification::{benchmarks, page};

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let mut results = Vec::new();
    let mut failed = false;
    for benchmark in benchmarks() {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == benchmark.id) {
            continue;
        }
        let begin = Instant::now();
        let cases = (benchmark.run)();
        let bad = cases.iter().filter(|c| !c.passes()).count();
        failed |= cases.is_empty() || (bad > 0 && benchmark.open.is_none());
        let word = if benchmark.open.is_some() { "open" } else { "fail" };
        eprintln!("{}: {} cases, {bad} {word}, {:.1} s", benchmark.id, cases.len(), begin.elapsed().as_secs_f64());
        for case in cases.iter().filter(|c| !c.passes()) {
            eprintln!("  {}", case.describe());
        }
        results.push((benchmark, cases));
    }
    let text = page(&results);
    if wanted.is_empty() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/verification.md");
        if let Err(error) = std::fs::write(&path, text) {
            eprintln!("{}: {error}", path.display());
            return ExitCode::FAILURE;
        }
    } else {
        eprint!("{text}");
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
