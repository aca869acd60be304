//! The results folder: one writer, one run, nothing of anybody else's touched, nothing damaged taken for a result.

use std::{
    collections::BTreeMap,
    fs,
    process::{Command, Output},
};

use crate::common::Folder;

/// A bar of modulus k*E with k from a table, on a mesh of a file, that cannot be solved at t = 3 while `late` is 1.
const BAR: &str = "wfl 1
use \"names.wfl\"
param gamma = 10
param late  = 0
mesh file \"bar.msh\"
region west = faces where x == 0
region east = faces where x == 1
unknown u : scalar
data k : scalar = \"k.csv\"
term bulk   on all  : (k*E + late*(sqrt(2.5 - t) - sqrt(2.5 - t)))*Grad_u.Grad_Test_u
term spring on east : gamma*u*Test_u
fix u = 0 on west
load u = t on east
steps t = 1 to 3 by 1
measure end = mean(u) on east
output vtk \"bar\" : u
output csv \"line\" : u along [0,0.5] to [1,0.5] with points=5
";

/// A square of four nodes and two triangles.
const MESH: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n\
                    $Elements\n2\n1 2 2 0 1 1 2 3\n2 2 2 0 1 1 3 4\n$EndElements\n";
const TABLE: &str = "x,y,k\n0,0,1\n1,0,1\n1,1,1\n0,1,1\n";

impl Folder {
    /// With the scene `bar.wfl` and what it reads.
    fn with_bar(name: &str) -> Self {
        let folder = Self::new(name);
        for (file, text) in [("bar.wfl", BAR), ("names.wfl", "param E = 100\n"), ("bar.msh", MESH), ("k.csv", TABLE)] {
            folder.write(file, text);
        }
        folder
    }

