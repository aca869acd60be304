//! The search with known errors and costs: formulas replace the runs.

use super::{
    Cost, Demand, Notice, Out, Role, Trials,
    estimate::{Norm, Step},
    seek,
    ways::test_ways,
};
use crate::knobs::Setting;

/// A made-up scene whose error is known.
struct Law {
    dim: i32,
    /// Error of a degree on one cell, and its order.
    errors: [(f64, f64); 2],
    /// Finenesses that have no solution are the odd ones.
    even: bool,
    /// The whole scene needs at least this fineness.
    least_last: usize,
    /// Error of a penalty of 1.
    penalty: f64,
    runs: Vec<String>,
}

/// A solution: an error along each of three directions.
#[derive(Clone, Debug)]
struct Point {
    at: [f64; 3],
    dofs: u64,
}

impl Law {
    fn new(errors: [(f64, f64); 2]) -> Self {
        Law { dim: 2, errors, even: false, least_last: 0, penalty: 0.0, runs: Vec::new() }
    }
}

fn value(setting: &Setting, name: &str) -> f64 {
    setting.iter().find(|s| s.0 == name).and_then(|s| s.1.parse().ok()).unwrap_or(1.0)
}

impl Trials for Law {
    type Run = Point;

    fn run(&mut self, setting: &Setting, fineness: usize, last: bool) -> Result<Point, String> {
        self.runs.push(format!("{setting:?} {last}"));
        if self.even && !fineness.is_multiple_of(2) || last && fineness < self.least_last {
            return Err("a region is empty".to_owned());
        }
        let degree = value(setting, "degree") as usize;
        let (c, p) = self.errors[degree - 1];
        let k = fineness as f64;
        // errors of degrees point in different directions
        let mut at = [0.0; 3];
        at[degree - 1] = c * k.powf(-p);
        at[2] = self.penalty / value(setting, "gamma");
        let dofs = ((degree * fineness) as f64).powi(self.dim) as u64;
        Ok(Point { at, dofs })
    }

    fn cost(&self, run: &Point) -> Cost {
        let seconds = 1e-6 * run.dofs as f64;
        Cost { dofs: run.dofs, seconds, whole: seconds }
    }

    fn distance(&mut self, run: &Point, from: &Point) -> Result<f64, String> {
        Ok(run.at.iter().zip(&from.at).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt())
    }

    fn tighter(&mut self, _: &mut Point, _: &Setting, _: usize) -> Result<f64, String> {
        Ok(0.0)
    }

    fn distances(&mut self, _: &Point, _: &Point) -> Vec<(String, f64)> {
        Vec::new()
    }
}

fn error(point: &Point) -> f64 {
    point.at.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn demand(error: f64) -> Demand {
    Demand { error, quantity: "L2".to_owned(), budget: 600.0 }
}

#[test]
fn the_order_of_a_power_law_is_found_from_three_levels() {
    for p in [0.5, 1.0, 1.7, 3.0] {
        let e = |k: f64| 2.5 * k.powf(-p);
        for norm in [Norm::Lengths, Norm::Squares] {
            let apart = |a: f64, b: f64| if norm == Norm::Lengths { a - b } else { (a * a - b * b).sqrt() };
            let step = |from: f64, to: f64| Step { from, to, distance: apart(e(from), e(to)) };
            let (first, second) = (step(4.0, 10.0), step(10.0, 17.0));
            assert!((norm.order(first, second) - p).abs() < 1e-9, "{p}");
            assert!((norm.error_behind(second, p) / e(17.0) - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn the_true_error_is_below_the_demand_and_not_far_below() {
    let laws = [
        [(1.0, 2.0), (1.0, 2.0)],
        [(1.0, 1.0), (0.5, 2.0)],
        [(0.7, 0.8), (0.2, 0.8)],
        [(1.0, 2.0), (0.3, 3.0)],
        [(2.0, 1.5), (2.0, 1.5)],
    ];
    for errors in laws {
        for asked in [1e-1, 1e-2, 1e-3] {
            let mut law = Law::new(errors);
            let found = seek(&mut law, &test_ways(2, Role::None, 8), &demand(asked)).expect("a run");
            let truth = error(&found.run);
            assert!(found.record.reached && found.record.estimate.0 <= asked);
            assert!(truth <= found.record.estimate.0, "{errors:?} {asked}: {truth} > {}", found.record.estimate.0);
            let steep = errors.iter().any(|e| e.1 > 2.0);
            assert!(truth >= if steep { 0.03 } else { 0.1 } * asked, "{errors:?} {asked}: {truth}");
        }
    }
}

#[test]
fn meshes_that_do_not_fit_are_passed_over() {
    let mut law = Law::new([(4.0, 1.0), (0.5, 2.0)]);
    (law.even, law.least_last) = (true, 13);
    let found = seek(&mut law, &test_ways(2, Role::None, 14), &demand(0.05)).expect("a run");
    assert_eq!(found.record.picked.iter().find(|p| p.0 == "cells").map(|p| p.1.as_str()), Some("[14,14]"));
    assert!(found.record.reached);
}

#[test]
fn a_penalty_is_raised_until_its_error_is_small() {
    let mut law = Law::new([(1.0, 2.0), (1.0, 2.0)]);
    law.penalty = 0.3;
    let found = seek(&mut law, &test_ways(2, Role::Penalty, 8), &demand(1e-2)).expect("a run");
    assert!(found.record.reached && found.record.method.0 <= 0.2e-2);
    assert!(found.run.at[2] <= 0.2e-2, "{:?}", found.run);
    assert!(error(&found.run) <= 1e-2);
}

#[test]
fn what_would_take_too_long_is_refused_before_it_is_run() {
    let mut law = Law::new([(1.0, 0.5), (0.5, 0.5)]);
    let mut asked = demand(1e-4);
    asked.budget = 1.0;
    let out = seek(&mut law, &test_ways(2, Role::None, 8), &asked).expect_err("too long");
    let Out::OutOfReach { error, within, seconds, .. } = &out else { panic!("{out}") };
    assert!(*seconds > 1.0 && *within > 1e-4 && within <= error);
    assert!(law.runs.iter().all(|r| !r.contains("[16,16]")) && law.runs.len() < 8, "{:?}", law.runs);
}

#[test]
fn the_error_of_a_mesh_that_cannot_be_refined_is_not_claimed() {
    let mut law = Law::new([(1.0, 1.0), (0.5, 2.0)]);
    let mut ways = test_ways(2, Role::None, 1);
    ways.fix();
    let found = seek(&mut law, &ways, &demand(1e-2)).expect("a run");
    assert_eq!(found.notice, Some(Notice::MeshOfFile));
    assert!(!found.record.reached && found.record.estimate.0.is_nan());
}
