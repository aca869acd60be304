//! `wfl run --accuracy`: errors against exact solutions and finer runs, demands that cannot be met, wrong values.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

use crate::common::exact_norms;
use serde_json::Value;

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("accuracy_{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn wfl(words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wfl")).current_dir(examples()).args(words).output().expect("wfl runs")
}

/// A run with a wanted accuracy: what it said, its exit code, its report.
fn run(scene: &str, words: &[&str], out: &Path) -> (String, Option<i32>, Value) {
    let place = out.display().to_string();
    let mut all = vec!["run", scene, "--out", &place];
    all.extend(words);
    let ended = wfl(&all);
    let said = String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
    let report = std::fs::read_to_string(out.join("report.json")).unwrap_or_default();
    (said, ended.status.code(), serde_json::from_str(&report).unwrap_or(Value::Null))
}

/// The manufactured contact without its expectations, which hold on one mesh.
fn signorini(out: &Path, more: &str) -> String {
    let text = std::fs::read_to_string(examples().join("signorini/signorini.wfl")).expect("the scene");
    let kept: Vec<&str> = text.lines().filter(|l| !l.starts_with("expect")).collect();
    let path = out.join("scene.wfl");
    std::fs::write(&path, kept.join("\n") + "\n" + more).expect("a file");
    path.display().to_string()
}

/// The true errors of a run of the manufactured contact, L2 and H1: its own integrals against the exact solution.
fn true_errors(report: &Value) -> [f64; 2] {
    let last = report["steps"].as_array().and_then(|s| s.last()).expect("a step");
    let error = |m: &str| last["measures"][m].as_f64().expect("a measure").sqrt();
    let (l2, h1) = exact_norms();
    [error("l2") / l2, error("h1") / h1]
}

#[test]
fn the_true_error_of_the_manufactured_contact_is_at_most_what_was_asked_for() {
    let out = folder("exact");
    let scene = signorini(&out, "");
    for (asked, of) in [(0.1, 1), (0.01, 1), (0.01, 0)] {
        let quantity = ["L2", "H1"][of];
        let words = ["--accuracy", &asked.to_string(), "--of", quantity];
        let (said, code, report) = run(&scene, &words, &out);
        assert_eq!(code, Some(0), "{said}");
        let truth = true_errors(&report)[of];
        assert!(truth <= asked && truth >= 0.05 * asked, "{quantity} {asked}: true error {truth}\n{said}");
        let record = &report["accuracy"];
        assert!(record["reached"] == true && record["quantity"] == quantity, "{record}");
        let estimate = record["estimate"].as_f64().expect("an estimate");
        assert!(truth <= estimate && estimate <= asked, "{truth} {estimate}");
        assert!(said.contains("estimated error"), "{said}");
    }
}

#[test]
fn a_scene_can_say_its_accuracy() {
    let out = folder("scene");
    let scene = signorini(&out, "solver newton with accuracy=0.05, of=H1\n");
    let (said, code, report) = run(&scene, &[], &out);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(report["accuracy"]["asked"], 0.05);
    assert!(true_errors(&report)[1] <= 0.05);
    let (said, code, _) = run(&scene, &["--savings"], &out);
    assert!(code == Some(1) && said.contains("--savings and --resume do not go with it"), "{said}");
    let checked = wfl(&["check", &scene]);
    let text = String::from_utf8_lossy(&checked.stdout).into_owned();
    assert!(text.contains("accuracy") && text.contains("0.05"), "{text}");
}

#[test]
fn the_mesh_of_a_demand_is_written_with_the_shares_of_the_error_and_shown_in_the_report() {
    let out = folder("mesh");
    let scene = signorini(&out, "");
    let place = out.join("run");
    let (said, code, report) = run(&scene, &["--accuracy", "1e-2", "--of", "H1"], &place);
    assert_eq!(code, Some(0), "{said}");
    let file = place.join("accuracy_mesh.vtu");
    let text = String::from_utf8_lossy(&std::fs::read(&file).expect("the mesh")).into_owned();
    let cells = report["accuracy"]["cells"].as_u64().expect("cells");
    assert!(text.contains(&format!("NumberOfCells=\"{cells}\"")), "{said}");
    assert!(text.contains("Name=\"share_of_error\"") && text.contains("Name=\"refined\""), "{said}");
    assert!(report["files"].as_array().is_some_and(|f| f.iter().any(|n| n == "accuracy_mesh.vtu")));
    // the exact solution of the scene: its own error measure agrees with the one that is told
    let told = report["accuracy"]["truth"].as_f64().expect("a true error");
    assert!((told / true_errors(&report)[1] - 1.0).abs() < 1e-2, "{told} {:?}", true_errors(&report));
    let page = wfl(&["report", &place.display().to_string()]);
    assert!(page.status.success());
    let page = std::fs::read_to_string(place.join("report.html")).expect("a page");
    assert!(page.contains("Demanded accuracy") && page.contains("Mesh and where its error came from"));
}

