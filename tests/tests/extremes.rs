//! Extreme values and bad input: every row of the verification suite holds.

use wfl_tests::{
    side_by_side,
    verification::{assert_holds, benchmarks},
};

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn every_row_of_extreme_input_holds() {
    let ids: Vec<&str> = benchmarks().iter().map(|b| b.id).filter(|id| id.starts_with('X')).collect();
    assert!(ids.len() > 30, "rows have gone: {ids:?}");
    side_by_side(&ids, |id| assert_holds(id));
}