    fn edit(&self, name: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.0.join(name)).expect("readable");
        assert!(text.contains(from), "{from}");
        self.write(name, text.replace(from, to));
    }

    /// `wfl run bar.wfl --out o` and more.
    fn run_bar(&self, more: &[&str]) -> Output {
        self.run_in("o", more)
    }

    fn run_in(&self, out: &str, more: &[&str]) -> Output {
        self.wfl(&[&["run", "bar.wfl", "--out", out], more].concat())
    }

    /// Every file of a folder.
    fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(self.0.join(folder)).expect("a folder").map(|e| e.expect("readable"));
        let one = |e: fs::DirEntry| {
            let bytes = fs::read(e.path()).expect("readable");
            (e.file_name().to_string_lossy().into_owned(), bytes)
        };
        entries.filter(|e| e.path().is_file()).map(one).collect()
    }

    /// The same without those that hold times.
    fn results(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = self.files(folder);
        files.retain(|name, _| name != "report.json" && !name.ends_with(".wflc"));
        files
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asserts exit code 1 and one error with code and words.
fn refused(output: &Output, code: &str, words: &[&str]) {
    let text = said(output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains(&format!("error[{code}]: ")) && text.contains("= help: "), "{code}: {text}");
    assert_eq!(text.matches("error[").count(), 1, "one cause, one message: {text}");
    for word in words {
        assert!(text.contains(word), "`{word}` is missing in {text}");
    }
}

/// Each input of a run, changed in a way that its numbers may depend on, and what names it.
const CHANGES: [(&str, &str, &str); 4] = [
    ("bar.wfl", "points=5", "points=6"),
    ("names.wfl", "E = 100", "E = 101"),
    ("bar.msh", "3 1 1 0\n4", "3 1 1.0 0\n4"),
    ("k.csv", "1,1,1", "1,1,2"),
];

#[test]
fn resume_names_the_input_that_differs() {
    for late in [false, true] {
        let folder = Folder::with_bar(&format!("identity{late}"));
        let given: &[&str] = if late { &["late=1"] } else { &[] };
        // one run that ended early, and one that is finished
        assert_eq!(folder.run_bar(given).status.code(), Some(i32::from(late)), "{}", said(&folder.run_bar(given)));
        let before = folder.files("o");
        for (file, from, to) in CHANGES {
            folder.edit(file, from, to);
            let words = format!("`o` holds results of another content of `{file}`");
            refused(&folder.run_bar(&[given, &["--resume"]].concat()), "E714", &[&words]);
            folder.edit(file, to, from);
        }
        for (more, words) in [
            ("gamma=11", "another value of the parameter `gamma` (10.0, here 11.0)"),
            ("E=101", "another value of the parameter `E` (100.0, here 101.0)"),
            ("--precision=f64", "another value of the setting `precision` (auto, here f64)"),
            ("--max-iter=7", "another value of the setting `max_iter`"),
            ("tol=1e-9", "no value of the setting `tol`"),
            ("--no-prune=constant", "no value of the setting `no_prune`"),
        ] {
            refused(&folder.run_bar(&[given, &["--resume", more]].concat()), "E714", &[words]);
        }
        assert_eq!(folder.files("o"), before, "a refusal changes nothing");
        // a value that is given and is that of the scene changes nothing; threads never do
        let again = folder.run_bar(&[given, &["--resume", "gamma=10", "--threads", "3"]].concat());
        assert!(!said(&again).contains("E714"), "{}", said(&again));
    }
}

#[test]
fn a_finished_run_is_not_made_again() {
    let folder = Folder::with_bar("finished");
    assert!(folder.run_bar(&[]).status.success());
    let before = folder.files("o");
    let again = folder.run_bar(&["--resume"]);
    assert!(again.status.success(), "{}", said(&again));
    let told = String::from_utf8_lossy(&again.stdout).into_owned();
    assert!(told.contains("o: the run is finished; its 3 steps and files are complete"), "{told}");
    assert_eq!(folder.files("o"), before, "also the report and its times");
    // the manifest does not depend on threads
    assert!(folder.run_in("p", &["--threads", "3"]).status.success());
    assert_eq!(folder.results("p"), folder.results("o"));
    // an expectation that does not hold is told again
    folder.edit("bar.wfl", "output vtk", "expect end < 0\noutput vtk");
    assert_eq!(folder.run_bar(&[]).status.code(), Some(3));
    let again = folder.run_bar(&["--resume"]);
    assert_eq!(again.status.code(), Some(3));
    assert!(said(&again).contains("error[E604]") && said(&again).contains("end < 0"), "{}", said(&again));
}

/// What can happen to a file.
fn damages(bytes: &[u8], other: &[u8], at: usize) -> Vec<Vec<u8>> {
    let mut flipped = bytes.to_vec();
    flipped[at] ^= 1;
    vec![flipped, bytes[..at].to_vec(), [bytes, b"\n1"].concat(), other.to_vec()]
}

/// Every file of two folders, one of a finished run and one of a run that ended early, damaged in every way: going on
/// is refused with the reason, or gives the same bytes.
#[test]
fn what_is_damaged_is_never_gone_on_from() {
    for (late, then) in [("late=0", 0), ("late=1", 1)] {
        let folder = Folder::with_bar(&format!("damage{then}"));
        assert_eq!(folder.run_bar(&[late]).status.code(), Some(then));
        let whole = folder.files("o");
        let expected = folder.results("o");
        let other: Vec<Vec<u8>> = whole.values().cycle().skip(1).take(whole.len()).cloned().collect();
        let (mut n_refused, mut part) = (0, 0.5f64);
        for (n_files, ((name, bytes), other)) in whole.iter().zip(&other).enumerate() {
            part = (part + 0.618_033_988_75).fract();
            let at = (part * bytes.len() as f64) as usize;
            let few = |k: usize| !cfg!(debug_assertions) || k % 2 == n_files % 2;
            for (k, damaged) in damages(bytes, other, at).into_iter().enumerate().filter(|(k, _)| few(*k)) {
                folder.write(&format!("o/{name}"), &damaged);
                let ran = folder.run_bar(&[late, "--resume"]);
                let text = said(&ran);
                if text.contains("E715") || text.contains("E712") {
                    n_refused += 1;
                    assert_eq!(ran.status.code(), Some(1), "{name}, damage {k}");
                    let named = text.contains(name) || name.starts_with("checkpoint");
                    assert!(named, "{name}, damage {k}: {text}");
                } else {
                    assert_eq!(ran.status.code(), Some(then), "{name}, damage {k}: {text}");
                    assert_eq!(folder.results("o"), expected, "{name}, damage {k}");
                }
                for (name, bytes) in &whole {
                    folder.write(&format!("o/{name}"), bytes);
                }
            }
        }
        // files of steps behind the last checkpoint are made again whatever they hold
        let least = if then == 0 { whole.len() } else { 4 };
        assert!(n_refused >= least, "{n_refused} of {} files", whole.len());
        // what is missing is named, too
        for name in ["line_0000.csv", "bar_0000.vtu"] {
            fs::remove_file(folder.0.join("o").join(name)).expect("our own file");
            refused(&folder.run_bar(&[late, "--resume"]), "E715", &[name, "is missing"]);
            folder.write(&format!("o/{name}"), &whole[name]);
        }
        // without --resume the run starts from the beginning whatever is there, but for a manifest that is none
        folder.write("o/line_0001.csv", "x");
        folder.write("o/checkpoint.wflc", "x");
        if then == 1 {
            assert_eq!(folder.run_bar(&[late]).status.code(), Some(1));
            assert_eq!(folder.results("o"), expected);
        }
    }
}

#[test]
fn files_of_others_are_left_alone_and_named_before_anything_is_computed() {
    let folder = Folder::with_bar("foreign");
    for name in ["line_0001.csv", "bar.pvd", "bar_0000.vtu", "report.json", "checkpoint.wflc", "manifest.json"] {
        let _ = fs::remove_dir_all(folder.0.join("o"));
        fs::create_dir(folder.0.join("o")).expect("a folder");
        folder.write(&format!("o/{name}"), "mine");
        let ran = folder.run_bar(&["-v"]);
        refused(&ran, "E712", &[&format!("`o/{name}`")]);
        assert!(!String::from_utf8_lossy(&ran.stdout).contains("step"), "nothing is computed");
        assert_eq!(folder.files("o"), BTreeMap::from([(name.to_owned(), b"mine".to_vec())]));
    }
    // also before runs that are made for another one
    for more in [&["--savings"][..], &["--accuracy", "0.5", "--of", "end"]] {
        refused(&folder.run_bar(more), "E712", &["`o/manifest.json`"]);
    }
    // names that the run does not use are nobody's business, also where they look like steps
    let _ = fs::remove_dir_all(folder.0.join("o"));
    fs::create_dir(folder.0.join("o")).expect("a folder");
    for name in ["line_0050.csv", "notes.txt", ".wfl-notes.tmp"] {
        folder.write(&format!("o/{name}"), "mine");
    }
    assert!(folder.run_bar(&[]).status.success());
    folder.edit("bar.wfl", "1 to 3", "1 to 2");
    assert!(folder.run_bar(&[]).status.success());
    let files = folder.files("o");
    for name in ["line_0050.csv", "notes.txt", ".wfl-notes.tmp"] {
        assert_eq!(files[name], b"mine", "{name}");
    }
    assert!(!files.contains_key("line_0002.csv") && files.contains_key("line_0001.csv"), "our own step is removed");
}

#[test]
fn a_run_does_not_replace_what_it_reads() {
    let folder = Folder::with_bar("input");
    folder.edit("bar.wfl", "steps t = 1 to 3 by 1\n", "");
    folder.edit("bar.wfl", "load u = t", "load u = 1");
    folder.edit("bar.wfl", "late*(sqrt(2.5 - t) - sqrt(2.5 - t))", "late");
    folder.edit("bar.wfl", "output csv \"line\"", "output csv \"k\"");
    refused(&folder.run_in(".", &[]), "E716", &["k.csv"]);
    assert_eq!(folder.files(".")["k.csv"], TABLE.as_bytes());
}

#[cfg(unix)]
#[test]
fn links_in_a_results_folder_are_not_followed() {
    let folder = Folder::with_bar("links");
    folder.write("victim", "mine");
    assert_eq!(folder.run_bar(&["late=1"]).status.code(), Some(1));
    let names: Vec<String> = folder.files("o").into_keys().chain([".wfl-lock".to_owned()]).collect();
    for name in names {
        let place = folder.0.join("o").join(&name);
        let kept = fs::read(&place).ok();
        let _ = fs::remove_file(&place);
        std::os::unix::fs::symlink(folder.0.join("victim"), &place).expect("a link");
        for more in [&["late=1"][..], &["late=1", "--resume"]] {
            let ran = folder.run_bar(more);
            let text = said(&ran);
            assert_eq!(ran.status.code(), Some(1), "{name}: {text}");
            assert!(text.contains("E712") || text.contains("E715"), "{name}: {text}");
        }
        assert_eq!(fs::read_to_string(folder.0.join("victim")).expect("readable"), "mine", "{name}");
        let _ = fs::remove_file(&place);
        if let Some(bytes) = kept {
            fs::write(&place, bytes).expect("writable");
        }
    }
    // plots of a report
    assert!(folder.run_bar(&[]).status.success());
    fs::create_dir(folder.0.join("elsewhere")).expect("a folder");
    std::os::unix::fs::symlink(folder.0.join("elsewhere"), folder.0.join("o/plots")).expect("a link");
    refused(&folder.wfl(&["report", "o", "--plots"]), "E712", &["o/plots", "a link"]);
    fs::remove_file(folder.0.join("o/plots")).expect("our own link");
    fs::remove_file(folder.0.join("o/report.html")).expect("the page");
    std::os::unix::fs::symlink(folder.0.join("victim"), folder.0.join("o/report.html")).expect("a link");
    refused(&folder.wfl(&["report", "o"]), "E712", &["o/report.html"]);
    assert_eq!(fs::read_to_string(folder.0.join("victim")).expect("readable"), "mine");
}

/// Whoever writes holds the lock of the folder: here the test does, in the name of process 1.
#[test]
fn a_second_writer_is_refused_and_a_dead_one_is_taken_over() {
    let folder = Folder::with_bar("lock");
    assert!(folder.run_bar(&[]).status.success());
    let before = folder.files("o");
    folder.write("o/.wfl-lock", "process 1\n");
    let lock = fs::OpenOptions::new().write(true).open(folder.0.join("o/.wfl-lock")).expect("a lock");
    lock.lock().expect("locked");
    let words = ["`o` is being written to by process 1"];
    refused(&folder.run_bar(&[]), "E711", &words);
    refused(&folder.run_bar(&["--resume"]), "E711", &words);
    refused(&folder.wfl(&["report", "o"]), "E711", &words);
    refused(&folder.wfl(&["sweep", "bar.wfl", "gamma=1", "--reference", "none", "--out", "o"]), "E711", &words);
    drop(lock);
    let mut after = folder.files("o");
    assert_eq!(after.remove(".wfl-lock").as_deref(), Some(&b"process 1\n"[..]));
    assert_eq!(after, before);
    // its process has ended
    assert!(folder.run_bar(&[]).status.success());
    assert!(!folder.files("o").contains_key(".wfl-lock"));
}

/// A run that is killed leaves its manifest and what it has written; the results of the run before are not taken for
/// its own.
#[test]
fn a_run_killed_over_a_finished_one_is_not_shown_with_its_numbers() {
    let folder = Folder::with_bar("over");
    assert!(folder.run_bar(&[]).status.success());
    let finished = folder.files("o");
    // another run ends early and leaves results of two runs; as if it had been killed before its report
    assert_eq!(folder.run_bar(&["gamma=20", "late=1"]).status.code(), Some(1));
    let mut both = folder.files("o");
    let manifest = String::from_utf8(both.remove("manifest.json").expect("a manifest")).expect("text");
    assert!(manifest.contains("\"state\":\"stopped\"") && manifest.contains("\"name\":\"bar_0002.vtu\""), "{manifest}");
    // its page shows its own two steps
    let page = folder.wfl(&["report", "o"]);
    assert!(page.status.success(), "{}", said(&page));
    // the run before does not go on from them
    refused(&folder.run_bar(&["--resume"]), "E714", &["another value of the parameter"]);
    // finished again, the page about another run is gone, and what is left is what a new folder would have
    assert!(folder.run_bar(&[]).status.success());
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&folder.files("o")), names(&finished));
    assert_eq!(folder.results("o")["bar_0001.vtu"], finished["bar_0001.vtu"]);
}

