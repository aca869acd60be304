//! The verification suite: numbers WFL computes against numbers it did not make.
//!
//! A [`Benchmark`] solves scenes and returns [`Case`]s, each a list of numbers with what they should be. The tests
//! assert that every case passes; the binary `verification` prints the same cases as `docs/verification.md`. Nothing
//! here decides a tolerance from what was computed: tolerances stand beside the expected numbers.

mod case;
mod common;
mod convergence;
mod cook;
mod crack;
mod damaged;
mod equilibrium;
mod extremes;
mod fault;
mod hertz;
mod invariance;
mod meshes;
mod numerics;
mod page;
mod public;
mod robust;
mod several;
mod signorini;
mod tangents;
mod two_block;

pub use case::{Case, Number, Tolerance};
pub use page::{page, updated};

/// A group of cases with one identifier, as in the table of `docs/verification.md`.
pub struct Benchmark {
    /// Identifier: B1, B2, ... for benchmarks, P1, P2, ... for public cases of other programs, X1, X2, ... for extreme
    /// input.
    pub id: &'static str,
    /// What is compared, in one sentence.
    pub title: &'static str,
    /// Where the expected numbers come from.
    pub origin: &'static str,
    /// Takes more than a few seconds with optimisation: only release builds run it in the tests.
    pub slow: bool,
    /// What is known not to hold yet; the page shows it, the tests tell but do not stop.
    pub open: Option<&'static str>,
    /// Solves the scenes and compares.
    pub run: fn() -> Vec<Case>,
}

/// Every benchmark in the order of the page.
#[must_use]
pub fn benchmarks() -> Vec<Benchmark> {
    let mut list = [
        two_block::BENCHMARKS,
        fault::BENCHMARKS,
        equilibrium::BENCHMARKS,
        crack::BENCHMARKS,
        extremes::BENCHMARKS,
        robust::BENCHMARKS,
        several::BENCHMARKS,
        meshes::BENCHMARKS,
        damaged::BENCHMARKS,
        numerics::BENCHMARKS,
        signorini::BENCHMARKS,
        hertz::BENCHMARKS,
        convergence::BENCHMARKS,
        cook::BENCHMARKS,
        invariance::BENCHMARKS,
        tangents::BENCHMARKS,
        public::BENCHMARKS,
    ]
    .into_iter()
    .flat_map(|list| list.iter())
    .map(|b| Benchmark { ..*b })
    .collect::<Vec<_>>();
    let chapter = |id: &str| "BPX".find(&id[..1]);
    list.sort_by_key(|b| (chapter(b.id), digits(b.id)));
    list
}

/// The number in an identifier.
fn digits(id: &str) -> usize {
    let digits: String = id.chars().skip(1).take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap_or(usize::MAX)
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
            eprintln!("skipped: {id} runs in the release suite (cargo test --release -p wfl-suites)");
            continue;
        }
        let cases = (benchmark.run)();
        assert!(!cases.is_empty(), "{id} compares nothing");
        if let Some(why) = benchmark.open {
            let held = if cases.iter().all(Case::passes) { "holds now: take the note away" } else { "open" };
            eprintln!("{id} {held}: {why}");
            continue;
        }
        let failures: Vec<String> = cases.iter().filter(|c| !c.passes()).map(Case::describe).collect();
        assert!(failures.is_empty(), "{id}:\n{}", failures.join("\n"));
    }
}
