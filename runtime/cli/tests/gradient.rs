//! `wfl run --gradient` and `wfl verify --gradient`: what is written, told and refused.

mod common;

use common::Folder;
use serde_json::Value;

/// A creeping bar that is pulled: a state, and steps that the run chooses.
const BAR: &str = "wfl 1\nparam E = 3\nparam eta = 2\nmesh box [0] to [1] cells [4] segment\n\
    region left = faces where x == 0\nregion right = faces where x == 1\nunknown u : scalar\n\
    state creep : scalar := creep + timestep*(E/eta)*(Grad_u(1) - creep)\n\
    data k : scalar = E\nterm stress on all : k*(Grad_u(1) - creep)*Grad_Test_u(1)\n\
    fix u = 0 on left\nfix u = t^2 on right\nsteps t = 0 to 1 by 0.25\n\
    measure stress = mean(E*(Grad_u(1) - creep)) on all\n";

fn said(done: &std::process::Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr))
}

#[test]
fn derivatives_stand_beside_the_results() {
    let folder = Folder::new("gradient_files");
    folder.write("bar.wfl", BAR);
    let words = ["run", "bar.wfl", "--gradient", "stress, sum(stress)", "--with", "E,", "eta,", "field", "k"];
    let done = folder.wfl(&words);
    assert!(done.status.success(), "{}", said(&done));
    let out = folder.0.join("out/bar");
    let table = std::fs::read_to_string(out.join("gradient.csv")).expect("a table");
    let head = "stress_by_E,stress_by_eta,sum(stress)_by_E,sum(stress)_by_eta";
    assert_eq!(table.lines().next(), Some(head));
    let report = std::fs::read_to_string(out.join("report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["gradients"][1]["result"], "sum(stress)");
    let by_eta = report["gradients"][0]["by"]["eta"].as_f64().expect("a number");
    let written: f64 =
        table.lines().nth(1).and_then(|l| l.split(',').nth(1)).and_then(|x| x.parse().ok()).expect("one");
    assert_eq!(by_eta.to_bits(), written.to_bits());
    let by_node = std::fs::read_to_string(out.join("gradient_stress_by_k.csv")).expect("a table");
    assert_eq!((by_node.lines().next(), by_node.lines().count()), (Some("x,y,z,stress_by_k(1)"), 6));
    // a run without derivatives leaves none of another one behind
    assert!(folder.wfl(&["run", "bar.wfl"]).status.success());
    assert!(!out.join("gradient.csv").exists() && !out.join("gradient_stress_by_k.csv").exists());
}

#[test]
fn differences_of_runs_go_through_the_steps_that_the_first_run_chose() {
    let folder = Folder::new("gradient_auto");
    let auto = "steps t = 0 to 1 by auto with error=1e-2\nscheme backward_euler\n";
    folder.write("bar.wfl", BAR.replace("steps t = 0 to 1 by 0.25\n", auto));
    let done = folder.wfl(&["verify", "bar.wfl", "--gradient", "stress, mean(stress)", "--with", "E,", "eta"]);
    assert!(done.status.success(), "{}", said(&done));
    assert_eq!(said(&done).matches("stress").count(), 4, "{}", said(&done));
    assert!(!said(&done).contains("rough") && !said(&done).contains("kink"), "{}", said(&done));
    // backward differentiation, of the orders that the first run chose
    let auto = "steps t = 0 to 1 by auto with error=1e-3\nterm drag on all : 0.2*Dot_u*Test_u\n";
    folder.write("bar.wfl", BAR.replace("steps t = 0 to 1 by 0.25\n", auto));
    let done = folder.wfl(&["verify", "bar.wfl", "--gradient", "stress, mean(stress)", "--with", "E,", "eta"]);
    assert!(done.status.success(), "{}", said(&done));
    assert!(!said(&done).contains("rough") && !said(&done).contains("kink"), "{}", said(&done));
}

#[test]
fn what_does_not_go_with_derivatives_is_told_before_the_run() {
    let folder = Folder::new("gradient_refused");
    folder.write("bar.wfl", BAR);
    let refused = |words: &[&str], text: &str| {
        let done = folder.wfl(words);
        assert!(!done.status.success() && said(&done).contains(text), "{words:?}: {}", said(&done));
    };
    let asked = ["run", "bar.wfl", "--gradient", "stress", "--with"];
    refused(&[&asked[..], &["E", "--resume"]].concat(), "does not go with --resume");
    refused(&[&asked[..], &["E=3"]].concat(), "stand before --gradient");
    refused(&[&asked[..], &["eto"]].concat(), "did you mean `eta`");
    refused(&[&asked[..], &["k"]].concat(), "`field k`");
    refused(&["run", "bar.wfl", "--with", "E"], "--gradient");
    refused(&["verify", "bar.wfl", "--gradient", "strain", "--with", "E"], "no measure");
}
