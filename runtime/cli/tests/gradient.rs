//! `wfl run --gradient` and `wfl verify --gradient`: what is written, told and refused.

use crate::common::Folder;
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

/// A bar that is pulled until the friction at its left end is all that there is: the slip is `max(0, drive - bound)`.
const ONSET: &str = "wfl 1\nparam drive = 0.4\nparam bound = 0.4\nmesh box [0] to [1] cells [4] segment\n\
    region wall = faces where x == 0\nregion end = faces where x == 1\nunknown u : scalar\n\
    multiplier tau : scalar on wall\nterm bulk on all : Grad_u.Grad_Test_u\nterm hold on wall : tau*Test_u\n\
    term law on wall : -1/8*(tau - Ball_projection(tau + 8*u, bound))*Test_tau\nfix u = drive on end\n\
    measure slip = value(u) at [0]\n";

#[test]
fn both_sides_of_a_kink_stand_in_table_files_and_beside_differences() {
    let folder = Folder::new("gradient_sides");
    folder.write("onset.wfl", ONSET);
    let asked = ["--gradient", "slip", "--with", "drive, bound", "--one-sided", "drive,-bound"];
    let done = folder.wfl(&[&["run", "onset.wfl"], &asked[..]].concat());
    assert!(done.status.success() && said(&done).contains("to larger values"), "{}", said(&done));
    let out = folder.0.join("out/onset");
    let table = std::fs::read_to_string(out.join("gradient.csv")).expect("a table");
    let mut lines = table.lines();
    let head = "slip_by_drive,slip_by_bound,slip_by_drive_larger,slip_by_drive_smaller,slip_by_bound_smaller";
    assert_eq!(lines.next(), Some(head));
    let numbers: Vec<f64> = lines.next().expect("a row").split(',').map(|x| x.parse().expect("a number")).collect();
    let expected = [1.0, 0.0, -1.0];
    assert!(numbers[2..].iter().zip(expected).all(|(x, closed)| (x - closed).abs() < 1e-12), "{numbers:?}");
    let report = std::fs::read_to_string(out.join("report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let by = &report["gradients"][0];
    assert!((by["by_larger"]["drive"].as_f64().expect("a number") - 1.0).abs() < 1e-12, "{by}");
    assert!((by["by_smaller"]["bound"].as_f64().expect("a number") + 1.0).abs() < 1e-12, "{by}");
    assert!(by["by_larger"].get("bound").is_none(), "{by}");
    let both = ["--gradient", "slip", "--with", "drive", "--one-sided", "drive"];
    let done = folder.wfl(&[&["verify", "onset.wfl"], &both[..]].concat());
    assert!(done.status.success() && said(&done).contains("both sides agree"), "{}", said(&done));
    // the word tells with which side a derivative agrees that is that of one of them
    let done = folder.wfl(&["verify", "onset.wfl", "--gradient", "slip", "--with", "drive"]);
    assert!(done.status.success() && said(&done).contains("a kink"), "{}", said(&done));
    let other = folder.wfl(&["run", "onset.wfl", "--gradient", "slip", "--with", "drive", "--one-sided", "bound"]);
    assert!(!other.status.success() && said(&other).contains("no side of a parameter"), "{}", said(&other));
}

/// A gap that closes exactly is a sum that cancels to rounding, on either side of zero: the slopes to both sides are those of runs on
/// either side, which `wfl verify` makes.
#[test]
fn a_gap_that_closes_to_rounding_has_two_sides() {
    let folder = Folder::new("gradient-closes");
    let scene = |motion: &str, steps: &str| {
        format!(
            "wfl 1\nparam v = 0.5\nparam g0 = 0.05\nparam k = 20\nmesh box [0] to [1] cells [1]\nunknown u : scalar\n\
             term m on all : {motion}*Test_u\nterm c on all : -k*pos_part(-(u + g0))*Test_u\n{steps}measure U = value(u) at [0]\n"
        )
    };
    folder.write("touches.wfl", scene("(u + v/10)", ""));
    folder.write("arrives.wfl", scene("(Dot_u + v)", "steps t = 0 to 0.4 by 0.1\n"));
    for file in ["touches.wfl", "arrives.wfl"] {
        for sided in ["v", "-v"] {
            let more = ["--gradient", "U", "--with", "v"];
            let done = folder.wfl(&[&["verify", file][..], &more, &[&format!("--one-sided={sided}")]].concat());
            assert!(done.status.success() && said(&done).contains("W660"), "{file}, {sided}: {}", said(&done));
        }
    }
}

/// At the tips of a crack both sides are one node: the jump is zero whatever moves, and no branch is another one's neighbour there.
/// Where the faces rest on each other without a force, they may open or close, and that is told.
#[test]
fn the_tips_of_a_crack_are_no_kinks() {
    let folder = Folder::new("gradient-tips");
    let scene = |law: &str, side: &str| {
        format!(
            "wfl 1\nuse \"elasticity\"\nuse \"contact\"\nparam q = 1\nparam L = 2\nmesh box [-2,-2] to [{side},2] cells [8,8] quad\n\
             region low = cells where y < 0\nregion upp = cells where y > 0\n\
             region crack = interface from low to upp & faces of low where y == 0 and abs(x) < 1.01\n\
             region floor = faces where y == -2\nregion top = faces where y == 2\nunknown u : vector\nsplit u across crack\n\
             def p = pos_part(1e6*jump(u,u).Normal)\nterm el on all : work(u, Test_u, 1000, 0.2)\n\
             term con on crack : {law}\nfix u = [0,0] on floor\nload u = [q/5,-q] on top\nmeasure d = min(u(2)) on top\n"
        )
    };
    let press = "p*(Normal.jump(Test_u,Test_u))";
    let rub = "(p*Normal + Ball_projection(1e6*(jump(u,u) - (jump(u,u).Normal)*Normal), 0.9*p)).jump(Test_u,Test_u)";
    for (name, law) in [("press", press), ("rub", rub)] {
        let file = format!("{name}.wfl");
        folder.write(&file, scene(law, "2"));
        let asked = |with: &str, q: &str| {
            let done = folder.wfl(&["run", &file, q, "--threads", "1", "--gradient", "d", "--with", with]);
            assert!(done.status.success(), "{}", said(&done));
            said(&done)
        };
        let closed = asked("q", "q=1");
        assert!(!closed.contains("W660"), "{name}: {closed}");
        let at_rest = asked("q", "q=0");
        assert!(at_rest.contains("6 of 8 points of `con` are between"), "{name}: {at_rest}");
        // the nodes of the mesh move, and both sides of a tip with them
        folder.write(&file, scene(law, "L"));
        let moved = asked("L", "q=1");
        assert!(!moved.contains("of `con` are between"), "{name}: {moved}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn steps_are_computed_again_where_memory_does_not_hold_them_all() {
    let folder = Folder::new("gradient_memory");
    // 2,000 unknowns and as many states by 1,000 steps are 32 MB
    let long = BAR.replace("cells [4]", "cells [2000]").replace("by 0.25", "by 0.001");
    folder.write("bar.wfl", &long);
    let asked = ["run", "bar.wfl", "--gradient", "stress", "--with", "E, eta"];
    let all = folder.wfl(&asked);
    assert!(all.status.success() && !said(&all).contains("computed again"), "{}", said(&all));
    let table = || std::fs::read_to_string(folder.0.join("out/bar/gradient.csv")).expect("a table");
    let known = table();
    let some = folder.wfl(&[&asked[..], &["--memory", "90MB"]].concat());
    assert!(some.status.success() && said(&some).contains("steps computed again"), "{}", said(&some));
    assert_eq!(known, table());
}

/// Nothing is run where a file of derivatives would replace another result, or one of another derivative.
#[test]
fn derivatives_replace_no_other_result() {
    let folder = Folder::new("gradient_names");
    folder.write("bar.wfl", format!("{BAR}output csv \"gradient\" : u at [0.5]\n"));
    let asked = ["run", "bar.wfl", "--gradient", "stress", "--with", "E"];
    let done = folder.wfl(&asked);
    assert!(!done.status.success() && said(&done).contains("E433"), "{}", said(&done));
    assert!(!folder.0.join("out").exists());
    assert!(folder.wfl(&["run", "bar.wfl"]).status.success());
    folder.write("bar.wfl", format!("{BAR}gradient stress with E\noutput csv \"gradient\" : u at [0.5]\n"));
    let done = folder.wfl(&["check", "bar.wfl"]);
    assert!(!done.status.success() && said(&done).contains("E433"), "{}", said(&done));
    let two = BAR.replace("steps t", "measure sum_stress_ = stress + 1\nsteps t");
    folder.write("bar.wfl", two);
    let done = folder.wfl(&["run", "bar.wfl", "--gradient", "sum(stress), sum_stress_", "--with", "field", "k"]);
    assert!(!done.status.success() && said(&done).contains("gradient_sum_stress__by_k.csv"), "{}", said(&done));
}