#[test]
fn a_file_of_others_under_the_name_of_the_mesh_is_refused_before_the_search() {
    let out = folder("foreign");
    let scene = signorini(&out, "");
    let place = out.join("run");
    std::fs::create_dir_all(&place).expect("a folder");
    std::fs::write(place.join("accuracy_mesh.vtu"), "of others").expect("a file");
    let (said, code, _) = run(&scene, &["--accuracy", "1e-2", "--of", "H1"], &place);
    assert!(code == Some(1) && said.contains("E712") && said.contains("accuracy_mesh.vtu"), "{said}");
    assert!(!said.contains("accuracy: degree"), "the search has begun: {said}");
    assert_eq!(std::fs::read_to_string(place.join("accuracy_mesh.vtu")).expect("it is there"), "of others");
}

#[test]
fn an_exact_solution_that_is_met_or_zero_has_no_ratio_of_errors() {
    let out = folder("met");
    // every space has the first one, and of the second no error is relative
    for (exact, source, code) in [("X(1) + 2*X(2)", "0", 0), ("0*X(1)", "0", 4)] {
        let text = format!(
            "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : scalar\ndef exact_u = {exact}\n\
             term a on all : Grad_u.Grad_Test_u\nload u = {source} on all\nfix u = exact_u on boundary\n\
             output vtk \"u\" : u\n"
        );
        let scene = out.join("scene.wfl");
        std::fs::write(&scene, text).expect("a file");
        let place = out.join("run");
        let (said, ended, report) = run(&scene.display().to_string(), &["--accuracy", "1e-2", "--of", "H1"], &place);
        assert_eq!(ended, Some(code), "{exact}: {said}");
        for word in ["inf", "NaN", "nan"] {
            assert!(!said.contains(word), "{exact}: {said}");
        }
        assert!(report["accuracy"]["truth"].is_null() || report["accuracy"]["truth"].as_f64() < Some(1e-12), "{said}");
        let page = wfl(&["report", &place.display().to_string()]);
        assert!(page.status.success(), "{}", String::from_utf8_lossy(&page.stderr));
        let page = std::fs::read_to_string(place.join("report.html")).expect("a page");
        assert!(!page.contains("inf times") && !page.contains("NaN"), "{exact}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn the_same_demand_gives_the_same_mesh_and_the_same_bits() {
    let out = folder("again");
    let scene = signorini(&out, "");
    let words = ["--accuracy", "0.002", "--of", "H1"];
    let (said, code, first) = run(&scene, &words, &out);
    assert_eq!(code, Some(0), "{said}");
    let more = [&words[..], &["--threads", "1"]].concat();
    let (said, code, again) = run(&scene, &more, &out);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(true_errors(&again), true_errors(&first), "{said}");
    assert_eq!((&again["dofs"], &again["accuracy"]["cells"]), (&first["dofs"], &first["accuracy"]["cells"]));
    // the mesh of its report is one that any run can have
    let words: Vec<String> = again["accuracy"]["picked"]
        .as_array()
        .expect("knobs")
        .iter()
        .map(|k| format!("{}={}", k[0].as_str().expect("a name"), k[1].as_str().expect("a value")))
        .collect();
    let marks = out.join("report.json").display().to_string();
    std::fs::copy(&marks, out.join("marks.json")).expect("a copy");
    let marks = format!("marks={}", out.join("marks.json").display());
    let words: Vec<&str> = words.iter().map(String::as_str).chain([marks.as_str()]).collect();
    let (said, code, third) = run(&scene, &words, &out);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(true_errors(&third), true_errors(&first), "{said}");
    // and its own report says it again, so that a second run into the same folder has it, too
    let own = format!("marks={}", out.join("report.json").display());
    let words: Vec<&str> = words.iter().copied().filter(|w| !w.starts_with("marks=")).chain([own.as_str()]).collect();
    for _ in 0..2 {
        let (said, code, again) = run(&scene, &words, &out);
        assert_eq!((code, true_errors(&again)), (Some(0), true_errors(&first)), "{said}");
    }
    let (said, code, _) = run(&scene, &["cells=[1,1]", &marks], &out);
    assert!(code == Some(1) && said.contains("of another mesh"), "{said}");
    // knobs are what an accuracy picks, and a word that means nothing is told
    for (words, needs) in [
        (["degree=2", "--accuracy=0.1"], "cannot be given, too"),
        (["degree=zero", "-q"], "is no value of knob `degree`"),
        (["tol=abc", "-q"], "`abc` is no value of knob `tol`: a number from 0 to 0.1"),
        (["tol=-1", "-q"], "is no value of knob `tol`"),
        (["degre=2", "-q"], "degre"),
    ] {
        let (said, code, _) = run(&scene, &words, &out);
        assert!(code == Some(1) && said.contains(needs), "{words:?}: {said}");
    }
}

#[test]
fn an_expectation_of_the_own_mesh_may_fail_and_that_is_told() {
    let out = folder("expect");
    let scene = signorini(&out, "expect h1 < 0\n");
    let (said, code, report) = run(&scene, &["--accuracy", "0.1", "--of", "H1"], &out);
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("which was picked for the accuracy, not on the mesh of the scene"), "{said}");
    assert_eq!(report["accuracy"]["reached"], true);
}

#[test]
fn what_cannot_be_had_in_time_is_told_and_the_best_is_kept() {
    let out = folder("budget");
    let scene = signorini(&out, "");
    let (said, code, report) = run(&scene, &["--accuracy", "1e-4", "--of", "H1", "--budget", "0.1"], &out);
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("E605") && said.contains("the budget of 0.1 s"), "{said}");
    let record = &report["accuracy"];
    // where no second mesh has confirmed an estimate there is none
    let estimate = record["estimate"].as_f64().unwrap_or(f64::INFINITY);
    assert!(record["reached"] == false && true_errors(&report)[1] <= estimate, "{record}");
}

