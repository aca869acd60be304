//! `table` through the command: files that are none, what `wfl check` shows, runs that go on, units.

use crate::common::Folder;

const SCENE: &str = "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\n\
    unknown u : vector\nterm bulk on all : Grad_u:Grad_Test_u\nfix u = [0,0] on west\n\
    load u = [table(\"h.csv\", t),0] on all\nmeasure m = max(u(1)) on all\nsteps t = 0 to 4 by 1\n";

const ROWS: &str = "t,q\n0,0\n1,2\n4,1\n";

fn with(name: &str, scene: &str, csv: &str) -> Folder {
    let folder = Folder::new(&format!("tables_{name}"));
    folder.write("s.wfl", scene);
    folder.write("h.csv", csv);
    folder
}

fn said(folder: &Folder, args: &[&str]) -> (Option<i32>, String) {
    let done = folder.wfl(args);
    let text = format!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    (done.status.code(), text)
}

#[test]
fn each_bad_file_has_one_message_with_its_line_and_what_to_do() {
    let cases: [(&str, &[u8], &str); 14] = [
        ("empty", b"", "\"h.csv\" is no table: it is empty"),
        ("one_row", b"t,q\n0,0\n", "it has one row; a table needs two at least"),
        ("word", b"t,q\n0,0\n1,high\n", "line 3: column 2: the cell is no number"),
        ("hole", b"t,q\n0,0\n1,\n", "line 3: column 2: the cell is empty"),
        ("nan", b"t,q\n0,0\n1,NaN\n", "line 3: column 2: the number is not finite"),
        ("infinite", b"t,q\n0,0\n1,1e999\n", "line 3: column 2: the number is not finite"),
        ("unsorted", b"t,q\n0,0\n2,1\n1,3\n", "line 4: the argument 1 is smaller than the one before, 2"),
        ("repeated", b"t,q\n0,0\n1,1\n1,3\n", "line 4: the argument 1 repeats the one before"),
        ("short", b"t,q\n0,0\n1\n", "line 3: 1 cell, the first line has 2"),
        ("semicolons", b"t;q\n0;0\n1;2\n", "line 1: the cells are separated by `;`"),
        ("tabs", b"t\tq\n0\t0\n1\t2\n", "line 1: the cells are separated by a tab"),
        ("unit", b"t [s],q [J/kg K]\n0,0\n1,2\n", "line 1: column 2: its unit cannot be read"),
        ("binary", b"t,q\n0,0\n1,\0\n", "cannot read \"h.csv\": it is a binary file"),
        ("coding", b"t,q\n0,0 # \xe9\n1,1\n", "cannot read \"h.csv\": it is not UTF-8 text"),
    ];
    for (name, csv, why) in cases {
        let folder = with(name, SCENE, "");
        folder.write("h.csv", csv);
        let (code, text) = said(&folder, &["check", "s.wfl"]);
        assert_eq!(code, Some(1), "{name}: {text}");
        assert!(text.contains("error[E446]: ") && text.contains(why), "{name}: {text}");
        assert!(text.contains("s.wfl:7:") && text.matches("error[").count() == 1, "{name}: {text}");
    }
}

#[test]
fn files_that_are_not_there_or_not_to_be_read_are_refused() {
    let gone = with("gone", &SCENE.replace("h.csv", "g.csv"), ROWS);
    let (_, text) = said(&gone, &["run", "s.wfl"]);
    assert!(text.contains("error[E446]: cannot read \"g.csv\": there is no such file"), "{text}");
    let outside = with("outside", &SCENE.replace("h.csv", "../h.csv"), ROWS);
    let (_, text) = said(&outside, &["run", "s.wfl"]);
    assert!(text.contains("error[E217]: cannot read \"../h.csv\"") && text.contains("--allow-read"), "{text}");
    let folder = with("folder", &SCENE.replace("h.csv", "."), ROWS);
    let (_, text) = said(&folder, &["run", "s.wfl"]);
    assert!(text.contains("error[E446]: cannot read \".\": it is a directory, a file is needed"), "{text}");
}

#[test]
fn columns_are_named_and_calls_are_checked() {
    let three = "t,q,r\n0,0,1\n4,2,1\n";
    let folder = with("columns", SCENE, three);
    let (_, text) = said(&folder, &["check", "s.wfl"]);
    assert!(text.contains("error[E446]: \"h.csv\" has 2 columns of values") && text.contains("\"q\", \"r\""), "{text}");
    let calls = [
        ("table(\"h.csv\", t, \"s\")", "error[E446]: \"h.csv\" has no column of values `s`"),
        ("table(\"h.csv\", t, \"t\")", "error[E446]: \"h.csv\" has no column of values `t`"),
        ("table(t, \"h.csv\")", "error[E105]: `table` takes a file in quotes and a number"),
        ("table(\"h.csv\")", "error[E105]: `table` takes a file in quotes and a number"),
        ("table(\"h.csv\", t, q)", "error[E105]: `table` takes a file in quotes and a number"),
        ("table(\"h.csv\", [1,t], \"q\")", "error[E108]: `table` needs a scalar as argument 2"),
        ("sin(\"h.csv\")", "error[E105]: the text \"h.csv\" is no argument of `sin`"),
    ];
    for (call, why) in calls {
        folder.write("s.wfl", SCENE.replace("table(\"h.csv\", t)", call));
        let (code, text) = said(&folder, &["check", "s.wfl"]);
        assert!(code == Some(1) && text.contains(why) && text.contains("s.wfl:7:"), "{call}: {text}");
    }
    folder.write("s.wfl", SCENE.replace("h.csv\", t", "h.csv\", t, \"q\""));
    assert_eq!(said(&folder, &["run", "s.wfl"]).0, Some(0));
}

