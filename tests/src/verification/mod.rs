//! The verification suite: numbers WFL computes against numbers it did not make.
//!
//! A [`Benchmark`] solves scenes and returns [`Case`]s, each a list of numbers with what they should be. The tests
//! assert that every case passes; the binary `verification` prints the same cases as `docs/verification.md`. Nothing
//! here decides a tolerance from what was computed: tolerances stand beside the expected numbers.

mod case;
mod common;
mod convergence;
mod cook;
mod hertz;
mod invariance;
mod page;
mod signorini;
mod tangents;

pub use case::{Case, Number, Tolerance};
pub use page::page;

/// A group of cases with one identifier, as in the table of `docs/verification.md`.
pub struct Benchmark {
    /// Identifier: B1, B2, ... for benchmarks, X1, X2, ... for extreme input.
    pub id: &'static str,
    /// What is compared, in one sentence.
    pub title: &'static str,
    /// Where the expected numbers come from.
    pub origin: &'static str,
    /// Takes more than a few seconds with optimisation: only release builds run it in the tests.
    pub slow: bool,
    /// Solves the scenes and compares.
    pub run: fn() -> Vec<Case>,
}

/// Every benchmark in the order of the page.
#[must_use]
pub fn benchmarks() -> Vec<Benchmark> {
    [
        signorini::BENCHMARKS,
        hertz::BENCHMARKS,
        convergence::BENCHMARKS,
        cook::BENCHMARKS,
        invariance::BENCHMARKS,
        tangents::BENCHMARKS,
    ]
    .into_iter()
    .flat_map(|list| list.iter())
    .map(|b| Benchmark { ..*b })
    .collect()
}

/// Runs the benchmarks of one identifier; panics with every case that fails.
///
/// # Panics
/// If there is no such identifier, or a case fails.
pub fn assert_holds(id: &str) {
    let list: Vec<Benchmark> = benchmarks().into_iter().filter(|b| b.id == id).collect();
    assert!(!list.is_empty(), "no benchmark {id}");
    for benchmark in list {
        if benchmark.slow && cfg!(debug_assertions) {
            eprintln!("skipped: {id} runs in the release suite (cargo test --release -p wfl-tests)");
            continue;
        }
        let cases = (benchmark.run)();
        assert!(!cases.is_empty(), "{id} compares nothing");
        let failures: Vec<String> = cases.iter().filter(|c| !c.passes()).map(Case::describe).collect();
        assert!(failures.is_empty(), "{id}:\n{}", failures.join("\n"));
    }
}
