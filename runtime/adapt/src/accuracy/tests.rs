//! The search with known errors and costs: formulas replace the runs.

use wfl_mesh::{
    mesh::{BoxShape, Mesh, generate_box},
    refine::{Mark, Refiner},
};
use wfl_output::{
    Real,
    record::{AccuracyRecord, Rounds},
};

use super::{Cost, Demand, Extent, Guide, Indicator, OfData, Out, Role, Short, Trials, Ways, seek, ways::test_ways};
use crate::knobs::Setting;

/// A made-up scene whose error is known: that of each cell falls with its size, from a corner or everywhere.
struct Law {
    /// Error of a degree on a cell of size 1, and its order.
    errors: [(f64, f64); 3],
    /// Error of a penalty of 1.
    penalty: f64,
    /// Of the estimates of the first meshes nothing is true: both degrees have this error beside.
    common: f64,
    /// The whole scene needs so many cells.
    least: usize,
    /// Error of the boundary.
    polygon: f64,
    seconds: f64,
    clock: f64,
}

/// A solution: an error along each of several directions.
struct Point {
    at: [f64; 5],
    mesh: Mesh,
    dofs: u64,
}

impl Law {
    fn new(errors: [(f64, f64); 3]) -> Self {
        Law { errors, penalty: 0.0, common: 0.0, least: 0, polygon: 0.0, seconds: 1e-6, clock: 0.0 }
    }

    fn smooth() -> Self {
        Self::new([(1.0, 1.0), (0.5, 2.0), (0.2, 3.0)])
    }
}

fn value(setting: &Setting, name: &str) -> f64 {
    setting.iter().find(|s| s.0 == name).and_then(|s| s.1.parse().ok()).unwrap_or(1.0)
}

fn size(mesh: &Mesh) -> f64 {
    (1.0 / mesh.n_cells() as f64).sqrt()
}

impl Trials for Law {
    type Run = Point;

    fn run(&mut self, setting: &Setting, fineness: usize, rounds: &Rounds, extent: Extent) -> Result<Point, String> {
        let mesh = generate_box([0.0; 3], [1.0; 3], [fineness, fineness, 1], 2, BoxShape::Triangle).expect("a mesh");
        let shape = mesh.clone();
        let mut refiner = Refiner::new(mesh, &shape).expect("a mesh");
        for marks in rounds {
            refiner.refine(marks).expect("a mesh");
        }
        let mesh = refiner.into_mesh();
        if extent == Extent::WholeScene && mesh.n_cells() < self.least {
            return Err("a region is empty".to_owned());
        }
        let richer = setting.iter().any(|s| s.0 == "richer");
        let degree = value(setting, "degree") as usize + usize::from(richer);
        let (c, p) = self.errors[degree - 1];
        let mut at = [0.0; 5];
        at[degree - 1] = c * size(&mesh).powf(p);
        at[3] = self.penalty / value(setting, "gamma");
        at[4] = if rounds.is_empty() { self.common } else { 0.0 };
        let dofs = mesh.n_cells() as u64 * (degree * degree) as u64;
        self.clock += self.seconds * dofs as f64;
        Ok(Point { at, mesh, dofs })
    }

    fn rich(&mut self, _: &mut Point, setting: &Setting, fineness: usize, rounds: &Rounds) -> Result<Point, String> {
        self.run(setting, fineness, rounds, Extent::Solution)
    }

    fn data(&self, _: &Point) -> OfData {
        OfData::default()
    }

    fn geometry(&mut self, _: &Point, _: &Setting, _: usize) -> f64 {
        self.polygon
    }

    fn locks(&self, _: &Point) -> bool {
        false
    }

    fn cost(&self, run: &Point) -> Cost {
        let seconds = self.seconds * run.dofs as f64;
        Cost { dofs: run.dofs, seconds, whole: seconds }
    }

    fn mesh<'r>(&self, run: &'r Point) -> &'r Mesh {
        &run.mesh
    }

    fn at_contact(&self, _: &Point, _: &[Mark]) -> bool {
        true
    }

    fn distance(&mut self, run: &Point, from: &Point) -> Result<f64, String> {
        Ok(run.at.iter().zip(&from.at).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt())
    }

    fn indicator(&mut self, run: &Point, _: &Point, _: Guide) -> Result<Indicator, String> {
        Ok(Indicator { parts: vec![[1.0, 0.0, 0.0]; run.mesh.n_cells()], size: None })
    }

    fn tighter(&mut self, _: &mut Point, setting: &Setting, _: usize) -> Result<f64, String> {
        assert!(value(setting, "tol") <= 1e-10);
        Ok(1e-9)
    }

    fn distances(&mut self, _: &Point, _: &Point) -> Vec<(String, f64)> {
        Vec::new()
    }

    fn elapsed(&self) -> f64 {
        self.clock
    }
}