#[test]
fn a_report_shows_files_of_its_run_only() {
    let folder = Folder::with_bar("doctored");
    assert!(folder.run_bar(&[]).status.success());
    folder.write("secret.csv", "s,x,y,u\n0,0,0,1\n");
    let json = fs::read_to_string(folder.0.join("o/report.json")).expect("a report");
    for name in ["../secret.csv", "/etc/passwd.csv", "..\\\\secret.csv", "notes.csv", "line_0007.csv"] {
        folder.write("o/notes.csv", "s,x,y,u\n0,0,0,1\n");
        folder.write("o/report.json", json.replace("\"line_0001.csv\"", &format!("\"{name}\"")));
        refused_report(
            &folder.wfl(&["report", "o"]),
            "`o/report.json` is damaged: its content is not what was written",
        );
    }
    folder.write("o/report.json", json.replace("\"converged\": true", "\"converged\": false"));
    refused_report(&folder.wfl(&["report", "o"]), "`o/report.json` is damaged");
    folder.write("o/report.json", &json);
    assert!(folder.wfl(&["report", "o"]).status.success());
    // a folder that was copied without its manifest
    fs::remove_file(folder.0.join("o/manifest.json")).expect("our own file");
    refused_report(&folder.wfl(&["report", "o"]), "no manifest.json");
}