#[test]
fn a_mesh_from_a_file_is_refined_too() {
    let out = folder("file");
    // its expectations hold where the faces of one body are parts of those of the other
    let text = std::fs::read_to_string(examples().join("mapping/pressed.wfl")).expect("the scene");
    let mesh = text.lines().find_map(|l| l.strip_prefix("mesh file \"")?.split('"').next()).expect("its mesh");
    std::fs::copy(examples().join("mapping").join(mesh), out.join(mesh)).expect("a copy");
    let kept: Vec<&str> = text.lines().filter(|l| !l.starts_with("expect")).collect();
    std::fs::write(out.join("scene.wfl"), kept.join("\n")).expect("a file");
    let scene = out.join("scene.wfl").display().to_string();
    let (said, code, report) = run(&scene, &["--accuracy", "0.1"], &out.join("run"));
    assert_eq!(code, Some(0), "{said}");
    assert!(report["accuracy"]["reached"] == true && report["accuracy"]["rounds"].as_u64() > Some(0), "{said}");
}

#[test]
fn a_nodal_rule_of_quadratic_elements_has_a_richer_rule() {
    let out = folder("nodal");
    let scene = out.join("crack.wfl");
    let _ = std::fs::remove_file(&scene);
    let place = scene.display().to_string();
    assert!(wfl(&["new", "crack", &place]).status.success());
    let text = std::fs::read_to_string(&scene).expect("a scene").replace("cells [36,36]", "cells [12,12]");
    let kept: Vec<&str> = text.lines().filter(|l| !l.starts_with("expect")).collect();
    std::fs::write(&scene, kept.join("\n")).expect("a file");
    let (said, code, report) = run(&place, &["--accuracy", "0.03", "--of", "opening"], &out.join("run"));
    assert_eq!(code, Some(0), "{said}");
    assert!(report["accuracy"]["reached"] == true, "{said}");
}

#[test]
fn wrong_values_are_refused() {
    let out = folder("wrong");
    let scene = signorini(&out, "");
    for value in ["0", "-1", "2", "much", "nan"] {
        let (said, code, _) = run(&scene, &[&format!("--accuracy={value}")], &out);
        assert_eq!(code, Some(1), "{value}: {said}");
        assert!(said.contains("relative error"), "{value}: {said}");
    }
    for option in ["accuracy=0", "accuracy=-1", "accuracy=2", "accuracy=auto"] {
        let scene = signorini(&out, &format!("solver newton with {option}\n"));
        let (said, code, _) = run(&scene, &[], &out);
        assert!(code == Some(1) && said.contains("E414") && said.contains("relative error"), "{option}: {said}");
    }
    let scene = signorini(&out, "");
    let (said, code, _) = run(&scene, &["--accuracy", "0.1", "--of", "slip"], &out);
    assert!(code == Some(1) && said.contains("no quantity `slip`") && said.contains("pressure"), "{said}");
}

/// A measure of the last step of a run.
fn measure(report: &Value, name: &str) -> f64 {
    let last = report["steps"].as_array().and_then(|s| s.last()).expect("a step");
    last["measures"][name].as_f64().expect("a measure")
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn the_true_error_of_fault_and_crack_is_at_most_what_was_asked_for() {
    let cases = [
        ("fault/nitsche.wfl", "Fn", "fault/nitsche.wfl", ["degree=2", "refine=1", "tol=1e-9"]),
        ("fault/penalty.wfl", "Fn", "fault/nitsche.wfl", ["degree=2", "refine=1", "tol=1e-9"]),
        ("crack/compression.wfl", "slip_area", "crack/compression.wfl", ["degree=2", "refine=2", "tol=1e-9"]),
    ];
    for (scene, of, other, finer) in cases {
        let out = folder(&format!("truth_{}", scene.replace(['/', '.'], "_")));
        let (said, code, reference) = run(other, &finer, &out);
        assert!(code == Some(0) || code == Some(3), "{said}");
        for asked in [0.1, 0.01] {
            let (said, code, report) = run(scene, &["--accuracy", &asked.to_string(), "--of", of, "--coarsest"], &out);
            assert!(code == Some(0) || code == Some(3), "{said}");
            let truth = (measure(&report, of) / measure(&reference, of) - 1.0).abs();
            assert!(truth <= asked && report["accuracy"]["reached"] == true, "{scene} {asked}: {truth}\n{said}");
        }
    }
}
