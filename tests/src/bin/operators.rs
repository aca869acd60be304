//! How fast the linear terms of a body are applied without a matrix, beside their matrix and beside what the machine gives.
//!
//! `cargo run --release -p wfl-tests --bin operators [-- NAME]`

use std::io::Write as _;

use wfl_tests::operators::{BODIES, limits, measure};

fn main() -> Result<(), String> {
    let only = std::env::args().nth(1);
    let mut out = std::io::stdout().lock();
    let mut line = |text: String| writeln!(out, "{text}").map_err(|error| error.to_string());
    let machine = limits();
    line(format!(
        "One thread: triad {:.1} GB/s; products and sums {:.1} G/s of single, {:.1} G/s of double precision",
        machine.bandwidth / 1e9,
        machine.single / 1e9,
        machine.double / 1e9
    ))?;
    line(String::new())?;
    line(
        "| body | unknowns | matrix, M/s | of triad | bytes | applied, M/s | single, M/s | of arithmetic | bytes |"
            .to_owned(),
    )?;
    line("|---|---|---|---|---|---|---|---|---|".to_owned())?;
    for body in BODIES.iter().filter(|body| only.as_ref().is_none_or(|name| body.name.contains(name.as_str()))) {
        let found = measure(body)?;
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let n = found.unknowns as f64;
        let stored = format!(
            "| {} | {} | {:.1} | {:.2} | {:.0} |",
            body.name,
            found.unknowns,
            n / found.stored / 1e6,
            found.matrix_bytes / found.stored / machine.bandwidth,
            found.matrix_bytes / n
        );
        let applied = format!(
            " {:.1} | {:.1} | {:.2} | {:.0} |",
            n / found.applied / 1e6,
            n / found.single / 1e6,
            found.operations / found.single / machine.single,
            found.applied_bytes / n
        );
        line(stored + if found.applied.is_finite() { &applied } else { " - | - | - | - |" })?;
    }
    Ok(())
}
