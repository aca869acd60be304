//! `wfl sweep`: errors against numbers of an independent program, failures that stay in the table, resuming.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

use crate::common::{exact_norms, rows};

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("sweep_{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn wfl(words: &[&str], out: &Path) -> Output {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut command = Command::new(env!("CARGO_BIN_EXE_wfl"));
    command.current_dir(examples).arg("sweep").args(words).arg("--out").arg(out);
    command.output().expect("wfl runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn cell<'r>(row: &'r [(String, String)], column: &str) -> &'r str {
    row.iter().find(|c| c.0 == column).map_or("", |c| c.1.as_str())
}

fn number(row: &[(String, String)], column: &str) -> f64 {
    cell(row, column).parse().unwrap_or_else(|_| panic!("no number in {column}: {row:?}"))
}

#[test]
fn errors_against_an_exact_solution_are_those_of_an_independent_program() {
    let out = folder("exact");
    let words = ["signorini/signorini.wfl", "n=8,16", "theta=0", "--reference", "exact", "--repeat", "2", "-q"];
    let run = wfl(&words, &out);
    // what the scene expects are the errors of the finer mesh
    assert_eq!(run.status.code(), Some(3), "{}", text(&run.stderr));
    let rows = rows(&out);
    let statuses: Vec<&str> = rows.iter().map(|row| cell(row, "status")).collect();
    assert_eq!(statuses, ["not as expected", "ok"]);
    // errors on 16 x 16 cells by the independent program, see the scene
    let (l2, h1) = exact_norms();
    let (error_l2, error_h1) = (number(&rows[1], "error L2"), number(&rows[1], "error H1"));
    assert!((error_l2 / (0.001615334741447155 / l2) - 1.0).abs() < 1e-4, "{error_l2}");
    assert!((error_h1 / (0.05937941628885151 / h1) - 1.0).abs() < 1e-4, "{error_h1}");
    // the pressure is r^4 on x < c: the square of its norm is c^9/9
    let pressure = ((2f64.sqrt() / 3.0).powi(9) / 9.0).sqrt();
    let error = number(&rows[1], "error pressure");
    assert!((error / (0.0008863220766572562 / pressure) - 1.0).abs() < 1e-4, "{error}");
    for row in &rows {
        assert_eq!(cell(row, "repeats"), "2");
        assert!(number(row, "time_min") <= number(row, "time") && number(row, "time") <= number(row, "time_max"));
        assert!(number(row, "iterations") >= 2.0 && number(row, "factorisations") >= 2.0);
    }
}

/// A block in 2-D under its weight; `deep` makes a measure that is no number, `nu` may leave its domain.
const BLOCK: &str = "wfl 1
param nu   = 0.3 in 0..0.49
param deep = 0
mesh box [0,0] to [1,1] cells [4,4] quad
region floor = faces where y == 0
unknown u : vector
def sigma(v) = nu*Div_v*Id(2) + Sym(Grad_v)
term elastic on all : sigma(u):Grad_Test_u
load u = [0,-1] on all
fix u = [0,0] on floor
measure depth = integral(sqrt(y - deep)) on all
";

#[test]
fn failures_and_numbers_that_are_none_stay_in_the_table() {
    let out = folder("failures");
    std::fs::write(out.join("block.wfl"), BLOCK).expect("written");
    let scene = out.join("block.wfl").display().to_string();
    let run = wfl(&[&scene, "nu=0.3,0.6", "deep=0,2", "--reference", "none", "-q"], &out);
    assert_eq!(run.status.code(), Some(2), "{}", text(&run.stderr));
    let rows = rows(&out);
    let found: Vec<(&str, &str, &str)> =
        rows.iter().map(|r| (cell(r, "knob nu"), cell(r, "knob deep"), cell(r, "status"))).collect();
    let expected = [("0.3", "0", "ok"), ("0.3", "2", "not finite"), ("0.6", "0", "failed"), ("0.6", "2", "failed")];
    assert_eq!(found, expected);
    assert!(cell(&rows[1], "message").contains("depth"), "{:?}", rows[1]);
    assert!(cell(&rows[2], "message").contains("E701"), "{:?}", rows[2]);
    assert!(rows.iter().all(|r| number(r, "time") > 0.0));
    // the page is made from the table alone: a row put in by hand is found there, with its failure
    let table = std::fs::read_to_string(out.join("sweep.csv")).expect("a table");
    let line = table.lines().nth(1).expect("a row");
    let planted = line.replace(",ok,", ",not converged,").replacen(",0.3,", ",0.123456,", 1);
    assert_ne!(planted, line);
    std::fs::write(out.join("sweep.csv"), format!("{table}{planted}\n")).expect("written");
    std::fs::remove_file(out.join("sweep.html")).expect("the sweep made a page");
    let folder = out.display().to_string();
    let plot = wfl(&["--plot", &folder], &out);
    assert!(plot.status.success(), "{}", text(&plot.stderr));
    let page = std::fs::read_to_string(out.join("sweep.html")).expect("a page");
    let failures = &page[page.find(">Failures</h2>").expect("failures have a section")..];
    let failures = &failures[..failures.find("</section>").expect("its end")];
    for needed in ["nu=0.123456 deep=0", "not converged", "not finite", "not a finite number: depth", "E701"] {
        assert!(failures.contains(needed), "{needed}: {failures}");
    }
}

#[test]
fn rows_that_are_there_are_not_run_again() {
    let out = folder("resume");
    let scene = out.join("block.wfl");
    std::fs::write(&scene, BLOCK).expect("written");
    let name = scene.display().to_string();
    assert!(wfl(&[&name, "nu=0.1,0.2", "--reference", "none", "-q"], &out).status.success());
    let first = rows(&out);
    let again = wfl(&[&name, "nu=0.1,0.2,0.3", "--reference", "none"], &out);
    assert!(text(&again.stderr).contains("3 runs, 2 of them already in the table"), "{}", text(&again.stderr));
    let second = rows(&out);
    assert_eq!(second.len(), 3);
    assert_eq!(second[..2], first[..]);
    // a sweep with nothing left to run
    assert!(wfl(&[&name, "nu=0.1,0.2,0.3", "--reference", "none", "-q"], &out).status.success());
    assert_eq!(rows(&out), second);
    // another text is another scene: its rows do not stand beside those of the former one
    std::fs::write(&scene, BLOCK.replace("[0,-1]", "[0,-2]")).expect("written");
    let other = wfl(&[&name, "nu=0.1", "--reference", "none"], &out);
    assert!(other.status.success() && text(&other.stdout).contains("3 rows were dropped"), "{}", text(&other.stdout));
    assert_eq!(rows(&out).len(), 1);
}

/// A file that a scene reads makes it another problem; rows of scenes that have not changed stay.
#[test]
fn rows_of_another_problem_are_dropped_and_that_is_told() {
    let out = folder("stale");
    let table = BLOCK.replace("load u = [0,-1]", "load u = [0,-table(\"weight.csv\", y)]");
    std::fs::write(out.join("block.wfl"), table).expect("written");
    std::fs::write(out.join("other.wfl"), BLOCK).expect("written");
    std::fs::write(out.join("weight.csv"), "0,1\n1,1\n").expect("written");
    let [scene, other] = ["block.wfl", "other.wfl"].map(|name| out.join(name).display().to_string());
    let made = |words: &[&str]| {
        let run = wfl(&[words, &["--reference", "none"]].concat(), &out.join("o"));
        assert!(run.status.success(), "{}", text(&run.stderr));
        text(&run.stdout)
    };
    made(&[&scene, "nu=0.1,0.2"]);
    assert!(!made(&[&other, "nu=0.1"]).contains("dropped"));
    assert_eq!(rows(&out.join("o")).len(), 3);
    std::fs::write(out.join("weight.csv"), "0,1\n1,2\n").expect("written");
    let told = made(&[&other, "nu=0.1,0.3"]);
    assert!(told.contains("2 rows were dropped"), "{told}");
    let scenes: Vec<String> = rows(&out.join("o")).iter().map(|r| cell(r, "scene").to_owned()).collect();
    assert_eq!(scenes, [other.clone(), other]);
    // a setting that is made again against another reference stands there once
    let again = wfl(&[&scene, "nu=0.1", "-q", "--reference", "none"], &out.join("p"));
    let other_reference = wfl(&[&scene, "nu=0.1", "-q"], &out.join("p"));
    assert!(again.status.success() && other_reference.status.success());
    assert_eq!(rows(&out.join("p")).len(), 1);
}

/// What a scene expects holds in each run, or its row and the exit code say so.
#[test]
fn a_run_that_is_not_as_expected_is_told() {
    let out = folder("expected");
    std::fs::write(out.join("block.wfl"), format!("{BLOCK}expect nu < 0.25\n")).expect("written");
    let scene = out.join("block.wfl").display().to_string();
    let run = wfl(&[&scene, "nu=0.1,0.3", "--reference", "none"], &out);
    assert_eq!(run.status.code(), Some(3), "{}", text(&run.stderr));
    assert!(text(&run.stdout).contains("2 rows, 0 failed, 1 not as the scene expects"), "{}", text(&run.stdout));
    let found = rows(&out);
    assert_eq!([cell(&found[0], "status"), cell(&found[1], "status")], ["ok", "not as expected"]);
    assert!(cell(&found[1], "message").contains("expect nu < 0.25") && number(&found[1], "time") > 0.0, "{found:?}");
    // rows of the table count as those that are made; of this command alone
    assert_eq!(wfl(&[&scene, "nu=0.3", "--reference", "none", "-q"], &out).status.code(), Some(3));
    assert_eq!(wfl(&[&scene, "nu=0.1", "--reference", "none", "-q"], &out).status.code(), Some(0));
}

#[test]
fn runs_at_once_give_the_same_numbers_and_no_times() {
    let (out, alone) = (folder("jobs"), folder("alone"));
    let words = ["signorini/signorini.wfl", "n=4,8", "degree=1,2", "--reference", "exact", "-q"];
    // the scene expects the errors of another mesh
    assert_eq!(wfl(&words, &alone).status.code(), Some(3));
    let run = wfl(&[&words[..], &["--jobs", "3"]].concat(), &out);
    assert_eq!(run.status.code(), Some(3), "{}", text(&run.stderr));
    let (many, one) = (rows(&out), rows(&alone));
    assert_eq!(many.len(), one.len());
    for (a, b) in many.iter().zip(&one) {
        for column in ["knob n", "knob degree", "status", "iterations", "error H1", "error L2"] {
            assert_eq!(cell(a, column), cell(b, column), "{column}");
        }
        assert!(a.iter().all(|(name, _)| name != "time"), "{a:?}");
    }
    // times are made up for later
    assert_eq!(wfl(&words, &out).status.code(), Some(3));
    let timed = rows(&out);
    assert_eq!(timed.len(), 4);
    assert!(timed.iter().all(|r| number(r, "time") > 0.0));
}

#[test]
fn a_finer_run_is_the_reference_and_knows_its_own_error() {
    let out = folder("finer");
    let run = wfl(&["elasticity/plane_strain.wfl", "n=4,8", "degree=1", "-q"], &out);
    // the scene expects the errors of another mesh
    assert_eq!(run.status.code(), Some(3), "{}", text(&run.stderr));
    let rows = rows(&out);
    // theory: order 1 in H1, 2 in L2
    let order = |c: &str| (number(&rows[0], c) / number(&rows[1], c)).log2();
    assert!((order("error H1") - 1.0).abs() < 0.1 && (order("error L2") - 2.0).abs() < 0.1, "{rows:?}");
    assert!(number(&rows[1], "reference error H1") < 0.1 * number(&rows[1], "error H1"));
}

/// A reference of another problem tells no errors.
#[test]
fn a_reference_from_a_file_is_that_of_its_problem() {
    let out = folder("other-problem");
    let scene = out.join("block.wfl");
    std::fs::write(&scene, BLOCK).expect("written");
    let name = scene.display().to_string();
    assert!(wfl(&[&name, "nu=0.1", "-q"], &out).status.success());
    let kept = std::fs::copy(out.join("reference_1.json"), out.join("../kept_reference.json"));
    assert!(kept.is_ok());
    let file = out.join("../kept_reference.json").display().to_string();
    let other = folder("other-problem-again");
    std::fs::write(other.join("block.wfl"), BLOCK).expect("written");
    let name = other.join("block.wfl").display().to_string();
    assert!(wfl(&[&name, "nu=0.1,0.3", "--reference", &file, "-q"], &other).status.code().is_some());
    let rows = rows(&other);
    let message = |k: usize| cell(&rows[k], "message").to_owned();
    assert!(!message(0).contains("the reference"), "{rows:?}");
    assert!(message(1).contains("has nu = 0.1, and this run 0.3"), "{rows:?}");
}

#[test]
fn a_sweep_that_means_nothing_is_refused_with_a_reason() {
    let out = folder("refused");
    for (words, needed) in [
        (&["fault/nitsche.wfl", "gama=1"][..], "no parameter and no knob `gama`"),
        (&["fault/nitsche.wfl", "h=-1"], "a length above 0"),
        (&["fault/nitsche.wfl", "h=1", "cells=[4,2,2]"], "knobs `h` and `cells` both say how the mesh is divided"),
        (&["signorini/signorini.wfl", "n=8,16", "cells=4"], "the division of the mesh, which reads `n`"),
        (&["fault_gmsh/fault_2deg.wfl", "h=1"], "comes from a file"),
        (&["fault/nitsche.wfl", "precision=f16"], "auto, f64 or f32+f64"),
        (&["fault/nitsche.wfl", "gamma=1..2"], "is no range"),
        (&["gamma=1"], "no scene is given"),
        (&["--plot", "nowhere"], "there is no sweep.csv in nowhere"),
        (&["fault/nitsche.wfl", "--reference", "exact"], "defines no exact solution"),
        (&["fault/nowhere.wfl"], "cannot read fault/nowhere.wfl"),
    ] {
        let run = wfl(words, &out);
        assert_eq!(run.status.code(), Some(1), "{words:?}");
        assert!(text(&run.stderr).contains(needed), "{words:?}: {}", text(&run.stderr));
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn solvers_that_are_asked_for_solve_the_same_problem() {
    let out = folder("solvers");
    // enough dofs of contact that one unknown is shared by facing ones
    let knobs = ["cells=[2,10,10]", "tol=1e-10", "solver=auto,condensed,full"];
    let run = wfl(&[&["fault/penalty.wfl", "--reference", "none"], &knobs[..]].concat(), &out);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let rows = rows(&out);
    let solvers: Vec<&str> = rows.iter().map(|r| cell(r, "solver")).collect();
    assert!(
        solvers[0] != solvers[1] && solvers[1] != solvers[2] && solvers[2].contains("whole tangent"),
        "{solvers:?}"
    );
    assert!(solvers.iter().all(|s| s.starts_with("Newton")), "{solvers:?}");
    for row in &rows[1..] {
        for column in ["measure Fn", "measure Ftz", "measure max_slip"] {
            let (a, b) = (number(row, column), number(&rows[0], column));
            assert!((a - b).abs() <= 1e-7 * b.abs(), "{column}: {a} and {b}");
        }
    }
    let wrong = wfl(&["fault/penalty.wfl", "solver=best", "--reference", "none"], &out);
    assert!(!wrong.status.success() && text(&wrong.stderr).contains("auto, forces"), "{}", text(&wrong.stderr));
}

#[test]
fn the_time_left_is_told_before_the_larger_runs() {
    let out = folder("left");
    let run = wfl(&["signorini/signorini.wfl", "n=16,4,8", "--reference", "none"], &out);
    let said = text(&run.stderr);
    let first = said.lines().find(|l| l.starts_with("[1/3]")).unwrap_or_default();
    assert!(first.contains("n=4") && first.contains("s left"), "{said}");
    let order: Vec<String> = rows(&out).iter().map(|r| cell(r, "knob n").to_owned()).collect();
    assert_eq!(order, ["16", "4", "8"]);
}

/// A smooth problem whose solution, load and boundary values follow from `q`; `n` divides the mesh.
const WAVES: &str = "wfl 1
param q = 3
param n = 8
mesh box [0,0] to [1,1] cells [n,n] quad
region rim = boundary
unknown u : scalar
def exact = sin(q*x)*exp(y)
term diffusion on all : Grad_u.Grad_Test_u
load u = (q*q - 1)*exact on all
fix u = exact on rim
";

#[test]
fn each_problem_has_a_reference_of_its_own() {
    let (out, exact) = (folder("problems"), folder("problems_exact"));
    let scene = out.join("waves.wfl");
    std::fs::write(&scene, WAVES).expect("written");
    let name = scene.display().to_string();
    let run = wfl(&[&name, "q=1,20", "n=8,16"], &out);
    assert!(run.status.success(), "{}", text(&run.stderr));
    // one reference a problem, shared by its meshes
    assert_eq!(text(&run.stderr).matches("kept in").count(), 2, "{}", text(&run.stderr));
    assert!(wfl(&[&name, "q=1,20", "n=8,16", "--reference", "exact", "-q"], &exact).status.success());
    let (found, truth) = (rows(&out), rows(&exact));
    assert_eq!((found.len(), truth.len()), (4, 4));
    for (row, exact) in found.iter().zip(&truth) {
        let setting = format!("{} q={} degree=2 refine=2 n=16", name, cell(row, "knob q"));
        let own: Vec<&str> = cell(row, "reference").split(' ').collect();
        assert!(setting.split(' ').all(|word| own.contains(&word)), "{own:?}");
        for column in ["error L2", "error H1"] {
            let (a, b) = (number(row, column), number(exact, column));
            assert!((a / b - 1.0).abs() < 0.02, "{column}: {a} and {b} in {row:?}");
        }
        assert!(number(row, "reference error H1") < 0.1 * number(row, "error H1"), "{row:?}");
    }
    // settings are compared with those of their own problem
    let told = text(&run.stdout);
    for q in ["q=1", "q=20"] {
        let of = |l: &&str| l.contains(&format!("waves {q} ")) || l.contains(&format!("none of these runs with {q} "));
        assert_eq!(told.lines().filter(of).count(), 8, "{told}");
    }
    // another value needs one reference more, and the rows stay
    let more = wfl(&[&name, "q=1,5,20", "n=8,16"], &out);
    assert!(text(&more.stderr).contains("6 runs, 4 of them already in the table"), "{}", text(&more.stderr));
    assert_eq!(text(&more.stderr).matches("kept in").count(), 1, "{}", text(&more.stderr));
}

#[test]
fn a_parameter_of_the_contact_method_shares_the_reference() {
    let out = folder("shared");
    // gamma of a consistent method changes how contact is solved, friction what is solved
    let knobs = ["cells=[2,4,4]", "gamma=5e4,1e5", "fric=0.2,0.4"];
    let run = wfl(&[&["fault/nitsche.wfl", "--reference-knob", "cells=[2,2,2]"], &knobs[..]].concat(), &out);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let rows = rows(&out);
    let mut references: Vec<&str> = rows.iter().map(|r| cell(r, "reference")).collect();
    references.sort_unstable();
    references.dedup();
    assert_eq!((rows.len(), references.len()), (4, 2), "{references:?}");
    assert!(references[0].contains("fric=0.2") && references[1].contains("fric=0.4"), "{references:?}");
}

/// A block of hexahedra whose rule holds elements of degree 1 and not those of degree 2.
const RULED: &str = "wfl 1
param k = 1
mesh box [0,0,0] to [1,1,1] cells [2,2,2] hex
region floor = faces where z == 0
region top = faces where z == 1
unknown u : vector
quadrature on all degree 3
term elastic on all : k*Sym(Grad_u):Grad_Test_u
load u = [0,0,-1] on top
fix u = [0,0,0] on floor
";

#[test]
fn a_reference_that_fails_leaves_the_rows_without_errors_and_says_why() {
    let out = folder("no_reference");
    let scene = out.join("ruled.wfl");
    std::fs::write(&scene, RULED).expect("written");
    let name = scene.display().to_string();
    let run = wfl(&[&name, "refine=1,2"], &out);
    let (said, told) = (text(&run.stderr), text(&run.stdout));
    assert!(run.status.success(), "{said}");
    let first = rows(&out);
    assert_eq!(first.len(), 2);
    for row in &first {
        assert_eq!(cell(row, "status"), "ok");
        assert!(row.iter().all(|c| !c.0.starts_with("error ")), "{row:?}");
        let why = cell(row, "reference");
        assert!(why.starts_with("none: ") && why.contains("hourglass") && why.contains("W511"), "{why}");
    }
    for place in [&said, &told] {
        assert!(place.contains("has no solution") && place.contains("hourglass modes on a hex"), "{place}");
        assert!(place.contains("degree 4 or more"), "{place}");
    }
    assert!(told.contains("2 rows, 0 failed"), "{told}");
    // the rows are kept as long as the reference fails, and made again with one that does not
    let again = wfl(&[&name, "refine=1,2"], &out);
    assert!(text(&again.stderr).contains("2 runs, 2 of them already in the table"), "{}", text(&again.stderr));
    assert!(wfl(&[&name, "refine=1,2", "--reference-knob", "degree=1", "-q"], &out).status.success());
    assert!(rows(&out)[2..].iter().all(|r| number(r, "error H1") > 0.0), "{:?}", rows(&out));
}

#[test]
fn a_row_as_good_as_its_reference_is_marked_in_the_terminal_and_on_the_page() {
    let out = folder("marked");
    let scene = out.join("waves.wfl");
    std::fs::write(&scene, WAVES).expect("written");
    let name = scene.display().to_string();
    let marks = |run: &Output| -> Vec<bool> {
        let told = text(&run.stdout);
        let of = |l: &&str| l.starts_with("| unknowns (L2)") && l.contains("n=");
        told.lines().filter(of).map(|l| l.contains("(not resolved by the reference)")).collect()
    };
    let same = ["--reference-knob", "degree=1", "--reference-knob", "refine=5/4"];
    let run = wfl(&[&[name.as_str(), "n=16"], &same[..]].concat(), &out);
    let found = marks(&run);
    assert!(!found.is_empty() && found.iter().all(|m| *m), "{}", text(&run.stdout));
    let page = std::fs::read_to_string(out.join("sweep.html")).expect("a page");
    assert!(page.contains("(not resolved by the reference)"));
    let fine = folder("unmarked");
    let run = wfl(&[&name, "n=16"], &fine);
    let found = marks(&run);
    assert!(!found.is_empty() && found.iter().all(|m| !*m), "{}", text(&run.stdout));
}