/// Files of other programs: a byte order mark, ends of lines of Windows, comments.
#[test]
fn files_of_other_programs_are_read_and_shown_by_check() {
    let folder = with("other", SCENE, "\u{feff}# measured\r\nt [s],q\r\n\r\n0,0\r\n1,2 # peak\r\n4,1\r\n");
    let (code, text) = said(&folder, &["check", "s.wfl", "--all"]);
    assert_eq!(code, Some(0), "{text}");
    let shown: Vec<&str> = text.lines().skip_while(|l| *l != "tables").take(3).collect();
    let row: Vec<&str> = shown[2].split_whitespace().collect();
    assert_eq!(row, ["h.csv", "t", "s", "q", "-", "3", "0", "4"], "{shown:?}");
    let (_, json) = said(&folder, &["check", "s.wfl", "--json"]);
    assert!(json.contains("\"tables\": ["), "{json}");
    // the same numbers as the plain file
    let plain = with("plain", SCENE, ROWS);
    let measures = |f: &Folder| {
        assert_eq!(said(f, &["run", "s.wfl"]).0, Some(0));
        std::fs::read_to_string(f.0.join("out/s/measures.csv")).expect("measures")
    };
    assert_eq!(measures(&folder), measures(&plain));
}

#[test]
fn a_value_outside_is_told_before_the_run_and_one_of_a_state_by_the_step() {
    let folder = with("range", &SCENE.replace("to 4", "to 6"), ROWS);
    let (code, text) = said(&folder, &["run", "s.wfl"]);
    assert!(code == Some(1) && text.contains("error[E447]: the table \"h.csv\" has no row at t = 5"), "{text}");
    assert!(text.contains("s.wfl:7:") && !folder.0.join("out").exists(), "{text}");
    let bulk = |argument: &str| {
        SCENE.replace("Grad_u:Grad_Test_u", &format!("table(\"h.csv\", {argument})*Grad_u:Grad_Test_u"))
    };
    let start = with("start", &bulk("x - 1/2 + u(1)"), ROWS);
    let (code, text) = said(&start, &["run", "s.wfl"]);
    assert!(code != Some(0) && text.contains("error[E447]"), "{code:?}: {text}");
    assert!(
        text.contains("is outside the rows of \"h.csv\", which go from 0 to 4") && text.contains("s.wfl:5:"),
        "{text}"
    );
    // trial states outside are refused; a load that no state inside carries has no solution
    let state = with("state", &bulk("1 + 10*u(1)"), ROWS);
    let (code, text) = said(&state, &["run", "s.wfl"]);
    assert!(code == Some(2) && text.contains("error[E603]"), "{code:?}: {text}");
    assert!(text.contains("note: a state outside the rows of \"h.csv\" (0 to 4) is no solution"), "{text}");
}

/// What a table says is part of a run: one that was stopped does not go on with other rows.
#[test]
fn a_run_does_not_go_on_with_a_changed_table() {
    let stopped = SCENE.replace("steps t", "term k on all : (if t > 2.5 then log(0 - t) else 0)*u.Test_u\nsteps t");
    let folder = with("resume", &stopped, ROWS);
    assert_ne!(said(&folder, &["run", "s.wfl"]).0, Some(0));
    folder.write("h.csv", ROWS.replace("1,2", "1,2.5"));
    let (code, text) = said(&folder, &["run", "s.wfl", "--resume"]);
    assert!(code == Some(1) && text.contains("error[E714]") && text.contains("another content of `h.csv`"), "{text}");
}

#[test]
fn units_of_the_file_are_checked_with_those_of_the_scene() {
    let scene = "wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nregion west = faces where x == 0\n\
        param k = 1 [MPa/m]\nunknown u : vector [m]\nterm bed on all : k*u.Test_u\n\
        load u = [table(\"h.csv\", t),0] on all\nsteps t = 0 to 1 by 0.5 [s]\n";
    let check = |name: &str, csv: &str| said(&with(name, scene, csv), &["check", "s.wfl"]).1;
    let right = check("units", "t [s],q [MPa]\n0,0\n1,2\n");
    assert!(!right.contains("error["), "{right}");
    let value = check("value", "t [s],q [kPa]\n0,0\n1,2\n");
    assert!(value.contains("warning[W505]") && value.contains("MPa*m^2 is 1000 kN"), "{value}");
    let argument = check("over", "t [h],q [MPa]\n0,0\n1,2\n");
    assert!(argument.contains("error[E501]: \"h.csv\" has rows over another unit"), "{argument}");
    let held = with("held", &scene.replace("\"h.csv\", t", "\"h.csv\", min(t, 1)"), "t [s],q [MPa]\n0,0\n1,2\n");
    let held = said(&held, &["check", "s.wfl"]).1;
    assert!(!held.contains("error["), "{held}");
    let bare = check("bare", "t,q\n0,0\n1,2\n");
    assert!(bare.contains("error[E501]") && bare.contains("t [s],q [MPa]"), "{bare}");
    let unknown = check("name", "t [s],q [MPaa]\n0,0\n1,2\n");
    assert!(unknown.contains("error[E502]: unknown unit `MPaa`"), "{unknown}");
}
