//! A run in the hands of its caller: the same bits step by step, own iterations with the equations of a scene, values that
//! the caller gives, contact at points, and a stop on request.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use wfl_compiler::InterpreterBackend;
use wfl_contact::{ContactPoints, PointState, contact_points};
use wfl_discrete::{system::FIXED, window::Window};
use wfl_jit::JitBackend;
use wfl_newton::NewtonError;
use wfl_problem::{Equations, Scene};
use wfl_run::{Outcome, Progress, Quiet, RunError, RunOptions, Session, field_grids, run, save};
use wfl_tests::{Sequence, prepared};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

fn example(path: &str, edits: &[(&str, String)], params: &[(&str, f64)]) -> Scene {
    let file = examples().join(path);
    let text = std::fs::read_to_string(&file).expect("an example");
    let backend = JitBackend::new().expect("machine code on this processor");
    prepared(file.parent().expect("a folder"), text, edits, params, &backend).expect("a scene")
}

fn options() -> RunOptions {
    RunOptions { keep_states: true, ..RunOptions::without_files(2, Instant::now()) }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// Contact on the region of some terms at the end of a run.
fn contact(scene: &Scene, end: &Equations, region: &str, u: &[f64]) -> ContactPoints {
    let terms: Vec<usize> = (0..scene.terms.len()).filter(|k| scene.terms[*k].place == region).collect();
    contact_points(&end.system, &end.contact, u, &terms).expect("a law of contact")
}

/// The slipping fault with so many cells along each edge.
fn fault(n: usize) -> Scene {
    example("fault/nitsche.wfl", &[("cells [8, 8, 8]", format!("cells [{n}, {n}, {n}]"))], &[])
}

#[test]
fn steps_one_by_one_have_the_bits_of_a_run() {
    let weakening = || example("friction/weakening.wfl", &[], &[]);
    let maxwell = || example("creep/maxwell.wfl", &[], &[]);
    let fault = || fault(2);
    let makers: [(&str, &dyn Fn() -> Scene); 3] = [("weakening", &weakening), ("maxwell", &maxwell), ("fault", &fault)];
    for (name, made) in makers {
        let whole = made();
        let outcome = run(&whole, &options(), &mut Quiet).expect("a run");
        let scene = made();
        let mut session = Session::new(&scene, options()).expect("a start");
        let mut n = 0;
        while let Some(step) = session.step(&scene, &mut Quiet).expect("a step") {
            let known = &outcome.steps[n];
            assert_eq!(
                (step.window.end, bits(&step.state)),
                (known.window.end, bits(&known.state)),
                "{name}: step {n}"
            );
            assert_eq!(format!("{:?}", step.measures), format!("{:?}", known.measures), "{name}: step {n}");
            n += 1;
        }
        assert_eq!(n, outcome.steps.len());
        let ended = session.outcome(&scene);
        let holds = |o: &Outcome| o.expectations.iter().map(|(_, holds)| *holds).collect::<Vec<_>>();
        assert!(ended.converged() && holds(&ended) == holds(&outcome), "{name}");
        // nothing of a run is left to the next one of the same scene
        let again = run(&whole, &options(), &mut Quiet).expect("a run");
        for (a, b) in again.steps.iter().zip(&outcome.steps) {
            assert_eq!(bits(&a.state), bits(&b.state), "{name}: again, t = {}", a.window.end);
        }
        // values that the caller chooses are solved as those of the scene
        let scene = made();
        let mut session = Session::new(&scene, options()).expect("a start");
        for known in outcome.steps.iter().take(4) {
            let step = session.step_to(&scene, known.window.end, &mut Quiet).expect("a step");
            assert_eq!(bits(&step.state), bits(&known.state), "{name}: t = {}", known.window.end);
        }
    }
}

/// Solves K x = r with a dense factor.
fn solved(matrix: &wfl_sparse::csr::Csr, r: &[f64]) -> Vec<f64> {
    let n = r.len();
    let mut a = vec![vec![0.0; n + 1]; n];
    for (i, row) in a.iter_mut().enumerate() {
        let (columns, values) = matrix.row(i);
        columns.iter().zip(values).for_each(|(c, v)| row[*c as usize] = *v);
        row[n] = r[i];
    }
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).expect("a row");
        a.swap(k, pivot);
        let own = a[k].clone();
        for row in a.iter_mut().skip(k + 1) {
            let factor = row[k] / own[k];
            (k..=n).for_each(|c| row[c] -= factor * own[c]);
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        x[k] = (a[k][n] - (k + 1..n).map(|c| a[k][c] * x[c]).sum::<f64>()) / a[k][k];
    }
    x
}

