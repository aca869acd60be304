//! The gradient of a measure in any number of parameters takes at most as long as its run.

use wfl_tests::gradient_cost::{CASES, cost};

/// Runs with the gradient, the run included, over runs alone: what the pages promise.
const MOST: f64 = 2.0;

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn a_run_with_a_gradient_takes_at_most_two_runs() {
    // the fault of 16 cells a side takes minutes, and has the ratio of that of 8
    for case in CASES.iter().filter(|case| case.name != "fault 16") {
        let of = cost(case);
        assert!(of.ratio <= MOST, "{}: {:.2} s and {:.2} s, ratio {:.2}", case.name, of.alone, of.both, of.ratio);
    }
}
