//! Every scene under `examples/` is solved; what it expects must hold. The expected numbers and their origin stand in
//! the scenes.

use std::path::Path;

use wfl_tests::{doubts, examples as folder, scene_files, solve as solve_text};

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
fn every_example_is_solved_and_its_expectations_hold() {
    let scenes = scene_files();
    assert!(scenes.len() >= 10, "the examples have gone");
    let failures: Vec<String> =
        scenes.iter().filter_map(|s| solve(s).err().map(|e| format!("{}: {e}", s.display()))).collect();
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