#[test]
fn an_own_newton_iteration_in_an_own_loop_over_time_finds_what_a_run_finds() {
    for path in ["creep/maxwell.wfl", "elasticity/rollers.wfl", "hyperelastic/contact.wfl", "plasticity/perzyna.wfl"] {
        let whole = example(path, &[], &[]);
        let outcome = run(&whole, &options(), &mut Quiet).expect("a run");
        let scene = example(path, &[], &[]);
        let mut session = Session::new(&scene, options()).expect("a start");
        for known in &outcome.steps {
            let mut u = session.begin(&scene, known.window.end).expect("a step").to_vec();
            let given = session.steps().is_empty() && scene.steps.from_start;
            for _ in 0..if given { 0 } else { 30 } {
                let r = session.residual(&u).expect("finite");
                let k = session.tangent(&u).expect("finite");
                let correction = solved(&k, &r);
                let from = u.clone();
                scene.system.numbering.advance(&from, &correction, -1.0, &mut u);
                if correction.iter().all(|x| x.abs() < 1e-15) {
                    break;
                }
            }
            let step = session.accept(&scene, &u, &mut Quiet).expect("a state");
            let size = known.state.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let apart = step.state.iter().zip(&known.state).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(apart <= 1e-9 * size, "{path}, t = {}: {apart:e} of {size:e}", known.window.end);
            for ((name, a), (_, b)) in step.measures.iter().zip(&known.measures) {
                assert!((a - b).abs() <= 1e-8 * b.abs() + 1e-12, "{path}, t = {}: {name} {a} {b}", known.window.end);
            }
        }
    }
}

#[test]
fn the_tangent_is_the_derivative_of_the_residual_and_reactions_balance_the_loads() {
    let scene = example("hyperelastic/contact.wfl", &[], &[]);
    let outcome = run(&scene, &options(), &mut Quiet).expect("a run");
    let u = outcome.steps[0].state.clone();
    let mut session = Session::new(&scene, options()).expect("a start");
    session.begin(&scene, 0.0).expect("a step");
    let n = scene.system.numbering.n_free();
    let mut numbers = Sequence(7);
    let d: Vec<f64> = (0..n).map(|_| numbers.number()).collect();
    let at = |part: f64| {
        let mut moved = u.clone();
        scene.system.numbering.advance(&u, &d, part, &mut moved);
        session.residual(&moved).expect("finite")
    };
    let step = 1e-6;
    let (ahead, behind) = (at(step), at(-step));
    let tangent = session.tangent(&u).expect("finite");
    let mut kd = vec![0.0; n];
    tangent.multiply(&d, &mut kd, 1);
    let size = kd.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for i in 0..n {
        let slope = (ahead[i] - behind[i]) / (2.0 * step);
        assert!((slope - kd[i]).abs() < 1e-6 * size, "{i}: {slope} and {}", kd[i]);
    }
    // at a solution all that is left are reactions
    let forces = session.forces(&u).expect("finite");
    let largest = |free: bool| {
        let own = forces.iter().zip(&scene.system.numbering.free).filter(|(_, f)| (**f != FIXED) == free);
        own.fold(0.0f64, |m, (x, _)| m.max(x.abs()))
    };
    assert!(largest(true) < 1e-8 * largest(false), "{} beside {}", largest(true), largest(false));
}

#[test]
fn contact_at_points_sums_up_to_the_measured_forces_and_keeps_the_conditions_of_signorini() {
    let scene = fault(4);
    let outcome = run(&scene, &options(), &mut Quiet).expect("a run");
    let step = outcome.steps.last().expect("a step");
    let found = contact(&scene, &outcome.equations, "fault", &step.state);
    let n = found.positions.len();
    let sum = |of: &dyn Fn(usize) -> f64| (0..n).map(|k| found.weights[k] * of(k)).sum::<f64>();
    let measure = |name: &str| step.measures.iter().find(|m| m.0 == name).expect("a measure").1;
    let along = |k: usize, v: &[f64; 3]| (0..3).map(|i| v[i] * found.normals[k][i]).sum::<f64>();
    // the scene measures the traction on the near side, too
    let near = |a: f64, b: f64, name: &str| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{name}: {a} {b}");
    near(sum(&|k| along(k, &found.tractions[k])), measure("Fn"), "Fn");
    let area = sum(&|_| 1.0);
    near(sum(&|k| -found.gaps[k]) / area, measure("opening"), "the mean overlap");
    let length = |v: &[f64; 3]| v.iter().fold(0.0f64, |m, x| m.hypot(*x));
    near((0..n).fold(0.0f64, |m, k| m.max(length(&found.slips[k]))), measure("max_slip"), "the largest slip");
    let counted = [PointState::Open, PointState::Slip, PointState::Stick]
        .map(|s| found.states.iter().filter(|x| **x == s).count());
    let told = step.history.iterations.last().and_then(|i| i.contact).expect("contact");
    assert_eq!(counted, told, "open, slip, stick");
    for k in 0..n {
        let pressure = -along(k, &found.tractions[k]);
        assert!(pressure > -1e-9, "no force pulls: {pressure}");
        assert_eq!(found.states[k] == PointState::Open, pressure.abs() < 1e-12, "open points carry nothing");
    }
}