fn refused_report(output: &Output, words: &str) {
    let text = said(output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains(words) && text.contains("= help: "), "`{words}`: {text}");
}

/// Names are judged before anything is computed, and a scene never writes into the folder it stands in.
#[test]
fn names_that_are_none_are_refused() {
    let folder = Folder::with_bar("names");
    for (k, name) in ["nul", "../up", "a:b", ".hidden", "con", "a/b", &"n".repeat(250)].into_iter().enumerate() {
        folder.write("s.wfl", BAR.replace("output csv \"line\"", &format!("output csv \"{name}\"")));
        let output = folder.wfl(&[["check", "run"][k % 2], "s.wfl"]);
        let text = said(&output);
        assert_eq!(output.status.code(), Some(1), "{name}: {text}");
        assert!(text.contains("error[E710]") && text.contains("s.wfl:17:"), "{name}: {text}");
    }
    assert!(!folder.0.join("out").exists());
    let before = folder.files(".");
    for scene in ["...wfl", ".wfl", "nul.wfl", "a:b.wfl"] {
        folder.write(scene, BAR);
        let ran = folder.wfl(&["run", scene]);
        refused(&ran, "E710", &["--out"]);
        assert!(folder.wfl(&["run", scene, "--out", "named", "-q"]).status.success());
        fs::remove_file(folder.0.join(scene)).expect("our own file");
        fs::remove_dir_all(folder.0.join("named")).expect("our own folder");
    }
    assert_eq!(folder.files("."), before);
}