fn ask(law: &mut Law, ways: &Ways, error: f64) -> Result<super::Found<Point>, Out> {
    seek(law, ways, &Demand { error, quantity: "H1".to_owned(), budget: 10.0, from_coarsest: true })
}

fn truth(run: &Point) -> f64 {
    run.at.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn the_true_error_is_below_the_demand_and_not_far() {
    for error in [0.3, 0.1, 0.01, 1e-3] {
        let mut law = Law::smooth();
        let found = ask(&mut law, &test_ways(2, Role::None, 8), error).expect("a run");
        let truth = truth(&found.run);
        assert!(found.record.reached && truth <= error && truth > 0.1 * error, "{error}: {truth}");
        let estimate = found.record.estimate.0;
        assert!(truth <= estimate && estimate <= error, "{truth} {estimate}");
    }
}

#[test]
fn the_degree_of_less_work_is_taken() {
    let degree = |errors| {
        let found = ask(&mut Law::new(errors), &test_ways(2, Role::None, 8), 1e-2).expect("a run");
        value(&found.record.picked, "degree")
    };
    assert_eq!(degree([(1.0, 1.0), (0.5, 2.0), (0.2, 3.0)]), 2.0);
    assert_eq!(degree([(0.02, 1.0), (0.02, 1.0), (0.001, 1.0)]), 1.0);
}

#[test]
fn an_error_that_both_degrees_share_is_found_on_the_next_mesh() {
    let mut law = Law { common: 0.5, ..Law::smooth() };
    let found = ask(&mut law, &test_ways(2, Role::None, 8), 0.3).expect("a run");
    assert!(truth(&found.run) <= 0.3 && found.record.rounds > 0, "{:?}", found.record);
}

#[test]
fn a_penalty_is_raised_until_it_adds_little() {
    let mut law = Law { penalty: 0.5, ..Law::smooth() };
    let found = ask(&mut law, &test_ways(2, Role::Penalty, 8), 1e-2).expect("a run");
    let method = found.run.at[3];
    assert!(found.record.reached && method <= 2e-3 && truth(&found.run) <= 1e-2, "{method}");
}

#[test]
fn the_parameter_of_a_consistent_method_grows_with_the_cells_at_contact() {
    let found = ask(&mut Law::smooth(), &test_ways(2, Role::Consistent, 8), 1e-2).expect("a run");
    let finer = 2f64.powf(found.record.rounds as f64) * 2.0 / 8.0;
    assert_eq!(value(&found.record.picked, "gamma"), finer * 4.0, "{:?}", found.record.picked);
}

#[test]
fn a_budget_ends_the_search_with_the_best_run() {
    let mut law = Law { seconds: 1e-3, ..Law::smooth() };
    let found = ask(&mut law, &test_ways(2, Role::None, 8), 1e-6).expect("a run");
    assert!(matches!(found.short, Some(Short::Budget { .. })) && !found.record.reached);
    let (estimate, truth) = (found.record.estimate.0, truth(&found.run));
    assert!(truth <= estimate && estimate < 0.1 && law.clock < 20.0, "{truth} {estimate} {}", law.clock);
}

#[test]
fn a_scene_that_needs_finer_cells_gets_them() {
    let mut law = Law { least: 500, ..Law::smooth() };
    let found = ask(&mut law, &test_ways(2, Role::None, 8), 0.1).expect("a run");
    assert!(found.record.reached && found.run.mesh.n_cells() >= 500);
}

#[test]
fn an_estimate_is_compared_with_a_true_error_only_where_that_is_a_positive_number() {
    let over = |truth: Option<f64>| {
        let record = AccuracyRecord { estimate: Real(3e-3), truth: truth.map(Real), ..AccuracyRecord::default() };
        record.over_truth()
    };
    assert_eq!(over(Some(1e-3)), Some(3.0));
    for truth in [None, Some(0.0), Some(f64::NAN), Some(f64::INFINITY)] {
        assert_eq!(over(truth), None, "{truth:?}");
    }
}

#[test]
fn a_boundary_that_refinement_keeps_is_named() {
    for (polygon, reached) in [(0.2, false), (1e-3, true)] {
        let mut law = Law { polygon, ..Law::smooth() };
        let found = ask(&mut law, &test_ways(2, Role::None, 8), 0.1).expect("a run");
        assert_eq!(found.record.reached, reached);
        assert_eq!(matches!(found.short, Some(Short::Geometry(_))), !reached);
        assert!(found.record.estimate.0 >= polygon);
    }
}

#[test]
fn the_mesh_of_the_scene_is_the_coarsest_result() {
    let mut law = Law::smooth();
    let demand = Demand { error: 0.3, quantity: "H1".to_owned(), budget: 10.0, from_coarsest: false };
    let found = seek(&mut law, &test_ways(2, Role::None, 16), &demand).expect("a run");
    assert!(found.record.reached && found.run.mesh.n_cells() == 2 * 16 * 16, "{:?}", found.record);
}
