//! A state is a value: whoever goes back to where a run has stood finds the same bits from there, in every scheme.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use proptest::prelude::*;
use wfl_compiler::InterpreterBackend;
use wfl_jit::JitBackend;
use wfl_newton::NewtonError;
use wfl_problem::Scene;
use wfl_run::{Progress, Quiet, RunError, RunOptions, Session, Standing, StepResult};
use wfl_tests::{fuzz::Random, prepared};

/// Steps of a scene that are looked at.
const STEPS: usize = 6;
/// What is done in a run at random: steps, values kept, returns.
const ACTIONS: usize = 24;

/// Scenes with friction, states, rates of both orders, explicit steps, steps that the run chooses, balances of energy.
const SCENES: [(&str, &[(&str, &str)]); 9] = [
    ("fault/nitsche.wfl", &[("cells [8, 8, 8]", "cells [2, 2, 2]")]),
    ("friction/weakening.wfl", &[]),
    ("friction/slider.wfl", &[]),
    ("creep/maxwell.wfl", &[]),
    ("creep/maxwell_auto.wfl", &[]),
    ("dynamics/vibration.wfl", &[]),
    ("dynamics/rod.wfl", &[]),
    ("dynamics/bars.wfl", &[]),
    ("dynamics/column.wfl", &[]),
];

fn scene(path: &str, edits: &[(&str, &str)]) -> Scene {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(path);
    let text = std::fs::read_to_string(&file).expect("an example");
    let backend = JitBackend::new().expect("machine code on this processor");
    let edits: Vec<(&str, String)> = edits.iter().map(|(from, to)| (*from, (*to).to_owned())).collect();
    prepared(file.parent().unwrap_or(Path::new(".")), text, &edits, &[], &backend).expect("a scene")
}

fn session(scene: &Scene) -> Session {
    Session::new(scene, RunOptions { keep_states: true, ..RunOptions::without_files(1, Instant::now()) })
        .expect("a start")
}

/// The numbers of a step, to be compared bit by bit.
fn numbers(step: &StepResult) -> (u64, Vec<u64>, String) {
    let bits = step.state.iter().map(|x| x.to_bits()).collect();
    (step.window.end.to_bits(), bits, format!("{:?} {:?} {:?}", step.measures, step.friction, step.series))
}

fn stands(session: &mut Session, scene: &Scene) -> Standing {
    session.standing(scene).expect("no step was begun")
}

/// Goes through a run with returns at random.
fn wander(scene: &Scene, seed: u64) -> Result<(), TestCaseError> {
    let mut random = Random(seed);
    let mut whole = session(scene);
    let mut known = Vec::new();
    while known.len() < STEPS {
        match whole.step(scene, &mut Quiet).expect("a step") {
            Some(step) => known.push(numbers(step)),
            None => break,
        }
    }
    let mut other = session(scene);
    let mut kept: Vec<Standing> = vec![stands(&mut other, scene)];
    for _ in 0..ACTIONS {
        match random.below(5) {
            0 => kept.push(stands(&mut other, scene)),
            1 => {
                let n = random.below(kept.len());
                let to = kept[n].clone();
                other.go_back(scene, &to, &mut Quiet).expect("it has stood there");
                let here = stands(&mut other, scene);
                prop_assert_eq!(here.state(), to.state());
                prop_assert_eq!(other.steps().len(), to.n_steps());
            }
            2 if kept.len() > 1 => drop(kept.swap_remove(random.below(kept.len()))),
            3 if scene.explicit.is_none() => {
                let here = stands(&mut other, scene);
                begin(scene, &mut other, &mut random)?;
                let n = other.steps().len();
                if n < known.len() {
                    let step = other.step(scene, &mut Quiet).expect("a step").expect("one is left");
                    prop_assert!(numbers(step) == known[n], "step {} differs behind one that was left", n);
                } else {
                    other.go_back(scene, &here, &mut Quiet).expect("it has stood there");
                }
            }
            _ if other.steps().len() < known.len() => {
                let n = other.steps().len();
                let step = other.step(scene, &mut Quiet).expect("a step").expect("one is left");
                prop_assert!(numbers(step) == known[n], "step {} differs", n);
            }
            _ => {}
        }
    }
    Ok(())
}

/// Begins steps to any values; of some what is found is no state.
fn begin(scene: &Scene, session: &mut Session, random: &mut Random) -> Result<(), TestCaseError> {
    let here = stands(session, scene);
    let from = session.steps().last().map_or(scene.steps.first(), |last| last.window.end);
    let span = scene.steps.last() - scene.steps.first();
    for part in [1e-3, 0.03, 0.2].iter().take(1 + random.below(3)) {
        let mut u = session.begin(scene, from + part * span).expect("a step").to_vec();
        prop_assert!(session.stands() && session.residual(&u).is_ok());
        if random.below(3) == 0 {
            u[0] = f64::NAN;
            prop_assert!(session.accept(scene, &u, &mut Quiet).is_err());
            prop_assert!(!session.stands());
            let there = stands(session, scene);
            prop_assert_eq!(there.state(), here.state());
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3, ..ProptestConfig::default() })]

    #[test]
    fn a_run_that_goes_back_has_the_bits_of_one_that_never_did(seed: u64) {
        for (path, edits) in SCENES {
            let scene = scene(path, edits);
            wander(&scene, seed).map_err(|error| TestCaseError::fail(format!("{path}: {error}")))?;
        }
    }
}

