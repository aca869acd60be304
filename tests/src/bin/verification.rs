//! Runs the verification suite and writes `docs/verification.md`. Names after the command run only those
//! identifiers; the rest of the page stays as it is.

use std::{path::Path, process::ExitCode, time::Instant};

use wfl_tests::verification::{benchmarks, page, updated};

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
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/verification.md");
    let text = if wanted.is_empty() {
        page(&results)
    } else {
        let order: Vec<&str> = benchmarks().iter().map(|b| b.id).collect();
        updated(&std::fs::read_to_string(&path).unwrap_or_default(), &order, &results)
    };
    if let Err(error) = std::fs::write(&path, text) {
        eprintln!("{}: {error}", path.display());
        return ExitCode::FAILURE;
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