#[test]
fn gap_and_slip_are_exact_on_a_face_that_is_not_normal_to_an_axis() {
    // a body moved as a whole by (0.3, -0.2) against an inclined face far from it: the gap of a point follows from its
    // motion alone
    let text = "wfl 1\nparam gamma = 10\nmesh box [0,0] to [1,1] cells [3,3] quad map [x - 0.5*y, y + 0.5*x]\n\
        region low = faces where y == 0.5*x - 0.0 or Normal.[0,1] < -10\nregion floor = boundary\nunknown u : vector\n\
        def tang(v) = v - (v.Normal)*Normal\ndef Pn = gamma*(u.Normal - 0.05)\n\
        term bulk on all : 1e-6*Grad_u:Grad_Test_u + 1e6*(u - [0.3,-0.2]).Test_u\n\
        term contact on floor : (1e-9*pos_part(Pn)*Normal + 1e-9*Ball_projection(gamma*tang(u), 0.3*pos_part(Pn))).Test_u\n";
    let text = text.replace("region low = faces where y == 0.5*x - 0.0 or Normal.[0,1] < -10\n", "");
    let scene = prepared(Path::new("."), text, &[], &[], &InterpreterBackend).expect("a scene");
    let outcome = run(&scene, &options(), &mut Quiet).expect("a run");
    let found = contact(&scene, &outcome.equations, "floor", &outcome.steps[0].state);
    let moved = [0.3, -0.2, 0.0];
    for k in 0..found.positions.len() {
        let n = found.normals[k];
        let along: f64 = (0..3).map(|i| moved[i] * n[i]).sum();
        assert!((found.gaps[k] - (0.05 - along)).abs() < 1e-7, "gap {} for {}", found.gaps[k], 0.05 - along);
        for i in 0..3 {
            let slip = moved[i] - along * n[i];
            assert!((found.slips[k][i] - slip).abs() < 1e-7, "slip {:?} for {moved:?} along {n:?}", found.slips[k]);
        }
    }
}

const HEAT: &str = "wfl 1\nmesh box [0,0] to [1,1] cells [6,6] quad\nregion left = faces where x == 0\n\
    data k : scalar = 1 + x*t\nunknown u : scalar\nterm flow on all : k*Grad_u.Grad_Test_u\nfix u = 0 on left\n\
    load u = 1 + y on all\nsteps t = 0 to 1 by 0.25\nmeasure m = mean(u) on all\n";

#[test]
fn data_that_the_caller_gives_are_asked_for_once_a_step_and_give_the_bits_of_the_formula() {
    let made = || prepared(Path::new("."), HEAT.to_owned(), &[], &[], &InterpreterBackend).expect("a scene");
    let known = run(&made(), &options(), &mut Quiet).expect("a run");
    let mut scene = made();
    let asked = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&asked);
    let span = scene.terms[0].span;
    let formula = move |x: &[[f64; 3]], step: Window| {
        count.fetch_add(1, Ordering::Relaxed);
        Some(x.iter().map(|x| 1.0 + x[0] * step.stage).collect())
    };
    scene.give_data("k", span, Box::new(formula)).expect("a data field");
    let given = run(&scene, &options(), &mut Quiet).expect("a run");
    assert_eq!(asked.load(Ordering::Relaxed), 5, "once for each value of t");
    for (a, b) in known.steps.iter().zip(&given.steps) {
        assert_eq!(bits(&a.state), bits(&b.state), "t = {}", a.window.end);
    }
    scene.set_steps(&[0.0, 0.5, 2.0]).expect("values");
    let other = run(&scene, &options(), &mut Quiet).expect("a run");
    assert_eq!(other.steps.iter().map(|s| s.window.end).collect::<Vec<_>>(), [0.0, 0.5, 2.0]);
    let pairs = other.steps[1].state.iter().zip(&known.steps[2].state);
    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-13 * b.abs()), "the same state by another way");
    // a source that fails ends the run before anything is assembled, and names what it was for
    scene.give_data("k", span, Box::new(|_, _| None)).expect("a data field");
    let failed = run(&scene, &options(), &mut Quiet).expect_err("no values");
    assert!(failed.to_string().contains("what the caller gives for `k`"), "{failed}");
    let wrong = scene.give_data("u", span, Box::new(|_, _| None)).expect_err("an unknown");
    assert!(wrong.to_string().contains("given as a start"), "{wrong}");
    assert!(scene.give_data("q", span, Box::new(|_, _| None)).expect_err("no field").to_string().contains("k, u"));
    assert!(scene.set_steps(&[0.0, 1.0, 0.5]).is_err() && scene.set_steps(&[]).is_err());
}