/// A block in 1-D whose modulus comes from a table.
const FLUX: &str = "wfl 1
param E = 1
mesh box [0] to [1] cells [4] segment
unknown u : scalar
data k : scalar = \"k.csv\"
term bulk on all : k*E*Grad_u.Grad_Test_u
fix u = x on boundary
measure flux = integral(k*E*Grad_u(1)) on all
";

#[test]
fn a_sweep_keeps_the_rows_of_what_it_reads_now() {
    let folder = Folder::with_bar("sweep");
    folder.write("flux.wfl", FLUX);
    let table = |k: f64| -> String {
        let row = |n: i32| format!("{},{k}\n", f64::from(n) / 4.0);
        "x,k\n".to_owned() + &(0..5).map(row).collect::<String>()
    };
    let sweep = |out: &str| folder.wfl(&["sweep", "flux.wfl", "E=1,2", "--reference", "none", "--out", out]);
    let fluxes = || -> Vec<f64> {
        let text = fs::read_to_string(folder.0.join("t/sweep.csv")).expect("a table");
        // the cells between quotes hold no numbers
        let plain = |line: &str| line.split('"').step_by(2).collect::<Vec<_>>().concat();
        let lines: Vec<Vec<String>> = text.lines().map(|l| plain(l).split(',').map(str::to_owned).collect()).collect();
        let at = lines[0].iter().position(|c| *c == "measure flux").expect("a column");
        lines[1..].iter().map(|l| (l[at].parse::<f64>().expect("a flux") * 1e9).round() / 1e9).collect()
    };
    folder.write("k.csv", table(1.0));
    let first = sweep("t");
    assert!(first.status.success(), "{}", said(&first));
    assert_eq!(fluxes(), [1.0, 2.0]);
    folder.write("k.csv", table(4.0));
    let second = sweep("t");
    assert!(said(&second).contains("2 runs, 0 of them already in the table"), "{}", said(&second));
    assert_eq!(fluxes(), [4.0, 8.0]);
    let told = String::from_utf8_lossy(&second.stdout).into_owned();
    assert!(told.contains("2 rows were dropped"), "{told}");
    assert!(said(&sweep("t")).contains("2 runs, 2 of them already in the table"));
    // a table that was changed is not gone on with
    let whole = fs::read_to_string(folder.0.join("t/sweep.csv")).expect("a table");
    folder.write("t/sweep.csv", whole.replacen(",ok,", ",OK,", 1));
    refused(&sweep("t"), "E715", &["t/sweep.csv", "--plot"]);
    folder.write("t/sweep.csv", &whole);
    // a folder of a run, and a table of somebody else
    fs::create_dir(folder.0.join("theirs")).expect("a folder");
    folder.write("theirs/sweep.csv", "a,b\n1,2\n");
    refused(&sweep("theirs"), "E712", &["theirs/sweep.csv"]);
    assert_eq!(fs::read_to_string(folder.0.join("theirs/sweep.csv")).expect("readable"), "a,b\n1,2\n");
    refused(&folder.wfl(&["run", "flux.wfl", "--out", "t"]), "E713", &["the table of a sweep"]);
    assert!(folder.wfl(&["run", "flux.wfl", "--out", "r", "-q"]).status.success());
    refused(&sweep("r"), "E713", &["the results of a run", "--out DIR"]);
    // what shows a run is not told where to write
    let shown = folder.wfl(&["report", "t"]);
    refused(&shown, "E713", &["the table of a sweep", "sweep.html"]);
    assert!(!said(&shown).contains("--out"), "{}", said(&shown));
}