#[test]
fn a_state_of_another_scene_is_refused_and_nothing_has_changed() {
    let (a, b) = (scene("creep/maxwell.wfl", &[]), scene("dynamics/rod.wfl", &[]));
    let (mut of_a, mut of_b) = (session(&a), session(&b));
    let start = stands(&mut of_a, &a);
    of_a.step(&a, &mut Quiet).expect("a step");
    let later = stands(&mut of_a, &a);
    of_b.step(&b, &mut Quiet).expect("a step");
    let here = stands(&mut of_b, &b);
    for to in [&start, &later] {
        assert!(matches!(of_b.go_back(&b, to, &mut Quiet), Err(RunError::NotOfThisScene)));
        assert_eq!(stands(&mut of_b, &b).state(), here.state());
    }
}

#[test]
fn within_a_step_a_run_stands_nowhere() {
    let scene = scene("creep/maxwell.wfl", &[]);
    let mut session = session(&scene);
    let start = stands(&mut session, &scene);
    session.begin(&scene, 0.5).expect("a step");
    assert!(matches!(session.standing(&scene), Err(RunError::Begun)));
    session.go_back(&scene, &start, &mut Quiet).expect("it has stood there");
    assert!(!session.has_begun());
}

/// A run that went other ways in between, by other increments, has the steps of the way it goes back to.
#[test]
fn the_steps_are_those_of_the_way_that_was_gone() {
    let scene = scene("friction/weakening.wfl", &[]);
    let mut session = session(&scene);
    let way = |session: &mut Session, times: &[f64]| {
        times.iter().map(|t| numbers(session.step_to(&scene, *t, &mut Quiet).expect("a step"))).collect::<Vec<_>>()
    };
    way(&mut session, &[0.0, 0.1]);
    let fork = stands(&mut session, &scene);
    let known = way(&mut session, &[0.2, 0.3]);
    session.go_back(&scene, &fork, &mut Quiet).expect("it has stood there");
    way(&mut session, &[0.2]);
    let first = stands(&mut session, &scene);
    session.go_back(&scene, &fork, &mut Quiet).expect("it has stood there");
    way(&mut session, &[0.5, 0.9]);
    session.go_back(&scene, &first, &mut Quiet).expect("it has stood there");
    assert_eq!(session.steps().iter().map(|s| s.window.end).collect::<Vec<_>>(), [0.0, 0.1, 0.2]);
    assert!(way(&mut session, &[0.3])[0] == known[1]);
}

/// Stops before so many iterations.
struct Patience(usize);

impl Progress for Patience {
    fn stops(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 == 0
    }
}

/// A mass on a spring that hardens so fast that steps are made in parts; energy is summed over the parts.
#[test]
fn a_step_that_is_stopped_in_the_middle_of_its_parts_leaves_nothing() {
    let text = "mesh box [0] to [1] cells [1] segment\nunknown d : scalar global\nscheme newmark energy=1\n\
                steps t = 0 to 3 by 1\nterm mass on global : 1e-3*Dot2_d*Test_d\n\
                term spring on global : (exp(d) - 1)*Test_d\nterm pull on global : -100*t*Test_d\n\
                solver newton with max_iter=9, search=none\nmeasure reached = mean(d) on all\n";
    let made = || prepared(Path::new("."), text.to_owned(), &[], &[], &InterpreterBackend).expect("a scene");
    let scene = made();
    let mut whole = session(&scene);
    let mut known = Vec::new();
    while let Some(step) = whole.step(&scene, &mut Quiet).expect("a step") {
        known.push((numbers(step), step.attempts.len(), step.iterations()));
    }
    assert!(known.iter().any(|(_, attempts, _)| *attempts > 3), "{:?}", known.iter().map(|k| k.1).collect::<Vec<_>>());
    let mut other = session(&scene);
    for (numbers_there, attempts, _) in &known {
        for patience in (1..9 * attempts).step_by(5) {
            let to = stands(&mut other, &scene);
            match other.step(&scene, &mut Patience(patience)) {
                Err(error) => assert!(matches!(error, RunError::Newton { error: NewtonError::Stopped, .. }), "{error}"),
                Ok(_) => other.go_back(&scene, &to, &mut Quiet).expect("it has stood there"),
            }
        }
        let step = other.step(&scene, &mut Quiet).expect("a step").expect("one is left");
        assert!(numbers(step) == *numbers_there, "t = {}", step.window.end);
        assert_eq!(step.attempts.len(), *attempts, "t = {}", step.window.end);
    }
}

#[test]
fn an_explicit_step_that_ends_with_an_error_leaves_nothing() {
    let text = "mesh box [0] to [1] cells [2] segment\nunknown u : scalar\nscheme explicit\nsteps t = 0 to 3 by 0.25\n\
                term mass on all : Dot2_u*Test_u\nterm spring on all : 0.01*(Grad_u.Grad_Test_u)\n\
                term pull on all : -sqrt(1.1 - t)*Test_u\nmeasure end = max(u) on all\n";
    let scene = prepared(Path::new("."), text.to_owned(), &[], &[], &InterpreterBackend).expect("a scene");
    let mut session = session(&scene);
    let mut before = stands(&mut session, &scene);
    while session.step(&scene, &mut Quiet).is_ok_and(|step| step.is_some()) {
        before = stands(&mut session, &scene);
    }
    assert_eq!(before.n_steps(), 5, "the load has no value behind t = 1.1");
    assert_eq!(stands(&mut session, &scene).state(), before.state());
}
