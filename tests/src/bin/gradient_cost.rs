//! What derivatives cost beside their run, printed: [`wfl_tests::gradient_cost`].
//!
//! `cargo run --release -p wfl-tests --bin gradient_cost [-- NAME]`

use std::io::Write as _;

use wfl_tests::gradient_cost::{CASES, cost};

fn main() {
    let only = std::env::args().nth(1);
    let mut out = std::io::stderr().lock();
    for case in CASES.iter().filter(|c| only.as_ref().is_none_or(|name| c.name.contains(name.as_str()))) {
        let of = cost(case);
        #[expect(clippy::cast_precision_loss, reason = "megabytes")]
        let megabytes = of.bytes as f64 / 1e6;
        let _ = writeln!(
            out,
            "{}: run {:.2} s, with the gradient of {} in {} {:.2} s, ratio {:.2}; {} steps in {megabytes:.1} MB, {} solutions, \
             {} factors",
            case.name, of.alone, case.result, case.with, of.both, of.ratio, of.steps, of.solutions, of.factors,
        );
    }
}
