//! Scenes of many steps: matrices of the past and vectors of measures give what evaluations at the points give.

use std::{path::Path, time::Instant};

use wfl_discrete::pruning::Pruning;
use wfl_jit::JitBackend;
use wfl_problem::{Scene, prepare_keeping};
use wfl_run::{Outcome, Quiet, RunOptions, Session, run};
use wfl_tests::{
    ranks::{Holding, Shared, solved},
    script_and_messages,
};

/// What may be different: sums in another order, over the hundred steps of a scene.
const ROUNDING: f64 = 1e-12;

fn scene(text: &str, keep: &[Pruning]) -> Scene {
    let folder = Path::new(".");
    let (script, _, messages) = script_and_messages(folder, text.to_owned(), &[], &[]);
    let backend = JitBackend::new().expect("machine code on this processor");
    let made = prepare_keeping(&script.unwrap_or_else(|| panic!("{messages}")), folder, &backend, keep);
    made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics))
}

fn outcome(scene: &Scene, threads: usize) -> Outcome {
    let options = RunOptions { keep_states: true, ..RunOptions::without_files(threads, Instant::now()) };
    let outcome = run(scene, &options, &mut Quiet).expect("a run");
    assert!(outcome.converged());
    outcome
}

/// The names of the terms whose constants are made by matrices.
fn by_past(scene: &Scene) -> Vec<&str> {
    scene.system.terms_by_past().into_iter().map(|k| scene.terms[k].name.as_str()).collect()
}

/// States and measures of all steps agree with those of evaluations at the points, and the terms by matrices are these.
fn agrees(text: &str, terms: &[&str]) {
    let (with, without) = (scene(text, &[]), scene(text, &[Pruning::Past]));
    assert_eq!(by_past(&with), terms, "{text}");
    assert!(by_past(&without).is_empty());
    let (a, b) = (outcome(&with, 1), outcome(&without, 1));
    let largest = |of: &dyn Fn(usize) -> f64| (0..b.steps.len()).map(of).fold(0.0f64, |m, x| m.max(x.abs()));
    for k in 0..b.steps[0].measures.len() {
        let size = largest(&|n| b.steps[n].measures[k].1);
        for (x, y) in a.steps.iter().zip(&b.steps) {
            let ((name, x), (_, y)) = (&x.measures[k], &y.measures[k]);
            assert!((x - y).abs() <= ROUNDING * size, "{name} = {x:e}, at points {y:e}\n{text}");
        }
    }
    for (k, field) in with.system.fields.iter().enumerate() {
        let Some(range) = with.system.range(k) else { continue };
        let size = b.steps.iter().flat_map(|s| &s.state[range.clone()]).fold(0.0f64, |m, x| m.max(x.abs()));
        for (x, y) in a.steps.iter().zip(&b.steps) {
            let apart = range.clone().map(|d| (x.state[d] - y.state[d]).abs()).fold(0.0f64, f64::max);
            assert!(
                apart <= ROUNDING * size,
                "{} moves by {apart:e} of {size:e} at {}\n{text}",
                field.name,
                x.window.end
            );
        }
    }
}

/// A square that is heated on one side, with a skin that stores heat on another one.
fn heat(rest: &str) -> String {
    format!(
        "wfl 1\nmesh box [0,0] to [1,1] cells [4,4] tri\nregion left = faces where x == 0\nregion right = faces where x == 1\n\
         unknown u : scalar\nstart u = 1 + x\nterm storage on all : (1 + x)*Dot_u*Test_u\n\
         term flux on all : Grad_u.Grad_Test_u\nterm skin on right : 40*(u - Previous_u)*Test_u\n\
         fix u = 1 + sin(30*t) on left\nload u = 0.3 + t on right\nsteps t = 0 to 0.12 by 0.001\n\
         measure heat = integral((1 + x)*u) on all\nmeasure mean = mean(u + y) on right\n\
         measure change = integral(u - Previous_u) on all\nmeasure slope = integral(Grad_u(1)) on all\n\
         measure square = integral(u*u) on all\nmeasure later = integral(u + t) on all\n{rest}"
    )
}

#[test]
fn differences_to_the_past_are_matrices() {
    agrees(&heat(""), &["storage", "skin"]);
    // the trapezoidal rule by hand, with gradients of the past
    let text = heat("").replace("Grad_u.Grad_Test_u", "0.5*(Grad_u + Grad_Previous_u).Grad_Test_u");
    agrees(&text, &["storage", "flux", "skin"]);
}

#[test]
fn coefficients_that_depend_on_the_step_variable_are_not_frozen() {
    let text = heat("").replace("(1 + x)*Dot_u*Test_u", "(1 + 9*t)*Dot_u*Test_u");
    agrees(&text, &["skin"]);
    let text = heat("").replace("storage on all : (1 + x)*Dot_u", "storage on all : Dot_u*(1 + c)");
    let text = text.replace("unknown u : scalar\n", "unknown u : scalar\ndata c : scalar on all = 3*t\n");
    agrees(&text, &["skin"]);
    // a load in the term: its part without the past follows the step variable
    let text = heat("").replace("40*(u - Previous_u)*Test_u", "(40*(u - Previous_u) - sin(20*t))*Test_u");
    agrees(&text, &["storage", "skin"]);
    // a product of the past is none of matrices
    let text = heat("").replace("40*(u - Previous_u)*Test_u", "(40*u - 40*Previous_u*Previous_u/(1 + x))*Test_u");
    agrees(&text, &["storage"]);
}

#[test]
fn a_last_step_of_another_length_has_matrices_of_its_own() {
    agrees(&heat("").replace("0 to 0.12 by", "0 to 0.1204 by"), &["storage", "skin"]);
}

