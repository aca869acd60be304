//! Every scene under `examples/` is solved; what it expects must hold. The expected numbers and their origin stand in
//! the scenes. The slow ones are solved in the release suite.

use std::{
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use wfl_tests::{doubts, examples as folder, scene_files, solve as solve_text};

/// Examples that take more than three seconds in a release build, and five times as long without: there they are solved.
const SLOW: [&str; 6] = [
    "dynamics/sphere.wfl",
    "dynamics/tpv205.wfl",
    "friction/bp1.wfl",
    "hertz/sphere.wfl",
    "poro/slow_slip.wfl",
    "sliding/gears.wfl",
];

fn solve(scene: &Path) -> Result<(), String> {
    let text = std::fs::read_to_string(scene).map_err(|e| e.to_string())?;
    let outcome = solve_text(scene.parent().expect("a folder"), text, &[], &[])?.outcome;
    if !outcome.converged() {
        return Err("a step did not converge".to_owned());
    }
    if let Some((code, warning)) = doubts(&outcome).first() {
        return Err(format!("false warning {code}: {warning}"));
    }
    for (expect, holds) in &outcome.expectations {
        if *holds != Some(true) {
            return Err(format!("does not hold: {}", expect.text));
        }
    }
    Ok(())
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn every_example_is_solved_and_its_expectations_hold() {
    let mut scenes = scene_files();
    assert!(scenes.len() >= 10, "the examples have gone");
    for slow in SLOW {
        assert!(scenes.iter().any(|scene| scene.ends_with(slow)), "{slow} is no example");
    }
    if cfg!(debug_assertions) {
        scenes.retain(|scene| !SLOW.iter().any(|slow| scene.ends_with(slow)));
    }
    let (next, failures) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || {
        while let Some(scene) = scenes.get(next.fetch_add(1, Ordering::Relaxed)) {
            if let Err(e) = solve(scene) {
                failures.lock().expect("a list").push(format!("{}: {e}", scene.display()));
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    let failures = failures.into_inner().expect("a list");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A scene with numbers must not be satisfied by anything: a wrong number is noticed.
#[test]
fn a_wrong_expectation_is_noticed() {
    let text = std::fs::read_to_string(folder().join("stokes/stokes.wfl")).expect("examples can be read");
    let wrong = text.replace("velocity_error < 1e-12", "velocity_error > 1e-12");
    assert_ne!(text, wrong);
    let folder = std::env::temp_dir().join(format!("wfl-scenes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let path = folder.join("wrong.wfl");
    std::fs::write(&path, wrong).expect("a temporary file");
    let result = solve(&path);
    std::fs::remove_dir_all(&folder).expect("our own folder");
    assert!(result.is_err_and(|e| e.contains("does not hold")));
}
