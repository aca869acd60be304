//! `wfl run` as a user meets it: files written, exit codes, and one clear message for every kind of wrong input.

use std::process::Output;

use crate::common::{Folder, ROUGH_FLOOR};
use serde_json::Value;

/// A scene with a closed form: a bar of modulus E, spring gamma at its end, traction t: end = t/(E + gamma).
const BAR: &str = "wfl 1
param E     = 100 in 1e-12..1e24 \"modulus\"
param gamma = 10  in 1e-12..1e24 \"spring\"
mesh box [0,0] to [1,1] cells [2,2] quad
region west = faces where x == 0
region east = faces where x == 1
unknown u : scalar
term bulk   on all  : E*Grad_u.Grad_Test_u
term spring on east : gamma*u*Test_u
fix u = 0 on west
load u = t on east
steps t = 1 to 3 by 1
measure end = mean(u) on east
output vtk \"bar\" : u
output csv \"line\" : u along [0,0.5] to [1,0.5] with points=5
";

impl Folder {
    /// Names below a folder, in order; none when it is not there.
    fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.join(folder)).into_iter().flatten();
        let mut names: Vec<String> =
            entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    fn report(&self, folder: &str) -> Value {
        let text = std::fs::read_to_string(self.0.join(folder).join("report.json")).expect("a report");
        serde_json::from_str(&text).expect("reports are JSON")
    }
}

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("messages are UTF-8")
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or_else(|| panic!("ended by a signal: {}", said(output)))
}

/// The scene with one text replaced by another that was there.
fn edited(from: &str, to: &str) -> String {
    assert!(BAR.contains(from), "{from}");
    BAR.replace(from, to)
}

/// The first line and column at which `part` stands in a text.
fn place(text: &str, part: &str) -> (usize, usize, String) {
    let (number, line) = text.lines().enumerate().find(|(_, l)| l.contains(part)).expect("the part is in the text");
    (number + 1, line.find(part).expect("found") + 1, line.to_owned())
}

/// Runs a wrong scene: exit code 1, a message with its code, place and source line, and nothing written.
fn refused(name: &str, text: &str, at: &str, code_of_message: &str, words: &[&str]) {
    let folder = Folder::new(name);
    folder.write("scene.wfl", text);
    let output = folder.wfl(&["run", "scene.wfl"]);
    let message = said(&output);
    assert_eq!(code(&output), 1, "{name}: {message}");
    let (line, column, source) = place(text, at);
    let expected = [format!("error[{code_of_message}]"), format!("scene.wfl:{line}:{column}"), source];
    for part in expected.iter().map(String::as_str).chain(words.iter().copied()) {
        assert!(message.contains(part), "{name}: `{part}` is missing in\n{message}");
    }
    assert_eq!(message.matches("error[").count(), 1, "{name}: one mistake, one message\n{message}");
    assert!(output.stdout.is_empty(), "{name}: a refused scene has no summary");
    assert_eq!(folder.names("."), ["scene.wfl"], "{name}: nothing may be written");
}

fn close(found: &Value, expected: f64) {
    let found = found.as_f64().expect("a number");
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} in place of {expected}");
}