/// A plate that is shaken, with damping.
fn plate(rest: &str) -> String {
    format!(
        "wfl 1\nmesh box [0,0] to [2,1] cells [4,2] quad\nregion left = faces where x == 0\nregion right = faces where x == 2\n\
         unknown u : vector Q2\nunknown p : scalar\nstart Dot_u = [0, 0.1*x]\n\
         def stress(v) = 2*Sym(Grad_v) + Div_v*Id(2)\nterm inertia on all : Dot2_u.Test_u\n\
         term stress on all : (stress(u) + 0.01*stress(Dot_u)):Grad_Test_u - p*Div_Test_u\n\
         term volume on all : (0.5*Dot_p + Div_Dot_u)*Test_p\nterm flow on all : 0.1*Grad_p.Grad_Test_p\n\
         fix u = [0.01*sin(9*t), 0] on left\nfix p = 0 on right\nload u = [0, 0.02*t] on right\n\
         steps t = 0 to 1.2 by 0.01\nmeasure tip = mean(u(2)) on right\nmeasure fluid = integral(p + Div_u) on all\n{rest}"
    )
}

#[test]
fn rates_of_every_scheme_are_matrices() {
    for scheme in [
        "bdf2",
        "bdf3",
        "newmark",
        "newmark beta=0.3025 gamma=0.6",
        "hht alpha=-0.1",
        "generalised_alpha rho_inf=0.8",
        "backward_euler",
    ] {
        let terms: &[&str] = match scheme {
            // rates of the pressure and of the volume are differences there: with other rates these stay at the points
            "backward_euler" => &["inertia", "stress", "flow"],
            _ => &["inertia", "stress", "volume", "flow"],
        };
        agrees(&plate(&format!("scheme {scheme}\n")), terms);
    }
}

#[test]
fn equations_that_are_not_linear_keep_matrices_for_their_linear_terms() {
    agrees(&heat("term cubic on all : u^3*Test_u\n"), &["storage", "skin"]);
    agrees(
        &plate("term stiffer on all : 0.3*(u.u)*u.Test_u\nscheme newmark\n"),
        &["inertia", "stress", "volume", "flow"],
    );
    // a state of the points
    let text = heat("state s : scalar on all := s + u\nterm memory on all : (0.1*s + Previous_u)*Test_u\n");
    agrees(&text, &["storage", "skin"]);
}

#[test]
fn few_steps_and_steps_that_the_run_chooses_stay_at_the_points() {
    let few = heat("").replace("0 to 0.12 by 0.001", "0 to 0.12 by 0.01");
    assert!(by_past(&scene(&few, &[])).is_empty());
    let auto = heat("").replace("by 0.001", "by auto");
    assert!(by_past(&scene(&auto, &[])).is_empty());
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn the_bits_are_those_of_any_number_of_threads_and_of_a_run_that_goes_back() {
    for text in [heat(""), plate("scheme newmark\n")] {
        let scene = scene(&text, &[]);
        let (one, two) = (outcome(&scene, 1), outcome(&scene, 2));
        for (a, b) in one.steps.iter().zip(&two.steps) {
            assert_eq!(bits(&a.state), bits(&b.state));
            assert_eq!(a.measures, b.measures);
            assert_eq!(a.accuracy, b.accuracy);
        }
        let options = RunOptions { keep_states: true, ..RunOptions::without_files(1, Instant::now()) };
        let mut session = Session::new(&scene, options).expect("a session");
        let go = |session: &mut Session, steps: usize| {
            for _ in 0..steps {
                session.step(&scene, &mut Quiet).expect("a step").expect("a step is left");
            }
        };
        go(&mut session, 50);
        let standing = session.standing(&scene).expect("between two steps");
        go(&mut session, 7);
        session.go_back(&scene, &standing, &mut Quiet).expect("of this scene");
        go(&mut session, 70);
        for (a, b) in one.steps.iter().zip(session.steps()) {
            assert_eq!(bits(&a.state), bits(&b.state), "{}", a.window.end);
            assert_eq!((&a.measures, &a.accuracy), (&b.measures, &b.accuracy));
        }
    }
}

#[test]
fn ranks_have_the_numbers_of_one_process() {
    // on parts of a mesh first rates of second ones are not solved for
    let cases = [
        (heat(""), &[Holding::Whole, Holding::Parts][..]),
        (heat("scheme bdf2\n"), &[Holding::Whole, Holding::Parts]),
        (plate("scheme newmark\n"), &[Holding::Whole]),
    ];
    for (text, holdings) in cases {
        let shared = Shared::text(Path::new("."), text, &[]);
        let alone = solved(shared.whole());
        for rank in holdings.iter().flat_map(|holding| shared.on_ranks(2, *holding, solved)) {
            for (a, b) in alone.steps.iter().zip(&rank.steps) {
                for ((name, x), (_, y)) in a.measures.iter().zip(&b.measures) {
                    assert!((x - y).abs() <= 1e-11 * x.abs().max(1.0), "{name} = {y:e} of {x:e} at {}", a.window.end);
                }
            }
        }
    }
}

#[test]
fn the_digits_of_steps_between_are_no_more_than_those_that_are_sampled() {
    let scene = scene(&heat(""), &[]);
    let outcome = outcome(&scene, 1);
    let digits = |n: usize| outcome.steps[n].accuracy.as_ref().expect("solved").digits();
    // step 64 is sampled (63 and 127 are counted from 0), its neighbours are not
    assert!((63..=65).all(|n| digits(n) > 12.0) && digits(62) <= digits(63) + 0.1 && digits(64) <= digits(63) + 0.1);
    assert!(digits(62) > digits(63) - 1.5, "{} of {}", digits(62), digits(63));
}