#[test]
fn a_reference_that_was_changed_is_noticed() {
    let folder = Folder::with_bar("reference");
    folder.write("flux.wfl", FLUX.replace("data k : scalar = \"k.csv\"\n", "def k = 1 + x*x\n"));
    let sweep = |more: &[&str]| folder.wfl(&[&["sweep", "flux.wfl", "cells=4"], more].concat());
    let first = sweep(&["--out", "t"]);
    assert!(first.status.success(), "{}", said(&first));
    let file = folder.0.join("t/reference_1.json");
    let whole = fs::read_to_string(&file).expect("a reference");
    let at = whole.rfind("flux\",1.").map(|at| at + 8).expect("the measure");
    let mut changed = whole.clone().into_bytes();
    changed[at] = if changed[at] == b'3' { b'4' } else { b'3' };
    fs::write(&file, changed).expect("writable");
    // of another sweep: refused; of this one: made anew
    let given = sweep(&["--out", "s", "--reference", "t/reference_1.json"]);
    assert_eq!(given.status.code(), Some(1));
    assert!(said(&given).contains("t/reference_1.json is not what a sweep of this version wrote"), "{}", said(&given));
    let again = sweep(&["--out", "t"]);
    assert!(again.status.success() && said(&again).contains("made anew"), "{}", said(&again));
    assert_eq!(fs::read_to_string(&file).expect("a reference"), whole);
    // of another text: a new reference, and a new row
    folder.edit("flux.wfl", "1 + x*x", "2 + x*x");
    assert!(said(&sweep(&["--out", "t"])).contains("1 runs, 0 of them already in the table"));
    assert_ne!(fs::read_to_string(&file).expect("a reference"), whole);
}