#[test]
fn a_run_writes_its_files_and_says_where() {
    let folder = Folder::new("files");
    folder.write("bar.wfl", BAR);
    let output = folder.wfl(&["run", "bar.wfl"]);
    assert_eq!(code(&output), 0, "{}", said(&output));
    let expected = ["bar.pvd", "bar_0000.vtu", "bar_0001.vtu", "bar_0002.vtu"];
    let tables = ["line_0000.csv", "line_0001.csv", "line_0002.csv", "manifest.json", "measures.csv", "report.json"];
    assert_eq!(folder.names("out/bar"), [&expected[..], &tables].concat());
    let summary = String::from_utf8(output.stdout.clone()).expect("UTF-8");
    assert!(summary.contains("3 of 3 steps converged") && summary.contains("out/bar"), "{summary}");
    assert!(said(&output).is_empty(), "no terminal, no progress: {}", said(&output));

    let report = folder.report("out/bar");
    assert_eq!(report["scene"], "bar");
    assert_eq!(report["parameters"]["gamma"], 10.0);
    assert_eq!(report["dofs"], 6, "the fixed side has no unknowns");
    let steps = report["steps"].as_array().expect("steps");
    for (k, step) in steps.iter().enumerate() {
        assert_eq!(step["converged"], true);
        close(&step["t"], k as f64 + 1.0);
        close(&step["measures"]["end"], (k as f64 + 1.0) / 110.0);
    }
    let timings = report["timings"].as_object().expect("timings");
    let keys = ["parse", "compile", "mesh", "assemble", "factor", "solve", "write", "total"];
    for key in keys {
        assert!(timings[key].as_f64().is_some_and(|t| t >= 0.0), "no time for {key}");
    }
    let sum: f64 = keys[..7].iter().map(|k| timings[*k].as_f64().expect("a time")).sum();
    assert!(sum <= timings["total"].as_f64().expect("a time") * 1.001, "the parts of the time exceed the whole");

    let pvd = std::fs::read_to_string(folder.0.join("out/bar/bar.pvd")).expect("a collection");
    for k in 0..3 {
        assert!(
            pvd.contains(&format!("timestep=\"{}.0\"", k + 1)) && pvd.contains(&format!("bar_000{k}.vtu")),
            "{pvd}"
        );
    }
    let table = std::fs::read_to_string(folder.0.join("out/bar/line_0002.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = table.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!((rows.len(), rows[0].as_slice()), (6, ["s", "x", "y", "u"].as_slice()));
    for row in &rows[1..] {
        let value = |k: usize| row[k].parse::<f64>().expect("a number");
        assert!((value(3) - 3.0 / 110.0 * value(1)).abs() < 1e-14, "u = 3 x/110: {row:?}");
    }
}

#[test]
fn parameters_results_folder_and_silence_come_from_the_command_line() {
    let folder = Folder::new("options");
    folder.write("bar.wfl", BAR);
    for (dir, extra) in [("one", vec![]), ("two", vec!["--interpret"]), ("three", vec!["--threads", "1"])] {
        let mut args = vec!["run", "bar.wfl", "gamma=2*50", "E=300", "--out", dir, "-q"];
        args.extend(extra);
        let output = folder.wfl(&args);
        assert_eq!(code(&output), 0, "{}", said(&output));
        assert!(output.stdout.is_empty() && output.stderr.is_empty(), "-q is quiet");
        let report = folder.report(dir);
        close(&report["parameters"]["gamma"], 100.0);
        close(&report["steps"][2]["measures"]["end"], 3.0 / 400.0);
    }
    assert_eq!(folder.names("."), ["bar.wfl", "one", "three", "two"], "nothing beside the asked folder");
    let files = folder.names("one");
    for name in files.iter().filter(|n| *n != "report.json") {
        let read = |dir: &str| std::fs::read(folder.0.join(dir).join(name)).expect("a result");
        assert!(read("one") == read("two"), "{name}: machine code and interpreter differ");
        assert!(read("one") == read("three"), "{name}: the number of threads shows");
    }
}

#[test]
fn a_second_run_replaces_the_results() {
    let folder = Folder::new("again");
    folder.write("bar.wfl", BAR);
    assert_eq!(code(&folder.wfl(&["run", "bar.wfl", "-q"])), 0);
    let first = std::fs::read(folder.0.join("out/bar/line_0000.csv")).expect("a table");
    let names = folder.names("out/bar");
    assert_eq!(code(&folder.wfl(&["run", "bar.wfl", "gamma=100", "-q"])), 0);
    assert_eq!(folder.names("out/bar"), names, "no other names, no temporary files");
    assert_ne!(std::fs::read(folder.0.join("out/bar/line_0000.csv")).expect("a table"), first);
}

#[test]
fn wrong_scenes_are_refused_at_their_place() {
    let text = edited("E*Grad_u.Grad", "E*Grad_v.Grad");
    refused("name", &text, "Grad_v", "E201", &["unknown name `Grad_v`"]);
    let text = edited("on east : gamma", "on eest : gamma");
    refused("region", &text, "eest", "E201", &["did you mean `east`"]);
    let text = edited("E*Grad_u.Grad_Test_u", "E*Grad_u.Test_u");
    refused("shape", &text, "Test_u", "E102", &["vector(2)", "scalar"]);
    let text = edited("faces where x == 1", "faces where x == 2");
    refused("empty", &text, "x == 2", "E402", &["`east` is empty"]);
    let text = edited("E     = 100", "E     = sqrt(-1)");
    refused("nan", &text, "sqrt(-1)", "E702", &["NaN"]);
    for value in ["0.0", "-2.5"] {
        let text = edited("gamma = 10", &format!("gamma = {value}"));
        refused("gamma", &text, value, "E701", &["`gamma`", "1e-12"]);
    }
    let text = edited("mesh box", "use \"missing.wfl\"\nmesh box");
    refused("use", &text, "use \"missing.wfl\"", "E213", &["no such file"]);
    let text = edited("term spring", "term spring!");
    let folder = Folder::new("syntax");
    folder.write("scene.wfl", &text);
    let output = folder.wfl(&["run", "scene.wfl"]);
    assert!(code(&output) == 1 && said(&output).contains("scene.wfl:9:"), "{}", said(&output));
}

#[test]
fn all_mistakes_of_a_file_are_told_in_one_run() {
    let names = edited("on east : gamma", "on eest : gamma").replace("fix u = 0 on west", "fix v = 0 on wast");
    let shapes = edited("E*Grad_u.Grad", "E*Grad_v.Grad").replace("gamma*u*Test_u", "gamma*Grad_u*Test_u");
    for (text, parts) in [(names, ["`eest`", "`wast`"]), (shapes, ["`Grad_v`", "gamma*Grad_u*Test_u"])] {
        let folder = Folder::new("all");
        folder.write("scene.wfl", text);
        let output = folder.wfl(&["run", "scene.wfl"]);
        let message = said(&output);
        assert_eq!(code(&output), 1);
        assert!(parts.iter().all(|p| message.contains(p)), "{parts:?} in\n{message}");
        assert!(message.matches("error[").count() >= 2, "{message}");
    }
}

#[test]
fn wrong_values_on_the_command_line_are_refused() {
    let folder = Folder::new("override");
    folder.write("bar.wfl", BAR);
    let cases = [
        ("gamma=0", "E701", "between"),
        ("gamma=-1", "E701", "between"),
        ("gamma=0/0", "E109", "division by zero"),
        ("gamma=sqrt(-1)", "E702", "NaN"),
        ("gamma=nan", "E216", "nan"),
        ("gamma=1e999", "E120", "1e999"),
        ("gama=1", "E703", "did you mean `gamma`"),
        ("gamma", "E703", "NAME=VALUE"),
        ("gamma=", "E703", "no value"),
    ];
    for (word, expected, part) in cases {
        let output = folder.wfl(&["run", "bar.wfl", word]);
        let message = said(&output);
        assert_eq!(code(&output), 1, "{word}: {message}");
        for part in [&format!("error[{expected}]"), part, "(command line):1:"] {
            assert!(message.contains(part), "{word}: `{part}` is missing in\n{message}");
        }
    }
    assert_eq!(folder.names("."), ["bar.wfl"]);
}

#[test]
fn unreadable_scenes_are_named() {
    let folder = Folder::new("unreadable");
    folder.write("binary.wfl", b"wfl 1\n\xff\xfe\n");
    for (scene, why) in [("missing.wfl", "no such file"), (".", "directory"), ("binary.wfl", "UTF-8")] {
        let output = folder.wfl(&["run", scene]);
        let message = said(&output);
        assert_eq!(code(&output), 1, "{scene}: {message}");
        assert!(message.contains(scene) && message.contains(why), "{scene}: {message}");
    }
    assert_eq!(folder.names("."), ["binary.wfl"]);
}

#[test]
fn a_results_folder_that_cannot_be_is_told_before_solving() {
    let folder = Folder::new("blocked");
    folder.write("bar.wfl", BAR);
    folder.write("file", "not a folder");
    let output = folder.wfl(&["run", "bar.wfl", "--out", "file/results"]);
    let message = said(&output);
    assert_eq!(code(&output), 1, "{message}");
    assert!(message.contains("file/results") && message.contains("output folder"), "{message}");
    assert!(output.stdout.is_empty(), "nothing was solved");
    assert_eq!(std::fs::read_to_string(folder.0.join("file")).expect("still there"), "not a folder");
}

#[test]
fn a_need_above_the_memory_allowed_is_told_before_it_is_taken() {
    let folder = Folder::new("memory");
    // 17 GB of numbers in the mesh; and a mesh that is small beside its factor
    let huge = "wfl 1\nmesh box [0,0,0] to [1,1,1] cells [500,500,500] hex\nunknown u : scalar\nterm on all : Grad_u.Grad_Test_u\nfix u = x on boundary\n";
    folder.write("huge.wfl", huge);
    let factor = huge.replace("500,500,500", "24,24,24");
    folder.write("factor.wfl", format!("{factor}solver linear with direct\n"));
    folder.write("chosen.wfl", &factor);
    for (scene, limits, words) in [
        ("huge.wfl", ["2GB", "2GB"], "the mesh needs about"),
        // a sweep begins with its reference of a higher degree: limits between what the process has come to before the factor, 74 to
        // 89 MB there, and that with the factor
        ("factor.wfl", ["70MB", "105MB"], "the factor of the matrix needs about"),
    ] {
        for (command, limit) in ["run", "sweep"].into_iter().zip(limits) {
            let output = folder.wfl(&[command, scene, "--memory", limit]);
            let told = format!("{}{}", said(&output), String::from_utf8_lossy(&output.stdout));
            let table = std::fs::read_to_string(folder.0.join("out/sweep/sweep.csv")).unwrap_or_default();
            let all = told + &table;
            let words = if command == "run" { words } else { "needs about" };
            assert!(all.contains(words), "{command} {scene}: {all}");
            assert!(command == "sweep" || code(&output) == 1, "{command} {scene}: {all}");
        }
    }
    let output = folder.wfl(&["run", "huge.wfl", "--memory", "2GB"]);
    let message = said(&output);
    for part in ["error[E606]", "huge.wfl:2:", "the limit is 2.0 GB", "--memory 16GB"] {
        assert!(message.contains(part), "`{part}` is missing in\n{message}");
    }
    // not asked for, a factor that does not fit gives way to iterations
    let chosen = folder.wfl(&["run", "chosen.wfl", "-v", "--memory", "72MB"]);
    let told = format!("{}{}", said(&chosen), String::from_utf8_lossy(&chosen.stdout));
    assert!(told.contains("conjugate gradients") && code(&chosen) == 0, "{told}");
    assert!(said(&folder.wfl(&["run", "factor.wfl", "--memory", "much"])).contains("a size with its unit"));
    assert_eq!(code(&folder.wfl(&["run", "factor.wfl", "--memory", "1GB"])), 0);
}

/// Steps before the failure stay whole; the failing one leaves nothing, not even under another name.
#[test]
fn a_number_that_is_not_finite_stops_the_run_at_its_place() {
    let text = edited("bulk   on all  : E", "bulk   on all  : sqrt(2.5-t)*E");
    let folder = Folder::new("late");
    folder.write("scene.wfl", &text);
    let output = folder.wfl(&["run", "scene.wfl"]);
    let message = said(&output);
    assert_eq!(code(&output), 1, "{message}");
    let (line, column, source) = place(&text, "sqrt(2.5-t)");
    let expected =
        ["error[E601]", &format!("scene.wfl:{line}:{column}"), &source, "`bulk`", "t = 3", "-0.5", "position"];
    for part in expected {
        assert!(message.contains(part), "`{part}` is missing in\n{message}");
    }
    // with what the next run goes on from
    let pairs = ["bar_0000.vtu", "bar_0001.vtu", "checkpoint.wflc", "checkpoint_steps.wflc"];
    let names: Vec<&str> = ["bar.pvd"].into_iter().chain(pairs).collect();
    let lines = ["line_0000.csv", "line_0001.csv", "manifest.json", "measures.csv", "report.json"];
    assert_eq!(folder.names("out/scene"), [names, lines.to_vec()].concat());
    let pvd = std::fs::read_to_string(folder.0.join("out/scene/bar.pvd")).expect("a collection");
    assert!(!pvd.contains("bar_0002"), "{pvd}");
}

#[test]
fn a_body_that_nothing_holds_is_named() {
    let text = edited("fix u = 0 on west\n", "").replace("term spring on east : gamma*u*Test_u\n", "");
    let folder = Folder::new("free");
    folder.write("scene.wfl", text);
    let output = folder.wfl(&["run", "scene.wfl"]);
    assert_eq!(code(&output), 1, "{}", said(&output));
    assert!(
        said(&output).contains("error[E602]") && said(&output).contains("`u` is determined up to a constant"),
        "{}",
        said(&output)
    );
    assert_eq!(folder.names("out/scene"), ["manifest.json", "report.json"], "no results of a run without a solution");
}

/// A block on a rough floor, pulled by more than friction holds: whatever way the matrix tells it, what moves is named.
#[test]
fn a_block_that_slides_away_is_named() {
    let folder = Folder::new("slides");
    folder.write("scene.wfl", format!("wfl 1\nparam gamma = 1e5\n{ROUGH_FLOOR}"));
    for gamma in ["gamma=1e3", "gamma=1e7", "gamma=1e10"] {
        let output = folder.wfl(&["run", "scene.wfl", gamma]);
        assert_eq!(code(&output), 1, "{}", said(&output));
        let text = said(&output);
        let named = text.contains("rigid body motion of `u`") || text.contains("supports `u`");
        assert!(text.contains("error[E602]") && named && text.contains("= help:"), "{text}");
    }
}

/// u + u^3 = 1000 by Newton from 0 needs more than 3 iterations.
#[test]
fn a_step_that_does_not_converge_is_marked() {
    let text = edited("gamma*u*Test_u", "gamma*(u + u*u*u - 1000)*Test_u")
        .replace("load u = t on east\nsteps t = 1 to 3 by 1\n", "solver newton with max_iter=3\n");
    let folder = Folder::new("maxit");
    folder.write("scene.wfl", &text);
    let output = folder.wfl(&["run", "scene.wfl"]);
    let message = said(&output);
    assert_eq!(code(&output), 2, "{message}");
    assert!(
        message.contains("error[E603]") && message.contains("did not converge in 18 iterations (6 attempts)"),
        "{message}"
    );
    let left = ["manifest.json", "measures.csv", "report.json"];
    assert_eq!(folder.names("out/scene"), left, "no fields of a state that solves nothing");
    let report = folder.report("out/scene");
    assert_eq!(report["steps"][0]["converged"], false);
    assert_eq!(report["steps"][0]["stop"], "maxit");
}

/// Bodies that are not linear, whose attempts and predictors once stood in no time.
#[test]
fn times_add_up_to_the_whole() {
    let folder = Folder::new("times");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/hyperelastic/contact.wfl");
    let output = folder.wfl(&["run", scene, "cells=[8,8,8]", "fric=0.3", "--out", "out/scene"]);
    assert_eq!(code(&output), 0, "{}", said(&output));
    let times = folder.report("out/scene")["timings"].clone();
    let of = |(name, value): (&String, &Value)| (name != "total").then(|| value.as_f64().expect("seconds"));
    let parts: f64 = times.as_object().expect("names").iter().filter_map(of).sum();
    let part = parts / times["total"].as_f64().expect("seconds");
    // what is missing are milliseconds of start-up, whatever the run takes; nothing is counted twice
    assert!((0.85..=1.0).contains(&part), "{part}: {times}");
}

#[test]
fn an_expectation_that_does_not_hold_fails_the_run() {
    let folder = Folder::new("expect");
    for (limit, expected) in [("0.03", 0), ("0.02", 3)] {
        let text = format!("{BAR}expect end < {limit}\n");
        folder.write("scene.wfl", &text);
        let output = folder.wfl(&["run", "scene.wfl", "-q"]);
        assert_eq!(code(&output), expected, "{}", said(&output));
        if expected != 0 {
            assert!(said(&output).contains("error[E604]"), "{}", said(&output));
            assert!(said(&output).contains(&format!("expect end < {limit}")), "{}", said(&output));
        }
    }
}

/// What does not go with a mapping that moves is refused at its line, before anything is done.
#[test]
fn what_does_not_go_with_images_that_move_is_refused_at_their_mapping() {
    let folder = Folder::new("moving_refused");
    let from = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/sliding");
    for name in ["ironing.wfl", "ironing.msh"] {
        folder.write(name, std::fs::read_to_string(from.join(name)).expect("an example"));
    }
    let words = [
        ("E470", &["run", "ironing.wfl", "--gradient", "Fx", "--with", "gamma"][..]),
        ("E802", &["run", "ironing.wfl", "--accuracy", "1e-2", "--of", "Fx"]),
    ];
    let text = std::fs::read_to_string(from.join("ironing.wfl")).expect("an example");
    let (line, column, source) = place(&text, "m = raytrace");
    for (expected, words) in words {
        let output = folder.wfl(words);
        let message = said(&output);
        assert_eq!(code(&output), 1, "{message}");
        for part in [format!("error[{expected}]"), format!("ironing.wfl:{line}:{column}"), source.clone()] {
            assert!(message.contains(&part), "`{part}` is missing in\n{message}");
        }
        assert_eq!(folder.names("."), ["ironing.msh", "ironing.wfl"], "nothing may be written");
    }
}