/// Stops after some iterations.
struct Patience(usize);

impl Progress for Patience {
    fn stops(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 == 0
    }
}

#[test]
fn a_run_stops_before_the_next_iteration_and_goes_on_later_with_the_same_bits() {
    let known = run(&fault(2), &options(), &mut Quiet).expect("a run");
    let scene = fault(2);
    let mut session = Session::new(&scene, options()).expect("a start");
    for step in &known.steps {
        let iterations = step.iterations();
        for patience in [1, 2] {
            if patience < iterations {
                let stopped = session.step(&scene, &mut Patience(patience)).expect_err("a stop");
                assert!(matches!(stopped, RunError::Newton { error: NewtonError::Stopped, .. }), "{stopped}");
            }
        }
        let again = session.step(&scene, &mut Quiet).expect("a step").expect("one is left");
        assert_eq!(bits(&again.state), bits(&step.state), "t = {}", step.window.end);
    }
}

#[test]
fn the_grids_of_the_fields_have_their_values_at_their_nodes() {
    let scene = fault(2);
    let outcome = run(&scene, &options(), &mut Quiet).expect("a run");
    let u = &outcome.steps.last().expect("a step").state;
    let grids = field_grids(&scene, outcome.equations.system.data(), u).expect("grids");
    assert_eq!(grids.len(), 2, "two bodies");
    for (grid, name) in grids.iter().zip(["uL", "uR"]) {
        assert_eq!(grid.point_data.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), [name]);
        let field = scene.system.fields.iter().position(|f| f.name == name).expect("a field");
        let own = &u[scene.system.range(field).expect("an unknown")];
        for (k, x) in grid.points.iter().enumerate() {
            let f = &scene.system.fields[field];
            let node = (0..f.n_nodes()).find(|n| f.node_position(*n) == *x).expect("a node of the field");
            assert_eq!(bits(&grid.point_data[0].values[3 * k..][..3]), bits(&own[3 * node..][..3]));
        }
    }
}

#[test]
fn a_run_without_files_can_be_saved_and_has_the_pages_of_one_with_files() {
    let folder = std::env::temp_dir().join(format!("wfl-session-{}", std::process::id()));
    let scene = example("friction/weakening.wfl", &[], &[]);
    let kept = RunOptions { keep_outputs: (0..9).collect(), name: "weakening".to_owned(), ..options() };
    let outcome = run(&scene, &kept, &mut Quiet).expect("a run");
    assert_eq!(outcome.kept.iter().map(|s| s.number).collect::<Vec<_>>(), (0..9).collect::<Vec<_>>());
    save(&scene, &kept, &outcome, &folder).expect("a folder");
    let saved = wfl_report::RunFolder::read(&folder).expect("a run");
    let pages = wfl_report::Pages::new(&saved, &[]).expect("pages");
    let direct = folder.join("direct");
    let scene = example("friction/weakening.wfl", &[], &[]);
    let files = RunOptions { out: Some(direct.clone()), name: "weakening".to_owned(), ..options() };
    run(&scene, &files, &mut Quiet).expect("a run");
    let of_files = wfl_report::Pages::new(&wfl_report::RunFolder::read(&direct).expect("a run"), &[]).expect("pages");
    let names = |p: &wfl_report::Pages| p.pictures.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&pages), names(&of_files));
    assert!(pages.pictures.len() > 5);
    drop(saved);
    std::fs::remove_dir_all(&folder).expect("the folder is ours");
}