/// A disc that is full, as far as one process sees it: no file may grow beyond some blocks. What is there is whole, no
/// temporary file stays, and with room again the run goes on to the same bytes.
#[cfg(unix)]
#[test]
fn a_full_disc_costs_nothing_that_was_done() {
    let folder = Folder::with_bar("full");
    assert!(folder.run_in("whole", &[]).status.success());
    let expected = folder.results("whole");
    let mut n_stopped = 0;
    for blocks in [0, 1, 2, 3, 4, 6, 8] {
        let _ = fs::remove_dir_all(folder.0.join("o"));
        let mut shell = Command::new("sh");
        // blocks of 512 bytes; a file that is too large is an error, not a signal
        let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" run bar.wfl --out o");
        let ran = shell.args(["-c", &line, env!("CARGO_BIN_EXE_wfl")]).current_dir(&folder.0).output();
        let ran = ran.expect("a shell");
        if !ran.status.success() {
            n_stopped += 1;
            refused(&ran, "E717", &["--resume"]);
        }
        assert!(
            folder.files("o").keys().all(|name| !name.starts_with('.')),
            "{blocks}: {:?}",
            folder.files("o").keys()
        );
        let again = folder.run_bar(&["--resume"]);
        assert!(again.status.success(), "{blocks}: {}", said(&again));
        assert!(folder.results("o") == expected, "{blocks} blocks: other results");
    }
    assert!(n_stopped >= 3, "{n_stopped}");
}

/// An interrupt leaves no temporary file and no lock, and says how to go on.
#[cfg(unix)]
#[test]
fn an_interrupt_tidies_up_and_says_how_to_go_on() {
    use std::os::unix::process::ExitStatusExt;
    let folder = Folder::with_bar("interrupt");
    folder.edit("bar.wfl", "1 to 3", "1 to 300");
    for (name, number) in [("INT", 2), ("TERM", 15)] {
        let _ = fs::remove_dir_all(folder.0.join("o"));
        let mut command = folder.command(&["run", "bar.wfl", "--out", "o"]);
        let child = command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped()).spawn();
        let child = child.expect("the command starts");
        let begin = std::time::Instant::now();
        while !folder.0.join("o/line_0003.csv").exists() && begin.elapsed().as_secs() < 60 {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let killed = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status();
        assert!(killed.is_ok_and(|s| s.success()));
        let ended = child.wait_with_output().expect("our own child");
        assert_eq!(ended.status.signal(), Some(number), "{}", said(&ended));
        let words = "interrupted: the steps done are kept: the same command with --resume continues";
        assert!(said(&ended).contains(words), "{}", said(&ended));
        // the thread that writes may have begun another file in the last moment
        let left: Vec<String> = folder.files("o").into_keys().filter(|n| n.starts_with(".wfl-")).collect();
        assert!(left.len() <= 1 && !left.contains(&".wfl-lock".to_owned()), "{left:?}");
    }
    let again = folder.run_bar(&["--resume"]);
    assert!(again.status.success(), "{}", said(&again));
    assert!(folder.run_in("whole", &[]).status.success());
    assert!(folder.results("o") == folder.results("whole"));
}
